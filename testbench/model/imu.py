"""The measurement model of an inertial sensor: from what happens to what is reported.

y = quantise(clip(M f(x) + b + w(t) + noise)), where M holds scale and cross-axis errors, f the
bandwidth and a cubic nonlinearity, b the turn-on bias, and w the in-run bias (Gauss-Markov and
random walk); IEEE Std 952 and 1293 name the same terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.model import rotation
from testbench.model.noise import GaussMarkov, RandomWalk, first_order, random_stream
from testbench.records.specs.sensor import DeviceOrientation, TriadParameters

SHEET_TEMPERATURE = 25.0
"""At which data sheets of MEMS sensors state their numbers [deg C]."""


@dataclass(frozen=True)
class TriadErrors:
    """The errors one part was made with, or turned on with.

    Attributes:
        matrix: Scale and cross-axis sensitivity, shape (3, 3).
        bias: At 25 deg C, shape (3,) [unit].
        g_matrix: Response of a gyroscope to specific force, shape (3, 3) [unit/(m/s^2)].
        drift: Change of the bias with temperature, shape (3,) [unit/K].
    """

    matrix: np.ndarray
    bias: np.ndarray
    g_matrix: np.ndarray
    drift: np.ndarray

    @staticmethod
    def draw(
        triad: TriadParameters, rng: np.random.Generator, thermal: np.random.Generator
    ) -> TriadErrors:
        """Errors of one part of the production.

        Args:
            triad: The data sheet, whose spreads are drawn from.
            rng: For all errors but the drift.
            thermal: For the drift with temperature.
        """
        scale = triad.scale_sd * rng.standard_normal(3)
        cross = triad.cross_axis_sd * rng.standard_normal((3, 3))
        np.fill_diagonal(cross, scale)
        bias = triad.bias_sd * rng.standard_normal(3)
        drift = triad.bias_drift_sd * thermal.standard_normal(3)
        return TriadErrors(
            np.eye(3) + cross, bias, triad.g_sensitivity_sd * rng.standard_normal((3, 3)), drift
        )


class TriadModel:
    """Three sensing axes that report at a fixed rate.

    Args:
        triad: The data sheet.
        rate: Output rate [Hz].
        seed: Of the run.
        *labels: Name this triad; they select its random numbers.
        drawn_as: Name, in place of the first label, that its lasting errors are drawn by:
            several sensors of one name are one device.
        part: Seed of those errors; that of the run if None.
    """

    def __init__(
        self,
        triad: TriadParameters,
        rate: float,
        seed: int,
        *labels: str,
        drawn_as: str | None = None,
        part: int | None = None,
    ):
        self.triad = triad
        device = labels if drawn_as is None else (drawn_as, *labels[1:])
        made = seed if part is None else part
        self.errors = TriadErrors.draw(
            triad, random_stream(made, *device, "part"), random_stream(made, *device, "thermal")
        )
        interval = 1.0 / rate
        self._bias = GaussMarkov(
            triad.bias_instability,
            triad.bias_time_constant,
            interval,
            3,
            random_stream(seed, *labels, "bias instability"),
        )
        self._walk = RandomWalk(
            triad.bias_random_walk, interval, 3, random_stream(seed, *labels, "bias walk")
        )
        self._noise = random_stream(seed, *labels, "noise")
        self._noise_sd = triad.noise_density * np.sqrt(rate / 2)
        self._low_pass_coefficients = (
            None if triad.bandwidth is None else low_pass_coefficients(triad.bandwidth, rate)
        )
        self._filter_state: np.ndarray | None = None

    def measure(
        self,
        x: np.ndarray,
        specific_force: np.ndarray | None = None,
        temperature: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is reported of a quantity.

        Args:
            x: The quantity in the sensor frame at the next n sampling instants, shape (n, 3)
                [unit].
            specific_force: Felt at the same instants, shape (n, 3) [m/s^2]; for gyroscopes.
            temperature: Of the part, shape (n,) [deg C]; that of the data sheet if None.

        Returns:
            Readings, shape (n, 3) [unit], and whether any axis was at full scale, shape (n,).
        """
        triad = self.triad
        if len(x) == 0:
            return np.zeros((0, 3)), np.zeros(0, dtype=bool)
        y = self._low_pass(x)
        y = y + triad.nonlinearity / triad.range**2 * y**3
        y = (
            y @ self.errors.matrix.T
            + self.errors.bias
            + self._bias.draw(len(y))
            + self._walk.draw(len(y))
        )
        if temperature is not None and triad.bias_drift_sd:
            y = y + (temperature - SHEET_TEMPERATURE)[:, None] * self.errors.drift
        if specific_force is not None:
            y = y + specific_force @ self.errors.g_matrix.T
        y = y + self._noise_sd * self._noise.standard_normal(y.shape)
        saturated = (np.abs(y) >= triad.range).any(axis=1)
        y = np.clip(y, -triad.range, triad.range)
        return (
            np.round(y / triad.resolution) * triad.resolution if triad.resolution else y
        ), saturated

    def _low_pass(self, x: np.ndarray) -> np.ndarray:
        if self._low_pass_coefficients is None:
            return x
        (b0, b1), (_, a1) = self._low_pass_coefficients
        if self._filter_state is None:
            settled = (b1 - a1 * b0) / (1 + a1)  # it has seen its first value for ever
            self._filter_state = settled * x[:1]
        return first_order(b0, b1, a1, np.ascontiguousarray(x), self._filter_state)


