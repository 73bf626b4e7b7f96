"""Sensors: inertial measurement units in terms of their data sheets, and presets that ship."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from pydantic import Field

from testbench.exceptions import InputError, NotFoundError
from testbench.frames import STANDARD_GRAVITY
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.specs.shipped import shipped_data, shipped_names
from testbench.records.specs.strict import Angles3, StrictModel

PRESETS = shipped_data("model", "presets")
PRESET_SUFFIXES = (".yaml", ".yml")
_G = STANDARD_GRAVITY
_DEG = np.pi / 180


@dataclass(frozen=True)
class TriadParameters:
    """Three orthogonal sensing axes in SI units; `unit` is m/s^2, rad/s or uT.

    Attributes:
        unit: Of all that is stated in [unit].
        range: Full scale, +- [unit].
        resolution: One count [unit], 0 for none.
        noise_density: One-sided, shape (3,) [unit/sqrt(Hz)].
        bandwidth: First-order low pass [Hz], None for none.
        bias_sd: Standard deviation of the turn-on bias [unit].
        bias_instability: Standard deviation of the in-run bias [unit].
        bias_time_constant: Of the in-run bias [s].
        bias_random_walk: Of the bias [unit/sqrt(s)].
        scale_sd: Standard deviation of the scale factors [1].
        cross_axis_sd: Standard deviation of the cross-axis factors [1].
        nonlinearity: Cubic, at full scale [1].
        g_sensitivity_sd: Standard deviation of the response of a gyroscope to force [unit/(m/s^2)].
        bias_drift_sd: Standard deviation of the change of the bias with temperature [unit/K].
    """

    unit: str
    range: float
    resolution: float
    noise_density: np.ndarray
    bandwidth: float | None
    bias_sd: float
    bias_instability: float
    bias_random_walk: float
    scale_sd: float
    cross_axis_sd: float
    nonlinearity: float
    bias_time_constant: float = 300.0
    g_sensitivity_sd: float = 0.0
    bias_drift_sd: float = 0.0


class TriadSheet(StrictModel):
    """What the data sheets of all three kinds of triad state alike."""

    bandwidth_hz: float | None = Field(
        default=None, gt=0, description="Bandwidth of a first-order low pass [Hz]; null: none."
    )
    scale_sd_percent: float = Field(
        default=0.0, ge=0, description="Scale factor error, standard deviation over parts [%]."
    )
    cross_axis_sd_percent: float = Field(
        default=0.0, ge=0, description="Cross-axis sensitivity, standard deviation [%]."
    )
    nonlinearity_percent_fs: float = Field(
        default=0.0, ge=0, description="Cubic error at full scale [% of full scale]."
    )

    def _common(self) -> dict[str, float | None]:
        return {
            "bandwidth": self.bandwidth_hz,
            "scale_sd": self.scale_sd_percent / 100,
            "cross_axis_sd": self.cross_axis_sd_percent / 100,
            "nonlinearity": self.nonlinearity_percent_fs / 100,
        }


class InertialSheet(TriadSheet):
    """What those of accelerometers and gyroscopes state beside it."""

    bias_time_constant_s: float = Field(
        default=300.0, gt=0, description="Correlation time of the in-run bias [s]."
    )


class Accelerometer(InertialSheet):
    """Accelerometer data sheet."""

    range_g: float = Field(gt=0, description="Full scale, +- [g].")
    counts_per_g: float | None = Field(
        default=None, gt=0, description="Sensitivity [LSB/g]; null: no quantisation."
    )
    noise_density_ug_sqrthz: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="White noise by axis [ug/sqrt(Hz)]."
    )
    bias_sd_mg: float = Field(
        default=0.0, ge=0, description="Turn-on bias, standard deviation [mg]."
    )
    in_run_bias_mg: float = Field(default=0.0, ge=0, description="In-run bias stability [mg].")
    bias_random_walk_mg_sqrts: float = Field(
        default=0.0, ge=0, description="Random walk of the bias [mg/sqrt(s)]."
    )
    bias_drift_sd_mg_k: float = Field(
        default=0.0, ge=0, description="Change of the bias with temperature, sd [mg/K]."
    )

    def triad(self) -> TriadParameters:
        """In SI units."""
        return TriadParameters(
            unit="m/s^2",
            range=self.range_g * _G,
            resolution=_G / self.counts_per_g if self.counts_per_g else 0.0,
            noise_density=np.array(self.noise_density_ug_sqrthz) * 1e-6 * _G,
            bias_sd=self.bias_sd_mg * 1e-3 * _G,
            bias_instability=self.in_run_bias_mg * 1e-3 * _G,
            bias_time_constant=self.bias_time_constant_s,
            bias_random_walk=self.bias_random_walk_mg_sqrts * 1e-3 * _G,
            bias_drift_sd=self.bias_drift_sd_mg_k * 1e-3 * _G,
            **self._common(),  # type: ignore[arg-type]
        )


class Gyroscope(InertialSheet):
    """Gyroscope data sheet."""

    range_deg_s: float = Field(gt=0, description="Full scale, +- [deg/s].")
    counts_per_deg_s: float | None = Field(
        default=None, gt=0, description="Sensitivity [LSB/(deg/s)]; null: no quantisation."
    )
    noise_density_deg_s_sqrthz: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="White noise by axis [deg/s/sqrt(Hz)]."
    )
    bias_sd_deg_s: float = Field(
        default=0.0, ge=0, description="Turn-on bias, standard deviation [deg/s]."
    )
    in_run_bias_deg_h: float = Field(
        default=0.0, ge=0, description="In-run bias stability [deg/h]."
    )
    bias_random_walk_deg_h_sqrts: float = Field(
        default=0.0, ge=0, description="Random walk of the bias [deg/h/sqrt(s)]."
    )
    g_sensitivity_sd_deg_s_g: float = Field(
        default=0.0, ge=0, description="Response to specific force, sd [deg/s/g]."
    )
    bias_drift_sd_deg_s_k: float = Field(
        default=0.0,
        ge=0,
        description="Change of the bias with temperature, sd over parts [deg/s/K].",
    )

    def triad(self) -> TriadParameters:
        """In SI units."""
        return TriadParameters(
            unit="rad/s",
            range=self.range_deg_s * _DEG,
            resolution=_DEG / self.counts_per_deg_s if self.counts_per_deg_s else 0.0,
            noise_density=np.array(self.noise_density_deg_s_sqrthz) * _DEG,
            bias_sd=self.bias_sd_deg_s * _DEG,
            bias_instability=self.in_run_bias_deg_h * _DEG / 3600,
            bias_time_constant=self.bias_time_constant_s,
            bias_random_walk=self.bias_random_walk_deg_h_sqrts * _DEG / 3600,
            g_sensitivity_sd=self.g_sensitivity_sd_deg_s_g * _DEG / _G,
            bias_drift_sd=self.bias_drift_sd_deg_s_k * _DEG,
            **self._common(),  # type: ignore[arg-type]
        )


class Magnetometer(TriadSheet):
    """Magnetometer data sheet."""

    range_uT: float = Field(gt=0, description="Full scale, +- [uT].")
    resolution_uT: float = Field(
        default=0.0, ge=0, description="One count [uT]; 0: no quantisation."
    )
    noise_density_uT_sqrthz: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="White noise by axis [uT/sqrt(Hz)]."
    )
    hard_iron_sd_uT: float = Field(
        default=0.0, ge=0, description="Offset left after the maker's calibration, sd [uT]."
    )

    def triad(self) -> TriadParameters:
        """In uT."""
        return TriadParameters(
            unit="uT",
            range=self.range_uT,
            resolution=self.resolution_uT,
            noise_density=np.array(self.noise_density_uT_sqrthz),
            bias_sd=self.hard_iron_sd_uT,
            bias_instability=0.0,
            bias_random_walk=0.0,
            **self._common(),  # type: ignore[arg-type]
        )


class Clock(StrictModel):
    """The sensor's own clock against the host's: reading = host time * (1 + drift) + offset."""

    offset_ms: float = Field(default=0.0, description="Offset [ms], the same for every part.")
    offset_sd_ms: float = Field(
        default=0.0, ge=0, description="Further offset drawn at power-up, standard deviation [ms]."
    )
    drift_ppm: float = Field(default=0.0, description="Drift [ppm], the same for every part.")
    drift_sd_ppm: float = Field(
        default=0.0, ge=0, description="Further drift of the part, standard deviation [ppm]."
    )
    jitter_us: float = Field(
        default=0.0, ge=0, description="Sampling jitter, standard deviation [us]."
    )
    accelerometer_lag_ms: float = Field(
        default=0.0,
        ge=0,
        le=1000,
        description="How much older the force of a sample is than its rate [ms]: of parts whose "
        "accelerometer and gyroscope are not read at one instant.",
    )
    latency_ms: float = Field(
        default=0.0, ge=0, description="Shortest delay from sampling to the host [ms]."
    )
    latency_jitter_ms: float = Field(
        default=0.0, ge=0, description="Mean of the exponential part of that delay [ms]."
    )


class DeviceOrientation(StrictModel):
    """The vendor's on-board filter as an error model: slow inclination and heading errors, and an
    earth of unknown heading.
    """

    heading_unknown: bool = Field(
        default=True, description="A new, uniform heading of the earth frame at each power-up."
    )
    inclination_sd_deg: float = Field(
        default=0.0, ge=0, description="Gauss-Markov error about each horizontal axis [deg]."
    )
    heading_sd_deg: float = Field(
        default=0.0, ge=0, description="Gauss-Markov error about the vertical [deg]."
    )
    time_constant_s: float = Field(default=60.0, gt=0, description="Correlation time of both [s].")
    noise_sd_deg: float = Field(default=0.0, ge=0, description="White noise about each axis [deg].")


class Thermometer(StrictModel):
    """The part's own thermometer."""

    resolution_deg_c: float = Field(
        default=0.0, ge=0, description="One count [deg C]; 0: no quantisation."
    )
    noise_sd_deg_c: float = Field(
        default=0.0, ge=0, description="Standard deviation of one reading [deg C]."
    )


