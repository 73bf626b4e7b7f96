"""Whether a joint log moves its link as the sensor on it turned, and which other reading does.

Two columns that were exchanged, a joint that counts the other way and a link that was confused give
a truth that is as smooth as the right one. Each is tried: the rates of the link are laid over those
of the sensor where both turn as fast, and turned onto them by the best rotation (Kabsch 1976), for
nobody need know how the sensor sits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.signal import correlate, find_peaks

from testbench.formats.recording import ImportedSensor
from testbench.formats.truth.joint_log import RobotLog
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import Kinematics
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

STEP_S = 0.05
"""Rates are compared as means over so long [s]."""
MOST_STEPS = 12_000
"""Of so many steps at most, ten minutes."""
LEAST_RATE = np.radians(5.0)
"""RMS rate of a motion that tells readings apart [rad/s]."""
LARGEST_BIAS = np.radians(10.0)
"""A larger reading of the quietest tenth is motion [rad/s]."""
LEAST_OVERLAP = 0.5
"""Part of the shorter of both logs that lies within the other [1]."""
SHIFTS, NEARLY = 6, 0.8
"""So many shifts are tried, whose correlation is so large a part of the best [1]."""
BELONGS, FITS, BETTER = 0.95, 0.9, 4.0
"""Part of the rates' variance that a right reading explains, and one that is named in its place;
what is named leaves so many times less unexplained [1].
"""
MOST_NAMED = 3


@dataclass(frozen=True)
class Turning:
    """Rates on an even grid of `STEP_S`.

    Attributes:
        rate: Shape (n, 3) [rad/s]; 0 where nothing is known.
        known: Shape (n,), bool.
    """

    rate: np.ndarray
    known: np.ndarray

    @staticmethod
    def of(seconds: np.ndarray, rate: np.ndarray) -> Turning:
        """Means over the steps of a grid.

        Args:
            seconds: Increasing, shape (m,) [s].
            rate: At these instants, shape (m, 3) [rad/s].
        """
        step = ((seconds - seconds[0]) / STEP_S).astype(int)
        inside = (step < MOST_STEPS) & np.isfinite(rate).all(axis=1)
        step, rate = step[inside], rate[inside]
        count = np.bincount(step)
        total = np.column_stack([np.bincount(step, axis) for axis in rate.T])
        known = count > 0
        return Turning(total / np.maximum(count, 1)[:, None], known)

    @property
    def speed(self) -> np.ndarray:
        """Shape (n,) [rad/s]."""
        return rotation.lengths(self.rate)


def read_otherwise(
    kinematics: Kinematics, log: RobotLog, link: str, sensor: ImportedSensor
) -> Finding | None:
    """What of a joint log must be read otherwise for a link to turn as the sensor on it did.

    Args:
        kinematics: Of the arm.
        log: With times.
        link: That carries the sensor.
        sensor: Its rates are used; one without any tells nothing.

    Returns:
        None where it turns so as it is read, or the motion tells nothing, or no other reading
        turns so.
    """
    assert log.time_ns is not None
    turned = _of_sensor(sensor)
    if turned is None or len(log.q) < 20:
        return None
    own = _explained(_of_link(kinematics, log, link, log.q), turned)
    if own is None or own >= BELONGS:
        return None
    found: dict[str, float] = {}
    for how, other, q in _readings(kinematics, link, log.q):
        fit = _explained(_of_link(kinematics, log, other, q), turned)
        if fit is not None and fit > FITS and BETTER * (1 - fit) < 1 - own:
            found[how] = fit
    if not found:
        return None
    best = sorted(found, key=lambda how: -found[how])
    close = [how for how in best if 1 - found[how] < BETTER * (1 - found[best[0]])]
    return finding(
        "truth.joints",
        link=link,
        how=" or ".join(close[:MOST_NAMED]),
        own_percent=100 * max(own, 0.0),
        percent=100 * found[best[0]],
    )


def _readings(
    kinematics: Kinematics, link: str, q: np.ndarray
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Other readings of a log: what is done, the link, and the angles, shape (n, k) [rad]."""
    names = kinematics.robot.joint_names
    moved = np.ptp(q, axis=0) > STEP_S * LEAST_RATE
    for i, j in combinations(range(len(names)), 2):
        if moved[i] or moved[j]:
            order = np.arange(len(names))
            order[[i, j]] = j, i
            yield f"the angles of {names[i]} and {names[j]} exchanged", link, q[:, order]
    for i in np.flatnonzero(moved).tolist():
        signs = np.ones(len(names))
        signs[i] = -1
        yield f"the sign of {names[i]} turned", link, q * signs
    yield "the angles in the reverse order", link, q[:, ::-1]
    yield "the angles one joint further on", link, np.roll(q, 1, axis=1)
    yield "the angles one joint further back", link, np.roll(q, -1, axis=1)
    for other in kinematics.link_names:
        if other != link:
            yield f"the sensor on {other}", other, q


