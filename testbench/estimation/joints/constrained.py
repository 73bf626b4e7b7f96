"""Where the axes of a joint correct the heading between its sensors, filter by filter."""

from __future__ import annotations

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.joint_constraint import track_heading
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import JointEstimate
from testbench.records.specs.protocol import JointDefinition

VAGUE_DEG = 10.0
"""A heading that is known no better for half of the time is remarked on."""


def is_constrained(joint: JointDefinition, kind: OrientationFilter) -> bool:
    """Whether a joint's axes correct a filter's heading, which must know up and not north."""
    if joint.constraint is None:
        return False
    if joint.constraint.filters is not None:
        return kind.name in joint.constraint.filters
    return {"gyr", "acc"} <= set(kind.needs) and "mag" not in kind.needs


def constrained(
    found: JointEstimate,
    joint: JointDefinition,
    key: str,
    q_proximal: np.ndarray,
    q_distal: np.ndarray,
    start_ns: int | None,
) -> np.ndarray:
    """The distal orientation turned by the heading that the joint's axes tell, kept in `found`.

    Args:
        found: The joint's estimate.
        joint: As defined, with its constraint.
        key: Of the filter.
        q_proximal: q_world_from_segment of the proximal segment, shape (n, 4).
        q_distal: Of the distal one, shape (n, 4).
        start_ns: When the heading between both is zero, host time [ns]; None where nobody knows.

    Returns:
        Shape (n, 4).
    """
    assert joint.constraint is not None
    try:
        track = track_heading(found.host_time_ns, q_proximal, q_distal, joint.constraint, start_ns)
    except PoorExcitation as error:
        found.findings.append(finding("joint.axes_do_not_tell", filter=key, why=str(error)))
        return q_distal
    sd_deg = float(np.degrees(np.median(track.sd)))
    if sd_deg > VAGUE_DEG:
        found.findings.append(finding("joint.axes_hardly_tell", filter=key, sd_deg=sd_deg))
    found.headings[key] = track
    return rotation.multiply(rotation.from_heading(track.heading), q_distal)
