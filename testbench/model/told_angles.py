"""Angles of a joint by another system as its truth."""

from __future__ import annotations

import numpy as np

from testbench.model.held_angles import Held, held_angles
from testbench.model.joint_angle import INDEX, decomposition_of, joint_angle_series
from testbench.model.truth import angles_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import JointEstimate
from testbench.records.session.session import Session
from testbench.records.specs.protocol import JointDefinition


def told_angles(
    session: Session, name: str, joint: JointEstimate
) -> tuple[dict[str, np.ndarray], list[Finding]] | None:
    """True angles of a joint by another system, at the instants of its estimate.

    Args:
        session: The recording.
        name: Of the joint.
        joint: Its estimate.

    Returns:
        By label of the definition, shape (n, 3) [rad], NaN where unknown or held while the joint
        turns, and what is to be said of that; None where there are none, or their time is not
        known. Definitions beside the joint's own are there where all three angles are.
    """
    true, clock = session.true_angles(name), joint.true_clock
    if true is None or clock is None or clock.refused:
        return None
    definition = session.analysis.joints[name]
    host_ns = clock.to_host(joint.host_time_ns)
    own = angles_at(true, host_ns)
    known, said = np.isfinite(own[:, true.given]).all(axis=1), []
    for held in held_angles(true, joint, definition.label, host_ns):
        said.append(_told(name, definition, held, len(known)))
        known &= ~held.rows
    own[~known] = np.nan
    found = {definition.label: own}
    if len(true.given) < own.shape[1]:
        return found, said
    q = decomposition_of(definition).rotation(own[known])
    level = np.zeros_like(q)
    level[:, 0] = 1.0  # of a level proximal segment both orders are the same
    for other in definition.definitions():
        # by how the segments lie in the world alone one of these orders follows from the other
        if other.label != definition.label and other.seen_from == definition.seen_from:
            found[other.label] = np.full(own.shape, np.nan)
            found[other.label][known] = joint_angle_series(level, q, other)
    return found, said


def _told(name: str, joint: JointDefinition, held: Held, samples: int) -> Finding:
    """That an angle is held, as the joint counts it."""
    sign = joint.sign if INDEX[joint.flexion] == held.place else 1
    return finding(
        "truth.angle_held",
        f"joint '{name}'",
        angle=decomposition_of(joint).names[held.place],
        at_deg=float(np.degrees(sign * held.value)),
        longest_s=held.longest_s,
        moved_deg=float(np.degrees(held.moved)),
        count=int(held.rows.sum()),
        samples=samples,
    )
