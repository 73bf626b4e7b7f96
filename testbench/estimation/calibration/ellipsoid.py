"""Hard and soft iron of a magnetometer from the length of the field alone: corrected = S (raw -
hard), S symmetric.

Renaudin, Afzal & Lachapelle, Complete triaxis magnetometer calibration in the magnetic domain,
Journal of Sensors 2010.

Gauge: lengths do not change when all fields are turned together. S is taken to be symmetric, the
nearest of all such matrices to no correction at all; the axes of the magnetometer against those of
the accelerometer are a matter of `ellipsoid_dip`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.norm_fit import MatrixModel, ellipsoid_through, fit_norm
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import MAGNETOMETER, Tolerance
from testbench.model.statistics.least_squares import FitParameter
from testbench.records.results.calibration import TriadCalibration

ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")
BASIS = np.zeros((6, 3, 3))
"""Symmetric matrices, one for each entry."""
for _k, (_i, _j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
    BASIS[_k, _i, _j] = BASIS[_k, _j, _i] = 1.0
GAUGE = (
    "the matrix is taken to be symmetric; how the magnetometer's axes sit against the "
    "accelerometer's is not seen"
)


def ellipsoid(poses: StaticPoses, tolerance: Tolerance = MAGNETOMETER) -> TriadCalibration:
    """Hard iron (bias) and soft iron (symmetric matrix), and the bias's drift where the temperature
    varied.

    Args:
        poses: Nine at least. Where `magnitude` is NaN the field's length is taken from the
            ellipsoid itself, the geometric mean of its axes.
        tolerance: Known beforehand.

    Raises:
        PoorExcitation: Fewer poses than parameters, or the sensor was turned about one axis only.
    """
    remarks: tuple[str, ...] = (GAUGE,)
    poses, unknown = with_magnitude(poses)
    if unknown:
        remarks += (
            (
                f"the field's length was not given; it is taken to be {poses.magnitude:.3f} "
                f"{tolerance.unit}"
            ),
        )
    shape = [
        FitParameter(f"soft_{name}", "1", float(name[0] == name[1]), tolerance.response)
        for name in ENTRIES
    ]
    model = MatrixModel(shape, symmetric_root, symmetric, lambda _: BASIS)
    return fit_norm(poses, model, tolerance, "ellipsoid", remarks)


def with_magnitude(poses: StaticPoses) -> tuple[StaticPoses, bool]:
    """The poses with a length of the field, and whether it is that of their own ellipsoid."""
    if np.isfinite(poses.magnitude):
        return poses, False
    guess = ellipsoid_through(poses.mean)
    centred = poses.mean - (poses.mean.mean(axis=0) if guess is None else guess[0])
    size = (
        float(np.linalg.norm(centred, axis=1).mean())
        if guess is None
        else float(np.linalg.det(guess[1]) ** (-1 / 6))
    )
    return replace(poses, magnitude=size), True


def symmetric(theta: np.ndarray) -> np.ndarray:
    """A symmetric matrix, shape (3, 3), of its six entries.

    Args:
        theta: xx, yy, zz, xy, xz and yz, shape (6,).
    """
    return np.asarray(np.tensordot(theta, BASIS, 1))


def symmetric_root(Q: np.ndarray) -> np.ndarray:
    """The six entries of the positive root of a symmetric matrix, shape (6,).

    Args:
        Q: Shape (3, 3).
    """
    # |S (m - h)|^2 = (m - h)' Q (m - h) with S = V sqrt(L) V', the only symmetric positive S
    values, vectors = np.linalg.eigh(Q)
    root = vectors * np.sqrt(values) @ vectors.T
    return root[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