class ImuParameters(StrictModel):
    """A simulated inertial measurement unit."""

    description: str = Field(default="", description="What it is, in a line.")
    source: str = Field(default="", description="Where the numbers come from.")
    rate_hz: float = Field(gt=0, le=10_000, description="Output rate [Hz].")
    sampling: Literal["instantaneous", "integrated"] = Field(
        default="instantaneous",
        description="integrated: rate and force are means over the interval before each sample "
        "(strapdown integration).",
    )
    accelerometer: Accelerometer = Field(description="Accelerometer data sheet.")
    gyroscope: Gyroscope = Field(description="Gyroscope data sheet.")
    magnetometer: Magnetometer | None = Field(default=None, description="null: the part has none.")
    clock: Clock = Field(
        default_factory=Clock, description="The sensor's own clock against the host's."
    )
    device_orientation: DeviceOrientation | None = Field(
        default=None, description="null: the part reports no orientation."
    )
    thermometer: Thermometer | None = Field(
        default=None, description="null: the part reports no temperature."
    )
    lost_packets_percent: float = Field(
        default=0.0, ge=0, lt=100, description="Part of the samples that never arrive [%]."
    )


def load_preset(name: str) -> ImuParameters:
    """The parameters of a sensor that ships with the bench.

    Raises:
        NotFoundError: No such preset; lists those that exist.
    """
    if name not in list_presets():
        raise NotFoundError("sensor preset", name, list_presets())
    return load_yaml(PRESETS / f"{name}.yaml", ImuParameters).value


def save_sensor(file: Path, parameters: ImuParameters) -> None:
    """Write a sensor as a preset file.

    Raises:
        InputError: The file exists already, or its folder does not.
    """
    if file.suffix not in PRESET_SUFFIXES:
        raise InputError(f"{file}: a sensor preset is a .yaml file")
    text = yaml.safe_dump(
        parameters.model_dump(exclude_defaults=True), sort_keys=False, allow_unicode=True, width=120
    )
    with stored_where_asked(file):
        write_text(file, text, anew=True)


def list_presets() -> list[str]:
    """Names of the sensor presets."""
    return shipped_names(PRESETS)
