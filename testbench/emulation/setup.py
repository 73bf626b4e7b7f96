"""What a person may ask of any emulated arm, checked."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.exceptions import InputError
from testbench.records.specs.robot import Robot, load_robot


def emulated_robot(model: str, known: Iterable[str]) -> Robot:
    """The robot of a model.

    Raises:
        InputError: It is not emulated.
    """
    if model not in known:
        raise InputError(f"'{model}' is not emulated; known: {', '.join(known)}")
    return load_robot(model)


def start_angles(robot: Robot, q_deg: list[float] | None) -> np.ndarray | None:
    """Joint angles at the start, shape (n,) [rad]; None for home.

    Raises:
        InputError: There is not one for each joint.
    """
    if q_deg is None:
        return None
    if len(q_deg) != len(robot.joint_names):
        raise InputError(
            f"{len(q_deg)} joint angles were given; {robot.name} has {len(robot.joint_names)}"
        )
    return np.radians(q_deg)