def _of_sensor(sensor: ImportedSensor) -> Turning | None:
    """How a sensor turned; None where it has no rates."""
    times, rates, lasted = [], [], 0
    for chunk in sensor.chunks:
        times.append(chunk.host_time_ns)
        rates.append(chunk.gyr)
        lasted = int(chunk.host_time_ns[-1]) - int(times[0][0])
        if lasted > MOST_STEPS * STEP_S * NANOSECONDS:
            break
    time, rate = np.concatenate(times), np.concatenate(rates)
    if not np.isfinite(rate).all(axis=1).any():
        return None
    turned = Turning.of((time - time[0]) / NANOSECONDS, rate)
    known = turned.rate[turned.known]
    speed = rotation.lengths(known)
    rest = np.median(known[speed <= np.quantile(speed, 0.1)], axis=0)
    if np.linalg.norm(rest) < LARGEST_BIAS:
        turned = Turning(np.where(turned.known[:, None], turned.rate - rest, 0.0), turned.known)
    return turned


def _of_link(kinematics: Kinematics, log: RobotLog, link: str, q: np.ndarray) -> Turning:
    """How a link turns by joint angles.

    Args:
        kinematics: Of the arm.
        log: Whose times they are at.
        link: Of the arm.
        q: Shape (n, k) [rad].
    """
    assert log.time_ns is not None
    seconds = (log.time_ns - log.time_ns[0]) / NANOSECONDS
    every = max(round(STEP_S / max(float(np.median(np.diff(seconds))), 1e-6)), 1)
    rows = np.arange(0, len(q), every)
    rows = rows[np.concatenate([[True], np.diff(seconds[rows]) > 0])]
    pose = kinematics.frame_motion(link, q[rows]).q_world_from_frame
    turns = rotation.multiply(rotation.conjugate(pose[:-1]), pose[1:])
    spans = np.diff(seconds[rows])
    rate = rotation.to_rotation_vector(turns) / spans[:, None]
    middle = seconds[rows][:-1] + spans / 2
    grid = np.arange(0.0, seconds[rows][-1], STEP_S) + STEP_S / 2
    even = np.column_stack([np.interp(grid, middle, axis) for axis in rate.T])
    return Turning.of(grid, even)


def _explained(link: Turning, sensor: Turning) -> float | None:
    """Part of the variance of a link's rates that a sensor's explain, at the shift and with the
    mounting that fit best; None where the link hardly turns.
    """
    if np.sqrt(np.mean(link.speed**2)) < LEAST_RATE:
        return None
    fits = [_fit_at(link, sensor, shift) for shift in _shifts(link.speed, sensor.speed)]
    return max(fits, default=None)


def _shifts(link: np.ndarray, sensor: np.ndarray) -> list[int]:
    """By how many steps a link's rates may come after a sensor's, those that correlate best."""
    a, b = link - link.mean(), sensor - sensor.mean()
    least = round(LEAST_OVERLAP * min(len(a), len(b)))
    ones = correlate(np.ones(len(b)), np.ones(len(a)))
    power = correlate(b**2, np.ones(len(a))) * correlate(np.ones(len(b)), a**2)
    size = correlate(b, a) / np.sqrt(np.maximum(power, 1e-12 * power.max()))
    size[ones < least - 0.5] = 0.0
    peaks = find_peaks(np.concatenate([[-1.0], size, [-1.0]]))[0] - 1
    peaks = peaks[np.argsort(-size[peaks])][:SHIFTS]
    good = peaks[size[peaks] >= NEARLY * size.max()]
    return [int(peak) - (len(a) - 1) for peak in good]


def _fit_at(link: Turning, sensor: Turning, shift: int) -> float:
    """Part of the variance that is explained where a link's step 0 is a sensor's step `shift`."""
    first = np.arange(max(shift, 0), min(len(sensor.rate), len(link.rate) + shift))
    both = first[sensor.known[first] & link.known[first - shift]]
    true, read = link.rate[both - shift], sensor.rate[both]
    profile = true.T @ read
    turn = rotation.nearest_rotation(profile)
    gain = float(np.sum(turn * profile) / max(float(np.sum(read**2)), 1e-30))
    left = float(np.sum((true - gain * read @ turn.T) ** 2))
    return 1 - left / max(float(np.sum(true**2)), 1e-30)
