"""Nine parameters of an accelerometer from the length of gravity alone, in any poses.

Tedaldi, Pretto & Menegatti, A robust and easy to implement method for IMU calibration without
external equipments, ICRA 2014, eqs 2 to 10: corrected = T K (raw - bias), T = [[1, -yz, zy], [0, 1,
-zx], [0, 0, 1]], K = diag(scale). There the bias is added; here it is subtracted. Others write the
same correction as A (x - o) with A = (K T)^-1 upper triangular.

Gauge: lengths do not change when all forces are turned together, so three angles stay unknown and
are fixed by T being upper triangular. As Tedaldi reads it, with readings as components along the
axes, the x axis is kept and y stays in the plane of x and y. Where readings are projections onto
the sensitive axes, the same T keeps the sensitive axis z, and y stays in the plane of y and z.
Either way the corrected axes are an orthogonal triad that is not turned into those of the housing.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.norm_fit import MatrixModel, fit_norm
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.triad_model import ACCELEROMETER, AXES, Tolerance
from testbench.model.statistics.least_squares import FitParameter
from testbench.records.results.calibration import TriadCalibration

GAUGE = (
    "the orthogonal axes are fixed by an upper triangular matrix; how they sit in the housing "
    "is not seen"
)


def norm_only(poses: StaticPoses, tolerance: Tolerance = ACCELEROMETER) -> TriadCalibration:
    """Misalignment, scale and bias, and the bias's drift where the temperature varied.

    Args:
        poses: Nine at least, more to have an uncertainty from their scatter.
        tolerance: Known beforehand.

    Raises:
        PoorExcitation: Fewer poses than parameters, or poses in a plane.
    """
    shape = [
        FitParameter(f"misalignment_{i}", "rad", 0.0, tolerance.response)
        for i in ("yz", "zy", "zx")
    ]
    shape += [FitParameter(f"scale_{i}", "1", 1.0, tolerance.response) for i in AXES]

    def start(Q: np.ndarray) -> np.ndarray:
        # Q = A' A with A = T K upper triangular
        A = np.linalg.cholesky(Q).T
        scale = np.diag(A)
        return np.array([-A[0, 1] / scale[1], A[0, 2] / scale[2], -A[1, 2] / scale[2], *scale])

    def matrix_of(theta: np.ndarray) -> np.ndarray:
        return _skewed(theta) * theta[3:]  # T K, of Tedaldi's model

    def gradient_of(theta: np.ndarray) -> np.ndarray:
        d = np.zeros((6, 3, 3))
        d[0, 0, 1], d[1, 0, 2], d[2, 1, 2] = -theta[4], theta[5], -theta[5]
        T = _skewed(theta)
        for i in range(3):
            d[3 + i, :, i] = T[:, i]
        return d

    model = MatrixModel(shape, start, matrix_of, gradient_of)
    return fit_norm(poses, model, tolerance, "norm_only", (GAUGE,))


def _skewed(theta: np.ndarray) -> np.ndarray:
    yz, zy, zx = theta[:3]
    return np.array([[1.0, -yz, zy], [0.0, 1.0, -zx], [0.0, 0.0, 1.0]])
