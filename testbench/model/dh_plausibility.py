"""Whether an arm's DH corrections can be a factory calibration, by what they do to the flange.

Single corrections say little: along the nearly parallel axes of joints 2 to 4 those of d are large
and cancel one another. The flange moves by little. Of two calibrations that owners made public,
over random configurations: 2.0 mm and 0.35 deg (UR5e, calib_14698139022496758595), 2.8 mm and 0.64
deg (UR5, calib_15200003067234149431). Universal Robots says of arms without theirs "multiple
millimeters" when stretched (support article Kinematic Robot Calibration, 2025) and, of its ROS
driver, "magnitude of centimeters" (documentation of ur_calibration).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.exceptions import InputError
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import Robot

FLANGE = "tool0"
DOUBTED_MM, DOUBTED_DEG = 5.0, 1.0
"""Beyond the largest of the public calibrations above, by a half and more: said, not refused."""
REFUSED_MM, REFUSED_DEG = 20.0, 2.0
"""The centimetres that the maker speaks of, and three times the largest turn above."""
CONFIGURATIONS = 500
"""Beside the stretched arm; drawn from a fixed seed."""


@dataclass(frozen=True)
class Deviation:
    """How far the flange is from where the nominal kinematics have it.

    Attributes:
        shift_mm: Largest distance.
        turn_deg: Largest rotation.
    """

    shift_mm: float
    turn_deg: float

    def __str__(self) -> str:
        return (
            f"move the flange by up to {self.shift_mm:.3g} mm and turn it by up to "
            f"{self.turn_deg:.3g} deg"
        )


def flange_deviation(nominal: Robot, own: Robot) -> Deviation:
    """How far the flange of an arm is from where its nominal kinematics have it.

    Args:
        nominal: As shipped.
        own: With its own kinematics.

    Returns:
        The largest over the stretched arm and random angles of all joints.
    """
    joints = len(nominal.joint_names)
    q = np.vstack(
        [
            np.zeros(joints),
            np.random.default_rng(0).uniform(-np.pi, np.pi, (CONFIGURATIONS, joints)),
        ]
    )
    before, after = (Kinematics(robot).frame_motion(FLANGE, q) for robot in (nominal, own))
    shift = np.linalg.norm(after.position - before.position, axis=1).max()
    # |R - I| of Frobenius is 2 sqrt(2) sin(angle / 2): exact for small angles too, where the arc
    # cosine is not
    difference = np.linalg.norm(
        after.R_world_from_frame - before.R_world_from_frame, axis=(1, 2)
    ).max()
    turn = 2 * np.arcsin(min(difference / np.sqrt(8), 1.0))
    return Deviation(1000 * float(shift), float(np.degrees(turn)))


def judge_corrections(nominal: Robot, own: Robot) -> str | None:
    """Refuse corrections that no factory calibration has.

    Args:
        nominal: As shipped.
        own: With its own kinematics.

    Returns:
        What is doubtful about them, or None.

    Raises:
        InputError: The flange moves or turns too far.
    """
    found = flange_deviation(nominal, own)
    if found.shift_mm > REFUSED_MM or found.turn_deg > REFUSED_DEG:
        raise InputError(
            f"the corrections of the arm's kinematics {found}, more than the {REFUSED_MM:g} mm and "
            f"{REFUSED_DEG:g} deg "
            "allowed: no factory calibration does; lengths are in metres, angles in radians, and "
            "both are added to the nominal "
            "parameters"
        )
    if found.shift_mm > DOUBTED_MM or found.turn_deg > DOUBTED_DEG:
        return (
            f"the corrections of the arm's kinematics {found}; factory calibrations mostly stay "
            f"below {DOUBTED_MM:g} mm and "
            f"{DOUBTED_DEG:g} deg: are they this arm's, in metres and radians?"
        )
    return None
