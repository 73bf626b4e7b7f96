"""Joint angles between sensors that no arm carries: each is placed on its segment first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.above import proximal_above
from testbench.estimation.joints.anatomical_range import beyond_anatomy
from testbench.estimation.joints.angle_sd import AngleBudget, angle_sd
from testbench.estimation.joints.centre_apart import centre_apart
from testbench.estimation.joints.constrained import constrained, is_constrained
from testbench.estimation.joints.facing import (
    DEVICE_SD,
    SHARED_SD,
    Facing,
    Relative,
    Unknown,
    chained,
    find_facing,
    relative_headings,
)
from testbench.estimation.joints.heading_drift import heading_drift
from testbench.estimation.joints.limb import Limb, limb_of, limbs_of, own_earth, sensors_of
from testbench.estimation.joints.placement import (
    HingePair,
    Placed,
    as_stated,
    by_motion,
    by_pose,
    facing_by_hinges,
    hinge_pair,
    is_hinge,
)
from testbench.estimation.joints.standing import Standing, find_standing
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.joint_angle import decomposition_of, joint_angle_series
from testbench.model.true_segment import stated_axes
from testbench.records.findings.catalogue import finding, of_filters_together
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import JointEstimate, SensorEstimate, as_kept
from testbench.records.specs.anatomy import JointKind, kind_of
from testbench.records.specs.protocol import Body, BodyJoint

DRIFT = np.radians(2.0) / np.sqrt(60.0)
"""By how much the headings of filters without a magnetometer drift apart, as of a joint constraint
[rad / sqrt(s)].
"""
ALIGNED_SD = np.radians(0.5)
"""Of the heading between two sensors that were brought to one truth [rad]."""
VAGUE = np.radians(10.0)
"""A relative heading that is known no better at some time is remarked on [rad]."""
MOST_STATED_SWAY = np.radians(3.0)
"""Who is said to stand and turns by more about the mean does not (RMS): twice what a rest that is
found may sway by [rad].
"""
DIRECTIONS = {
    sign + name: (1 if not sign else -1) * np.eye(3)[i]
    for sign in ("", "-")
    for i, name in enumerate("xyz")
}


@dataclass(frozen=True)
class Read:
    """What a sensor read, at its estimate's instants.

    Attributes:
        force: Specific force, shape (n, 3) [m/s^2].
        rate: Calibrated angular rate of the interval before each, shape (n, 3) [rad/s]; NaN where
            nothing was measured.
    """

    force: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class BodyRecording:
    """What joints of a body are computed from.

    Attributes:
        body: As a person says it.
        sensors: Their estimates, by name.
        read: What they read, by name.
        true: Sensors whose truth is known.
        begin_ns: Host time of the first sample of all [ns].
    """

    body: Body
    sensors: Mapping[str, SensorEstimate]
    read: Mapping[str, Read]
    true: frozenset[str]
    begin_ns: int

    def method(self, joint: BodyJoint) -> str:
        """How the sensors of a joint are placed: as asked for, or what suits what is known."""
        asked = joint.aligned(self.body).method
        if asked != "auto":
            return asked
        ends = (joint.proximal, joint.distal)
        stated = all(self.body.segment(own).rotation_deg for own in ends)
        return "stated" if stated or set(ends) <= self.true else "standing"


@dataclass
class Placing:
    """How the sensors of some joints are placed by one filter, and what is said of it.

    Attributes:
        placed: By sensor.
        common: Standard uncertainty of the heading that all share [rad].
        relative: Of the heading between the sensors of each joint [rad].
        start_ns: When those were brought together, host time [ns].
        standing: The pose they were brought together in, where it was one.
        pairs: Joints whose axis was found in both of their sensors.
        posed: Whether an error of them is none in the standing pose, by joint.
        aligned: Whether orientations are used as brought to the truth's frames.
        refused: Why a joint was not computed, by joint.
        findings: What else is to be said, by joint.
    """

    placed: dict[str, Placed] = field(default_factory=dict)
    common: float = 0.0
    relative: dict[str, float] = field(default_factory=dict)
    start_ns: int | None = None
    standing: Standing | None = None
    pairs: frozenset[str] = frozenset()
    posed: dict[str, bool] = field(default_factory=dict)
    aligned: bool = False
    refused: dict[str, Finding] = field(default_factory=dict)
    findings: dict[str, list[Finding]] = field(default_factory=dict)


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
            if all(kind.name in recording.sensors[own].orientation for own in _ends(joint))
        }
        by_method: dict[str, dict[str, BodyJoint]] = {}
        for name, joint in ran.items():
            by_method.setdefault(recording.method(joint), {})[name] = joint
        for method, alike in by_method.items():
            for limb_joints in limbs_of(alike):
                placing = _place(recording, limb_joints, kind, method)
                for name, joint in limb_joints.items():
                    _angles(found[name], name, joint, recording, kind, placing)
    for own in found.values():
        own.findings[:] = of_filters_together(own.findings)
    return found


def _ends(joint: BodyJoint) -> tuple[str, str]:
    return joint.proximal, joint.distal


def _shared_sd(kind: OrientationFilter) -> float | None:
    """How far apart the headings of a filter's sensors are; None where each has its own earth."""
    if kind.name == "device":
        return DEVICE_SD
    return SHARED_SD if "mag" in kind.needs else None


