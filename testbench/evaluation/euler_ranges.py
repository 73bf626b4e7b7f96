"""Ranges of a sensor's own Euler angles over a section: limit tests, in which one angle should move
and the others stay.

In gimbal lock the two outer angles are not defined apart, whatever the sensor: only their sum is,
or their difference. A device whose yaw and roll "change equally with opposite sign" there is not at
fault. Beyond it they have jumped by half a turn, to either side alike, so that they are unwrapped
from sample to sample only between two passages of lock.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.evaluation import EulerRangeRow
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth

LOCKED = np.radians(10.0)
"""Nearer to gimbal lock than this the outer angles are not reported apart [rad]."""
LARGEST_STEP = np.pi / 2
"""A larger step of an outer angle between two samples is a passage of lock that no sample fell into
[rad].
"""
MOSTLY_LOCKED = 50.0
"""Percent of a section beyond which it counts as locked."""


def euler_range_rows(
    name: str,
    estimate: SensorEstimate,
    truth: Truth,
    steps: list[PlannedStep],
    wanted: Mapping[str, str],
) -> list[EulerRangeRow]:
    """One row for each section and filter.

    Args:
        name: Of the sensor.
        estimate: Orientations of the sensor.
        truth: What the sensor went through.
        steps: Of the session.
        wanted: Euler sequence by section.
    """
    rows = []
    for section, sequence in wanted.items():
        moved = [step for step in steps if step.section == section and step.kind == "sweep"]
        own = moved or [step for step in steps if step.section == section]
        if not own:
            continue
        time = estimate.host_time_ns
        within = (time >= own[0].start_ns) & (time <= own[-1].end_ns) & ~estimate.flagged
        q_true = truth_at(truth, time[within])
        known = np.isfinite(q_true[:, 0])
        if known.sum() < 2:
            continue
        true, margin = _angles(sequence, q_true[known])
        sense = _sense(sequence, true)
        for key, q in estimate.orientation.items():
            estimated, own_margin = _angles(sequence, q[within][known])
            locked = (margin < LOCKED) | (own_margin < LOCKED)
            percent = float(100 * locked.mean())
            shut = percent > MOSTLY_LOCKED
            rows.append(
                EulerRangeRow(
                    name,
                    section,
                    key,
                    sequence,
                    ranges_deg(true, locked, shut),
                    ranges_deg(estimated, locked, shut),
                    percent,
                    _outer(true, sense) if shut else None,
                    _outer(estimated, sense) if shut else None,
                )
            )
    return rows


def _angles(sequence: str, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    angles = rotation.to_euler(sequence, q)
    return angles, np.asarray(rotation.gimbal_margin(sequence, angles))


def ranges_deg(angles: np.ndarray, locked: np.ndarray, shut: bool) -> list[float | None]:
    """Ranges of three Euler angles whose outer ones are only defined apart from gimbal lock [deg].

    Args:
        angles: Shape (n, 3) [rad].
        locked: In gimbal lock, shape (n,), bool.
        shut: Whether that holds for most of them, so that the outer ones have no range.
    """
    middle = float(np.degrees(np.ptp(np.unwrap(angles[:, 1]))))
    if shut:
        return [None, middle, None]
    broken = (
        locked[1:]
        | locked[:-1]
        | (np.abs(rotation.wrap(np.diff(angles[:, [0, 2]], axis=0))) > LARGEST_STEP).any(axis=1)
    )
    runs = [
        run
        for run in np.split(np.arange(len(angles)), np.flatnonzero(broken) + 1)
        if not locked[run[0]]
    ]
    first, third = (float(np.degrees(_range(angles[:, i], runs))) for i in (0, 2))
    return [first, middle, third]


def _range(angle: np.ndarray, runs: list[np.ndarray]) -> float:
    """Range of an angle over runs of samples whose turns against one another are not known [rad].

    The shortest arc that holds every sample, unless one run alone goes farther; for a single run
    that is its unwrapped range.
    """
    around = np.sort(np.mod(angle[np.concatenate(runs)], 2 * np.pi))
    gaps = np.diff(around, append=around[0] + 2 * np.pi)
    return max(
        2 * np.pi - float(gaps.max()), *(float(np.ptp(np.unwrap(angle[run]))) for run in runs)
    )


def _sense(sequence: str, true: np.ndarray) -> int:
    """+1 where the sum of the outer angles is what stays defined in lock, -1 where their difference
    is.
    """
    angles = np.array([0.0, true[len(true) // 2, 1], 0.0])
    both = angles + np.array([0.1, 0.0, 0.1])
    together = rotation.multiply(
        rotation.conjugate(rotation.from_euler(sequence, angles)),
        rotation.from_euler(sequence, both),
    )
    return -1 if float(rotation.angle(together)) < 0.1 else 1


def _outer(angles: np.ndarray, sense: int) -> float:
    return float(np.degrees(np.ptp(np.unwrap(rotation.wrap(angles[:, 0] + sense * angles[:, 2])))))
