"""Joints of an imported recording, as a person names them beside its files."""

from __future__ import annotations

from collections.abc import Iterable

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.recording import Recording
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.specs.anatomy import BETWEEN, JointKind, kind_of, segment_of, side_of
from testbench.records.specs.protocol import Body


def attach_body(recording: Recording, given: Body) -> None:
    """Give a recording joints, beside those that its mapping has.

    Args:
        recording: What was read.
        given: Segments, joints and alignment; an alignment that says nothing leaves that of the
            mapping.

    Raises:
        NotFoundError: A part of it is of a sensor that there is not; lists those that exist.
        InputError: A joint or segment stands in the mapping, too; or there is no joint at all.
    """
    sensors, known = list(recording.sensors), recording.analysis.body or Body()
    ends = [end for joint in given.joints.values() for end in (joint.proximal, joint.distal)]
    for name in (*given.segments, *given.alignment.forward, *ends):
        if name not in sensors:
            raise NotFoundError("sensor of this recording", name, sensors)
    for what, mine, theirs in (
        ("joint", given.joints, known.joints),
        ("segment of sensor", given.segments, known.segments),
    ):
        twice = sorted(set(mine) & set(theirs))
        if twice:
            raise InputError(
                f"the {what} '{twice[0]}' is given by an option and by the mapping; leave one out"
            )
    joints = {**known.joints, **given.joints}
    if not joints:
        raise InputError(
            "--sequence, --place-by, --standing, --forward and --segment describe joints, and "
            "there is none: name one with --joint NAME=PROXIMAL:DISTAL"
        )
    alignment = given.alignment if given.alignment.model_fields_set else known.alignment
    body = Body(segments={**known.segments, **given.segments}, joints=joints, alignment=alignment)
    recording.analysis = recording.analysis.model_copy(update={"body": body})
    recording.findings += side_findings(body, given.joints)


def refuse_contradictions(body: Body) -> None:
    """Refuse a body whose parts cannot hold together.

    Args:
        body: With its joints.

    Raises:
        InputError: A joint lies within one segment, or is compared with one of a robot; a sensor
            that no joint has points forwards; or a pose is given that nothing is placed by.
    """
    alignment = body.alignment
    methods = {joint.aligned(body).method for joint in body.joints.values()}
    if methods == {"stated"} and (alignment.standing_s or alignment.forward):
        raise InputError(
            "joints placed as stated (--place-by, alignment.method) take their axes from "
            "`segments`, and neither --standing (standing_s) nor --forward (forward) has an "
            "effect; leave one of them out"
        )
    used = {end for joint in body.joints.values() for end in (joint.proximal, joint.distal)}
    for name in body.alignment.forward:
        if name not in used:
            raise InputError(
                f"--forward (alignment.forward) speaks of {name}, and no joint is of that sensor; "
                f"joints are of {', '.join(sorted(used))}"
            )
    for name, joint in body.joints.items():
        first, second = (body.segment(end).name for end in (joint.proximal, joint.distal))
        if first == second:
            raise InputError(
                f"joint '{name}' is between two sensors of one segment, '{first}'; give "
                f"{joint.proximal} and {joint.distal} segments of their own (--segment "
                "SENSOR=NAME, `segments` of the mapping)"
            )
        if joint.reference_joint is not None:
            raise InputError(
                f"joint '{name}' has the reference_joint '{joint.reference_joint}', which is one "
                "of a robot, and no robot carries these sensors; true angles go into "
                "`truth_angles`, or --truth with --truth-angle"
            )


def side_findings(body: Body, names: Iterable[str]) -> list[Finding]:
    """Joints of a limb of which nobody says on which side of the body they are.

    Args:
        body: With its joints.
        names: Of those that are looked at.
    """
    found = []
    for name in names:
        joint = body.joints[name]
        if kind_of(name, joint) is None:
            continue
        if side_of(name, joint.distal, joint.proximal) is None:
            found.append(finding("structure.side_assumed", f"joint '{name}'"))
    return found


def name_findings(body: Body) -> list[Finding]:
    """Joints of a limb whose names and those of their sensors contradict each other.

    Args:
        body: With its joints.
    """
    kinds = {name: kind_of(name, joint) for name, joint in body.joints.items()}
    return [
        own
        for name, kind in kinds.items()
        if kind is not None
        for own in _contradicting(f"joint '{name}'", name, kind, body)
    ]


def _contradicting(where: str, name: str, kind: JointKind, body: Body) -> list[Finding]:
    """A joint whose sensors are called after other segments than those beside it, or after the
    other side of the body.
    """
    joint, found = body.joints[name], []
    ends = (joint.proximal, joint.distal)
    proximal, distal = (segment_of(end) or segment_of(body.segment(end).name) for end in ends)
    if proximal is not None and distal is not None:
        values = {"kind": kind, "proximal": ends[0], "distal": ends[1]}
        if BETWEEN.get((distal, proximal)) == kind:
            found.append(finding("structure.joint_turned", where, **values))
        elif BETWEEN.get((proximal, distal)) != kind:
            wanted = next(pair for pair, own in BETWEEN.items() if own == kind)
            values["segments"] = f"{wanted[0]} and {wanted[1]}"
            found.append(finding("structure.joint_elsewhere", where, **values))
    sides = {own: side for own in (name, *ends) if (side := side_of(own)) is not None}
    if len(set(sides.values())) > 1:
        told = ", ".join(f"{own} ({side})" for own, side in sides.items())
        found.append(finding("structure.joint_of_both_sides", where, names=told))
    return found
