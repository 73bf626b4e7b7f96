"""Angles of a joint by another system as its truth."""

from __future__ import annotations

import numpy as np

from testbench.model.joint_angle import decomposition_of, joint_angle_series
from testbench.model.truth import angles_at
from testbench.records.results.estimate import JointEstimate
from testbench.records.session.session import Session


def told_angles(session: Session, name: str, joint: JointEstimate) -> dict[str, np.ndarray] | None:
    """True angles of a joint by another system, at the instants of its estimate.

    Args:
        session: The recording.
        name: Of the joint.
        joint: Its estimate.

    Returns:
        By label of the definition, shape (n, 3) [rad], NaN where unknown; None where there are
        none, or their time is not known. Definitions beside the joint's own are there where all
        three angles are.
    """
    true, clock = session.true_angles(name), joint.true_clock
    if true is None or clock is None or clock.refused:
        return None
    definition = session.analysis.joints[name]
    own = angles_at(true, clock.to_host(joint.host_time_ns))
    known = np.isfinite(own[:, true.given]).all(axis=1)
    own[~known] = np.nan
    found = {definition.label: own}
    if len(true.given) < own.shape[1]:
        return found
    q = decomposition_of(definition).rotation(own[known])
    level = np.zeros_like(q)
    level[:, 0] = 1.0
    for other in definition.definitions():
        if other.label != definition.label:
            found[other.label] = np.full(own.shape, np.nan)
            found[other.label][known] = joint_angle_series(level, q, other)
    return found
