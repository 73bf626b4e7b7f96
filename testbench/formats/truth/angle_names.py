"""Which column of a truth is which angle of which joint: as stated, or by names that tell."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from testbench.exceptions import InputError, NotFoundError
from testbench.formats.opensim_names import FILES, IsbAngles, Model, isb_angles
from testbench.formats.truth.angle_table import AngleTable, plain_title
from testbench.model.joint_angle import INDEX, decomposition_of
from testbench.records.specs.anatomy import JointKind, Side, side_of
from testbench.records.specs.protocol import BodyJoint

AXES = "xyz"
# Plug-in Gait counts flexion, adduction and internal rotation of hip and knee as the ISB does, on
# either side, in the same order of turns (Vicon Nexus, Lower body angles as output from Plug-in
# Gait). Of the ankle the order is another, so that the first angle alone is the same.
PLUG_IN_GAIT: dict[JointKind, int] = {"hip": 3, "knee": 3, "ankle": 1}


@dataclass(frozen=True)
class Chosen:
    """The column that is the truth of one angle of a joint.

    Attributes:
        joint: Its name.
        place: Of the angle among the three of the joint's own definition.
        word: For the angle.
        column: Title of the column.
        sign: By which the column is the angle: 1 or -1.
    """

    joint: str
    place: int
    word: str
    column: str
    sign: float

    def __str__(self) -> str:
        return f"{self.joint}.{self.word}={'-' if self.sign < 0 else ''}{self.column}"


def angle_words(name: str, joint: BodyJoint) -> dict[str, tuple[int, float]]:
    """Words for the angles of a joint, each with its place and the sign that it counts by.

    Args:
        name: Of the joint.
        joint: As defined.
    """
    words: dict[str, tuple[int, float]] = {word: (place, 1.0) for word, place in INDEX.items()}
    own = decomposition_of(joint).names
    words |= {word.replace(" ", "_"): (place, 1.0) for place, word in enumerate(own)}
    isb = isb_angles(name, joint)
    if isb is not None:
        words |= {word: (i, float(isb.signs[i])) for i, word in enumerate(isb.words)}
    return words | {"flexion": (INDEX[joint.flexion], float(joint.sign))}


def stated_angles(
    stated: Mapping[str, str], joints: Mapping[str, BodyJoint], titles: Iterable[str], flag: str
) -> list[Chosen]:
    """The columns that a person names.

    Args:
        stated: Column, with a minus before it where it counts the other way, by joint or
            joint.angle; of a joint alone its flexion, or the three angles of a point of C3D.
        joints: Of the recording, by name.
        titles: Of the columns.
        flag: How they are stated, for messages.

    Raises:
        InputError: A joint has no such angle, or no flexion is named.
        NotFoundError: There is no such joint or column; lists those that exist.
    """
    known, found = list(titles), []
    for key, text in stated.items():
        name, _, word = key.partition(".")
        if name not in joints:
            raise NotFoundError(f"joint of this recording ({flag})", name, list(joints))
        words = angle_words(name, joints[name])
        if word and word not in words:
            raise InputError(
                f"{flag} {key}: joint '{name}' has no angle '{word}'; it has {', '.join(words)}"
            )
        title, sign = _column(text, known, flag)
        group = [f"{title}.{axis}" for axis in AXES]
        if not word and group[0] in known:
            found += _of_point(name, joints[name], title, 3, sign)
            continue
        if title not in known:
            raise NotFoundError(f"column of the truth ({flag})", title, known)
        place, counted = words[word or "flexion"]
        found.append(Chosen(name, place, word or "flexion", title, sign * counted))
    return _checked(found, joints, flag)


def _column(text: str, titles: list[str], flag: str) -> tuple[str, float]:
    """A title as it stands in the file, and its sign."""
    sign = 1.0
    if text not in titles and text.startswith("-"):
        text, sign = text[1:].strip(), -1.0
    if text in titles:
        return text, sign
    bare = [t for t in titles if plain_title(t) == text.lower() or t.rpartition(":")[2] == text]
    if len(bare) == 1:
        return bare[0], sign
    if len(bare) > 1:
        raise InputError(f"{flag} {text}: more than one column is called so: {', '.join(bare)}")
    points = [t.rpartition(".")[0] for t in titles if t.endswith(".x")]
    own = [point for point in points if point.rpartition(":")[2] == text]
    return (own[0] if len(own) == 1 else text), sign


def _of_point(name: str, joint: BodyJoint, point: str, count: int, sign: float) -> list[Chosen]:
    """The first angles of a point of C3D: those of the ISB, where the joint's are such."""
    isb = isb_angles(name, joint)
    words = list(INDEX) if isb is None else isb.words
    signs = [1.0] * 3 if isb is None else [float(own) for own in isb.signs]
    return [Chosen(name, i, words[i], f"{point}.{AXES[i]}", sign * signs[i]) for i in range(count)]


