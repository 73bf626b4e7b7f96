"""How a magnetometer's axes sit against the accelerometer's, by a dip that is always the same.

Vertical u and field m, each in its own axes: u . R m = -|m| sin(dip) whatever the pose, which the
heading does not enter (Kok & Schon, Magnetometer calibration using inertial sensors, IEEE Sensors
Journal 16(14), 2016, in its static form). The dip is found too; it is positive where the field
points down.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.ellipsoid import symmetric, symmetric_root, with_magnitude
from testbench.estimation.calibration.norm_fit import ellipsoid_through, searched
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import (
    MAGNETOMETER,
    Tolerance,
    bias_parameters,
    response_parameters,
)
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.model.statistics.least_squares import FitParameter
from testbench.model.statistics.linear import whitening
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence

CROOKED = np.radians(10.0)
"""Standard deviation beforehand of the rotation, about each axis, and of the dip [rad]."""
ADVICE = "poses that turn the sensor about two axes at least, upside down too, are needed"


def ellipsoid_dip(poses: StaticPoses, tolerance: Tolerance = MAGNETOMETER) -> TriadCalibration:
    """Hard iron, soft iron and axes together, from length and dip of the field in each pose.

    corrected = A (raw - bias), with A general. Each pose gives |A (raw - bias)| = F and u . A (raw
    - bias) = -F sin(dip).

    Args:
        poses: With `vertical`; seven at least. Where `magnitude` is NaN the ellipsoid's own is
            taken.
        tolerance: Known beforehand.

    Raises:
        InputError: No vertical.
        PoorExcitation: The poses leave a parameter vaguer than its tolerance.
    """
    # Longer than a screen: residuals and their derivatives share the poses and the whitening.
    if poses.vertical is None:
        raise InputError(
            "the method ellipsoid_dip needs the vertical of each pose, from a calibrated "
            "accelerometer; see ellipsoid"
        )
    poses, unknown = with_magnitude(poses)
    u, F, x = poses.vertical, poses.magnitude, poses.mean
    assert u is not None
    guess = ellipsoid_through(x)
    bias, A = (
        (np.zeros(3), np.eye(3))
        if guess is None
        else (guess[0], symmetric(symmetric_root(F**2 * guess[1])))
    )
    R, dip = _start((x - bias) @ A.T / F, u)
    begin = np.linalg.inv(R @ A).reshape(-1)
    parameters = [
        FitParameter(item.name, item.unit, float(value), item.size)
        for item, value in zip(response_parameters(tolerance), begin, strict=True)
    ]
    parameters += [*bias_parameters(tolerance, bias), FitParameter("dip", "rad", dip, CROOKED)]
    whiten = whitening(_covariance(poses, R @ A, bias, dip))

    def split(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        A = np.linalg.inv(theta[:9].reshape(3, 3))
        h = (x - theta[9:12]) @ A.T
        return A, h, np.linalg.norm(h, axis=1)

    def residuals(theta: np.ndarray) -> np.ndarray:
        # |A (raw - bias)| - F, and u . A (raw - bias) + F sin(dip)
        _, h, length = split(theta)
        pair = np.column_stack([length - F, np.sum(u * h, axis=1) + F * np.sin(theta[12])])
        return np.asarray(np.einsum("mij,mj->mi", whiten, pair)).reshape(-1)

    def jacobian(theta: np.ndarray) -> np.ndarray:
        A, h, length = split(theta)
        # what each residual takes of a change of h; dA = -A dM A
        rows = np.stack([h / length[:, None], u], axis=1)
        J = np.zeros((len(x), 2, 13))
        J[:, :, :9] = -((rows @ A)[:, :, :, None] * h[:, None, None, :]).reshape(len(x), 2, 9)
        J[:, :, 9:12] = -rows @ A
        J[:, 1, 12] = F * np.cos(theta[12])
        return np.asarray((whiten @ J).reshape(-1, 13))

    fit = searched(residuals, jacobian, parameters, guess is not None, ADVICE)
    matrix = np.linalg.inv(fit.values[:9].reshape(3, 3))
    remarks: tuple[str, ...] = (f"the field dips by {np.degrees(fit['dip']):.2f} deg",)
    if unknown:
        remarks += (
            f"the field's length was not given; it is taken to be {F:.3f} {tolerance.unit}",
        )
    A, h, length = split(fit.values)
    reach = -whiten @ np.stack([h / length[:, None], u], axis=1) @ A
    evidence = Evidence(fit.residuals, jacobian(fit.values), reach)
    return TriadCalibration(
        "ellipsoid_dip",
        matrix,
        fit.values[9:12],
        fits=(fit,),
        remarks=remarks,
        evidence=evidence,
    )


def _start(m: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
    """Rotation and dip from the null vector of u . G m + s = 0; no rotation where that is none."""
    design = np.column_stack([(u[:, :, None] * m[:, None, :]).reshape(-1, 9), np.ones(len(u))])
    if len(u) >= 9:
        null = np.linalg.svd(design)[2][-1]
        G, s = null[:9].reshape(3, 3), null[9]
        if np.linalg.det(G) < 0:
            G, s = -G, -s
        size = np.cbrt(abs(np.linalg.det(G)))
        if size > 1e-3 and abs(s) < size:
            R = rotation.nearest_rotation(G)
            return R, float(np.arcsin(np.clip(-np.mean(np.sum(u * (m @ R.T), axis=1)), -1, 1)))
    return np.eye(3), float(np.arcsin(np.clip(-np.mean(np.sum(u * m, axis=1)), -1, 1)))


def _covariance(poses: StaticPoses, A: np.ndarray, bias: np.ndarray, dip: float) -> np.ndarray:
    """Covariance of both residuals of each pose, shape (m, 2, 2).

    Noise of the field, and in the second residual of the vertical's direction.
    """
    assert poses.vertical is not None
    h = (poses.mean - bias) @ A.T
    rows = np.stack([h / np.linalg.norm(h, axis=1, keepdims=True), poses.vertical], axis=1) @ A
    covariance = np.einsum("mij,mj,mkj->mik", rows, poses.variance, rows)
    covariance[:, 1, 1] += (poses.magnitude * np.cos(dip) * poses.vertical_sd) ** 2
    return np.asarray(covariance)
