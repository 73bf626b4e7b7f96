"""How the sensors of joints that hang together are placed on their segments by one filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.body_recording import BodyRecording
from testbench.estimation.joints.constrained import is_constrained
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
from testbench.estimation.joints.limb import LEAST_S, Limb, limb_of, sensors_of
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
from testbench.model.true_segment import stated_axes
from testbench.records.specs.anatomy import JointKind, kind_of
from testbench.records.specs.protocol import BodyJoint

ALIGNED_SD = np.radians(0.5)
"""Of the heading between two sensors that were brought to one truth [rad]."""
DIRECTIONS = {
    sign + name: (1 if not sign else -1) * np.eye(3)[i]
    for sign in ("", "-")
    for i, name in enumerate("xyz")
}
TOO_SHORT = (
    f"its sensors have orientations together for less than {2 * LEAST_S:g} s, or in less than half "
    "of the time"
)
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


@dataclass
class Placing:
    """How the sensors of some joints are placed by one filter, and what told it.

    Attributes:
        method: As asked for, or what suits what is known.
        limb: The sensors on one grid; None where the bodies of a truth place them.
        placed: By sensor; none where nothing tells it.
        common: Standard uncertainty of the heading that all share [rad].
        relative: Of the heading between the sensors of each joint [rad].
        relative_by: What told that, in words, by joint.
        start_ns: When those were brought together, host time [ns].
        standing: The pose they were brought together in, where it was one.
        facing_by: What told which way the body faces in it, in words.
        pairs: Joints whose axis was found in both of their sensors.
        no_pair: Why other hinges do not show theirs, by joint.
        posed: Whether an error of them is none in the standing pose, by joint.
        aligned: Whether orientations are used as brought to the truth's frames.
        refused: Why nothing is placed, and what would tell it; None where it is.
    """

    method: str
    limb: Limb | None = None
    placed: dict[str, Placed] = field(default_factory=dict)
    common: float = 0.0
    relative: dict[str, float] = field(default_factory=dict)
    relative_by: dict[str, str] = field(default_factory=dict)
    start_ns: int | None = None
    standing: Standing | None = None
    facing_by: str = ""
    pairs: dict[str, HingePair] = field(default_factory=dict)
    no_pair: dict[str, str] = field(default_factory=dict)
    posed: dict[str, bool] = field(default_factory=dict)
    aligned: bool = False
    refused: Unknown | None = None


def shared_sd(kind: OrientationFilter) -> float | None:
    """How far apart the headings of a filter's sensors are [rad]; None where each has an earth of
    its own.
    """
    if kind.name == "device":
        return DEVICE_SD
    return SHARED_SD if "mag" in kind.needs else None


def place(
    recording: BodyRecording, joints: Mapping[str, BodyJoint], kind: OrientationFilter, method: str
) -> Placing:
    """Place the sensors of joints that hang together.

    Args:
        recording: Of the body.
        joints: By name.
        kind: The filter, which ran for all their sensors.
        method: Of `BodyRecording.method`.
    """
    names = sensors_of(joints.values())
    if method == "stated" and _aligned_to_truth(recording, names, kind.name):
        return _by_truth(recording, joints)
    own = {name: recording.sensors[name] for name in names}
    limb = limb_of(own, {name: recording.read[name].force for name in names}, kind.name)
    if limb is None:
        return Placing(method, refused=Unknown(TOO_SHORT, ""))
    relative = relative_headings(limb, joints, shared_sd(kind))
    if method == "stated":
        return _as_stated(recording, joints, kind, limb, relative)
    return _by_standing(recording, joints, limb, relative)


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
        "stated",
        placed=placed,
        relative=dict.fromkeys(joints, float(ALIGNED_SD)),
        start_ns=(middle + last) // 2,
        posed=dict.fromkeys(joints, False),
        aligned=True,
    )


def _as_stated(
    recording: BodyRecording,
    joints: Mapping[str, BodyJoint],
    kind: OrientationFilter,
    limb: Limb,
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
        unknown = Unknown(
            f"how the headings of the sensors of {', '.join(open_to)} differ: the filter has an "
            "earth of its own for each, and the motion of the joint's centre does not tell",
            "a filter with a magnetometer, a brisk motion, or the joint's axes (constraint)",
        )
        return Placing("stated", limb, refused=unknown)
    headings = chained(joints, {name: own.heading for name, own in relative.items()})
    placed = {
        name: as_stated(stated_axes(recording.body, name), heading, sd)
        for name, heading in headings.items()
    }
    return Placing(
        "stated",
        limb,
        placed,
        relative={name: relative[name].sd if name in relative else np.pi for name in joints},
        relative_by={name: own.by for name, own in relative.items()},
        posed=dict.fromkeys(joints, False),
    )


def _by_standing(
    recording: BodyRecording,
    joints: Mapping[str, BodyJoint],
    limb: Limb,
    relative: Mapping[str, Relative],
) -> Placing:
    """By the standing pose, and by the axes of hinges where a joint asks for functional motions."""
    alignment = recording.body.alignment
    functional = all(recording.method(joint) == "functional" for joint in joints.values())
    method, stated = "functional" if functional else "standing", alignment.standing_s
    standing = find_standing(limb, None if stated is None else _host(recording, stated))
    if standing is None:
        return Placing(method, limb, refused=Unknown(*_NO_STANDING[stated is None]))
    kinds = {name: kind_of(name, joint) for name, joint in joints.items()}
    forward = {name: DIRECTIONS[axis] for name, axis in alignment.forward.items() if name in limb.q}
    facing = find_facing(limb, joints, kinds, standing, forward, relative)
    if isinstance(facing, Unknown):
        return Placing(method, limb, refused=facing)
    sd = float(np.radians(alignment.axes_sd_deg))
    pairs: dict[str, HingePair] = {}
    no_pair: dict[str, str] = {}
    if functional:
        pairs, no_pair = _hinges(limb, joints, kinds, _posed(standing, facing, sd), facing)
        if pairs:
            facing = facing_by_hinges(facing, joints, pairs, standing, sd)
    posed = _posed(standing, facing, sd)
    return Placing(
        method,
        limb,
        by_motion(joints, pairs, posed, sd) if functional else posed,
        facing.common_sd,
        # both axes of a hinge coincide, whatever the heading between its sensors
        {name: 0.0 if name in pairs else own for name, own in facing.relative_sd.items()},
        facing.relative_by,
        standing.middle_ns,
        standing,
        facing.by,
        pairs,
        no_pair,
        {name: name not in pairs for name in joints},
    )


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
