"""Joints of an import, from the words of a request."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from testbench.exceptions import FileProblems, InputError
from testbench.pipeline.request import BodyRequest
from testbench.records.disk.yaml_file import parse_yaml, validation_problems
from testbench.records.specs.anatomy import FLEXION_AXIS, JointKind, kind_of, side_of
from testbench.records.specs.joint_definition import NamedDefinition
from testbench.records.specs.protocol import Body
from testbench.records.specs.strict import EulerSequence

SEQUENCES, NAMED = get_args(EulerSequence), get_args(NamedDefinition)


def body_of(asked: BodyRequest) -> Body:
    """The joints of a request.

    Args:
        asked: Each part as text.

    Raises:
        InputError: A part is malformed or contradicts another; says what is allowed.
    """
    joints = _pairs("--joint", "NAME=PROXIMAL:DISTAL", asked.joints)
    sequences = _sequences(asked.sequences, list(joints))
    data: dict[str, Any] = {
        "joints": {
            name: _joint(name, ends, sequences.get(name, sequences.get("")))
            for name, ends in joints.items()
        },
        "segments": {
            sensor: {"name": segment}
            for sensor, segment in _pairs("--segment", "SENSOR=NAME", asked.segments).items()
        },
    }
    alignment: dict[str, Any] = {}
    if asked.place_by is not None:
        alignment["method"] = asked.place_by
    if asked.standing is not None:
        alignment["standing_s"] = _interval(asked.standing)
    if asked.forward:
        alignment["forward"] = _pairs("--forward", "SENSOR=AXIS, such as Pelvis=-z", asked.forward)
    if alignment:
        data["alignment"] = alignment
    try:
        return Body.model_validate(data)
    except ValidationError as error:
        places = [_asked_by(own["loc"]) for own in error.errors(include_url=False)]
        problems = validation_problems(error, {})
        told = [
            f"{place}: {problem.message}" for place, problem in zip(places, problems, strict=False)
        ]
        raise InputError("; ".join(told)) from None


def _asked_by(place: tuple[int | str, ...]) -> str:
    """The option that a part of a body comes from, and the part of what it says."""
    parts = [str(own) for own in place if own != "[key]"]
    if parts[0] == "alignment":
        given = {"standing_s": "--standing", "forward": "--forward", "method": "--place-by"}
        rest = parts[2:] if parts[1] == "forward" else []
        return " ".join([given.get(parts[1], parts[1]), *rest])
    option = {"joints": "--joint", "segments": "--segment"}.get(parts[0], parts[0])
    if len(parts) > 2 and parts[2] in ("sequence", "definition"):
        return f"--sequence {parts[1]}" + "".join(f" {own}" for own in parts[4:])
    return " ".join([option, *parts[1:]])


def _joint(name: str, ends: str, definition: str | None) -> dict[str, Any]:
    """A joint as a mapping has it."""
    proximal, colon, distal = (part.strip() for part in ends.partition(":"))
    if not colon or not proximal or not distal:
        raise InputError(
            f"--joint {name}={ends}: write it as NAME=PROXIMAL:DISTAL, the sensor nearer to the "
            "trunk first, such as knee=RFemur:RTibia"
        )
    return {"proximal": proximal, "distal": distal} | _angles(name, distal, proximal, definition)


def _angles(name: str, distal: str, proximal: str, definition: str | None) -> dict[str, Any]:
    """How the angles of a joint are written, and which of them is the flexion.

    Without a word the coordinate system of the ISB for a joint that its name tells, else ZXY. Of a
    sequence with one z the flexion is about it, as in the ISB's axes, and knees flex backwards.
    """
    kind: JointKind | None = kind_of(name)
    side = side_of(name, distal, proximal)
    if definition is None and kind is not None:
        return {"definition": {"isb": kind, "side": side or "right"}}
    definition = "ZXY" if definition is None else definition
    if definition in SEQUENCES:
        angles: dict[str, Any] = {"sequence": definition}
        if definition.count(FLEXION_AXIS) == 1:
            place = definition.index(FLEXION_AXIS)
            angles["flexion"] = ("first", "second", "third")[place]
            angles["sign"] = -1 if kind == "knee" else 1
        return angles
    if definition in NAMED:
        if definition in ("axis_angle", "rotation_vector"):
            return {"definition": definition}
        return {"definition": {"isb": definition, "side": side or "right"}}
    if not definition.startswith("{"):
        raise InputError(
            f"--sequence {definition}: unknown; an Euler sequence ({', '.join(SEQUENCES)}), a "
            f"definition ({', '.join(NAMED)}), or a mapping such as '{{hinge: [0, 0, 1]}}'"
        )
    try:
        data, _ = parse_yaml(definition, Path("--sequence"))
    except FileProblems as error:
        raise InputError(str(error)) from None
    return {"definition": data}


def _sequences(given: Iterable[str], joints: list[str]) -> dict[str, str]:
    """Definition by joint, "" for all that have none of their own."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, rest = (part.strip() for part in text.partition("="))
        if equals and not name:
            raise InputError(f"--sequence {text}: write it as DEFINITION or JOINT=DEFINITION")
        name, rest = (name, rest) if equals and "{" not in name else ("", text.strip())
        if name and name not in joints:
            raise InputError(
                f"--sequence {text}: there is no --joint {name}; the joints are "
                f"{', '.join(joints) or 'none'}"
            )
        if name in found:
            raise InputError(
                f"--sequence is given twice for {name or 'all joints'}; say which holds"
            )
        found[name] = rest
    return found


def _pairs(option: str, form: str, given: Iterable[str]) -> dict[str, str]:
    """What an option says of each name, of which it may speak once."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name or not value:
            raise InputError(f"{option} {text}: write it as {form}")
        if name in found:
            raise InputError(f"{option} is given twice for {name}; say which holds")
        found[name] = value
    return found


def _interval(text: str) -> list[float]:
    begin, _, end = text.partition(":")
    try:
        return [float(begin), float(end)]
    except ValueError:
        raise InputError(
            f"--standing {text}: write it as FROM:TO in seconds since the first sample, such as 0:2"
        ) from None
