"""Ideal sensors in motions whose orientation is known, and how far off a filter is in them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from testbench.estimation.filters.base import UniformSamples
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation

RATE_HZ = 100.0
REST_S, TURN_S = 6.0, 2.0
"""Time to settle before a turn, and time of the turn [s]."""


class SteadyTurn(NamedTuple):
    """A turn at a constant rate.

    Attributes:
        rate: Angular rate [rad/s].
        seconds: How long it lasts [s].
    """

    rate: float
    seconds: float


SLOW = SteadyTurn(np.radians(40.0), TURN_S)
FAST = SteadyTurn(np.radians(400.0), 0.2)
"""A turn of which a sample is twice the limit."""
BIAS_RAD_S = np.radians(1.0)
"""Bias of the gyroscope in one check, that of a poor small sensor at power-up."""
PATTERN = np.array([0.6, 0.8, 1.2, 1.4])
"""Intervals at rest, over and over, as multiples of the mean one; in the turn they are longer by
`STRETCH`.
"""
STRETCH = 1.5
FIELD_UT = np.array([0.0, 24.0, -39.0])
"""North along y, about that of northern Spain (IGRF-13) [uT]."""

DEVICE_HEADING_RAD = np.radians(25.0)
"""Heading of the earth that the device's own orientation refers to."""

Run = Callable[[UniformSamples], np.ndarray]


@dataclass(frozen=True)
class KnownMotion:
    """What an ideal sensor gives in a known motion.

    Attributes:
        name: For people.
        samples: What it gives.
        q_true: q_earth_from_sensor, shape (n, 4).
        begin: First sample of the turn, or None at rest.
        behind: Axis of the turn in the sensor, shape (3,), where only being late in it is judged:
            feedback of a high gain that compares a sample with the orientation before it runs ahead
            in a fast turn, and is no mistake.
    """

    name: str
    samples: UniformSamples
    q_true: np.ndarray
    begin: int | None
    behind: np.ndarray | None = None


@dataclass(frozen=True)
class Check:
    """One check of a filter: the worst of its recordings against a limit.

    Attributes:
        name: For people.
        worst_deg: Its error; None where the filter gave no orientation.
        limit_deg: Largest error that passes.
        where: The recording of the worst error.
    """

    name: str
    worst_deg: float | None
    limit_deg: float
    where: str

    @property
    def passed(self) -> bool:
        return self.worst_deg is not None and self.worst_deg <= self.limit_deg


def axis_aligned() -> list[np.ndarray]:
    """The 24 rotations that lay the sensor's axes along those of the earth, shape (3, 3)."""
    signed = [
        np.array(
            [
                [sign if axis == column else 0.0 for column in range(3)]
                for axis, sign in zip(order, signs, strict=True)
            ]
        )
        for order in itertools.permutations(range(3))
        for signs in itertools.product([1.0, -1.0], repeat=3)
    ]
    return [matrix for matrix in signed if np.linalg.det(matrix) > 0]


def recording(
    name: str,
    start: np.ndarray,
    axis: np.ndarray | None = None,
    *,
    rate_hz: float = RATE_HZ,
    turn: SteadyTurn = SLOW,
    bias_rad_s: float = 0.0,
    irregular: bool = False,
) -> KnownMotion:
    """Rest, and then a turn about an axis of the sensor if one is given.

    Rates are means over the interval before each sample.

    Args:
        name: For people.
        start: q_earth_from_sensor, shape (4,).
        axis: Unit vector in the sensor, shape (3,); None: rest only.
        rate_hz: Of sampling.
        turn: How fast and how long it turns.
        bias_rad_s: Of the gyroscope, about the same axis.
        irregular: Whether the intervals differ, those of the turn in the mean from those of the
            rest.
    """
    rest = round(REST_S * rate_hz)
    count = rest + (0 if axis is None else round(turn.seconds * rate_hz))
    along = np.zeros(3) if axis is None else axis
    moving = np.arange(count) >= rest
    intervals = np.full(count, 1 / rate_hz)
    if irregular:
        intervals *= np.resize(PATTERN, count) * np.where(moving, STRETCH, 1.0)
    angle = turn.rate * np.cumsum(np.where(moving, intervals, 0.0))
    q = rotation.multiply(start, rotation.from_rotation_vector(angle[:, None] * along))
    gyr = np.where(moving[:, None], turn.rate * along, 0.0) + bias_rad_s * along
    back = rotation.conjugate(q)
    acc = rotation.rotate(back, np.array([0.0, 0.0, STANDARD_GRAVITY]))
    device = rotation.multiply(rotation.from_heading(DEVICE_HEADING_RAD), q)
    samples = UniformSamples(
        float(intervals.mean()),
        gyr,
        acc,
        rotation.rotate(back, FIELD_UT),
        device,
        intervals if irregular else None,
    )
    return KnownMotion(name, samples, q, rest - 1 if count > rest else None)


def pose(*angles_deg: float) -> np.ndarray:
    """q_earth_from_sensor of intrinsic ZYX angles."""
    return rotation.from_euler("ZYX", np.radians(angles_deg))


def recordings(needs: tuple[str, ...]) -> dict[str, list[KnownMotion]]:
    """The recordings of each check.

    Args:
        needs: What the filter needs; the device's orientation is there for one that asks for it.
    """
    with_device = "device_q" in needs
    return {
        name: [_fresh(case, with_device) for case in cases] for name, cases in _groups().items()
    }


