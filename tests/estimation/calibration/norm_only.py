"""An accelerometer calibrated by the norm of gravity alone, as the tests of gyroscopes need it."""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.least_squares import Parameter, solve


def calibrated_force(acc: np.ndarray, rests: list[tuple[int, int]], gravity: float) -> np.ndarray:
    """Specific force of a raw accelerometer, shape (n, 3): nine parameters from the norms of its means at rest."""
    means = np.array([acc[begin:end].mean(axis=0) for begin, end in rests])
    parameters = [Parameter(f"scale_{axis}", "1", 1.0, 0.05) for axis in "xyz"]
    parameters += [Parameter(name, "rad", 0.0, 0.05) for name in ("yz", "zy", "zx")]
    parameters += [Parameter(f"bias_{axis}", "m/s^2", 0.0, 1.0) for axis in "xyz"]

    def corrected(theta: np.ndarray, readings: np.ndarray) -> np.ndarray:
        T = np.array([[1, -theta[3], theta[4]], [0, 1, -theta[5]], [0, 0, 1]])
        return (readings - theta[6:]) @ (T * theta[:3]).T

    fit = solve(lambda theta: np.linalg.norm(corrected(theta, means), axis=1) - gravity, parameters)
    return corrected(fit.values, acc)
