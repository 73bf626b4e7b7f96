"""Ferraris: the accelerometer from six faces up, the gyroscope from a known turn about each axis.

Ferraris, Grimaldi & Parvis, Procedure for effortless in-field calibration of three-axial rate gyro and accelerometers, Sensors
and Materials 7(5), 1995, eqs 9 to 23. The response is not split into scale and rotation here: it is their product K R.
Each result is a linear combination of means, so its covariance follows from theirs.

The faces are taken to be exactly level: what a crooked table or housing adds looks like cross-axis error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.attitude_aided import calibration_of
from testbench.estimation.calibration.faces import face_of, need_all_faces, six_faces
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES, Tolerance
from testbench.exceptions import InputError
from testbench.records.calibration import TriadCalibration
from testbench.records.fit import Fit

LEVEL = "the faces are taken to be exactly level; what tilts them looks like cross-axis error"


@dataclass(frozen=True)
class Turn:
    """One turn about one axis of the sensor, from rest to rest.

    Attributes:
        rate: Raw, shape (n, 3) [rad/s]. force: By the calibrated accelerometer, shape (n, 3) [m/s^2]. interval: [s].
    """

    rate: np.ndarray
    force: np.ndarray
    interval: float


def ferraris(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Bias (eq. 20) and response (eqs 21 to 23) of an accelerometer.

    Args:
        poses: With each face up once at least. tolerance: For the unit.

    Raises:
        PoorExcitation: A face is never up.
    """
    mean, covariance = six_faces(poses)
    combine = np.zeros((12, 18))  # response row by row, then bias, by readings pose by pose
    for j in range(3):
        up, down = 2 * j, 2 * j + 1
        for i in range(3):
            combine[3 * i + j, [3 * up + i, 3 * down + i]] = np.array([0.5, -0.5]) / poses.magnitude
        combine[9 + j, [3 * up + j, 3 * down + j]] = 0.5
    noise = np.zeros((18, 18))
    for face in range(6):
        noise[3 * face : 3 * face + 3, 3 * face : 3 * face + 3] = covariance[face]
    names = (*_response_names(), *(f"bias_{i}" for i in AXES))
    fit = Fit(
        names, ("1",) * 9 + (tolerance.unit,) * 3, combine @ mean.reshape(-1), combine @ noise @ combine.T, condition=1.0
    )  # fmt: skip
    return calibration_of(fit, "ferraris", remarks=(LEVEL,))


def ferraris_gyroscope(
    rest: StaticPoses, force: StaticPoses, turns: Sequence[Turn], angle: float, angle_sd: float = 0.0
) -> TriadCalibration:
    """Bias, g-sensitivity (eq. 9) and response (eqs 12 to 15) of a gyroscope.

    Args:
        rest: Readings of the gyroscope at rest [rad/s]; of `magnitude` the specific force [m/s^2]. force: Of the accelerometer
        in the same poses: it says which face is up. turns: About x, y and z. angle: Of each [rad], negative for clockwise ones.
        angle_sd: Standard deviation of each turn's angle [rad].

    Raises:
        InputError: Not three turns. PoorExcitation: A face is never up.
    """
    if len(turns) != 3:
        raise InputError(f"Ferraris needs three turns, about x, y and z; {len(turns)} were given")
    face = face_of(force.mean)
    need_all_faces(face)
    m = len(rest)
    count = np.ones(m) if rest.count is None else rest.count.astype(float)
    pooled = count / count.sum()
    differ = np.zeros((3, m))  # half the difference of opposite faces over gravity (eq. 9)
    for k in range(6):
        differ[k // 2, face == k] = (0.5, -0.5)[k % 2] / rest.magnitude / np.sum(face == k)
    lasting = np.array([len(turn.rate) * turn.interval for turn in turns])
    felt = np.array([turn.force.sum(axis=0) * turn.interval for turn in turns])
    swept = np.array([turn.rate.sum(axis=0) * turn.interval for turn in turns])
    # All that is found is linear in the means at rest and the sums over the turns, alike for each axis of the gyroscope.
    found = np.zeros((7, m + 3))  # response (3), bias, g-sensitivity (3)
    found[3, :m], found[4:, :m] = pooled, differ
    found[:3, m:] = np.eye(3) / angle
    found[:3, :m] = -(lasting[:, None] * pooled + felt @ differ) / angle
    values = found @ np.vstack([rest.mean, swept])
    response, bias, g_matrix = values[:3].T, values[3], values[4:].T
    white = (rest.variance * count[:, None]).mean(axis=0)  # of one sample
    covariance = np.zeros((21, 21))
    for i in range(3):
        noise = np.concatenate([rest.variance[:, i], white[i] * lasting * np.array([turn.interval for turn in turns])])
        block = [3 * i, 3 * i + 1, 3 * i + 2, 9 + i, 12 + 3 * i, 13 + 3 * i, 14 + 3 * i]
        covariance[np.ix_(block, block)] = found * noise @ found.T
    for j in range(3):  # an error of a turn's angle scales a column of the response
        column = [j, 3 + j, 6 + j]
        covariance[np.ix_(column, column)] += np.outer(response[:, j], response[:, j]) * (angle_sd / angle) ** 2
    fit = Fit(
        (*_response_names(), *(f"bias_{i}" for i in AXES), *(f"g_sensitivity_{i}{j}" for i in AXES for j in AXES)),
        ("1",) * 9 + ("rad/s",) * 3 + ("rad/s/(m/s^2)",) * 9,
        np.concatenate([response.reshape(-1), bias, g_matrix.reshape(-1)]),
        covariance,
    )
    return TriadCalibration("ferraris", np.linalg.inv(response), bias, g_matrix=g_matrix, fits=(fit,), remarks=(LEVEL,))


def _response_names() -> list[str]:
    return [f"response_{i}{j}" for i in AXES for j in AXES]
