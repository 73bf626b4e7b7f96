"""Lines of the budget of a truth that came with a recording: cameras, or the log of a robot."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.sensitivity import flexion_by_turning
from testbench.evaluation.uncertainty import Stated
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.true_segment import true_segment
from testbench.model.truth import truth_at
from testbench.records.results.uncertainty import UncertaintySource
from testbench.records.session.samples import Truth
from testbench.records.session.session import Session
from testbench.records.specs.joint_definition import FlexionAngle

UNKNOWN_TRUTH = "the accuracy of the reference system is not known (--truth-sd states it)"
MOST_INSTANTS = 32
"""A joint is looked at in so many of its judged instants."""
MOST_STEPS = 4000
"""The steps of a truth are looked at in so many places."""
RIGID = "what the reference follows is rigid, and the sensor does not move on it"


def known_of(session: Session, sensors: list[str]) -> bool:
    """Whether the accuracy of the truth of all these sensors is known.

    Args:
        session: The recording.
        sensors: Their names.
    """
    described = session.manifest.sensors
    return all(name in described and described[name].truth_sd_deg is not None for name in sensors)


def reference_sources(
    session: Session, sensor: str, by_axes: float, by_turn: float
) -> list[UncertaintySource]:
    """What the reference itself contributes: its orientations, and that it is known step by step.

    Both are taken to last, so that nothing averages out.

    Args:
        session: The recording.
        sensor: Whose truth.
        by_axes: Change of the error for a turn of the truth about any axis, all axes that count
            together.
        by_turn: Change of the error for a turn of the truth about the axis that counts most.
    """
    described, truth = session.manifest.sensors.get(sensor), session.truth(sensor)
    lines = []
    if described is not None and described.truth_sd_deg is not None:
        lines.append(
            Stated(
                f"orientation of the reference, {sensor}",
                "B",
                described.truth_sd_deg,
                "deg",
                f"about each axis: {described.truth_sd_from or 'as was stated'}",
            ).source(by_axes, by_axes)
        )
    if truth is not None:
        lines.append(
            Stated(
                f"time step of the reference, {sensor}",
                "A",
                step_sd_deg(truth),
                "deg",
                "between two of its frames the motion is taken to be even: by how much one step's "
                "turn differs from the next",
            ).source(by_turn, by_turn)
        )
    return lines


def step_sd_deg(truth: Truth) -> float:
    """RMS error of orientations that are interpolated evenly between two frames [deg].

    At an angular acceleration a, s after one frame and h - s before the next, that is
    a s (h - s) / 2; its RMS over the step is a h^2 / sqrt(120), and a h^2 is how much one step's
    turn differs from the next.

    Args:
        truth: With gaps of any size, which are passed over.
    """
    time, q = truth.host_time_ns, truth.q_world_from_sensor
    count = len(time) - 2
    if count < 1:
        return 0.0
    first = np.unique(np.linspace(0, count - 1, min(count, MOST_STEPS)).astype(int))
    usual = 1.5 * median_interval(time)
    even = np.maximum(time[first + 1] - time[first], time[first + 2] - time[first + 1]) <= usual
    first = first[even]
    turns = [rotation.turn_between(q[first + i], q[first + i + 1]) for i in (0, 1)]
    squares = np.sum((turns[1] - turns[0]) ** 2, axis=1)
    squares = squares[np.isfinite(squares)]
    if not len(squares):
        return 0.0
    return float(np.degrees(np.sqrt(np.mean(squares) / 120)))


def flexion_sensitivities(
    session: Session,
    sensors: tuple[str, str],
    definition: FlexionAngle,
    time_ns: np.ndarray,
) -> tuple[float, float]:
    """Change of a flexion for a turn of either true orientation about any axis, RMS.

    Args:
        session: With the truth of both.
        sensors: The proximal and the distal one.
        definition: What the flexion is.
        time_ns: When it is judged, shape (n,).

    Returns:
        All three axes together, of each sensor [1]; 1 for a middle angle, more where an outer one
        comes near to gimbal lock.
    """
    rows = np.unique(np.linspace(0, len(time_ns) - 1, MOST_INSTANTS).astype(int))
    segments = []
    for name in sensors:
        truth = session.truth(name)
        if truth is None:
            return 1.0, 1.0
        segments.append(true_segment(session.analysis, name, truth_at(truth, time_ns[rows])))
    known = np.isfinite(segments[0][:, 0]) & np.isfinite(segments[1][:, 0])
    if not known.any():
        return 1.0, 1.0
    axes = np.broadcast_to(np.eye(3), (int(known.sum()), 3, 3))
    still = np.zeros_like(axes)
    turning = [np.concatenate(pair, axis=1) for pair in ((axes, still), (still, axes))]
    found = flexion_by_turning([q[known] for q in segments], turning, definition)
    sizes = np.sqrt(np.mean(np.sum(found.reshape(-1, 2, 3) ** 2, axis=2), axis=0))
    return float(sizes[0]), float(sizes[1])
