"""Gyroscope calibration with the arm as a rate table: raw = S w + b + G f at every sample.

Linear in all 21 unknowns; IEEE Std 952-1997 tests a gyroscope so, and calls them scale factor,
misalignment, bias and acceleration sensitivity.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.gyroscope import AXES, BIAS_SIZE, G_SIZE, SCALE_SIZE
from testbench.estimation.calibration.turns import GyroscopeRecording
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import covariance_of
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

ADVICE = "motion about other axes, and other poses, are needed"


def rate_table(recording: GyroscopeRecording, g_sensitivity: bool = True) -> TriadCalibration:
    """Regress the readings on the arm's rates.

    Residuals of neighbouring samples may hang together (in-run bias, errors of time); the
    covariance is widened by their correlation time, as in Newey & West, Econometrica 55, 1987.

    Args:
        recording: Turns with `rate`, on the sensor's clock; rests count with rate zero.
        g_sensitivity: Whether to fit the response to specific force, which turns must then know;
            rests without it are left out.

    Raises:
        PoorExcitation: The motion does not determine a parameter.
        InputError: Nothing to calibrate from.
    """
    turns = [turn for turn in recording.turns if turn.rate is not None]
    if not turns:
        raise InputError(
            "rate_table needs turns whose rate is known at every sample; there are none"
        )
    if g_sensitivity and any(turn.force is None for turn in turns):
        raise InputError(
            "a response to specific force can only be fitted to turns whose force is known"
        )
    raw, designs = [], []
    for turn in turns:
        assert turn.rate is not None
        columns = [turn.rate, np.ones((len(turn.gyr), 1))] + (
            [turn.force] if g_sensitivity and turn.force is not None else []
        )
        raw.append(turn.gyr)
        designs.append(np.hstack(columns))
    for rest in recording.rests:
        n = len(rest.gyr)
        if g_sensitivity and rest.force is None:
            continue
        felt = [np.tile(rest.force, (n, 1))] if g_sensitivity and rest.force is not None else []
        raw.append(rest.gyr)
        designs.append(np.hstack([np.zeros((n, 3)), np.ones((n, 1)), *felt]))
    fit = _regress(np.concatenate(raw), np.concatenate(designs), g_sensitivity)
    width = 7 if g_sensitivity else 4
    table = fit.values.reshape(3, width)
    response = table[:, :3]
    g_matrix = table[:, 4:] if g_sensitivity else np.zeros((3, 3))
    return TriadCalibration(
        "rate_table", np.linalg.inv(response), table[:, 3].copy(), g_matrix.copy(), fits=(fit,)
    )


def _regress(raw: np.ndarray, design: np.ndarray, g_sensitivity: bool) -> Fit:
    """Least squares for each axis, raw = S w + b + G f; parameters axis by axis."""
    n, width = design.shape
    size = np.array([SCALE_SIZE] * 3 + [BIAS_SIZE] + ([G_SIZE] * 3 if g_sensitivity else []))
    names: list[str] = []
    units: list[str] = []
    for axis in AXES:
        names += [*(f"gyr_response_{axis}{other}" for other in AXES), f"gyr_bias_{axis}"]
        units += ["1"] * 3 + ["rad/s"]
        if g_sensitivity:
            names += [f"gyr_g_{axis}{other}" for other in AXES]
            units += ["rad/s/(m/s^2)"] * 3
    if n <= width:
        raise InputError(f"{n} samples are too few for the {width} unknowns of an axis")
    Q, R = np.linalg.qr(design * size)
    solution = np.linalg.pinv(R) @ (Q.T @ raw)
    left = raw - design @ (solution * size[:, None])
    covariance, condition, dof = np.zeros((3 * width, 3 * width)), 0.0, np.inf
    for i in range(3):
        together = correlation_time(left[:, i])
        variance = float(left[:, i] @ left[:, i]) / (n - width) * together
        block = slice(width * i, width * (i + 1))
        own, condition = covariance_of(R, variance, names[block], ADVICE)
        covariance[block, block] = own * np.outer(size, size)
        dof = min(dof, (n - width) / together)
    values = (solution * size[:, None]).T.ravel()
    return Fit(tuple(names), tuple(units), values, covariance, dof, condition, left, "rad/s")


def correlation_time(residuals: np.ndarray) -> float:
    """How many neighbouring residuals say the same; 1 for white ones.

    1 + 2 (sum of the autocorrelation up to its first zero); correlations that white noise of this
    length shows as well count as zero.

    Args:
        residuals: Shape (n,).
    """
    n = len(residuals)
    centred = residuals - residuals.mean()
    power = float(centred @ centred)
    if power <= 0:
        return 1.0
    length = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, length)) ** 2
    correlation = np.fft.irfft(spectrum, length)[1 : n // 4] / power
    within_noise = np.flatnonzero(correlation < 2 / np.sqrt(n))
    count = int(within_noise[0]) if len(within_noise) else len(correlation)
    return float(1 + 2 * correlation[:count].sum())
