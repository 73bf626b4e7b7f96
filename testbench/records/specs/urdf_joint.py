"""The joints of a URDF: what one states of its limits, its axis, and whom it mimics.

URDF (http://wiki.ros.org/urdf/XML/joint) gives `lower` and `upper` in radians, 0 where one is not
stated, and asks for `effort` and `velocity`.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path

from testbench.exceptions import FileProblems, Problem

UNLIMITED = 1e6
"""Limits beyond this are written for a joint without limits [rad]."""
MOST_TURNED = 4 * math.pi
"""Two turns to either side, twice what the arms that ship turn [rad]: limits beyond are doubted."""
FASTEST = 30.0
"""1700 deg/s, over twice the fastest joint that ships (720 deg/s) [rad/s]; beyond is doubted."""


class UrdfJoint:
    """One joint of a URDF.

    Args:
        element: Its XML.
        path: Of the URDF.
        text: Of the URDF, to find lines in.
    """

    def __init__(self, element: ElementTree.Element, path: Path, text: str):
        self._element, self._path, self._text = element, path, text
        self.name = element.get("name", "")
        self.kind = element.get("type", "")

    @property
    def movable(self) -> bool:
        return self.kind in {"revolute", "continuous", "prismatic"}

    @property
    def mimics(self) -> str | None:
        """The joint whose angle this one follows, None where it is its own."""
        mimic = self._element.find("mimic")
        return None if mimic is None else mimic.get("joint", "?")

    def problem(self, message: str) -> Problem:
        """What is wrong with this joint, with its line."""
        found = re.search(
            rf"<joint\s[^>]*\bname\s*=\s*['\"]{re.escape(self.name)}['\"]", self._text
        )
        line = None if found is None else self._text.count("\n", 0, found.start()) + 1
        return Problem(f"joint {self.name}: {message}", line=line)

    def problems(self) -> list[Problem]:
        """What no reader of URDF could make sense of."""
        try:
            self.position()
            self.speed()
            self.axis()
        except FileProblems as error:
            return error.problems
        return []

    def position(self) -> tuple[float, float] | None:
        """Lowest and highest angle [rad]; None: it turns without end.

        Raises:
            FileProblems: The limits are missing, no numbers, or leave no range.
        """
        if self.kind == "continuous":
            return None
        lower, upper = (self._limit(key, 0.0) for key in ("lower", "upper"))
        if lower <= -UNLIMITED and upper >= UNLIMITED and math.isfinite(upper - lower):
            return None
        if not math.isfinite(upper - lower):
            raise self._refused(
                f"its limits are {lower:g} to {upper:g}, where URDF has finite ones; a joint that "
                'turns without end is of type="continuous"'
            )
        if lower >= upper:
            raise self._refused(f"its limits leave no range: {self._range(lower, upper)}")
        return lower, upper

    def _range(self, lower: float, upper: float) -> str:
        how = f"lower {lower:g}, upper {upper:g} rad"
        unstated = self.unstated()
        said = f" ({' and '.join(unstated)} not stated, which URDF takes for 0)" if unstated else ""
        return f"{how}{said}, where lower must be below upper" + (
            "; they are swapped" if lower > upper and not unstated else ""
        )

    def unstated(self) -> list[str]:
        """Which of a revolute joint's two limits are not stated, and so are 0."""
        limit = self._element.find("limit")
        if self.kind == "continuous" or limit is None:
            return []
        return [key for key in ("lower", "upper") if key not in limit.attrib]

    def speed(self) -> float:
        """Highest rate [rad/s]; 0 where none is known.

        Raises:
            FileProblems: It is no number, or negative.
        """
        limit = self._element.find("limit")
        if limit is None and self.kind == "continuous":
            return 0.0
        self._limit("effort", None)
        speed = self._limit("velocity", None)
        if not 0 <= speed < math.inf:
            raise self._refused(f"its velocity is {speed:g}; it must be finite, and not negative")
        return speed

    def axis(self) -> tuple[float, ...]:
        """Of rotation or travel, in the joint's frame, of any length but zero.

        Raises:
            FileProblems: It is no direction.
        """
        axis = self._element.find("axis")
        text = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        values = [self._number("axis", part) for part in text.split()]
        if len(values) != 3 or not math.isfinite(sum(values)) or not any(values):
            raise self._refused(
                f"it has no axis: xyz is '{text}', where three numbers that are not all 0 tell the "
                "direction it turns about"
            )
        return tuple(values)

    def doubt(self) -> str | None:
        """What looks like degrees, None where nothing does."""
        position, speed = self.position(), self.speed()
        said = []
        if position is not None and max(-position[0], position[1]) > MOST_TURNED:
            turns = max(-position[0], position[1]) / (2 * math.pi)
            said.append(f"may turn {turns:.0f} times round")
        if speed > FASTEST:
            said.append(f"turns at {math.degrees(speed):.0f} deg/s")
        return f"{self.name} {' and '.join(said)}" if said else None

    def _limit(self, key: str, default: float | None) -> float:
        limit = self._element.find("limit")
        if limit is None:
            raise self._refused(
                f'it is {self.kind} and has no <limit lower=".." upper=".." effort=".." '
                'velocity="..">, which URDF asks for; a joint that turns without end is of '
                'type="continuous"'
            )
        text = limit.get(key)
        if text is not None:
            return self._number(key, text)
        if default is None:
            raise self._refused(f"its <limit> states no {key}, which URDF asks for")
        return default

    def _number(self, key: str, text: str) -> float:
        try:
            return float(text)
        except ValueError:
            raise self._refused(
                f"its {key} '{text}' is no number; URDF has plain numbers, angles in radians"
            ) from None

    def _refused(self, message: str) -> FileProblems:
        return FileProblems(self._path, [self.problem(message)])