def _place(
    recording: BodyRecording, joints: Mapping[str, BodyJoint], kind: OrientationFilter, method: str
) -> Placing:
    """Place the sensors of joints that hang together."""
    names = sensors_of(joints.values())
    if method == "stated" and _aligned_to_truth(recording, names, kind.name):
        return _by_truth(recording, joints)
    own = {name: recording.sensors[name] for name in names}
    limb = limb_of(own, {name: recording.read[name].force for name in names}, kind.name)
    if limb is None:
        return _refused(joints, kind.name, "its sensors were hardly recorded together", "")
    relative = relative_headings(limb, joints, _shared_sd(kind))
    if method == "stated":
        placing = _as_stated(recording, joints, kind, relative)
    else:
        placing = _by_standing(recording, joints, kind, limb, relative)
    for name, joint in joints.items():
        told = _of_centre(limb, joint, kind.name)
        if not told and placing.standing is not None and kind_of(name, joint) is not None:
            told = _of_order(limb, joint, kind.name, placing.standing)
        placing.findings.setdefault(name, []).extend(told)
    return placing


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


def _aligned_to_truth(recording: BodyRecording, names: Sequence[str], key: str) -> bool:
    """Whether all sensors were brought to the frames of the truth."""
    for name in names:
        own = recording.sensors[name]
        fit = own.frames.get(key)
        if name not in recording.true or fit is None or fit.method == "none":
            return False
        if not own.can_be_judged(key):
            return False
    return True


def _by_truth(recording: BodyRecording, joints: Mapping[str, BodyJoint]) -> Placing:
    """Segments are the bodies of the truth, that the orientations are brought to."""
    placed = {
        name: as_stated(stated_axes(recording.body, name), 0.0, 0.0)
        for name in sensors_of(joints.values())
    }
    middle = int(np.median([recording.sensors[name].host_time_ns[0] for name in placed]))
    last = int(np.median([recording.sensors[name].host_time_ns[-1] for name in placed]))
    return Placing(
        placed,
        relative=dict.fromkeys(joints, float(ALIGNED_SD)),
        start_ns=(middle + last) // 2,
        posed=dict.fromkeys(joints, False),
        aligned=True,
        findings={name: [finding("joint.by_truth")] for name in joints},
    )


def _refused(joints: Mapping[str, BodyJoint], key: str, why: str, add: str) -> Placing:
    code = "joint.not_placed" if add else "joint.not_computed"
    values = {"filter": key, "why": why} | ({"add": add} if add else {})
    return Placing(refused={name: finding(code, **values) for name in joints})


def _as_stated(
    recording: BodyRecording,
    joints: Mapping[str, BodyJoint],
    kind: OrientationFilter,
    relative: Mapping[str, Relative],
) -> Placing:
    """Segment axes in the sensors as a person states them."""
    sd = float(np.radians(recording.body.alignment.stated_sd_deg))
    open_to = [
        name
        for name, joint in joints.items()
        if name not in relative and not is_constrained(joint, kind)
    ]
    if open_to:
        return _refused(
            joints,
            kind.name,
            f"how the headings of the sensors of {', '.join(open_to)} differ: the filter has an "
            "earth of its own for each, and the motion of the joint's centre does not tell",
            "a filter with a magnetometer, a brisk motion, or the joint's axes (constraint)",
        )
    headings = chained(joints, {name: own.heading for name, own in relative.items()})
    placed = {
        name: as_stated(stated_axes(recording.body, name), heading, sd)
        for name, heading in headings.items()
    }
    findings: dict[str, list[Finding]] = {}
    for name, joint in joints.items():
        bare = [own for own in _ends(joint) if not recording.body.segment(own).rotation_deg]
        findings[name] = [finding("joint.axes_unstated", sensors=bare)] if bare else []
        if name in relative:
            findings[name].append(finding("joint.as_stated", by=relative[name].by))
    return Placing(
        placed,
        relative={name: relative[name].sd if name in relative else np.pi for name in joints},
        posed=dict.fromkeys(joints, False),
        findings=findings,
    )


