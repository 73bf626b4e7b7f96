"""The motion of an arm in its order, so that a person can walk through it before anything moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.drivers.arms.remote import APPROACH_RAD_S
from testbench.frames import NANOSECONDS
from testbench.records.session.plan import Plan, PlannedStep

SWINGS_DEG = 0.05
"""A joint of a sweep that turns by less is not named [deg]: none can be seen to move so little."""


@dataclass(frozen=True)
class MotionRow:
    """One motion, with the dwell after it.

    Attributes:
        index: Of the step in the plan; None of a connecting move.
        name: Of the step.
        kind: "move", "sweep", "hold" or "connect", which goes to where the next step begins because
            a step between was left out.
        pose_deg: Joint angles at its end [deg].
        swings_deg: Of a sweep, least and largest angle of each joint that moves [deg].
        speed_deg_s: Of the fastest joint.
        duration_s: As planned.
    """

    index: int | None
    name: str
    kind: str
    pose_deg: list[float]
    speed_deg_s: float
    duration_s: float
    swings_deg: dict[str, tuple[float, float]] = field(default_factory=dict)


def motion_rows(plan: Plan, steps: Sequence[PlannedStep] | None = None) -> list[MotionRow]:
    """What the arm does from the start of the plan on.

    Args:
        plan: The motion.
        steps: Those of its steps to do, in order; all if None.
    """
    rows, before = [], plan.trajectory.q[0]
    for step in plan.steps if steps is None else steps:
        begin = plan.trajectory.at(np.array([step.start_ns]))[0][0]
        if not np.allclose(begin, before, atol=1e-9):
            duration = float(np.abs(begin - before).max()) / APPROACH_RAD_S
            speed = float(np.degrees(APPROACH_RAD_S))
            rows.append(
                MotionRow(None, f"on to '{step.name}'", "connect", _degrees(begin), speed, duration)
            )
        row = _row(plan, step)
        rows.append(row)
        before = plan.trajectory.at(np.array([step.settled_ns]))[0][0]
    return rows


def _row(plan: Plan, step: PlannedStep) -> MotionRow:
    knots = plan.trajectory
    pose = knots.at(np.array([step.settled_ns]))[0][0]
    first = int(np.searchsorted(knots.time_ns, step.start_ns))
    inside = slice(first, int(np.searchsorted(knots.time_ns, step.settled_ns, side="right")))
    fastest = float(np.degrees(np.abs(knots.v[inside]).max(initial=0.0)))
    swings: dict[str, tuple[float, float]] = {}
    if step.kind == "sweep" and inside.stop > inside.start:
        q = np.degrees(knots.q[inside])
        for joint, low, high in zip(
            plan.robot.joint_names, q.min(axis=0), q.max(axis=0), strict=True
        ):
            if high - low > SWINGS_DEG:
                swings[joint] = (float(low), float(high))
    duration = (step.end_ns - step.start_ns) / NANOSECONDS
    return MotionRow(step.index, step.name, step.kind, _degrees(pose), fastest, duration, swings)


def _degrees(q: np.ndarray) -> list[float]:
    return [float(angle) for angle in np.degrees(q)]
