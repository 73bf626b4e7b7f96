"""What a pose or a turn tells about a sensor's errors: Fisher information of the linear model.

Accelerometer: reading = M f + b, 12 parameters, of poses whose force f the arm knows. Gyroscope:
the integral of the readings over a turn = M phi + b T + G F, with phi the rotation vector, T the
duration and F the integral of the specific force; the same seven unknowns for each axis.
Information adds over observations (Pukelsheim, Optimal Design of Experiments, 2006, section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ACCELEROMETER = tuple(f"acc_response_{i}{j}" for i in "xyz" for j in "xyz") + tuple(
    f"acc_bias_{i}" for i in "xyz"
)
"""Order of the accelerometer's parameters; response in 1, bias in m/s^2."""
GYROSCOPE_AXIS = (*(f"gyr_response_{j}" for j in "xyz"), "gyr_bias", *(f"gyr_g_{j}" for j in "xyz"))
"""Order of the parameters of one axis of a gyroscope; response in 1, bias in rad/s, g-sensitivity
in rad/s/(m/s^2).
"""


@dataclass(frozen=True)
class ObservationNoise:
    """How well one observation is known.

    Attributes:
        force: Standard deviation of a pose's mean reading: noise, and what does not average out
            [m/s^2].
        direction: Standard deviation of the arm's orientation about each axis [rad].
        rate_density: White noise of the gyroscope, one-sided [rad/s/sqrt(Hz)].
        in_run: Standard deviation of the bias between one observation and the next [rad/s].
    """

    force: float
    direction: float
    rate_density: float
    in_run: float


def pose_information(force: np.ndarray, noise: ObservationNoise) -> np.ndarray:
    """Information of poses about the accelerometer's 12 parameters.

    The reading's noise is alike along all axes; the error of the known direction lies across it,
    and there counts for more.

    Args:
        force: Specific force in the sensor, shape (m, 3) [m/s^2].
        noise: Of the observations.

    Returns:
        One matrix for each pose, shape (m, 12, 12).
    """
    m = len(force)
    length = np.linalg.norm(force, axis=1)
    u = force / length[:, None]
    along = u[:, :, None] * u[:, None, :]
    precision = (
        along / noise.force**2
        + (np.eye(3) - along) / (noise.force**2 + (length * noise.direction) ** 2)[:, None, None]
    )
    design = np.zeros((m, 3, 12))
    for i in range(3):
        design[:, i, 3 * i : 3 * i + 3] = force
        design[:, i, 9 + i] = 1.0
    return np.asarray(np.einsum("nki,nkl,nlj->nij", design, precision, design))


def rest_information(force: np.ndarray, dwell: float, noise: ObservationNoise) -> np.ndarray:
    """Information of rests about the seven parameters of each axis of the gyroscope.

    Args:
        force: Specific force in the sensor, shape (m, 3) [m/s^2].
        dwell: Length of each rest [s].
        noise: Of the observations.

    Returns:
        One matrix for each rest, shape (m, 7, 7).
    """
    design = np.column_stack([np.zeros_like(force), np.ones(len(force)), force])
    variance = noise.rate_density**2 / (2 * dwell) + noise.in_run**2
    return design[:, :, None] * design[:, None, :] / variance


def turn_information(
    turn: np.ndarray, duration: np.ndarray, force: np.ndarray, noise: ObservationNoise
) -> np.ndarray:
    """Information of turns about the seven parameters of each axis of the gyroscope.

    Args:
        turn: Rotation vector in the sensor, shape (m, 3) [rad].
        duration: Of each turn, shape (m,) [s].
        force: Mean specific force in the sensor over the turn, shape (m, 3) [m/s^2].
        noise: Of the observations.

    Returns:
        One matrix for each turn, shape (m, 7, 7).
    """
    design = np.column_stack([turn, duration, force * duration[:, None]])
    variance = (
        2 * noise.direction**2
        + noise.rate_density**2 * duration / 2
        + (noise.in_run * duration) ** 2
    )
    return design[:, :, None] * design[:, None, :] / variance[:, None, None]


def predicted_sd(information: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Standard uncertainty of each parameter.

    Args:
        information: Sum over the observations, shape (p, p).
        size: Scale of each parameter, shape (p,), for the conditioning only.

    Returns:
        Shape (p,) [unit of the parameter]; infinite where the observations cannot separate it from
        others.
    """
    scaled = information * np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    blind = values < 1e-9 * values[-1]
    with np.errstate(divide="ignore"):
        variance = (vectors**2 / np.where(blind, np.inf, values)).sum(axis=1)
    lost = (vectors[:, blind] ** 2).sum(axis=1) > 1e-6
    return np.asarray(np.where(lost, np.inf, np.sqrt(variance)) * size)