def low_pass_coefficients(bandwidth: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """First-order low pass for an input that is linear between samples.

    Its delay is exactly 1 / (2 pi bandwidth), also where the bandwidth is above the rate:
    ramp-invariant discretisation (Franklin, Powell & Workman, Digital Control of Dynamic Systems,
    1998, section 6.3).

    Args:
        bandwidth: -3 dB frequency [Hz].
        rate: Of the samples [Hz].

    Returns:
        Numerator and denominator, each of shape (2,).
    """
    omega = 2 * np.pi * bandwidth / rate
    pole = np.exp(-omega)
    return np.array([1 - (1 - pole) / omega, (1 - pole) / omega - pole]), np.array([1.0, -pole])


class DeviceOrientationModel:
    """A vendor's on-board filter: the true orientation with slow errors.

    It reports against an earth frame of its own heading.

    Args:
        parameters: Sizes of the errors.
        rate: Output rate [Hz].
        seed: Of the run.
        *labels: Name this filter; they select its random numbers.
    """

    def __init__(self, parameters: DeviceOrientation, rate: float, seed: int, *labels: str):
        power_up = random_stream(seed, *labels, "heading")
        self.heading = float(power_up.uniform(-np.pi, np.pi)) if parameters.heading_unknown else 0.0
        self._sd = np.radians(
            [
                parameters.inclination_sd_deg,
                parameters.inclination_sd_deg,
                parameters.heading_sd_deg,
            ]
        )
        self._slow = GaussMarkov(
            1.0, parameters.time_constant_s, 1.0 / rate, 3, random_stream(seed, *labels, "slow")
        )
        self._noise = random_stream(seed, *labels, "noise")
        self._noise_sd = np.radians(parameters.noise_sd_deg)

    def measure(self, q_world_from_sensor: np.ndarray) -> np.ndarray:
        """What the device reports.

        Args:
            q_world_from_sensor: True orientations at the next n sampling instants, shape (n, 4).

        Returns:
            q_earth_from_sensor, shape (n, 4).
        """
        n = len(q_world_from_sensor)
        error = self._sd * self._slow.draw(n) + self._noise_sd * self._noise.standard_normal((n, 3))
        q_earth_from_world = rotation.multiply(
            rotation.from_heading(self.heading), rotation.from_rotation_vector(error)
        )
        return rotation.multiply(q_earth_from_world, q_world_from_sensor)