def _by_standing(
    recording: BodyRecording,
    joints: Mapping[str, BodyJoint],
    kind: OrientationFilter,
    limb: Limb,
    relative: Mapping[str, Relative],
) -> Placing:
    """By the standing pose, and by the axes of hinges where a joint asks for functional motions."""
    alignment = recording.body.alignment
    stated = alignment.standing_s
    standing = find_standing(limb, None if stated is None else _host(recording, stated))
    if standing is None:
        return _refused(joints, kind.name, *_NO_STANDING[stated is None])
    kinds = {name: kind_of(name, joint) for name, joint in joints.items()}
    forward = {name: DIRECTIONS[axis] for name, axis in alignment.forward.items() if name in limb.q}
    facing = find_facing(limb, joints, kinds, standing, forward, relative)
    if isinstance(facing, Unknown):
        return _refused(joints, kind.name, facing.why, facing.add)
    sd = float(np.radians(alignment.axes_sd_deg))
    functional = all(recording.method(joint) == "functional" for joint in joints.values())
    pairs: dict[str, HingePair] = {}
    why: dict[str, str] = {}
    if functional:
        pairs, why = _hinges(limb, joints, kinds, _posed(standing, facing, sd), facing)
        if pairs:
            facing = facing_by_hinges(facing, joints, pairs, standing, sd)
    posed = _posed(standing, facing, sd)
    placed = by_motion(joints, pairs, posed, sd) if functional else posed
    # both axes of a hinge coincide, whatever the heading between its sensors
    relative_sd = {name: 0.0 if name in pairs else own for name, own in facing.relative_sd.items()}
    placing = Placing(
        placed,
        facing.common_sd,
        relative_sd,
        standing.middle_ns,
        standing,
        frozenset(pairs),
        {name: name not in pairs for name in joints},
    )
    for name in joints:
        placing.findings[name] = _said(recording, standing, facing, name, kind.name)
        if functional:
            placing.findings[name] += _said_of_hinge(name, kind.name, pairs, why)
    return placing


_NO_STANDING = {
    True: (
        "no standing pose was found: there is no rest of all its sensors of 1 s",
        "standing still at the beginning, or --standing FROM:TO (alignment.standing_s) in seconds",
    ),
    False: (
        "nothing was recorded while the person is said to stand",
        "another interval for --standing (alignment.standing_s)",
    ),
}


def _host(recording: BodyRecording, interval_s: Sequence[float]) -> tuple[int, int]:
    begin, end = (recording.begin_ns + round(own * NANOSECONDS) for own in interval_s)
    return begin, end


def _posed(standing: Standing, facing: Facing, sd: float) -> dict[str, Placed]:
    return {name: by_pose(name, standing, facing, sd) for name in facing.heading}


def _hinges(
    limb: Limb,
    joints: Mapping[str, BodyJoint],
    kinds: Mapping[str, JointKind | None],
    posed: Mapping[str, Placed],
    facing: Facing,
) -> tuple[dict[str, HingePair], dict[str, str]]:
    """The hinges whose axis the motion shows, and why others do not show theirs."""
    pairs: dict[str, HingePair] = {}
    why: dict[str, str] = {}
    for name, joint in joints.items():
        if is_hinge(joint, kinds[name]):
            found = hinge_pair(limb, joint, posed, facing.relative_sd[name])
            if isinstance(found, str):
                why[name] = found
            else:
                pairs[name] = found
    return pairs, why


