"""The dwell in which the frames of filters and sensors are aligned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.session.plan import PlannedStep, evaluated_steps

SHORTEST_DWELL_NS = NANOSECONDS // 5
"""A shorter one gives no mean orientation."""


def reference_step(steps: Sequence[PlannedStep]) -> PlannedStep | None:
    """The first dwell of the reference section, or of all where there is no such section.

    Returns:
        None where nothing dwells.
    """
    dwells = [
        step
        for step in steps
        if step.kind != "sweep" and step.end_ns - step.settled_ns >= SHORTEST_DWELL_NS
    ]
    return next(
        (step for step in dwells if step.role == "reference"), dwells[0] if dwells else None
    )


def aligning_part(step: PlannedStep) -> tuple[int, int]:
    """Begin and end of the part of a dwell that is averaged, host time [ns].

    It is the second half, when filters have settled.
    """
    return (step.settled_ns + step.end_ns) // 2, step.end_ns


def before_judging(steps: Sequence[PlannedStep], time_ns: np.ndarray) -> np.ndarray:
    """Samples before the first evaluated step, or all where no step is evaluated.

    Args:
        steps: Of the session.
        time_ns: Host time of the samples, shape (n,).

    Returns:
        Shape (n,), bool.
    """
    judged = [step.start_ns for step in evaluated_steps(steps)]
    return (
        time_ns < min(judged)
        if judged and min(judged) > time_ns[0]
        else np.ones(len(time_ns), dtype=bool)
    )


def aligned_instant(steps: Sequence[PlannedStep], align: str, time_ns: np.ndarray) -> int:
    """The middle of what a method of alignment averages over, host time [ns].

    Args:
        steps: Of the session.
        align: The method, which is not "none".
        time_ns: Of the samples, increasing, shape (n,).
    """
    step = reference_step(steps)
    if align in ("heading", "reference_pose") and step is not None:
        begin, end = aligning_part(step)
        return (begin + end) // 2
    used = time_ns[before_judging(steps, time_ns)]
    return int((used[0] + used[-1]) // 2)


def reference_warning(steps: Sequence[PlannedStep], align: str) -> str | None:
    """What is doubtful about the pose that a method of alignment takes, or None."""
    step = reference_step(steps)
    if align not in ("heading", "reference_pose") or not any(s.role == "evaluation" for s in steps):
        return None
    if step is not None and step.role == "reference":
        return None
    where = (
        "nowhere, for nothing dwells"
        if step is None
        else f"in '{step.name}', of section {step.section}"
    )
    return (
        f"align: {align} finds no section of the role reference with a dwell of 0.2 s: every "
        f"sensor is aligned {where}"
    )
