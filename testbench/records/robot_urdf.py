"""A robot from a bare URDF: what the URDF does not say (acceleration, jerk, home) is filled in, and
says so.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import yaml

from testbench.exceptions import FileProblems, Problem
from testbench.records.robot import CatalogueEntry, Robot, RobotSpec, Servo

TIME_TO_FULL_SPEED = 0.25
"""Assumed time to reach full speed, and full acceleration [s]; gentle for a cobot, whose makers
state about 0.1 to 0.3 s.
"""
ASSUMED_SPEED_DEG_S = 180.0


def robot_from_urdf(
    path: Path, name: str | None = None, entry: CatalogueEntry | None = None
) -> Robot:
    """Describe the arm of a URDF.

    Args:
        path: The URDF.
        name: How to call the arm; its own name if None.
        entry: Which joints make up the arm, and where home is; all movable joints and their middle
            if None.

    Raises:
        FileProblems: Not a URDF, or one without the joints that are asked for.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, UnicodeDecodeError) as error:
        raise FileProblems(path, [Problem(f"not a readable URDF: {error}")]) from None
    if root.tag != "robot":
        raise FileProblems(path, [Problem(f"not a URDF: its root is <{root.tag}>, not <robot>")])
    movable = {
        joint.get("name", ""): joint
        for joint in root.findall("joint")
        if joint.get("type") in {"revolute", "continuous", "prismatic"}
    }
    names = (
        entry.joints
        if entry
        else [key for key, joint in movable.items() if joint.find("mimic") is None]
    )
    missing = [key for key in names if key not in movable]
    if missing or not names:
        raise FileProblems(
            path,
            [
                Problem(
                    f"the URDF lacks the movable joints {missing or 'of an arm'}; it has "
                    f"{sorted(movable)}"
                )
            ],
        )
    for key in names:
        if movable[key].get("type") == "prismatic":
            raise FileProblems(
                path, [Problem(f"joint {key} is prismatic; the bench drives rotating joints only")]
            )
    joints = [_joint(key, movable[key]) for key in names]
    home = (
        entry.home_deg
        if entry
        else [0.0 if not j["position_deg"] else sum(j["position_deg"]) / 2 for j in joints]
    )
    data: dict[str, Any] = {
        "name": name or root.get("name") or path.stem,
        "description": entry.description if entry else f"from {path.name}",
        "urdf": str(path),
        "joints": joints,
        "assumptions": [
            f"{path.name} states no acceleration, jerk, servo or floor: full speed in "
            f"{TIME_TO_FULL_SPEED} s, a servo of "
            f"{Servo().natural_frequency_hz:g} Hz and no floor are assumed"
            + ("" if entry else ", and home in the middle of each joint's range")
        ],
        "home_deg": home,
    }
    text = yaml.safe_dump(data, sort_keys=False)
    return Robot(
        RobotSpec.model_validate(data), path.resolve(), text, None if entry else path.resolve()
    )


def _joint(name: str, joint: ElementTree.Element) -> dict[str, Any]:
    limit = joint.find("limit")
    attributes = {} if limit is None else limit.attrib
    continuous = joint.get("type") == "continuous" or "lower" not in attributes
    position = (
        None if continuous else [math.degrees(float(attributes[key])) for key in ("lower", "upper")]
    )
    speed = math.degrees(float(attributes.get("velocity", 0.0)))
    why = "position and velocity from the URDF"
    if speed <= 0:
        speed, why = (
            ASSUMED_SPEED_DEG_S,
            f"the URDF states no velocity: {ASSUMED_SPEED_DEG_S:.0f} deg/s assumed",
        )
    return {
        "name": name,
        "position_deg": position,
        "velocity_deg_s": speed,
        "acceleration_deg_s2": speed / TIME_TO_FULL_SPEED,
        "jerk_deg_s3": speed / TIME_TO_FULL_SPEED**2,
        "why": f"{why}; acceleration and jerk assumed: full speed in {TIME_TO_FULL_SPEED} s",
    }
