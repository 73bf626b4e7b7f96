"""Whether a joint of a body flexes farther than such a joint goes."""

from __future__ import annotations

import numpy as np

from testbench.model.joint_angle import INDEX
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.specs.anatomy import JointKind, kind_of
from testbench.records.specs.joint_definition import JointRotation
from testbench.records.specs.protocol import BodyJoint

RANGE_DEG: dict[JointKind, tuple[float, float]] = {
    "hip": (-30.0, 120.0),
    "knee": (-10.0, 160.0),
    "ankle": (-50.0, 20.0),
    "elbow": (-10.0, 150.0),
    "wrist": (-70.0, 80.0),
}
"""Flexion that healthy joints reach (American Academy of Orthopaedic Surgeons, Joint motion: method
of measuring and recording, 1965), hyperextension included; of the knee what kneeling takes [deg].
"""
BEYOND_DEG = 25.0
"""So much farther no one goes, as the angle is zero where a person stands, and gymnasts go farther
than the range [deg].
"""
RARELY = 0.01
"""Part of the samples at either end that may be a spike [1]."""


def beyond_anatomy(name: str, joint: BodyJoint, key: str, angles: np.ndarray) -> list[Finding]:
    """What is to be said of a flexion that goes farther than the joint.

    Args:
        name: Of the joint, which with its definition tells what it is.
        joint: As defined.
        key: Of the filter.
        angles: By the joint's own definition, shape (n, 3) [rad].
    """
    kind = kind_of(name, joint)
    flexion = np.degrees(joint.sign * angles[:, INDEX[joint.flexion]])
    flexion = flexion[np.isfinite(flexion)]
    if kind is None or not _flexes(joint) or not len(flexion):
        return []
    least, most = RANGE_DEG[kind]
    low, high = np.quantile(flexion, [RARELY, 1 - RARELY]).tolist()
    if low >= least - BEYOND_DEG and high <= most + BEYOND_DEG:
        return []
    values = {"low_deg": low, "high_deg": high, "least_deg": least, "most_deg": most}
    return [finding("joint.beyond_anatomy", filter=key, kind=kind, **values)]


def _flexes(joint: BodyJoint) -> bool:
    """Whether the flexion is that of a joint coordinate system, which has anatomy's sign; that of a
    plain sequence has whichever a person gave it.
    """
    own = joint.rotation
    return isinstance(own, JointRotation) and (own.isb or own.grood_suntay) is not None
