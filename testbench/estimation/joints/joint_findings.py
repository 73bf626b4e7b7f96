"""What is said of how the joints of a body were placed, and of how far their headings drift."""

from __future__ import annotations

import numpy as np

from testbench.estimation.joints.above import proximal_above
from testbench.estimation.joints.body_recording import BodyRecording, ends
from testbench.estimation.joints.centre_apart import centre_apart
from testbench.estimation.joints.limb import Limb
from testbench.estimation.joints.placing import Placing
from testbench.estimation.joints.standing import Standing
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.specs.anatomy import kind_of
from testbench.records.specs.protocol import BodyJoint

VAGUE = np.radians(10.0)
"""A relative heading that is known no better at some time is remarked on [rad]."""
MOST_STATED_SWAY = np.radians(3.0)
"""Who is said to stand and turns by more about the mean does not (RMS): twice what a rest that is
found may sway by [rad].
"""


def placing_findings(
    recording: BodyRecording, placing: Placing, name: str, joint: BodyJoint, key: str
) -> list[Finding]:
    """What is to be said of the placing of a joint's sensors by one filter.

    Args:
        recording: Of the body.
        placing: Of the joints that hang together with it.
        name: Of the joint.
        joint: As defined.
        key: Of the filter.
    """
    told = [] if placing.refused is not None else _of_way(recording, placing, name, joint, key)
    if placing.limb is not None:
        beside = _of_centre(placing.limb, joint, key)
        if not beside and placing.standing is not None and kind_of(name, joint) is not None:
            beside = _of_order(placing.limb, joint, key, placing.standing)
        told += beside
    if placing.refused is not None:
        why, add = placing.refused.why, placing.refused.add
        values = {"filter": key, "why": why} | ({"add": add} if add else {})
        told.append(finding("joint.not_placed" if add else "joint.not_computed", **values))
    return told


def drift_findings(
    recording: BodyRecording, time_ns: np.ndarray, sd: np.ndarray, key: str
) -> list[Finding]:
    """That the heading between the sensors of a joint is hardly known at some time.

    Args:
        recording: Of the body.
        time_ns: Host time, shape (n,) [ns].
        sd: Standard uncertainty of that heading, shape (n,) [rad].
        key: Of the filter.
    """
    at = int(np.argmax(sd))
    if sd[at] <= VAGUE:
        return []
    seconds = (time_ns[at] - recording.begin_ns) / NANOSECONDS
    return [finding("joint.drifts", filter=key, sd_deg=float(np.degrees(sd[at])), at_s=seconds)]


def _of_way(
    recording: BodyRecording, placing: Placing, name: str, joint: BodyJoint, key: str
) -> list[Finding]:
    """By what its sensors were placed."""
    if placing.aligned:
        return [finding("joint.by_truth")]
    if placing.standing is None:
        return _of_statement(recording, placing, name, joint)
    told = _of_pose(recording, placing, placing.standing, name, joint, key)
    return told + (_of_hinge(placing, name, key) if placing.method == "functional" else [])


def _of_statement(
    recording: BodyRecording, placing: Placing, name: str, joint: BodyJoint
) -> list[Finding]:
    """That a person stated the axes, or did not."""
    bare = [own for own in ends(joint) if not recording.body.segment(own).rotation_deg]
    told = [finding("joint.axes_unstated", sensors=bare)] if bare else []
    if name in placing.relative_by:
        told.append(finding("joint.as_stated", by=placing.relative_by[name]))
    return told


def _of_pose(
    recording: BodyRecording,
    placing: Placing,
    standing: Standing,
    name: str,
    joint: BodyJoint,
    key: str,
) -> list[Finding]:
    """When the person stands, and what told which way."""
    begin, end = (
        (own - recording.begin_ns) / NANOSECONDS for own in (standing.begin_ns, standing.end_ns)
    )
    code = "joint.standing_stated" if standing.told else "joint.standing_found"
    sd = recording.body.alignment.axes_sd_deg
    told = [finding(code, begin_s=begin, end_s=end, sd_deg=sd)]
    sway = max(standing.sway[own] for own in ends(joint))
    if sway > MOST_STATED_SWAY:
        told.append(finding("joint.standing_moves", sway_deg=float(np.degrees(sway))))
    by, relative = placing.facing_by, placing.relative_by.get(name, "")
    told.append(finding("joint.facing", filter=key, by=by, relative=relative))
    return told


def _of_hinge(placing: Placing, name: str, key: str) -> list[Finding]:
    """Whether a hinge's axis was found by its motion."""
    if name in placing.pairs:
        sd = float(np.degrees(np.hypot(*placing.pairs[name].sds)))
        return [finding("joint.hinge_found", filter=key, sd_deg=sd)]
    if name in placing.no_pair:
        return [finding("joint.hinge_unknown", filter=key, why=placing.no_pair[name])]
    return [finding("joint.no_hinge" if placing.pairs else "joint.no_hinge_at_all")]


def _of_centre(limb: Limb, joint: BodyJoint, key: str) -> list[Finding]:
    """Whether the sensors of a joint do not see its centre move alike."""
    apart = centre_apart(limb, joint.proximal, joint.distal)
    if apart is None:
        return []
    if apart.shift_s is None:
        return [finding("joint.centre_apart", filter=key)]
    shift, sensor = apart.shift_s, joint.distal
    return [finding("joint.clocks_apart", filter=key, shift_s=shift, sensor=sensor)]


def _of_order(limb: Limb, joint: BodyJoint, key: str, standing: Standing) -> list[Finding]:
    """Whether the sensors of a joint were exchanged: all joints of known kinds hang while standing,
    the proximal segment above.
    """
    above = proximal_above(limb, joint.proximal, joint.distal, standing)
    if above is None or not above.upside_down:
        return []
    return [
        finding(
            "joint.sensors_exchanged",
            filter=key,
            proximal=joint.proximal,
            distal=joint.distal,
            below_cm=-100 * above.height,
            sd_cm=100 * above.sd,
        )
    ]