def _fresh(case: KnownMotion, with_device: bool) -> KnownMotion:
    """The same with samples of its own: a filter that is tested may write into them."""
    samples = case.samples
    copied: dict[str, Any] = {
        name: value.copy() for name, value in vars(samples).items() if isinstance(value, np.ndarray)
    }
    own = replace(samples, **copied)
    return replace(case, samples=own if with_device else replace(own, device_q=None))


@cache
def _groups() -> dict[str, list[KnownMotion]]:
    # Longer than a screen: a list of recordings, check by check.
    rests = [
        recording(f"axes {matrix.astype(int).tolist()}", rotation.from_matrix(matrix))
        for matrix in axis_aligned()
    ]
    poses = [
        (70, 20, 35),
        (-130, -50, 160),
        (15, 75, -100),
        (200, -10, -170),
        (-60, 40, 95),
        (110, -80, 10),
    ]
    anywhere = [recording(f"ZYX {angles} deg", pose(*angles)) for angles in poses]
    headings = [
        recording(f"heading {angle} deg", pose(angle, 0, 0)) for angle in (0, 30, 90, 180, 210, 315)
    ]
    groups = {"rest in 24 poses": rests, "start in any pose": anywhere, "known heading": headings}
    for name, index in (("x", 0), ("y", 1), ("z", 2)):
        for sign in (1.0, -1.0):
            turns = [
                recording(f"from ZYX {angles} deg", pose(*angles), sign * np.eye(3)[index])
                for angles in ((0, 0, 0), (60, -35, 25), (-100, 20, -140))
            ]
            groups[f"turn about {'+' if sign > 0 else '-'}{name}"] = turns
    x, y, z = np.eye(3)
    upright = {"x": (x, pose(0, -90, 0)), "y": (y, pose(0, 0, 90)), "z": (z, pose(0, 0, 0))}
    start, axis = pose(60, -35, 25), np.array([0.6, -0.48, 0.64])
    groups["other rates"] = [
        recording(f"{rate:g} Hz", start, sign * axis, rate_hz=rate)
        for rate in (50, 200)
        for sign in (1, -1)
    ]
    groups["irregular intervals"] = [
        recording(f"about {words} axis", start, axis, irregular=True)
        for words, axis in (("a general", axis), ("the z", z))
    ]
    fast = [
        (recording(f"about {name}", start, axis, turn=FAST), axis)
        for name, axis in (("x", x), ("y", y), ("z", z))
    ]
    groups["late in a fast turn"] = [replace(case, behind=axis) for case, axis in fast]
    groups[BIASED] = [
        recording(
            f"{'+' if sign > 0 else '-'}1 deg/s about {name}, upright",
            start,
            axis,
            bias_rad_s=sign * BIAS_RAD_S,
        )
        for name, (axis, start) in upright.items()
        for sign in (1, -1)
    ]
    return groups


BIASED = "gyroscope with a bias"
LIMIT_DEG = {
    "rest in 24 poses": 1.0,
    "start in any pose": 2.0,
    "known heading": 2.0,
    BIASED: 1.1 * float(np.degrees(BIAS_RAD_S)) * TURN_S,
}
"""With a bias, a tenth more than the turn that the gyroscope alone makes of it."""
TURN_LIMIT_DEG = 2.0
"""Right filters stay below half of these; the smallest fault that is looked for is far above."""


def error_deg(case: KnownMotion, q: np.ndarray, needs: tuple[str, ...]) -> float:
    """Largest error of what a filter can know [deg]: total, inclination, or turn since the rest.

    With a bias the turn since the rest alone: only of that is it known how far off the gyroscope by
    itself would be.

    Args:
        case: The recording.
        q: What the filter gave, q_earth_from_sensor, shape (n, 4).
        needs: What the filter needs.
    """
    level = "acc" in needs or "device_q" in needs
    biased = case.begin is not None and bool(np.any(case.samples.gyr[case.begin]))
    errors = []
    off = rotation.multiply(q[-1], rotation.conjugate(case.q_true[-1]))
    if level and not biased:
        errors.append(
            rotation.angle(off)
            if "mag" in needs and "acc" in needs
            else rotation.inclination_angle(off)
        )
    if case.begin is not None and any(need in needs for need in ("gyr", "mag", "device_q")):
        turned = rotation.multiply(rotation.conjugate(q[case.begin]), q[-1])
        expected = rotation.multiply(rotation.conjugate(case.q_true[case.begin]), case.q_true[-1])
        wrong = rotation.multiply(turned, rotation.conjugate(expected))
        if case.behind is not None:
            return max(0.0, float(np.degrees(-rotation.to_rotation_vector(wrong) @ case.behind)))
        errors.append(rotation.angle(wrong))
    elif case.begin is None and not level:
        errors.append(rotation.angle(rotation.multiply(rotation.conjugate(q[0]), q[-1])))
    return float(np.degrees(np.max(errors))) if errors else 0.0


def judge(run: Run, needs: tuple[str, ...], groups: dict[str, list[KnownMotion]]) -> list[Check]:
    """Every check of a filter that gives well-formed quaternions."""
    checks = []
    for name, cases in groups.items():
        if name == "known heading" and not ("mag" in needs and "acc" in needs):
            continue
        errors = [(error_deg(case, run(case.samples), needs), case.name) for case in cases]
        worst, where = max(errors, key=lambda entry: (np.isnan(entry[0]), entry[0]))
        checks.append(Check(name, worst, LIMIT_DEG.get(name, TURN_LIMIT_DEG), where))
    return checks
