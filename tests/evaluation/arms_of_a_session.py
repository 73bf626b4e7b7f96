"""Drawn arms in the judged poses and sweeps of one session: how often its U holds what the truth
was off by.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from testbench.evaluation.judged import window
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.plan import judged_steps
from testbench.records.session.session import Session
from tests.evaluation.drawn_arms import Judged, Stated, differences, drawn

DEFINITIONS = {"by_joint": None, "by_frames": "YXZ", "by_symmetric_frames": "ZXZ"}
MOST_INSTANTS = 24


@dataclass(frozen=True)
class Law:
    """How errors are drawn against what the robot file states.

    Attributes:
        scale: By what they are really greater.
        reliable: Whether the stated numbers are exact, not off as their degrees of freedom say.
        shape: "normal" or "rectangular".
        edge: Whether delays that nobody states are off by as much as is thought possible.
    """

    scale: float = 1.0
    reliable: bool = True
    shape: str = "normal"
    edge: bool = False


LAWS = {
    "as stated": Law(),
    "as stated, to 25 %": Law(reliable=False),
    "delays at the edge": Law(edge=True),
    "rectangular": Law(shape="rectangular"),
    "narrower by 25 %": Law(scale=0.75),
    "wider by 25 %": Law(scale=1.25),
}


@dataclass(frozen=True)
class Drawn:
    """How often the truth of drawn arms lay within U."""

    joint: str
    section: str
    law: str
    percent: float
    percent_of_magnitudes: float
    expanded: float
    expanded_of_magnitudes: float
    k: float


def judged_arms(
    recorded: tuple[Session, Evaluation], count: int, laws: Iterable[str] = LAWS
) -> list[Drawn]:
    """Draw arms, and hold what they do to each joint and section to its budget.

    Args:
        recorded: A session of a UR3e, and what was made of it.
        count: Of arms, for each law.
        laws: By which they are drawn, of `LAWS`.
    """
    session, evaluation = recorded
    result = []
    for budget in evaluation.uncertainty:
        if budget.quantity == "flexion" and budget.owner in DEFINITIONS:
            steps = _steps(session, str(budget.section))
            rng = np.random.default_rng(7)
            result += [_held(session, budget, steps, name, count, rng) for name in laws]
    return result


def _steps(session: Session, section: str) -> list[Judged]:
    """What the encoders said in the judged instants of a section."""
    arm = session.arm()
    assert arm is not None
    steps = []
    for step in judged_steps(session.steps):
        if step.section == section:
            first, last = np.searchsorted(arm.host_time_ns, window(step))
            if step.kind == "sweep":
                rows = np.linspace(first, last - 1, MOST_INSTANTS).astype(int)
                steps.append(Judged(arm.q_measured[rows], arm.v_measured[rows]))
            else:
                mean = arm.q_measured[first:last].mean(axis=0)[None]
                steps.append(Judged(mean, np.zeros_like(mean)))
    return steps


def _held(
    session: Session,
    budget: UncertaintyBudget,
    steps: list[Judged],
    name: str,
    count: int,
    rng: np.random.Generator,
) -> Drawn:
    assert session.robot is not None
    law = LAWS[name]
    spec, servo = session.robot.spec.uncertainty, session.robot.spec.servo
    assert isinstance(spec.joint_angle_deg, float)
    stated = Stated(
        spec.joint_angle_deg, spec.link_twist_deg, spec.link_length_mm, spec.link_offset_mm
    )
    stated = replace(stated, scale=law.scale, law=law.shape)
    if not law.reliable:
        stated = replace(stated, freedom=0.5 / (spec.reliability_percent / 100) ** 2)
    arms = drawn(stated, count, rng)
    joint = session.analysis.joints[budget.owner]
    late = np.column_stack(
        [_late(budget, sensor, count, rng) for sensor in (joint.proximal, joint.distal)]
    )
    if law.edge:
        late = np.column_stack(
            [_edge(budget, sensor, count) for sensor in (joint.proximal, joint.distal)]
        )
    by_step = []
    for step in steps:
        moved = np.radians(servo.repeatability_deg) * rng.standard_normal((count, 6))
        by_step.append(differences(step, arms, DEFINITIONS[budget.owner], late, moved))
    mean = np.mean([own.mean(axis=1) for own in by_step], axis=0)
    size = np.sqrt(np.mean([(own**2).mean(axis=1) for own in by_step], axis=0))
    assert budget.expanded_deg is not None and budget.expanded_magnitude_deg is not None
    return Drawn(
        budget.owner,
        str(budget.section),
        name,
        100 * float(np.mean(np.abs(mean) <= budget.expanded_deg)),
        100 * float(np.mean(size <= budget.expanded_magnitude_deg)),
        budget.expanded_deg,
        budget.expanded_magnitude_deg,
        float(budget.coverage_factor or np.nan),
    )


def _late(
    budget: UncertaintyBudget, sensor: str, count: int, rng: np.random.Generator
) -> np.ndarray:
    """By how much the samples of a sensor were taken later than is believed [s], shape (count,)."""
    late = np.zeros(count)
    for line in budget.sources:
        if line.source.endswith(f", {sensor}") and line.unit == "ms":
            if line.distribution == "rectangular":
                late += 1e-3 * line.value * rng.uniform(-1, 1, count)
            else:
                late += 1e-3 * line.value * rng.standard_normal(count)
    return late


def _edge(budget: UncertaintyBudget, sensor: str, count: int) -> np.ndarray:
    """The largest delay of a sensor that its line allows [s], shape (count,)."""
    lines = [s for s in budget.sources if s.source.endswith(f", {sensor}") and s.unit == "ms"]
    return np.full(count, sum(1e-3 * s.value for s in lines if s.distribution == "rectangular"))
