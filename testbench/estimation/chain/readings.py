"""What the chain filter takes of a sensor: calibrated readings, and what is known of its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.chain.settings import SensorNoise
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.statistics.intervals import gradient
from testbench.records.results.estimate import CalibrationFit, ClockFit, SensorEstimate
from testbench.records.session.sensor_file import SensorFile
from testbench.records.specs.sensor import ImuParameters, TriadParameters

LEAST_SAMPLES = 10
GYR_SD_FLOOR, ACC_SD_FLOOR = np.radians(0.02), 0.005
"""A sensor is not believed better than this, however quiet at rest: jitter of its clock and what is
left of its scale [rad/s], [m/s^2].
"""
CALIBRATED_SD = (2e-4, 2e-4)
"""What a calibration by static poses leaves of the accelerometer's scale and axes, as a standard
deviation [1]: the arm's own angles are good to 0.01 deg.
"""
CALIBRATED_BIAS_SD = 0.02
"""A calibration whose biases are less certain than this saw too few poses, and the data sheet is
believed instead [m/s^2].
"""


def calibrated(
    file: SensorFile, name: str, sensor: SensorEstimate, sheet: ImuParameters
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When samples that no gate refuses were true [s], their rates [rad/s] and forces [m/s^2].

    What the sensor's low pass took is put back: of a first-order one y of time constant T, the
    input is y + T dy/dt. A sensor that integrates gives means over the interval before its stamp,
    the force in the axes at its end.
    """
    if sensor.every > 1:
        raise InputError(
            f"{name} is too long a recording: estimates are kept at one of {sensor.every} of its "
            "samples, and the chain filter needs all; import a part of it"
        )
    samples = file.read()
    rate, force, _ = sensor.calibration.apply(samples.gyr, samples.acc, None)
    sound = ~sensor.flagged & np.isfinite(rate).all(axis=1) & np.isfinite(force).all(axis=1)
    time, rate, force = sensor.host_time_ns[sound] / NANOSECONDS, rate[sound], force[sound]
    if len(time) < LEAST_SAMPLES:
        raise InputError(
            f"{name} has {len(time)} samples that no gate refuses; {LEAST_SAMPLES} are needed"
        )
    rate = _without_low_pass(time, rate, sheet.gyroscope.bandwidth_hz)
    force = _without_low_pass(time, force, sheet.accelerometer.bandwidth_hz)
    if sheet.sampling == "integrated":
        half = 0.5 / sheet.rate_hz
        force = rotation.rotate(rotation.from_rotation_vector(rate * half), force)
        time = time - half
    return time, rate, force


def _without_low_pass(time: np.ndarray, reading: np.ndarray, bandwidth: float | None) -> np.ndarray:
    if bandwidth is None:
        return reading
    return np.asarray(reading + gradient(reading, time) / (2 * np.pi * bandwidth))


def rest_noise(
    sheet: ImuParameters,
    calibration: CalibrationFit,
    rate: np.ndarray,
    force: np.ndarray,
    scales: bool,
) -> SensorNoise:
    """White noise as measured at rest, biases by the calibration or else by the data sheet.

    A gyroscope's response to gravity acts like a bias, and so does an accelerometer's scale where
    it is no state of its own.

    Args:
        sheet: What its maker states.
        calibration: What was fitted to it, if anything.
        rate: Angular rates at rest, shape (n, 3) [rad/s].
        force: Specific forces at rest, shape (n, 3) [m/s^2].
        scales: Whether errors of scale and axes are states.
    """
    gyroscope, accelerometer = sheet.gyroscope.triad(), sheet.accelerometer.triad()
    calibrated = calibration.method != "none" and bool(
        (calibration.acc_bias_sd <= CALIBRATED_BIAS_SD).all()
    )
    gyr_bias = np.hypot(gyroscope.bias_sd, STANDARD_GRAVITY * gyroscope.g_sensitivity_sd)
    if calibrated:
        gyr_bias = _worst(calibration.gyr_bias_sd, gyr_bias)
    acc_bias = (
        _worst(calibration.acc_bias_sd, accelerometer.bias_sd)
        if calibrated
        else accelerometer.bias_sd
    )
    axes = CALIBRATED_SD if calibrated else (accelerometer.scale_sd, accelerometer.cross_axis_sd)
    if not scales:
        acc_bias = np.hypot(acc_bias, STANDARD_GRAVITY * np.hypot(*axes))
    return SensorNoise(
        gyr_sd=max(_white(rate), GYR_SD_FLOOR),
        acc_sd=max(_white(force), ACC_SD_FLOOR),
        gyr_bias_sd=float(np.hypot(gyr_bias, gyroscope.bias_instability)),
        acc_bias_sd=float(np.hypot(acc_bias, accelerometer.bias_instability)),
        gyr_bias_walk=_wandering(gyroscope),
        acc_bias_walk=_wandering(accelerometer),
        gyr_scale_sd=gyroscope.scale_sd,
        gyr_cross_sd=gyroscope.cross_axis_sd,
        acc_scale_sd=axes[0],
        acc_cross_sd=axes[1],
        g_sd=0.0 if calibrated else gyroscope.g_sensitivity_sd,
        gyr_cubic_sd=gyroscope.nonlinearity / gyroscope.range**2,
        acc_cubic_sd=accelerometer.nonlinearity / accelerometer.range**2,
    )


def with_clock(noise: SensorNoise, clock: ClockFit, seconds: float) -> SensorNoise:
    """With what the fit of the sensor's clock leaves.

    Its offset, and its drift as a random walk that grows as far in a section of that length. A
    sensor on the host's clock, or one that no motion was found for, is taken at its word.
    """
    offset, drift = (
        value if np.isfinite(value) else 0.0
        for value in (clock.offset_sd_s, 1e-6 * clock.drift_sd_ppm)
    )
    return replace(noise, clock_sd=offset, clock_walk=drift * np.sqrt(seconds))


def _wandering(triad: TriadParameters) -> float:
    """Growth of the bias [unit/sqrt(s)]: random walk and the start of a Gauss-Markov process."""
    return float(
        np.hypot(
            triad.bias_instability * np.sqrt(2 / triad.bias_time_constant), triad.bias_random_walk
        )
    )


def _white(readings: np.ndarray) -> float:
    """Standard deviation of white noise in readings at rest, shape (n, 3), by differences."""
    return float(np.sqrt(np.mean(np.diff(readings, axis=0) ** 2) / 2))


def _worst(fitted: np.ndarray, otherwise: float) -> float:
    known = fitted[np.isfinite(fitted)]
    return float(known.max()) if len(known) else otherwise