def _checked(found: list[Chosen], joints: Mapping[str, BodyJoint], flag: str) -> list[Chosen]:
    """The same, if each angle is named once and the flexion of each joint is among them."""
    for name in dict.fromkeys(own.joint for own in found):
        places = [own.place for own in found if own.joint == name]
        if len(set(places)) != len(places):
            raise InputError(f"{flag} names one angle of joint '{name}' twice; say which holds")
        if INDEX[joints[name].flexion] not in places:
            raise InputError(
                f"a joint is evaluated by its flexion: name that of '{name}', too, with {flag} "
                f"{name}.flexion=COLUMN"
            )
    return found


def guessed_angles(joints: Mapping[str, BodyJoint], table: AngleTable) -> list[Chosen]:
    """The columns whose names tell what they are, of joints whose flexion is among them.

    Args:
        joints: Of the recording, by name.
        table: The truth.
    """
    titles: dict[str, list[str]] = {}
    for title in table.titles:
        titles.setdefault(plain_title(title), []).append(title)
    alone = {plain: own[0] for plain, own in titles.items() if len(own) == 1}
    found = []
    for name, joint in joints.items():
        by_place: dict[int, Chosen] = {}
        for own in [*_own_titles(name, joint, alone), *_anatomical(name, joint, alone, table)]:
            by_place.setdefault(own.place, own)
        if INDEX[joint.flexion] in by_place:
            found += [by_place[place] for place in sorted(by_place)]
    return found


def _own_titles(name: str, joint: BodyJoint, alone: Mapping[str, str]) -> list[Chosen]:
    """Columns that are called after the joint, and after one of its angles."""
    found = []
    for word, (place, sign) in angle_words(name, joint).items():
        forms = [f"{name}_{word}", f"{name}.{word}", f"{name}_{joint.label}_{word}"]
        forms += [name] if word == "flexion" else []
        titles = [alone[form.lower()] for form in forms if form.lower() in alone]
        found += [Chosen(name, place, word, title, sign) for title in titles]
    return found


def _anatomical(
    name: str, joint: BodyJoint, alone: Mapping[str, str], table: AngleTable
) -> list[Chosen]:
    """Coordinates of OpenSim's models, and points of Plug-in Gait."""
    isb = isb_angles(name, joint)
    if isb is None:
        return []
    side = _side(name, joint, isb, table)
    if side is None:
        return []
    model: Model = "gait2392" if table.model == FILES["gait2392"] else "rajagopal"
    found = []
    for place, word in enumerate(isb.words):
        coordinate, sign = isb.coordinate(place, model, side)
        if coordinate and coordinate in alone:
            counted = sign * float(isb.signs[place])
            found.append(Chosen(name, place, word, alone[coordinate], counted))
    point = f"{side[0]}{isb.kind}angles"
    first = alone.get(f"{point}.x")
    if first is not None:
        count = PLUG_IN_GAIT.get(isb.kind, 0)
        found += _of_point(name, joint, first.rpartition(".")[0], count, 1.0)
    return found


def _side(name: str, joint: BodyJoint, isb: IsbAngles, table: AngleTable) -> Side | None:
    """Which side's columns are meant; None where neither joint nor file tells."""
    said = side_of(name, joint.distal, joint.proximal)
    if said is not None or isb.side == "left":
        return said or isb.side
    seen = _sides_of(isb.kind, table)
    return seen.pop() if len(seen) == 1 else None


def _sides_of(kind: JointKind, table: AngleTable) -> set[Side]:
    """Sides of which a file has angles of some joint of the body."""
    found: set[Side] = set()
    for title in map(plain_title, table.titles):
        point = re.match(rf"([lr]){kind}angles\b", title)
        ending = re.match(rf"{kind}_\w+_([lr])$", title)
        said = point or ending
        if said is not None:
            found.add("left" if said[1] == "l" else "right")
    return found
