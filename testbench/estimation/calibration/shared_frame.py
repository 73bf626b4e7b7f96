"""One frame for all triads: the mounting that some methods leave in a triad's matrix is taken out
and stored once, for all.

Methods that know the arm's orientation correct a triad into the axes as believed; others
(`norm_only`, `ellipsoid`, `static_bias`, the device's own quaternion) keep the sensor's. Every
matrix is split as M = R P into the nearest rotation R and the rest (polar decomposition; Higham,
SIAM J. Sci. Stat. Comput. 7(4), 1986). Of one triad R is taken for all: the accelerometer's, or the
gyroscope's where only that one knew the arm. It is stored as the mounting, and R' M in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.gyroscope import matrix_of
from testbench.estimation.calibration.methods import METHODS
from testbench.estimation.calibration.static_poses import LEAST_TURN
from testbench.model import rotation
from testbench.records.results.calibration import MountingCalibration, TriadCalibration
from testbench.records.results.fit import Fit

STEP = 1e-6
"""Of a parameter in a numeric derivative, in its own unit [1, rad]: its square is lost beside a
matrix of 1.
"""
NAMES = ("rotation_x", "rotation_y", "rotation_z")
APART = (
    "its parameters are stated in the axes as believed; the matrix is without the mounting, "
    "which is applied after it"
)


def in_believed_axes(found: TriadCalibration) -> bool:
    """Whether a triad was corrected into the axes that the mounting as believed gives it."""
    return METHODS[found.method].axes == "believed"


def take_mounting_out(
    triads: dict[str, TriadCalibration], keep_small: bool = True
) -> tuple[dict[str, TriadCalibration], MountingCalibration | None, list[str]]:
    """Split the rotation that is common to the arm-aided triads from their matrices.

    A rotation below `LEAST_TURN` may as well be cross-axis error of the triad itself. It turns no
    other triad and stays.

    Args:
        triads: As the methods gave them.
        keep_small: Whether a small rotation stays; where a mounting is found by itself, none must.

    Returns:
        The triads in one frame; the mounting, or None where no method contains it or it is small;
        and remarks.
    """
    aided = [
        name
        for name in ("accelerometer", "gyroscope")
        if name in triads and in_believed_axes(triads[name])
    ]
    if not aided:
        found = triads.get("magnetometer")
        alone = found is not None and in_believed_axes(found)
        remark = (
            "the magnetometer is in the axes as believed and the other triads are in the sensor's "
            "own; where the mounting is "
            "crooked, calibrate the accelerometer by the arm too"
        )
        return triads, None, [remark] if alone else []
    source = triads[aided[0]]
    R = rotation.nearest_rotation(source.matrix)
    if keep_small and float(rotation.angle(rotation.from_matrix(R))) < LEAST_TURN:
        return triads, None, []
    with_accelerometer = aided[0] == "accelerometer"
    turned = {}
    for name, found in triads.items():
        inside = in_believed_axes(found) or (
            with_accelerometer and METHODS[found.method].axes == "accelerometer"
        )
        matrix = R.T @ found.matrix if inside else found.matrix
        # The response to force is that to the corrected one, which is turned too where the
        # accelerometer's matrix is.
        g_matrix = found.g_matrix @ R if with_accelerometer else found.g_matrix
        remarks = (*found.remarks, APART) if inside else found.remarks
        turned[name] = replace(found, matrix=matrix, g_matrix=g_matrix, remarks=remarks)
    fit = Fit(
        NAMES,
        ("rad",) * 3,
        rotation.to_rotation_vector(rotation.from_matrix(R)),
        _covariance(source.fits, R),
        min((part.dof for part in source.fits), default=float("inf")),
        max((part.condition for part in source.fits), default=float("nan")),
    )
    remark = (
        f"the rotation nearest to the {aided[0]}'s matrix: its axes as a whole, with half of "
        "what cross-axis error it has"
    )
    return turned, MountingCalibration(f"from {source.method}", R, fit, (remark,)), []


def _covariance(fits: Sequence[Fit], R: np.ndarray) -> np.ndarray:
    """Of the small rotation of the nearest rotation about the axes as believed, shape (3, 3)
    [rad^2].
    """
    names = [name for fit in fits for name in fit.names]
    values = np.concatenate([fit.values for fit in fits])
    covariance, first = np.zeros((len(values), len(values))), 0
    for fit in fits:
        block = slice(first, first := first + len(fit.values))
        covariance[block, block] = fit.covariance
    if "rotation_x" in names:  # a small rotation about the sensor's axes, whose inverse this is
        return np.asarray(R @ covariance[:3, :3] @ R.T)

    def turn(theta: np.ndarray) -> np.ndarray:
        near = rotation.nearest_rotation(_matrix(names, theta))
        return np.asarray(rotation.to_rotation_vector(rotation.from_matrix(near @ R.T)))

    steps = np.eye(len(values)) * STEP
    J = np.array([(turn(values + step) - turn(values - step)) / (2 * STEP) for step in steps]).T
    return np.asarray(J @ covariance @ J.T)


def _matrix(names: list[str], theta: np.ndarray) -> np.ndarray:
    """The matrix of a triad by its method's parameters, shape (3, 3)."""
    if "gyr_scale_x" in names:
        return matrix_of(theta)[0]
    matrix = np.eye(3)
    for name, value in zip(names, theta, strict=True):
        kind, _, entry = name.removeprefix("gyr_").partition("_")
        if kind in {"response", "map"}:
            matrix["xyz".index(entry[0]), "xyz".index(entry[1])] = value
    return matrix if "map_xx" in names or "map_yy" in names else np.asarray(np.linalg.inv(matrix))
