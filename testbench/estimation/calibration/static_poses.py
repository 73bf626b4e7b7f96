"""Accelerometer and gyroscope errors from static poses that the arm knows.

At rest in a pose the specific force is known in the sensor frame, so each accelerometer axis is linear in four unknowns: three
sensitivities and a bias. Few poses do not determine them all; the data sheet's tolerance is the prior, and the posterior says what
was learnt (Bayesian linear regression; Bishop 2006, section 3.3).
"""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.records.estimate import CalibrationFit

PRIOR_BIAS = 0.4
"""Standard deviation of an accelerometer bias before the calibration [m/s^2]: 40 mg, of consumer MEMS data sheets."""
PRIOR_SENSITIVITY = 0.03
"""Standard deviation of scale and cross-axis errors before the calibration [1]."""
POSE_ERROR = 0.006
"""Standard deviation of a pose's mean beside its noise [m/s^2]: 0.03 deg of arm and mounting error under gravity."""


def fit_static_poses(
    acc: list[np.ndarray], gyr: list[np.ndarray], q_world_from_sensor: list[np.ndarray], gravity: np.ndarray
) -> CalibrationFit:
    """Fit corrections to static poses.

    Args:
        acc, gyr: Raw samples of each pose, shape (n_i, 3) [m/s^2], [rad/s]. q_world_from_sensor: The truth in each, (4,).
        gravity: In the world, shape (3,) [m/s^2].

    Returns:
        The corrections; none where there is no pose.
    """
    if not acc:
        return CalibrationFit()
    readings = np.array([samples.mean(axis=0) for samples in acc])
    expected = rotation.rotate(rotation.conjugate(np.array(q_world_from_sensor)), -gravity)
    noise = np.array([samples.var(axis=0).mean() / len(samples) for samples in acc]) + POSE_ERROR**2
    design = np.column_stack([expected, np.ones(len(expected))])
    prior_precision = np.diag([PRIOR_SENSITIVITY**-2] * 3 + [PRIOR_BIAS**-2])
    precision = prior_precision + design.T @ (design / noise[:, None])
    covariance = np.linalg.inv(precision)
    prior_mean = np.vstack([np.eye(3), np.zeros(3)])
    solution = covariance @ (prior_precision @ prior_mean + design.T @ (readings / noise[:, None]))
    sensitivity, bias = solution[:3].T, solution[3]
    residual = readings - design @ solution
    return CalibrationFit(
        acc_matrix=np.linalg.inv(sensitivity),
        acc_bias=bias,
        acc_bias_sd=np.full(3, np.sqrt(covariance[3, 3])),
        gyr_bias=np.concatenate(gyr).mean(axis=0),
        poses=len(acc),
        residual_m_s2=float(np.sqrt(np.mean(residual**2))),
        method="static_poses",
    )
