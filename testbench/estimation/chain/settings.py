"""What the chain filter is told: noise of the sensors, the start, and noise of the process."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.frames import STANDARD_GRAVITY

START_RATE_SD = np.radians(0.2)
"""How still a joint at rest is held to be: rate [rad/s], and with it START_ACCELERATION_SD
[rad/s^2].
"""
START_ACCELERATION_SD = np.radians(2.0)
AMPLITUDE_SD, PART_OF_RANGE = np.radians(30.0), 0.25
"""How far the first harmonic of a joint angle may be expected to go [rad], or this part of the
joint's range where that is less; the k-th goes this over k^1.5. Walking moves hips, knees and
ankles by 5 to 21 deg in the first harmonic, and harmonics fall off faster than 1/k (fitted to the
curves of Perry & Burnfield, Gait Analysis, 2010).
"""
AMPLITUDE_FALL = 1.5
REST_AMPLITUDE_SD = np.radians(0.1)
"""The same at rest, where nothing swings [rad]."""
MEAN_PART = 0.1
"""How much less the mean angle changes than the first harmonic while a motion builds up [1]."""
OMEGA_SD = 0.05
"""Prior relative standard deviation of the base frequency, found beforehand in the rates [1]."""
RAISED_ABOVE, MEMORY_S, FALL_S = 3.0, 0.1, 0.3
"""Two levels of process noise of the Fourier state: mean normalised innovation squared above which
the amplitudes may change wholly within a second, as in a fade; memory of that mean, and time
constant with which the level falls back [s].
"""


@dataclass(frozen=True)
class SensorNoise:
    """What is known of one sensor beforehand.

    Attributes:
        gyr_sd: Of the white noise of a rate [rad/s].
        acc_sd: Of the white noise of a force [m/s^2].
        gyr_bias_sd: Of the gyroscope's bias at the start [rad/s].
        acc_bias_sd: Of the accelerometer's bias at the start [m/s^2].
        gyr_bias_walk: Growth of the gyroscope's bias [rad/s/sqrt(s)].
        acc_bias_walk: Growth of the accelerometer's bias [m/s^2/sqrt(s)].
        gyr_scale_sd: Of the scales of the gyroscope's axes [1].
        gyr_cross_sd: Of what an axis of the gyroscope reads of the others [1].
        acc_scale_sd: Of the scales of the accelerometer's axes [1].
        acc_cross_sd: Of what an axis of the accelerometer reads of the others [1].
        g_sd: Of the elements of the gyroscope's response to force [rad/s/(m/s^2)].
        gyr_cubic_sd: Of what an axis adds to a rate, over its third power [s^2/rad^2].
        acc_cubic_sd: Of what an axis adds to a force, over its third power [s^4/m^2].
        clock_sd: Of how much later than believed the samples were taken [s].
        clock_walk: Growth of it [s/sqrt(s)].
    """

    gyr_sd: float
    acc_sd: float
    gyr_bias_sd: float = 0.0
    acc_bias_sd: float = 0.0
    gyr_bias_walk: float = 0.0
    acc_bias_walk: float = 0.0
    gyr_scale_sd: float = 0.0
    gyr_cross_sd: float = 0.0
    acc_scale_sd: float = 0.0
    acc_cross_sd: float = 0.0
    g_sd: float = 0.0
    gyr_cubic_sd: float = 0.0
    acc_cubic_sd: float = 0.0
    clock_sd: float = 0.0
    clock_walk: float = 0.0

    @property
    def variance(self) -> np.ndarray:
        """Of the six readings, shape (6,)."""
        return np.repeat(np.square([self.gyr_sd, self.acc_sd]), 3)

    @property
    def bias_variance(self) -> np.ndarray:
        """Of the six biases at the start, shape (6,)."""
        return np.repeat(np.square([self.gyr_bias_sd, self.acc_bias_sd]), 3)

    @property
    def scale_variance(self) -> np.ndarray:
        """Of scales, cross-axis responses and nonlinearities at the start, shape (33,).

        Three rows of the gyroscope's matrix, each followed by that of its response to force, then
        three of the accelerometer's; then the nonlinearities of the six axes.
        """
        gyr, acc = (
            np.where(np.eye(3, dtype=bool), scale, cross)
            for scale, cross in (
                (self.gyr_scale_sd, self.gyr_cross_sd),
                (self.acc_scale_sd, self.acc_cross_sd),
            )
        )
        cubic = np.repeat([self.gyr_cubic_sd, self.acc_cubic_sd], 3)
        return (
            np.concatenate(
                [np.hstack([gyr, np.full((3, 3), self.g_sd)]).ravel(), acc.ravel(), cubic]
            )
            ** 2
        )

    @property
    def walk(self) -> np.ndarray:
        """Growth of the variance of the six biases, shape (6,) [unit^2/s]."""
        return np.repeat(np.square([self.gyr_bias_walk, self.acc_bias_walk]), 3)


@dataclass(frozen=True)
class FilterSettings:
    """How the filter runs.

    Attributes:
        harmonics: Of the Fourier state; 0 for the kinematic one.
        biases: Whether the biases of the sensors and their clocks are states.
        scales: Whether their errors of scale, axes and linearity are states too.
        noise: Of each sensor, in the order of ChainSensors.
        start: Stated start pose, shape (m,) [rad].
        start_sd: Standard deviation of each of its angles [rad].
        process_noise: Kinematic: square root of the power spectral density of the jerk
            [rad/s^3/sqrt(Hz)]; Fourier: random walk of the coefficients of the first harmonic
            [rad/sqrt(s)], the k-th over k^1.5.
        amplitude: How far each joint may be expected to swing, shape (m,) or one for all [rad];
            Fourier only.
        frequency: First guess of the base frequency [Hz]; Fourier only.
        limits: Whether joint limits hold.
        pose_sd: How far each sensor's body may be tilted at rest against every pose that the joints
            can give it, about each axis [rad].
    """

    harmonics: int
    noise: list[SensorNoise]
    start: np.ndarray
    start_sd: float
    process_noise: float
    biases: bool = True
    scales: bool = False
    amplitude: np.ndarray | float = AMPLITUDE_SD
    frequency: float = 1.0
    limits: bool = True
    pose_sd: float = 0.0

    @property
    def rest_variance(self) -> np.ndarray:
        """Of mean readings at rest beside their noise, shape (6,): gravity in a tilted body."""
        return np.repeat(np.square([0.0, STANDARD_GRAVITY * self.pose_sd]), 3)

    @property
    def error_variance(self) -> np.ndarray:
        """Of the sensor errors that are states: biases of all sensors, then clocks, then scales."""
        biases = [noise.bias_variance for noise in self.noise if self.biases]
        clocks = [np.array([noise.clock_sd**2]) for noise in self.noise if self.biases]
        scales = [noise.scale_variance for noise in self.noise if self.biases and self.scales]
        return np.concatenate([np.zeros(0), *biases, *clocks, *scales])

    def jerk(self, m: int) -> np.ndarray:
        """Power spectral density of the jerk of each joint, shape (m,)."""
        return np.full(m, 0.0 if self.harmonics else self.process_noise**2)

    def walk(self, m: int) -> np.ndarray:
        """Growth of the variance of each state, shape (n,)."""
        errors = np.zeros_like(self.error_variance)
        if self.biases:
            clocks = [noise.clock_walk**2 for noise in self.noise]
            errors[: 7 * len(self.noise)] = np.concatenate(
                [*[noise.walk for noise in self.noise], clocks]
            )
        motion = np.zeros(3 * m)
        if self.harmonics:
            motion = np.append(np.repeat(self.process_noise**2 * self._fall() ** 2, m), 0.0)
        return np.concatenate([motion, errors])

    def raised(self, m: int) -> np.ndarray:
        """What is added to `walk` at the raised level, shape (n,)."""
        motion = np.zeros(3 * m)
        if self.harmonics:
            part = self._fall()
            part[0] = MEAN_PART
            motion = np.append(np.outer(part, np.full(m, self.amplitude)).ravel() ** 2, 0.0)
        return np.concatenate([motion, np.zeros_like(self.error_variance)])

    def coefficient_sd(self, m: int) -> np.ndarray:
        """Prior standard deviation of the coefficients at rest, shape (m (2 n + 1),) [rad].

        It is wide for the mean angle.
        """
        sd = np.repeat(REST_AMPLITUDE_SD * self._fall(), m)
        sd[:m] = AMPLITUDE_SD
        return sd

    def levels(self) -> np.ndarray:
        """As `kernel.FilterPoint` has them at the start, shape (5,)."""
        return np.array([RAISED_ABOVE, MEMORY_S, 1.0, 0.0, FALL_S])

    def _fall(self) -> np.ndarray:
        k = np.repeat(np.arange(1, self.harmonics + 1), 2)
        return np.concatenate([[1.0], 1.0 / k**AMPLITUDE_FALL])
