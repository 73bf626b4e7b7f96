"""The magnetic field in the world: that of the earth, of magnetised parts of the arm, of iron."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from testbench.model.kinematics import Kinematics
from testbench.records.specs.magnetism import MagneticDipole
from testbench.records.specs.protocol import Environment

MU_0_OVER_4PI = 1e-7
"""Magnetic constant over 4 pi [T m/A] (CODATA 2018, to 1e-9)."""


def induced_moment(field: np.ndarray, radius: float) -> np.ndarray:
    """Moment of a sphere of soft iron in a uniform field (Jackson, eq. 5.115).

    It is 4 pi a^3 B / mu_0, as the iron's permeability is large.

    Args:
        field: Shape (3,) [uT].
        radius: Of the sphere [m].

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


@njit(cache=True)
def _add_dipoles(
    field: np.ndarray,
    position: np.ndarray,
    origins: np.ndarray,
    rotations: np.ndarray,
    link: np.ndarray,
    places: np.ndarray,
    moments: np.ndarray,
) -> None:
    """Add the fields of dipoles, Jackson, Classical Electrodynamics, eq. 5.56.

    Args:
        field: In the world, shape (n, 3) [uT].
        position: Where the field is wanted, shape (n, 3) [m].
        origins: Of the links, shape (n, l, 3) [m].
        rotations: World from link, shape (n, l, 3, 3).
        link: Place of each dipole's link among them, shape (k,).
        places: Of the dipoles in their links, shape (k, 3) [m].
        moments: In the link, and what is induced in the world, shape (k, 2, 3) [A m^2].
    """
    d, m = np.empty(3), np.empty(3)
    for i in range(field.shape[0]):
        for k in range(places.shape[0]):
            square, along = 0.0, 0.0
            R, origin = rotations[i, link[k]], origins[i, link[k]]
            for r in range(3):
                d[r], m[r] = position[i, r] - origin[r], moments[k, 1, r]
                for c in range(3):
                    # d from the dipole to the place; its moment, fixed to the link and induced
                    d[r] -= R[r, c] * places[k, c]
                    m[r] += R[r, c] * moments[k, 0, c]
                square += d[r] * d[r]
                along += d[r] * m[r]
            # mu_0 / 4 pi / r^3 (Jackson, eq. 5.56), in uT
            scale = 1e6 * MU_0_OVER_4PI / (square * np.sqrt(square))
            for r in range(3):
                # 3 n (n . m) - m with n = d / r
                field[i, r] += scale * (3.0 * along / square * d[r] - m[r])


class MagneticField:
    """The field about an arm, as it moves.

    The iron takes its moment of the earth's undisturbed field: what one disturbance induces in
    another is of higher order.

    Args:
        environment: The earth's field, and disturbances of the protocol.
        kinematics: Of the arm, with its own disturbances.
    """

    def __init__(self, environment: Environment, kinematics: Kinematics):
        self.earth, self.kinematics = earth_field(environment), kinematics
        dipoles = disturbances(environment, kinematics)
        self._links = list(dict.fromkeys(dipole.link for dipole in dipoles))
        dipoles.sort(key=lambda dipole: self._links.index(dipole.link))
        self._link = np.array([self._links.index(dipole.link) for dipole in dipoles])
        self._places = np.array([dipole.position_mm for dipole in dipoles], float) / 1000
        self._moments = np.array(
            [
                [dipole.moment_A_m2, induced_moment(self.earth, dipole.iron_radius_mm / 1000)]
                for dipole in dipoles
            ]
        )

    def at(self, position: np.ndarray, q: np.ndarray) -> np.ndarray:
        """The field in the world frame, shape (n, 3) [uT].

        Args:
            position: In the world, shape (n, 3) [m].
            q: Joint angles at the same instants, shape (n, n_joints) [rad].
        """
        field = np.tile(self.earth, (len(position), 1))
        if len(position) and self._links:
            origins, rotations = self.kinematics.link_poses(self._links, q)
            _add_dipoles(
                field, position, origins, rotations, self._link, self._places, self._moments
            )
        return field


def describe_environment(environment: Environment, kinematics: Kinematics) -> dict[str, object]:
    """What the simulated magnetometers feel, for the manifest."""
    found: Sequence[MagneticDipole] = disturbances(environment, kinematics)
    return {
        "magnetic_field_uT": list(environment.magnetic_field_uT),
        "dipoles": [dipole.model_dump() for dipole in found],
        "why": kinematics.robot.spec.magnetism.why if environment.arm_magnetism else "",
    }
