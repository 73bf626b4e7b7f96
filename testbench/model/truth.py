"""The truth at other instants than its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_angle import unwrapped
from testbench.records.session.samples import TrueAngles, Truth

JUMP_FACTOR, LEAST_JUMP = 3.0, np.radians(5.0)
"""A truth that turns this many times faster than the sensor ever does, and by at least this angle,
has jumped [rad].
"""
WIDEST_GAP_NS = 200_000_000
"""Truth is interpolated over gaps up to this long; beyond it nobody knows [ns]."""


def truth_at(truth: Truth, time_ns: np.ndarray) -> np.ndarray:
    """q_world_from_sensor at other times than the truth's own.

    Args:
        truth: As recorded.
        time_ns: Host time, shape (n,).

    Returns:
        Shape (n, 4); NaN before, after and in gaps of the truth.
    """
    known = np.isfinite(truth.q_world_from_sensor).all(axis=1)
    result = np.full((len(time_ns), 4), np.nan)
    if known.sum() < 2:
        return result
    times = truth.host_time_ns[known]
    inside = _between(times, time_ns)
    result[inside] = rotation.interpolate(times, truth.q_world_from_sensor[known], time_ns[inside])
    return result


def angles_at(true: TrueAngles, time_ns: np.ndarray) -> np.ndarray:
    """Angles of a joint at other times than the truth's own, without jumps of a turn.

    Args:
        true: As recorded.
        time_ns: Host time, shape (n,).

    Returns:
        Shape (n, 3) [rad]; NaN before, after and in gaps of each angle.
    """
    result = np.full((len(time_ns), 3), np.nan)
    for i in range(3):
        known = np.isfinite(true.angles[:, i])
        if known.sum() < 2:
            continue
        times = true.host_time_ns[known]
        inside = _between(times, time_ns)
        result[inside, i] = np.interp(time_ns[inside], times, unwrapped(true.angles[known, i]))
    return result


def _between(times: np.ndarray, time_ns: np.ndarray) -> np.ndarray:
    """Where instants lie between two neighbours of a truth that are near enough, shape (n,), bool.

    Args:
        times: Of the truth, increasing, two or more [ns].
        time_ns: Of the instants, shape (n,).
    """
    index = np.clip(np.searchsorted(times, time_ns, side="right"), 1, len(times) - 1)
    near = times[index] - times[index - 1] <= WIDEST_GAP_NS
    return np.asarray((time_ns >= times[0]) & (time_ns <= times[-1]) & near)


def without_jumps(truth: Truth, fastest: Callable[[], float]) -> tuple[Truth, int]:
    """The truth with its jumps blanked out.

    A jump is a single orientation that leaves and comes back faster than the sensor ever turned.

    Args:
        truth: As recorded.
        fastest: Gives the sensor's largest angular rate [rad/s]; asked where there may be a jump
            only.

    Returns:
        The truth, NaN on either side of a jump, and the number of orientations blanked.
    """
    q, time = truth.q_world_from_sensor, truth.host_time_ns / NANOSECONDS
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    if len(known) < 3:
        return truth, 0
    angle = rotation.angle(rotation.multiply(rotation.conjugate(q[known[:-1]]), q[known[1:]]))
    interval = np.maximum(np.diff(time[known]), 1e-9)
    wide = angle > LEAST_JUMP
    limit = JUMP_FACTOR * fastest() if wide.any() else 0.0
    jump = wide & (angle / interval > limit)
    if not (limit > 0 and jump.any()):
        return truth, 0
    bad = np.zeros(len(known), dtype=bool)
    bad[:-1] |= jump
    bad[1:] |= jump
    cleaned = q.copy()
    cleaned[known[bad]] = np.nan
    return Truth(truth.host_time_ns, cleaned, truth.rate, truth.force, truth.judged), int(bad.sum())
