"""Rotational calibration of a triad: the map from mean readings to known forces, and the rotation
nearest to it.

Castellanos Alonso (Universidad de Oviedo, 2023): R = A' pinv(B'), A the known forces and B the mean
readings, pose by pose. That R is a general linear map: it takes up scale, cross-axis error and, as
it has no bias, part of the bias too. It is shown beside the rotation that fits the same poses
(Wahba's problem, by SVD: Markley 1988), each with and without a bias, with how far R is from a
rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.statistics.least_squares import (
    FitParameter,
    PoorExcitation,
    covariance_of,
)
from testbench.model.statistics.linear import axis_by_axis, solve_linear
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

IN_PLANE = 0.05
"""An axis is out of the plane of the poses where no expected force has more than this share of its
length along it (3 deg).
"""
CROOKED = np.radians(10.0)
"""Standard deviation of the rotation beforehand, about each axis [rad]; a fit that says less is
refused.
"""
ADVICE = "forces along two axes at least are needed, and opposite ones for a bias"


@dataclass(frozen=True)
class Likeness:
    """How near a matrix is to a rotation.

    Attributes:
        determinant: 1 of a rotation.
        distance: Frobenius norm of its difference from the nearest rotation.
        orthogonality: Largest entry of |R'R - 1|.
        R: The nearest rotation, of the matrix's shape.
        angle: Of that [rad].
    """

    determinant: float
    distance: float
    orthogonality: float
    R: np.ndarray
    angle: float


def likeness(matrix: np.ndarray) -> Likeness:
    """Compare a matrix with the rotation nearest to it in the Frobenius norm.

    Args:
        matrix: Shape (2, 2) or (3, 3).
    """
    k = len(matrix)
    u, _, vt = np.linalg.svd(matrix)
    R = u @ np.diag([1.0] * (k - 1) + [float(np.sign(np.linalg.det(u @ vt)))]) @ vt
    whole = np.eye(3)
    whole[:k, :k] = R
    return Likeness(
        float(np.linalg.det(matrix)),
        float(np.linalg.norm(matrix - R)),
        float(np.abs(matrix.T @ matrix - np.eye(k)).max()),
        R,
        float(rotation.angle(rotation.from_matrix(whole))),
    )


def axes_in_plane(poses: StaticPoses, method: str) -> list[int]:
    """The two axes of the sensor whose plane holds all expected forces.

    Raises:
        InputError: No expected forces, or they do not lie in such a plane.
        PoorExcitation: They lie along one axis.
    """
    expected = poses.need_expected(method)
    share = np.abs(expected / np.linalg.norm(expected, axis=1, keepdims=True)).max(axis=0)
    plane = np.flatnonzero(share > IN_PLANE)
    if len(plane) < 2:
        raise PoorExcitation(
            ["rotation"],
            float("inf"),
            "forces along one axis only; poses along a second are needed",
        )
    if len(plane) > 2:
        raise InputError(
            f"{method} needs forces in the plane of two axes of the sensor; these poses have them "
            "along all three; "
            "use a method in three dimensions"
        )
    return [int(i) for i in plane]


def rotational_3d(poses: StaticPoses) -> TriadCalibration:
    """The general map as printed, without a bias.

    Raises:
        InputError: No expected forces.
        PoorExcitation: They lie in a plane.
    """
    return _mapped(poses, [0, 1, 2], "rotational_3d")


def rotational_2d(poses: StaticPoses) -> TriadCalibration:
    """The same by the two axes of the plane that the poses lie in; the third is left as it is.

    Raises:
        InputError: No expected forces, or they do not lie in a plane of two axes of the sensor.
        PoorExcitation: On a line.
    """
    return _mapped(poses, axes_in_plane(poses, "rotational_2d"), "rotational_2d")


def rotational_nearest(poses: StaticPoses) -> TriadCalibration:
    """The rotation that fits the poses best, and no bias.

    Raises:
        InputError: No expected forces.
        PoorExcitation: They lie along one line.
    """
    return _rotated(poses, False, "rotational_nearest")


def rotational_nearest_bias(poses: StaticPoses) -> TriadCalibration:
    """The rotation and the bias that fit the poses best.

    Raises:
        InputError: No expected forces.
        PoorExcitation: The poses do not tell bias from rotation.
    """
    return _rotated(poses, True, "rotational_nearest_bias")


def rotational_3d_bias(poses: StaticPoses) -> TriadCalibration:
    """The general map with a bias: force = R (reading - bias), by least squares on the forces, as
    printed but for the bias.

    Raises:
        InputError: No expected forces.
        PoorExcitation: Fewer than four poses, or all in a plane.
    """
    return _mapped(poses, [0, 1, 2], "rotational_3d_bias", with_bias=True)


def rotational_2d_bias(poses: StaticPoses) -> TriadCalibration:
    """The same by the two axes of the plane that the poses lie in; the third is left as it is.

    Raises:
        InputError: No expected forces, or not in such a plane.
        PoorExcitation: Fewer than three poses, or all on a line.
    """
    return _mapped(
        poses, axes_in_plane(poses, "rotational_2d_bias"), "rotational_2d_bias", with_bias=True
    )


def _mapped(
    poses: StaticPoses, axes: list[int], method: str, *, with_bias: bool = False
) -> TriadCalibration:
    """Least squares on force = R reading (+ offset), axis by axis."""
    expected = poses.need_expected(method)[:, axes]
    readings, k = poses.mean[:, axes], len(axes)
    regressors = np.column_stack([readings, np.ones(len(poses))]) if with_bias else readings
    names = [AXES[i] for i in axes]
    parameters: list[FitParameter] = []
    for i in names:
        parameters += [FitParameter(f"map_{i}{j}", "1", float(i == j), 1.0) for j in names]
        parameters += [
            FitParameter(f"offset_{i}", ACCELEROMETER.unit, 0.0, poses.magnitude)
        ] * with_bias
    sd = poses.typical_sd()
    fit = solve_linear(
        axis_by_axis(regressors, k) / sd,
        expected.reshape(-1) / sd,
        parameters,
        residual_unit=ACCELEROMETER.unit,
        residual_scale=sd,
        advice=ADVICE,
    )
    R, bias, matrix = fit.block("map_").reshape(k, k), np.zeros(3), np.eye(3)
    matrix[np.ix_(axes, axes)] = R
    remarks = list(_describe(R))
    if with_bias:
        bias[axes] = -np.linalg.solve(R, fit.block("offset_"))
    else:
        remarks.append("a bias is taken for part of the map, or left")
    if k == 2:
        remarks.append(
            f"the axis {next(a for a in AXES if a not in names)} is out of the plane and left as "
            "it is"
        )
    return TriadCalibration(method, matrix, bias, fits=(fit,), remarks=tuple(remarks))


def _rotated(poses: StaticPoses, with_bias: bool, method: str) -> TriadCalibration:
    """Reading = R_sensor_from_believed expected + bias; small rotations of R about the sensor's
    axes are its parameters.
    """
    expected = poses.need_expected(method)
    about = poses.mean.mean(axis=0) if with_bias else np.zeros(3)
    middle = expected.mean(axis=0) if with_bias else np.zeros(3)
    R = rotation.nearest_rotation((poses.mean - about).T @ (expected - middle))
    bias = about - R @ middle
    parameters = [FitParameter(f"rotation_{i}", "rad", 0.0, CROOKED) for i in AXES]
    parameters += (
        [FitParameter(f"bias_{i}", ACCELEROMETER.unit, 0.0, ACCELEROMETER.bias) for i in AXES]
        if with_bias
        else []
    )
    turned = expected @ R.T
    J = np.zeros((len(poses), 3, len(parameters)))
    J[:, :, :3] = -_cross(turned)  # d(exp(w) v)/dw = -[v]
    if with_bias:
        J[:, :, 3:] = np.eye(3)
    left = (turned + bias - poses.mean).reshape(-1)
    size = np.array([item.size for item in parameters])
    names = tuple(item.name for item in parameters)
    dof = max(float(left.size - len(parameters)), 1.0)
    covariance, condition = covariance_of(
        J.reshape(-1, len(parameters)) * size, float(left @ left) / dof, names, ADVICE
    )
    values = rotation.to_rotation_vector(rotation.from_matrix(R))
    fit = Fit(
        names,
        tuple(item.unit for item in parameters),
        np.concatenate([values, bias]) if with_bias else values,
        covariance * np.outer(size, size),
        dof,
        condition,
        left,
        ACCELEROMETER.unit,
    )
    return TriadCalibration(
        method,
        R.T,
        bias,
        fits=(fit,),
        remarks=(
            "the uncertainty of the rotation is about the axes of the sensor",
            "scale and cross-axis errors are left",
        ),
    )


def _cross(v: np.ndarray) -> np.ndarray:
    """Matrices [v] with [v] w = v x w, shape (m, 3) to (m, 3, 3)."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)


def _describe(R: np.ndarray) -> tuple[str, ...]:
    near = likeness(R)
    return (
        f"determinant {near.determinant:.4f}; R'R differs from 1 by up to {near.orthogonality:.4f}",
        (
            f"the nearest rotation, by {np.degrees(near.angle):.3f} deg, is {near.distance:.4f} "
            "away "
            "(Frobenius)"
        ),
    )
