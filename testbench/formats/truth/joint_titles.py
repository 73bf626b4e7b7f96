"""Which columns of a joint log are the joints' angles, by the titles that loggers give them."""

from __future__ import annotations

import re
from dataclasses import dataclass

_UNIT = r"(?:_(?P<u>rad|deg))?(?:\s*[\[(](?P<v>rad|deg)[\])])?"
_OF_JOINT = (
    r"(?P<before>(?:.*[/.:])?)(?P<kind>(?:q_measured_|q_|actual_)?){joint}"
    rf"(?P<after>(?:[/._](?:position|pos|angle))?){_UNIT}"
)
_COUNTED_UNIT = r"(?:[\s_]*[\[(]?(?P<u>rad|deg)[\])]?)?"
_PATTERNS = (
    _OF_JOINT,
    r"(?P<before>(?:.*[/.:])?)actual_q_?\[?{zero}\]?",
    r"(?P<before>(?:.*[/.:])?)q[._]?\[?{zero}\]?",
    rf"(?P<before>)(?:j|joint|q|axis|a)[\s_]?{{one}}{_COUNTED_UNIT}",
    rf"(?P<before>)(?:j|joint|q)[\s_]?{{zero}}{_COUNTED_UNIT}",
)
"""Of titles, `{joint}` for the joint's name, `{zero}` and `{one}` for its place from 0 and 1."""
_COMMANDED = re.compile(r"command|target|desired|goal|reference|setpoint", re.I)
_RADIANS = re.compile(r"joint_?states?|robot_state|actual_q", re.I)
"""Titles of sensor_msgs/JointState, of libfranka and of a controller's own data, all in radians."""


@dataclass(frozen=True)
class JointTitles:
    """Titles of the joints' columns.

    Attributes:
        titles: In the arm's order.
        unit: "rad" or "deg", None where none is stated.
        before: What stands before the joint in each of them.
    """

    titles: list[str]
    unit: str | None
    before: str


def joint_titles(titles: list[str], joints: list[str]) -> list[JointTitles]:
    """All sets of columns that are angles of the joints, measured ones if there are any.

    Args:
        titles: Of the table.
        joints: Names, in the arm's order.
    """
    commanded: list[JointTitles] = []
    for pattern in _PATTERNS:
        sets = _sets(pattern, titles, joints)
        measured = [one for one in sets if not _COMMANDED.search(one.before)]
        if measured:
            return measured
        commanded = commanded or sets
    return commanded


def _sets(pattern: str, titles: list[str], joints: list[str]) -> list[JointTitles]:
    found: list[dict[str, re.Match[str]]] = []
    for place, joint in enumerate(joints):
        own = pattern.replace("{joint}", re.escape(joint))
        own = own.replace("{zero}", str(place)).replace("{one}", str(place + 1))
        matches = (re.fullmatch(own, title.strip(), re.I) for title in titles)
        found.append({m.group("before").lower(): m for m in matches if m})
    shared = [key for key in found[0] if all(key in matches for matches in found)]
    return [_set([matches[key] for matches in found]) for key in shared]


def _set(matches: list[re.Match[str]]) -> JointTitles:
    groups = [m.groupdict() for m in matches]
    stated = {one.get("u") or one.get("v") for one in groups}
    unit = stated.pop() if len(stated) == 1 else None
    if unit is None and all(_RADIANS.search(m.string) for m in matches):
        unit = "rad"
    return JointTitles([m.string for m in matches], unit and unit.lower(), groups[0]["before"])


def titles_that_do(joints: list[str]) -> str:
    """The titles that would be understood, for a message."""
    count = len(joints)
    return (
        f"{joints[0]} (also as {joints[0]}_deg, /joint_states/{joints[0]}/position), J1 .. "
        f"J{count}, actual_q_0 .. actual_q_{count - 1}, robot_state.q[0] .. "
        f"robot_state.q[{count - 1}], or name_0, position_0, name_1, ... with the joints' names in "
        "the cells"
    )