def in_degrees(path: Path, joints: Iterable[UrdfJoint]) -> list[str]:
    """A sentence where limits look like degrees.

    Args:
        path: Of the URDF.
        joints: Of the arm.
    """
    doubts = [doubt for joint in joints if (doubt := joint.doubt()) is not None]
    if not doubts:
        return []
    sentence = (
        f"{path.name}: limits are radians in URDF, and by them {'; '.join(doubts)}: are they in "
        "degrees? Then multiply them by pi/180"
    )
    return [sentence]


def zero_limits(path: Path, joints: Iterable[UrdfJoint]) -> list[str]:
    """A sentence for each joint of which only one limit is stated.

    Args:
        path: Of the URDF.
        joints: Of the arm.
    """
    return [
        f"{path.name}: joint {joint.name} states no {key} limit, which is 0 in URDF"
        for joint in joints
        for key in joint.unstated()
    ]


def read_urdf(path: Path) -> tuple[ElementTree.Element, dict[str, UrdfJoint]]:
    """The root of a URDF, and its joints by name.

    Raises:
        FileProblems: It is no URDF.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, OSError, ValueError) as error:
        raise FileProblems(path, [Problem(f"not a readable URDF: {error}")]) from None
    if root.tag != "robot":
        raise FileProblems(path, [Problem(f"not a URDF: its root is <{root.tag}>, not <robot>")])
    joints = (UrdfJoint(element, path, text) for element in root.findall("joint"))
    return root, {joint.name: joint for joint in joints}


@lru_cache(maxsize=8)
def _carriers(path: Path, _changed_ns: int) -> Callable[[str], list[UrdfJoint]]:
    root, joints = read_urdf(path)
    above = {}
    for element in root.findall("joint"):
        parent, child = element.find("parent"), element.find("child")
        if parent is not None and child is not None:
            above[child.get("link", "")] = (parent.get("link", ""), element.get("name", ""))

    def carrying(link: str) -> list[UrdfJoint]:
        found: list[UrdfJoint] = []
        while link in above and len(found) <= len(above):
            link, name = above[link]
            found.append(joints[name])
        return found

    return carrying


def joints_to(path: Path, link: str) -> list[UrdfJoint]:
    """All joints of a URDF between its base and a link, the nearest to the link first.

    Args:
        path: Of the URDF.
        link: Its name.
    """
    return _carriers(path, path.stat().st_mtime_ns)(link)


def package_folders(path: Path) -> list[Path]:
    """Folders that hold the packages which the meshes of a URDF are addressed in.

    A package is the folder of its name that the URDF is in, or one beside it or above it.

    Args:
        path: Of the URDF.
    """
    try:
        names = set(re.findall(r"package://([^/\"']+)/", path.read_text(encoding="utf-8-sig")))
    except (OSError, ValueError):
        return []
    return [one for one in path.resolve().parents if any((one / name).is_dir() for name in names)]
