"""Accelerometer and gyroscope errors from static poses that the arm knows.

At rest in a pose the specific force is known in the sensor frame and the angular rate is zero, so
each axis is linear in four unknowns: a bias and the response to each component of the force; for an
accelerometer that is its sensitivity, for a gyroscope its g-sensitivity. Few poses do not determine
them all; the data sheets' tolerances are the prior, and the posterior says what was learnt
(Bayesian linear regression; Bishop, Pattern Recognition and Machine Learning, 2006, section 3.3).
"""

from __future__ import annotations

import numpy as np

from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.records.results.estimate import CalibrationFit

PRIOR_BIAS = 0.4
"""Standard deviation of an accelerometer bias before the calibration [m/s^2]: 40 mg, of consumer
MEMS data sheets.
"""
PRIOR_SENSITIVITY = 0.03
"""Standard deviation of scale and cross-axis errors before the calibration [1]."""
PRIOR_GYRO_BIAS = np.radians(1.0)
"""Standard deviation of a gyroscope bias before the calibration [rad/s]: 1 deg/s, of consumer MEMS
data sheets.
"""
PRIOR_G_SENSITIVITY = np.radians(0.1) / STANDARD_GRAVITY
"""Standard deviation of a gyroscope's response to force before the calibration: 0.1 deg/s/g, of
consumer MEMS data sheets.
"""
GYRO_POSE_ERROR = np.radians(10 / 3600)
"""Standard deviation of a pose's mean rate beside its noise [rad/s]: an in-run bias of 10 deg/h."""
POSE_ERROR = 0.006
"""Standard deviation of a pose's mean beside its noise [m/s^2]: the arm's settling and
repeatability, 0.03 deg of gravity.
"""
GYRO_IN_RUN = np.radians(10 / 3600)
"""In-run bias that all poses share [rad/s]: 10 deg/h, of consumer MEMS data sheets."""
PRIOR_MOUNTING = np.radians(5.0)
"""Standard deviation of the mounting before the calibration, about each axis [rad]."""
DIRECTION_ERROR = 0.05
"""Standard deviation of a felt force against a rotated expected one: scale and cross-axis errors of
0.5 % [m/s^2].
"""
LEAST_TURN = np.radians(0.3)
"""A smaller rotation may as well be the accelerometer's own cross-axis error, and turns no other
triad [rad].
"""
FEWEST_POSES = 3
"""With fewer poses a bias cannot be told from a crooked mounting, and is the likelier of the
two.
"""
ROUNDS = 5


def fit_static_poses(
    acc: list[np.ndarray],
    gyr: list[np.ndarray],
    q_world_from_sensor: list[np.ndarray],
    gravity: np.ndarray,
) -> CalibrationFit:
    """Fit corrections to static poses.

    Args:
        acc: Raw forces of each pose, shape (n_i, 3) [m/s^2].
        gyr: Raw rates of each pose, shape (n_i, 3) [rad/s].
        q_world_from_sensor: The truth in each pose, shape (4,).
        gravity: In the world, shape (3,) [m/s^2].

    Returns:
        The corrections; none where there is no pose.
    """
    if not acc:
        return CalibrationFit()
    expected = rotation.rotate(rotation.conjugate(np.array(q_world_from_sensor)), -gravity)
    felt = np.array([pose.mean(axis=0) for pose in acc])
    bias = np.zeros(3)
    for _ in range(ROUNDS):  # the rotation needs the bias, and the bias the rotation
        R_sensor_from_believed = (
            _mounting(felt - bias, expected) if len(acc) >= FEWEST_POSES else np.eye(3)
        )
        acc_fit, acc_covariance, residual = _regress(
            acc, expected, R_sensor_from_believed, PRIOR_SENSITIVITY, PRIOR_BIAS, POSE_ERROR
        )
        bias = acc_fit[3]
    gyr_fit, gyr_covariance, _ = _regress(
        gyr, felt, np.zeros((3, 3)), PRIOR_G_SENSITIVITY, PRIOR_GYRO_BIAS, GYRO_POSE_ERROR
    )
    turned = float(rotation.angle(rotation.from_matrix(R_sensor_from_believed)))
    return CalibrationFit(
        acc_matrix=np.linalg.inv(acc_fit[:3].T),
        acc_bias=acc_fit[3],
        acc_bias_sd=np.full(3, np.sqrt(acc_covariance[3, 3])),
        gyr_bias=gyr_fit[3],
        gyr_bias_sd=np.full(3, np.sqrt(gyr_covariance[3, 3] + GYRO_IN_RUN**2)),
        gyr_g_matrix=gyr_fit[:3].T,
        R_believed_from_sensor=R_sensor_from_believed.T if turned > LEAST_TURN else np.eye(3),
        poses=len(acc),
        residual_m_s2=float(np.sqrt(np.mean(residual**2))),
        method="static_poses",
    )


def _mounting(force: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """R_sensor_from_believed that turns expected forces into felt ones (Wahba's problem).

    By SVD (Markley 1988).
    The mounting as believed weighs in as three unit vectors with `PRIOR_MOUNTING` of error, so that
    what the poses do not show stays as it was.

    Args:
        force: As felt, shape (m, 3) [m/s^2].
        expected: By the truth, shape (m, 3) [m/s^2].
    """
    attitude = force.T @ expected / DIRECTION_ERROR**2 + np.eye(3) / PRIOR_MOUNTING**2
    return rotation.nearest_rotation(attitude)


def _regress(
    samples: list[np.ndarray],
    force: np.ndarray,
    prior: np.ndarray,
    response_sd: float,
    bias_sd: float,
    pose_error: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Posterior mean (4, 3) of response and bias, covariance (4, 4) of each axis, and residuals (m,
    3).

    Args:
        samples: Of each of m poses, shape (n_i, 3).
        force: Shape (m, 3).
        prior: Response expected beforehand, shape (3, 3).
        response_sd: Standard deviation of the response beforehand.
        bias_sd: Standard deviation of the bias beforehand.
        pose_error: Standard deviation of a pose's mean beside its noise.
    """
    readings = np.array([pose.mean(axis=0) for pose in samples])
    variance = np.array([pose.var(axis=0).mean() / len(pose) for pose in samples]) + pose_error**2
    design = np.column_stack([force, np.ones(len(force))])
    precision = np.diag([response_sd**-2] * 3 + [bias_sd**-2])
    covariance = np.linalg.inv(precision + design.T @ (design / variance[:, None]))
    mean = covariance @ (
        precision @ np.vstack([prior.T, np.zeros(3)]) + design.T @ (readings / variance[:, None])
    )
    return mean, covariance, readings - design @ mean
