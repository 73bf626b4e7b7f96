"""The accelerometer that a study of gyroscopes takes gravity's direction from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.estimation.calibration.least_squares import Parameter, solve
from testbench.records.calibration import TriadCalibration


def calibrate_by_norm(rests: Sequence[np.ndarray], gravity: float) -> TriadCalibration:
    """Nine parameters from the norm of gravity at rest (Tedaldi, Pretto & Menegatti, ICRA 2014).

    corrected = T K (raw - b), T = [[1, -yz, zy], [0, 1, -zx], [0, 0, 1]], K = diag(scale).

    Args:
        rests: Raw samples of each rest, shape (n_i, 3) [m/s^2]. gravity: Its magnitude [m/s^2].

    Raises:
        PoorExcitation: The rests do not determine a parameter.
    """
    means = np.array([rest.mean(axis=0) for rest in rests])
    parameters = [Parameter(f"acc_scale_{axis}", "1", 1.0, 0.05) for axis in "xyz"]
    parameters += [Parameter(f"acc_misalignment_{name}", "rad", 0.0, 0.05) for name in ("yz", "zy", "zx")]
    parameters += [Parameter(f"acc_bias_{axis}", "m/s^2", 0.0, 1.0) for axis in "xyz"]

    def matrix(theta: np.ndarray) -> np.ndarray:
        return np.array([[1, -theta[3], theta[4]], [0, 1, -theta[5]], [0, 0, 1]]) * theta[:3]

    def residuals(theta: np.ndarray) -> np.ndarray:
        return np.linalg.norm((means - theta[6:]) @ matrix(theta).T, axis=1) - gravity

    fit = solve(residuals, parameters, residual_unit="m/s^2", advice="rests with other sides up are needed")
    return TriadCalibration("norm_only", matrix(fit.values), fit.values[6:], fits=(fit,))
