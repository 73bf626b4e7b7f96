"""A walk against what a person counted, measured or walked along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from testbench.exceptions import InputError
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.gait import Gait, GaitCheck, SensorGait

FARTHEST_M = 1e5
"""Between two corners of a walk [m]."""
HEADINGS = 720
"""Of half a degree, from which the heading of the path at its start is chosen."""


@dataclass(frozen=True)
class WalkTruth:
    """What a person knows of a walk.

    Attributes:
        cycles: Strides of one leg, None where nobody counted.
        distance_m: Length of the way, None where nobody measured.
        corners_m: Of the path that was walked, from its start to its end, x and y each; none where
            nobody knows.
    """

    cycles: int | None = None
    distance_m: float | None = None
    corners_m: Sequence[tuple[float, float]] = ()

    def check(self) -> None:
        """Refuse what no walk can be.

        Raises:
            InputError: Says what.
        """
        if self.cycles is not None and self.cycles < 1:
            raise InputError(f"--cycles {self.cycles}: a walk has one cycle at least")
        if self.distance_m is not None and not 0 < self.distance_m < np.inf:
            raise InputError(f"--distance {self.distance_m:g}: a walk is longer than 0 m")
        if self.corners_m and len(self.corners_m) < 2:
            raise InputError("--corners: a path has two corners at least, its start and its end")
        if not np.isfinite(np.array(self.corners_m, dtype=float)).all():
            raise InputError("--corners: a corner is no number")
        ways = np.diff(np.array(self.corners_m, dtype=float).reshape(-1, 2), axis=0)
        if self.corners_m and not 0 < np.abs(ways).max() < FARTHEST_M:
            raise InputError(
                "--corners: a path goes from its first corner to others, less than "
                f"{FARTHEST_M / 1000:g} km from one to the next"
            )


def judge_walk(found: Gait, truth: WalkTruth) -> Gait:
    """The same gait, judged by what is known of the walk.

    Args:
        found: The gait.
        truth: What is known.

    Raises:
        InputError: It cannot be of a walk.
    """
    truth.check()
    checks: list[GaitCheck] = []
    sensors = dict(found.sensors)
    for name, own in found.sensors.items():
        if not own.strides:
            continue
        checks += _of_sensor(own, truth)
        if truth.corners_m:
            turned, on_path = _of_path(own, np.array(truth.corners_m, dtype=float))
            own = sensors[name] = replace(own, path_heading_deg=turned)
            checks += on_path
        if truth.distance_m is not None and own.method == "regression":
            fits = _fitting_intercept(own, truth.distance_m)
            sensors[name] = replace(own, findings=[*own.findings, fits])
    return replace(found, sensors=sensors, checks=checks, corners_m=list(truth.corners_m))


def _of_sensor(own: SensorGait, truth: WalkTruth) -> list[GaitCheck]:
    checks = []
    if truth.cycles is not None:
        checks.append(_check(own.sensor, "cycles", len(own.strides), truth.cycles))
    if truth.distance_m is not None:
        checks.append(_check(own.sensor, "distance_m", own.distance_m, truth.distance_m))
    return checks


def _check(sensor: str, quantity: str, value: float, truth: float) -> GaitCheck:
    error = value - truth
    return GaitCheck(
        sensor=sensor,
        quantity=quantity,
        value=value,
        truth=truth,
        error=error,
        error_percent=100 * error / truth,
    )


def _of_path(own: SensorGait, corners: np.ndarray) -> tuple[float, list[GaitCheck]]:
    """Length, end and greatest distance from the path, turned about its start to fit it best.

    The heading at the start is not known to any sensor; it is the one thing that is fitted.

    Returns:
        By how much it was turned [deg], and the checks.
    """
    path = np.array([[0.0, 0.0], *([s.x_m, s.y_m] for s in own.strides)])
    goal = corners - corners[0]
    headings = np.arange(HEADINGS) * (2 * np.pi / HEADINGS)
    off = [np.mean(distances_from(_turned(path, angle), goal) ** 2) for angle in headings]
    end_off = [float(np.sum((_turned(path[-1:], angle) - goal[-1]) ** 2)) for angle in headings]
    best = float(headings[int(np.argmin(np.array(off) + np.array(end_off) / len(path)))])
    placed = _turned(path, best)
    length = float(np.linalg.norm(np.diff(goal, axis=0), axis=1).sum())
    end = float(np.linalg.norm(placed[-1] - goal[-1]))
    farthest = float(distances_from(placed, goal).max())
    nothing = {"truth": 0.0, "error_percent": float("nan")}
    return float(np.degrees(best)), [
        _check(own.sensor, "path_length_m", own.distance_m, length),
        GaitCheck(sensor=own.sensor, quantity="end_off_m", value=end, error=end, **nothing),
        GaitCheck(
            sensor=own.sensor, quantity="path_off_m", value=farthest, error=farthest, **nothing
        ),
    ]


def _turned(path: np.ndarray, angle: float) -> np.ndarray:
    """A path turned about the origin, shape (n, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    return path @ np.array([[c, s], [-s, c]])


def distances_from(path: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """How far each place lies from the nearest point of a line through corners, shape (n,) [m].

    Args:
        path: Places, shape (n, 2) [m].
        corners: Shape (k, 2) [m].
    """
    found = np.full(len(path), np.inf)
    for begin, end in pairwise(corners):
        along = end - begin
        size = float(along @ along)
        part = np.clip((path - begin) @ along / size, 0, 1) if size > 0 else np.zeros(len(path))
        near = begin + part[:, None] * along
        found = np.minimum(found, np.linalg.norm(path - near, axis=1))
    return found


def _fitting_intercept(own: SensorGait, distance_m: float) -> Finding:
    """Which intercept of the regression line would have given the distance."""
    more = (distance_m - own.distance_m) / len(own.strides)
    return finding("gait.intercept", own.sensor, more_m=more, distance_m=distance_m)
