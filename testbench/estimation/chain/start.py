"""The state at the start: at rest, near the stated pose, inclined as the accelerometers say."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import (
    OMEGA_SD,
    START_ACCELERATION_SD,
    START_RATE_SD,
    FilterSettings,
)
from testbench.estimation.chain.state import joint_motion, motion_size, state_indices

STEPS = 20
UNKNOWN = 1e3
"""Standard deviation of what the rest has yet to tell, in multiples of what it will be known to
[1].
"""


class RestPose(NamedTuple):
    """What rest says.

    Attributes:
        theta: Joint angles and the sensor errors that are states, shape (k,).
        covariance: Theirs, shape (k, k).
        by_theta: Derivative of the mean readings by them, shape (6 s, k).
        misfit: Mean readings less those of the stated pose and errors, shape (6 s,).
        weight: Of each mean reading, one over its variance, shape (6 s,).
        reading: Those of an ideal sensor in this pose, shape (s, 6).
    """

    theta: np.ndarray
    covariance: np.ndarray
    by_theta: np.ndarray
    misfit: np.ndarray
    weight: np.ndarray
    reading: np.ndarray


class StartState(NamedTuple):
    """Where the filter begins, and what wrong placement does to that (`effect.PlacementEffect`).

    Attributes:
        x: State, shape (n,).
        P: Its covariance, shape (n, n).
        sensitivity: Of the state's error to the p constants of placement, shape (n, p).
        information: What rest tells of them, shape (p, p).
        score: The same times their most likely values, shape (p,).
    """

    x: np.ndarray
    P: np.ndarray
    sensitivity: np.ndarray
    information: np.ndarray
    score: np.ndarray


def rest_pose(
    sensors: ChainSensors, settings: FilterSettings, mean: np.ndarray, counts: np.ndarray
) -> RestPose:
    """Pose and biases at rest: the most probable ones given the stated pose and the mean readings
    (Gauss-Newton).

    Args:
        sensors: The chain.
        settings: Start pose, noise and biases.
        mean: Mean readings at rest, shape (s, 6) [rad/s], [m/s^2].
        counts: Number of readings behind each mean, shape (s,).

    Returns:
        Angles and errors with what they follow from.
    """
    m, s = len(sensors.joints), len(sensors.sensors)
    errors = settings.error_variance
    size = m + len(errors)
    prior = np.concatenate([settings.start, np.zeros(size - m)])
    information = np.concatenate(
        [np.full(m, settings.start_sd**-2.0), 1 / np.maximum(errors, 1e-20)]
    )
    white = np.array([noise.variance for noise in settings.noise]) / counts[:, None]
    weight = 1 / (white + settings.rest_variance)
    theta, zero = prior.copy(), np.zeros(m)
    for _ in range(STEPS):
        reading, by_q, _, _ = sensors.readings(theta[:m], zero, zero)
        J = np.zeros((6 * s, size))
        J[:, :m] = by_q.reshape(-1, m)
        residual = (mean - reading).ravel()
        J[:, m:] = _by_errors(reading, size - m)
        residual = residual - J[:, m:] @ theta[m:]
        normal = np.diag(information) + (J.T * weight.ravel()) @ J
        step = np.linalg.solve(
            normal, (J.T * weight.ravel()) @ residual + information * (prior - theta)
        )
        theta = theta + step
        if np.abs(step[:m]).max() < 1e-12:
            break
    # linear about what was found: as if the prior had been compared with the readings
    misfit = residual + J @ (theta - step - prior)
    return RestPose(theta, np.linalg.inv(normal), J, misfit, weight.ravel(), reading)


def _by_errors(reading: np.ndarray, count: int) -> np.ndarray:
    """Derivative of readings (s, 6) by the sensor errors that are states, shape (6 s, count)."""
    s = len(reading)
    J = np.zeros((6 * s, 40 * s))  # at rest nothing tells of the clocks
    J[:, : 6 * s] = np.eye(6 * s)
    for i in range(s):
        first = 7 * s + 33 * i
        for r in range(3):
            J[6 * i + r, first + 6 * r : first + 6 * r + 6] = reading[i]
            J[6 * i + 3 + r, first + 18 + 3 * r : first + 21 + 3 * r] = reading[i, 3:]
        J[range(6 * i, 6 * i + 6), range(first + 27, first + 33)] = reading[i] ** 3
    return J[:, :count]


def start_state(
    sensors: ChainSensors,
    settings: FilterSettings,
    mean: np.ndarray,
    counts: np.ndarray,
    constants: int = 0,
) -> StartState:
    """State and covariance at rest.

    The prior of the motion (unknown for q, v, a; that of the settings for Fourier coefficients)
    meets what rest says: the pose and sensor errors of `rest_pose`, and no rate and no
    acceleration.

    Args:
        sensors: The chain.
        settings: Start pose, noise and biases.
        mean: Mean readings at rest, shape (s, 6) [rad/s], [m/s^2].
        counts: Number of readings behind each mean, shape (s,).
        constants: How many constants of placement there are: none, or the six of each sensor and
            then lengths, of which rest does not tell.

    Returns:
        State, covariance, and the effect of placement.
    """
    m, harmonics = len(sensors.joints), settings.harmonics
    rested = rest_pose(sensors, settings, mean, counts)
    theta, covariance = rested.theta, rested.covariance
    size = motion_size(m, harmonics)
    n = size + len(theta) - m
    x, sd = np.zeros(n), np.empty(n)
    told = np.sqrt(np.diag(covariance))
    if harmonics:
        omega = 2 * np.pi * settings.frequency
        x[:m], x[size - 1] = theta[:m], omega
        sd[: size - 1], sd[size - 1] = settings.coefficient_sd(m), OMEGA_SD * omega
    else:
        x[:m] = theta[:m]
        sd[:m] = UNKNOWN * told[:m]
        sd[m : 2 * m], sd[2 * m : size] = UNKNOWN * START_RATE_SD, UNKNOWN * START_ACCELERATION_SD
    sd[size:] = UNKNOWN * told[m:]
    indices = state_indices(m, harmonics)
    motion, slopes = np.empty((3, m)), np.empty((3, m, indices.shape[1]))
    joint_motion(x, indices, harmonics, motion, slopes)
    H = np.zeros((3 * m + n - size, n))
    for order in range(3):
        for j in range(m):
            H[order * m + j, indices[j]] = slopes[order, j]
    H[3 * m :, size:] = np.eye(n - size)
    R = np.zeros((len(H), len(H)))
    same = np.r_[0:m, 3 * m : len(H)]
    R[np.ix_(same, same)] = covariance
    R[range(m, 3 * m), range(m, 3 * m)] = np.repeat(
        np.square([START_RATE_SD, START_ACCELERATION_SD]), m
    )
    said = np.concatenate([theta[:m], np.zeros(2 * m), theta[m:]])
    P = np.diag(sd**2)
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    # linear but for omega, which multiplies coefficients that are still 0
    x = x + K @ (said - H @ x)
    left = np.eye(n) - K @ H
    P = left @ P @ left.T + K @ R @ K.T
    moved, information, score = _rest_effect(rested, constants)
    # an error of placement moves what rest says, and that the state
    sensitivity = K @ np.vstack([moved[:m], np.zeros((2 * m, constants)), moved[m:]])
    return StartState(x, (P + P.T) / 2, sensitivity, information, score)


def _rest_effect(rested: RestPose, constants: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What constants of placement do to what rest says, and what rest tells of them.

    Returns:
        Sensitivity of the error of pose and sensor errors, shape (k, p); information, shape (p, p);
        and score, shape (p,).
    """
    by_placement = _by_placement(rested.reading, constants)
    weighted = rested.weight[:, None] * by_placement
    pulled = rested.by_theta.T @ weighted
    # the misfit's covariance is J prior J' + R; its inverse by that of what was found (Woodbury)
    information = by_placement.T @ weighted - pulled.T @ rested.covariance @ pulled
    score = weighted.T @ rested.misfit - pulled.T @ rested.covariance @ (
        rested.by_theta.T @ (rested.weight * rested.misfit)
    )
    return -rested.covariance @ pulled, information, score


def _by_placement(reading: np.ndarray, count: int) -> np.ndarray:
    """Derivative of readings at rest (s, 6) by constants of placement, shape (6 s, count)."""
    s = len(reading)
    J = np.zeros((6 * s, count))
    for i in range(s if count else 0):
        for first in (0, 3):
            x, y, z = reading[i, first : first + 3]
            J[6 * i + first : 6 * i + first + 3, 6 * i : 6 * i + 3] = [
                [0, -z, y],
                [z, 0, -x],
                [-y, x, 0],
            ]
    return J