def _said(
    recording: BodyRecording, standing: Standing, facing: Facing, name: str, key: str
) -> list[Finding]:
    """When the person stands, and what told which way."""
    begin, end = (
        (own - recording.begin_ns) / NANOSECONDS for own in (standing.begin_ns, standing.end_ns)
    )
    code = "joint.standing_stated" if standing.told else "joint.standing_found"
    sd = recording.body.alignment.axes_sd_deg
    said = [finding(code, begin_s=begin, end_s=end, sd_deg=sd)]
    sway = max(standing.sway[own] for own in _ends(recording.body.joints[name]))
    if sway > MOST_STATED_SWAY:
        said.append(finding("joint.standing_moves", sway_deg=float(np.degrees(sway))))
    relative = facing.relative_by.get(name, "")
    said.append(finding("joint.facing", filter=key, by=facing.by, relative=relative))
    return said


def _said_of_hinge(
    name: str, key: str, pairs: Mapping[str, HingePair], why: Mapping[str, str]
) -> list[Finding]:
    """Whether a hinge's axis was found by its motion."""
    if name in pairs:
        sd = float(np.degrees(np.hypot(*pairs[name].sds)))
        return [finding("joint.hinge_found", filter=key, sd_deg=sd)]
    if name in why:
        return [finding("joint.hinge_unknown", filter=key, why=why[name])]
    return [finding("joint.no_hinge")] if pairs else [finding("joint.no_hinge_at_all")]


def _angles(
    found: JointEstimate,
    name: str,
    joint: BodyJoint,
    recording: BodyRecording,
    kind: OrientationFilter,
    placing: Placing,
) -> None:
    """The angles of a joint by one filter, kept in `found`."""
    codes = {(own.code, str(own)) for own in found.findings}
    told = placing.findings.get(name, [])
    found.findings.extend(own for own in told if (own.code, str(own)) not in codes)
    if name in placing.refused:
        found.findings.append(placing.refused[name])
        return
    key, time = kind.name, found.host_time_ns
    q = []
    for end in _ends(joint):
        own = recording.sensors[end]
        raw = own.orientation[key]
        raw = raw if placing.aligned else own_earth(raw, own.frames.get(key))
        if end == joint.distal:
            raw = rotation.interpolate(own.host_time_ns, raw, time)
        q.append(placing.placed[end].segment(raw))
    if is_constrained(joint, kind):
        q[1] = constrained(found, joint, key, q[0], q[1], placing.start_ns)
    found.placements[key] = {end: placing.placed[end].by for end in _ends(joint)}
    budget = _budget(found, name, joint, kind, placing)
    if budget.headings is None and _shared_sd(kind) is None:
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
    for end, sign in zip(_ends(joint), (-1.0, 1.0), strict=True):
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
    if said.max() > VAGUE:
        at = int(np.argmax(said))
        found.findings.append(
            finding(
                "joint.drifts",
                filter=kind.name,
                sd_deg=float(np.degrees(said[at])),
                at_s=(time[at] - recording.begin_ns) / NANOSECONDS,
            )
        )
    drift_sd = float(np.sqrt(walk))
    return replace(budget, relative=relative, drift=drift_sd, start_ns=start, drifted=variance)


def _budget(
    found: JointEstimate, name: str, joint: BodyJoint, kind: OrientationFilter, placing: Placing
) -> AngleBudget:
    """What makes the angles of a joint by one filter uncertain."""
    ends = [placing.placed[end] for end in _ends(joint)]
    covariances, shared = [own.covariance for own in ends], np.zeros((3, 3))
    about_up = placing.common**2 * np.diag([0.0, 1.0, 0.0])
    if name in placing.pairs:  # an axis that is not the one that is meant is so in both segments
        shared = np.mean([own.of_axis for own in ends if own.of_axis is not None], axis=0)
        covariances = [own.covariance - own.of_axis for own in ends if own.of_axis is not None]
    elif any(own.hinged for own in ends):  # the one beside a hinge faces as its axis says
        covariances = [
            own.covariance + about_up
            if own.of_axis is None
            else own.covariance - own.of_axis * np.diag([0.0, 1.0, 0.0])
            for own in ends
        ]
    else:
        shared = about_up
    track = found.headings.get(kind.name)
    return AngleBudget(
        covariances[0],
        covariances[1],
        shared,
        placing.relative.get(name, 0.0),
        0.0 if _shared_sd(kind) is not None else float(DRIFT),
        placing.start_ns,
        placing.posed.get(name, False),
        None if track is None else track.sd,
    )
