"""What the chain filter is told: of the sensors, of the start, and how lively the joints are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

START_RATE_SD = np.radians(0.2)
"""How still a joint at rest is held to be: rate [rad/s], and with it START_ACCELERATION_SD [rad/s^2]."""
START_ACCELERATION_SD = np.radians(2.0)
AMPLITUDE_SD = np.radians(30.0)
"""Prior standard deviation of the first harmonic of a joint angle [rad]; that of the k-th is this over k^1.5. Walking moves
hips, knees and ankles by 20 to 35 deg in the first harmonic, and harmonics fall off faster than 1/k (Winter, 2009, ch. 2)."""
AMPLITUDE_FALL = 1.5
OMEGA_SD = 0.05
"""Prior relative standard deviation of the base frequency, found beforehand in the rates [1]."""
RAISED, RAISED_ABOVE, MEMORY_S = 1e4, 3.0, 0.1
"""Raised level of process noise of the Fourier state: factor of the variance, mean normalised innovation squared above which it
holds, and memory of that mean [s]: a fade takes one cycle, in which the series must follow a hundred times faster than in
steady motion."""


@dataclass(frozen=True)
class SensorNoise:
    """What is known of one sensor beforehand.

    Attributes:
        gyr_sd, acc_sd: Of the white noise of one reading [rad/s], [m/s^2]. gyr_bias_sd, acc_bias_sd: Of the bias at the start.
        gyr_bias_walk, acc_bias_walk: Growth of its standard deviation [rad/s/sqrt(s)], [m/s^2/sqrt(s)].
    """

    gyr_sd: float
    acc_sd: float
    gyr_bias_sd: float = 0.0
    acc_bias_sd: float = 0.0
    gyr_bias_walk: float = 0.0
    acc_bias_walk: float = 0.0

    @property
    def variance(self) -> np.ndarray:
        """Of the six readings, shape (6,)."""
        return np.repeat(np.square([self.gyr_sd, self.acc_sd]), 3)

    @property
    def bias_variance(self) -> np.ndarray:
        """Of the six biases at the start, shape (6,)."""
        return np.repeat(np.square([self.gyr_bias_sd, self.acc_bias_sd]), 3)

    @property
    def walk(self) -> np.ndarray:
        """Growth of the variance of the six biases, shape (6,) [unit^2/s]."""
        return np.repeat(np.square([self.gyr_bias_walk, self.acc_bias_walk]), 3)


@dataclass(frozen=True)
class FilterSettings:
    """How the filter runs.

    Attributes:
        harmonics: Of the Fourier state; 0 for the kinematic one. biases: Whether the biases of the sensors are states.
        noise: Of each sensor, in the order of ChainSensors. start, start_sd: Stated start pose, shape (m,), and its standard
        deviation [rad]. liveliness: Kinematic: square root of the power spectral density of the jerk [rad/s^3/sqrt(Hz)];
        Fourier: random walk of the coefficients of the first harmonic [rad/sqrt(s)], the k-th over k^1.5.
        frequency: First guess of the base frequency [Hz]; Fourier only. limits: Whether joint limits hold.
    """

    harmonics: int
    noise: list[SensorNoise]
    start: np.ndarray
    start_sd: float
    liveliness: float
    biases: bool = True
    frequency: float = 1.0
    limits: bool = True

    def jerk(self, m: int) -> np.ndarray:
        """Power spectral density of the jerk of each joint, shape (m,)."""
        return np.full(m, 0.0 if self.harmonics else self.liveliness**2)

    def walk(self, m: int) -> np.ndarray:
        """Growth of the variance of each state, shape (n,)."""
        biases = np.concatenate([noise.walk for noise in self.noise]) if self.biases else np.zeros(0)
        if not self.harmonics:
            return np.concatenate([np.zeros(3 * m), biases])
        coefficients = np.repeat(self.liveliness**2 * self._fall() ** 2, m)
        return np.concatenate([coefficients, [0.0], biases])

    def coefficient_sd(self, m: int) -> np.ndarray:
        """Prior standard deviation of the coefficients, shape (m (2 n + 1),) [rad]."""
        return np.repeat(AMPLITUDE_SD * self._fall(), m)

    def levels(self) -> np.ndarray:
        """As `kernel.filter_chain` takes them; the kinematic state has one level."""
        return np.array([RAISED if self.harmonics else 1.0, RAISED_ABOVE, MEMORY_S, 1.0])

    def _fall(self) -> np.ndarray:
        k = np.repeat(np.arange(1, self.harmonics + 1), 2)
        return np.concatenate([[1.0], 1.0 / k**AMPLITUDE_FALL])
