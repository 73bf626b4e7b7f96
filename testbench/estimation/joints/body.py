"""Joint angles between sensors that no arm carries, and how sure they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.anatomical_range import beyond_anatomy
from testbench.estimation.joints.angle_sd import AngleBudget, angle_sd
from testbench.estimation.joints.body_recording import BodyRecording, ends
from testbench.estimation.joints.constrained import constrained, is_constrained
from testbench.estimation.joints.heading_drift import heading_drift
from testbench.estimation.joints.joint_findings import drift_findings, placing_findings
from testbench.estimation.joints.limb import limbs_of, own_earth
from testbench.estimation.joints.placing import Placing, place, shared_sd
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_angle import decomposition_of, joint_angle_series
from testbench.records.findings.catalogue import finding, of_filters_together
from testbench.records.results.estimate import JointEstimate, as_kept
from testbench.records.specs.protocol import BodyJoint

DRIFT = np.radians(2.0) / np.sqrt(60.0)
"""By how much the headings of filters without a magnetometer drift apart, as of a joint constraint
[rad / sqrt(s)].
"""


def estimate_body(
    joints: Mapping[str, BodyJoint],
    recording: BodyRecording,
    filters: Sequence[OrientationFilter],
) -> dict[str, JointEstimate]:
    """Joint angles of a body, by every filter that ran for both sensors of a joint.

    Args:
        joints: As defined, by name.
        recording: What they are computed from.
        filters: Those that ran.
    """
    found = {
        name: JointEstimate(recording.sensors[joint.proximal].host_time_ns, {})
        for name, joint in joints.items()
    }
    for kind in filters:
        ran = {
            name: joint
            for name, joint in joints.items()
            if all(kind.name in recording.sensors[own].orientation for own in ends(joint))
        }
        by_method: dict[str, dict[str, BodyJoint]] = {}
        for name, joint in ran.items():
            by_method.setdefault(recording.method(joint), {})[name] = joint
        for method, alike in by_method.items():
            for limb_joints in limbs_of(alike):
                placing = place(recording, limb_joints, kind, method)
                for name, joint in limb_joints.items():
                    told = placing_findings(recording, placing, name, joint, kind.name)
                    codes = {(own.code, str(own)) for own in found[name].findings}
                    new = (own for own in told if (own.code, str(own)) not in codes)
                    found[name].findings.extend(new)
                    if placing.refused is None:
                        _angles(found[name], name, joint, recording, kind, placing)
    for name, joint in joints.items():
        own = found[name].findings
        own[:] = of_filters_together(own)
        given = [recording.sensors[end].orientation for end in ends(joint)]
        if not any(all(kind.name in one for one in given) for kind in filters):
            own.append(finding("joint.no_filter"))
    return found


def _angles(
    found: JointEstimate,
    name: str,
    joint: BodyJoint,
    recording: BodyRecording,
    kind: OrientationFilter,
    placing: Placing,
) -> None:
    """The angles of a joint by one filter, kept in `found`."""
    key, time = kind.name, found.host_time_ns
    q = []
    for end in ends(joint):
        own = recording.sensors[end]
        raw = own.orientation[key]
        raw = raw if placing.aligned else own_earth(raw, own.frames.get(key))
        if end == joint.distal:
            raw = rotation.interpolate(own.host_time_ns, raw, time)
        q.append(placing.placed[end].segment(raw))
    if is_constrained(joint, kind):
        q[1] = constrained(found, joint, key, q[0], q[1], placing.start_ns)
    found.placements[key] = {end: placing.placed[end].by for end in ends(joint)}
    budget = _budget(found, name, joint, kind, placing)
    if budget.headings is None and shared_sd(kind) is None:
        budget = _with_drift(budget, found, name, joint, recording, kind, placing)
    for definition in joint.definitions():
        angles = joint_angle_series(q[0], q[1], definition)
        found.angles[key, definition.label] = as_kept(angles)
        found.sd[key, definition.label] = as_kept(
            angle_sd(time, q[0], q[1], decomposition_of(definition), budget)
        )
    found.findings.extend(beyond_anatomy(name, joint, key, found.angles[key, joint.label]))


def _with_drift(
    budget: AngleBudget,
    found: JointEstimate,
    name: str,
    joint: BodyJoint,
    recording: BodyRecording,
    kind: OrientationFilter,
    placing: Placing,
) -> AngleBudget:
    """With what the sensors' rests show of how their headings drift apart; much of it is said.

    A relative heading that the centre of the joint told is the mean over the recording: without a
    pose it counts from the middle. So it does where the motion of a hinge told the axis in both
    sensors: what their headings are apart by in the mean is in the axis.
    """
    time, start = found.host_time_ns, placing.start_ns
    posed = start is not None and name not in placing.pairs
    if start is None or not posed:
        start = int(time[0] + time[-1]) // 2
    since = (time - start) / NANOSECONDS
    apart, rate, walk = np.zeros(len(time)), 0.0, budget.drift**2
    for end, sign in zip(ends(joint), (-1.0, 1.0), strict=True):
        own = recording.sensors[end]
        raw = own_earth(own.orientation[kind.name], own.frames.get(kind.name))
        resting = own.static & ~own.flagged
        if placing.standing is not None:
            resting = resting | placing.standing.holds(own.host_time_ns)
        drift = heading_drift(own.host_time_ns, raw, recording.read[end].rate, resting)
        if drift is not None:
            apart += sign * np.interp(time, own.host_time_ns, drift.astray)
            rate, walk = float(np.hypot(rate, drift.rate_sd)), walk + drift.walk**2
    apart -= np.interp(start, time, apart) if posed else apart.mean()
    relative = budget.relative
    if budget.posed:
        relative = float(np.hypot(relative, np.hypot(apart.mean(), rate * since.mean())))
    variance = apart**2 + (rate * since) ** 2
    said = np.sqrt(relative**2 + variance + walk * np.abs(since))
    found.findings.extend(drift_findings(recording, time, said, kind.name))
    drift_sd = float(np.sqrt(walk))
    return replace(budget, relative=relative, drift=drift_sd, start_ns=start, drifted=variance)


def _budget(
    found: JointEstimate, name: str, joint: BodyJoint, kind: OrientationFilter, placing: Placing
) -> AngleBudget:
    """What makes the angles of a joint by one filter uncertain."""
    placed = [placing.placed[end] for end in ends(joint)]
    covariances, shared = [own.covariance for own in placed], np.zeros((3, 3))
    about_up = placing.common**2 * np.diag([0.0, 1.0, 0.0])
    if name in placing.pairs:  # an axis that is not the one that is meant is so in both segments
        shared = np.mean([own.of_axis for own in placed if own.of_axis is not None], axis=0)
        covariances = [own.covariance - own.of_axis for own in placed if own.of_axis is not None]
    elif any(own.hinged for own in placed):  # the one beside a hinge faces as its axis says
        covariances = [
            own.covariance + about_up
            if own.of_axis is None
            else own.covariance - own.of_axis * np.diag([0.0, 1.0, 0.0])
            for own in placed
        ]
    else:
        shared = about_up
    track = found.headings.get(kind.name)
    return AngleBudget(
        covariances[0],
        covariances[1],
        shared,
        placing.relative.get(name, 0.0),
        0.0 if shared_sd(kind) is not None else float(DRIFT),
        placing.start_ns,
        placing.posed.get(name, False),
        None if track is None else track.sd,
        hinged=name in placing.pairs,
    )
