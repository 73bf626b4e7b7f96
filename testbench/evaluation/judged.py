"""Which samples count: static poses once they have settled, sweeps while they move, or what the
recording itself marks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model.truth import without_jumps
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import Estimate
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth
from testbench.records.session.session import Session
from testbench.records.specs.protocol import JointDefinition

SETTLING_NS = NANOSECONDS * 3 // 10
"""After a move the arm still swings in; this long is left out of a dwell (a servo of 12 Hz is
within 1e-6 after 0.3 s).
"""


def window(step: PlannedStep) -> tuple[int, int]:
    """First and last host time of a step that count [ns]."""
    if step.kind == "sweep":
        return step.start_ns, step.settled_ns
    settling = min(SETTLING_NS, (step.end_ns - step.settled_ns) // 4)
    return step.settled_ns + settling, step.end_ns


def window_rows(
    steps: Sequence[PlannedStep], time_ns: np.ndarray, end: Literal["left", "right"] = "left"
) -> tuple[np.ndarray, np.ndarray]:
    """The first row of a time column that counts in each step, and the row after the last.

    Args:
        steps: That are looked at, m of them.
        time_ns: Increasing, shape (n,).
        end: Whether a sample at the very end of a step counts ("right") or not.

    Returns:
        Shape (m,) each.
    """
    windows = np.array([window(step) for step in steps], dtype=np.int64).reshape(-1, 2)
    return np.searchsorted(time_ns, windows[:, 0]), np.searchsorted(time_ns, windows[:, 1], end)


def judgeable(
    estimate: Estimate, joints: Mapping[str, JointDefinition]
) -> tuple[Estimate, dict[str, list[Finding]]]:
    """An estimate without what was not aligned to the truth, and what that is.

    Args:
        estimate: Of a session.
        joints: As defined, by name.

    Returns:
        The rest of the estimate, and findings by sensor, and by joint as `joint 'NAME'`.
    """
    sensors, angles = {}, {}
    found: dict[str, list[Finding]] = {}
    for name, sensor in estimate.sensors.items():
        kept = {key: q for key, q in sensor.orientation.items() if sensor.can_be_judged(key)}
        sensors[name] = replace(sensor, orientation=kept)
        gone = [key for key in sensor.orientation if key not in kept]
        if gone:
            found[name] = [finding("judged.not_aligned", name, filters=gone)]
    for name, joint in estimate.joints.items():
        if joint.true_clock is not None:  # judged by angles, whatever its sensors' frames are
            angles[name] = joint if not joint.true_clock.refused else replace(joint, angles={})
            gone = list(dict.fromkeys(key for key, _ in joint.angles))
            if joint.true_clock.refused and gone:
                where = f"joint '{name}'"
                found[where] = [finding("judged.angles_not_aligned", where, filters=gone)]
            continue
        pair = [estimate.sensors[own] for own in (joints[name].proximal, joints[name].distal)]
        aligned = {
            key: own
            for key, own in joint.angles.items()
            if all(sensor.can_be_judged(key[0]) for sensor in pair)
        }
        angles[name] = replace(joint, angles=aligned)
        gone = list(dict.fromkeys(key[0] for key in joint.angles if key not in aligned))
        if gone:
            where = f"joint '{name}'"
            found[where] = [finding("judged.joint_not_aligned", where, filters=gone)]
    return replace(estimate, sensors=sensors, joints=angles), found


def sound_truth(session: Session, sensor: str) -> tuple[Truth | None, int]:
    """The truth that a sensor's orientation is judged by, or None, and how many of its orientations
    were left out as jumps.
    """
    truth, file = session.truth(sensor), session.truth_file(sensor)
    if truth is None or file is None or file.has_rates:
        return truth, 0
    return without_jumps(truth, lambda: _fastest(session, sensor))


def _fastest(session: Session, sensor: str) -> float:
    """Largest angular rate that a sensor reported [rad/s]; 0 where it reports none."""
    norms = (np.linalg.norm(samples.gyr, axis=1) for samples in session.imu_batches(sensor))
    return max((float(np.max(norm[np.isfinite(norm)], initial=0.0)) for norm in norms), default=0.0)


def rows_by_step(
    steps: list[PlannedStep], time_ns: np.ndarray, static: np.ndarray
) -> Iterator[tuple[PlannedStep, np.ndarray]]:
    """The rows of a time column that count in each step, in order.

    Args:
        steps: As `judged_steps` gives them.
        time_ns: Increasing, shape (n,).
        static: At rest by the sensors, shape (n,).
    """
    for step, first, last in zip(steps, *window_rows(steps, time_ns, "right"), strict=True):
        rows = np.arange(first, last)
        yield step, rows if step.kind == "sweep" else rows[static[rows]]
