"""The magnetic field at a place in the world: that of the earth, of magnetised parts of the arm, and of iron about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.model.kinematics import Kinematics
from testbench.records.magnetism import MagneticDipole
from testbench.records.protocol import Environment

MU_0_OVER_4PI = 1e-7
"""Magnetic constant over 4 pi [T m/A] (CODATA 2018, to 1e-9)."""


def dipole_field(displacement: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Field of magnetic dipoles (Jackson, Classical Electrodynamics, eq. 5.56).

    Args:
        displacement: From the dipole to the point, shape (n, 3) [m]. moment: Shape (n, 3) or (3,) [A m^2], same frame.

    Returns:
        Shape (n, 3) [uT].
    """
    distance = np.linalg.norm(displacement, axis=1, keepdims=True)
    direction = displacement / distance
    field = MU_0_OVER_4PI * (3 * direction * np.sum(direction * moment, axis=1, keepdims=True) - moment) / distance**3
    return 1e6 * field


def induced_moment(field: np.ndarray, radius: float) -> np.ndarray:
    """Moment of a sphere of soft iron in a uniform field: 4 pi a^3 B / mu_0, as its permeability is large (Jackson, eq. 5.115).

    Args:
        field: Shape (3,) [uT]. radius: Of the sphere [m].

    Returns:
        Shape (3,) [A m^2], along the field.
    """
    return np.asarray(field, float) * 1e-6 * radius**3 / MU_0_OVER_4PI


def earth_field(environment: Environment) -> np.ndarray:
    """The undisturbed field in the world frame, shape (3,) [uT]."""
    return np.asarray(environment.magnetic_field_uT, float)


def disturbances(environment: Environment, kinematics: Kinematics) -> list[MagneticDipole]:
    """Those of the robot file, unless the protocol leaves them out, and those of the protocol."""
    own = kinematics.robot.spec.magnetism.dipoles if environment.arm_magnetism else []
    return [*own, *environment.dipoles]


class MagneticField:
    """The field about an arm, as it moves.

    The iron takes its moment of the earth's undisturbed field: what one disturbance induces in another is of higher order.

    Args:
        environment: The earth's field, and disturbances of the protocol. kinematics: Of the arm, with its own disturbances.
    """

    def __init__(self, environment: Environment, kinematics: Kinematics):
        self.earth, self.kinematics = earth_field(environment), kinematics
        self._by_link: dict[str, list[MagneticDipole]] = {}
        for dipole in disturbances(environment, kinematics):
            self._by_link.setdefault(dipole.link, []).append(dipole)

    def at(self, position: np.ndarray, q: np.ndarray) -> np.ndarray:
        """The field in the world frame, shape (n, 3) [uT].

        Args:
            position: In the world, shape (n, 3) [m]. q: Joint angles at the same instants, shape (n, n_joints) [rad].
        """
        field = np.broadcast_to(self.earth, position.shape).copy()
        for link, dipoles in self._by_link.items():
            fixed = len(self.kinematics.chain_to(link)[3]) == 0  # no joint moves it: one pose is that of all instants
            motion = self.kinematics.frame_motion(link, q[:1] if fixed else q)
            R, origin = motion.R_world_from_frame, motion.position
            for dipole in dipoles:
                moment = R @ np.asarray(dipole.moment_A_m2) + induced_moment(self.earth, dipole.iron_radius_mm / 1000)
                field += dipole_field(position - origin - R @ (np.asarray(dipole.position_mm) / 1000), moment)
        return field


def describe_environment(environment: Environment, kinematics: Kinematics) -> dict[str, object]:
    """What the simulated magnetometers feel, for the manifest."""
    found: Sequence[MagneticDipole] = disturbances(environment, kinematics)
    return {
        "magnetic_field_uT": list(environment.magnetic_field_uT),
        "dipoles": [dipole.model_dump() for dipole in found],
        "why": kinematics.robot.spec.magnetism.why if environment.arm_magnetism else "",
    }
