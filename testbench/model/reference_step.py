"""The dwell in which the frames of filters and sensors are aligned."""

from __future__ import annotations

from collections.abc import Sequence

from testbench.frames import NANOSECONDS
from testbench.records.plan import PlannedStep

SHORTEST_DWELL_NS = NANOSECONDS // 5
"""A shorter one gives no mean orientation."""


def reference_step(steps: Sequence[PlannedStep]) -> PlannedStep | None:
    """The first dwell of the reference section, or the first dwell of all where there is no such section; None without any."""
    dwells = [step for step in steps if step.kind != "sweep" and step.end_ns - step.settled_ns >= SHORTEST_DWELL_NS]
    return next((step for step in dwells if step.role == "reference"), dwells[0] if dwells else None)


def reference_warning(steps: Sequence[PlannedStep], align: str) -> str | None:
    """What is doubtful about the pose that a method of alignment takes, or None."""
    step = reference_step(steps)
    if align not in ("heading", "reference_pose") or not any(s.role == "evaluation" for s in steps):
        return None
    if step is not None and step.role == "reference":
        return None
    where = "nowhere, for nothing dwells" if step is None else f"in '{step.name}', of section {step.section}"
    return f"align: {align} finds no section of the role reference with a dwell of 0.2 s: every sensor is aligned {where}"
