"""The part of a protocol that asks for all joints of a chain, from the sensors on its links."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from testbench.records.specs.sensor import ImuParameters, list_presets, load_preset
from testbench.records.specs.strict import Name, Placement, StrictModel

ChainState = Literal["kinematic", "fourier"]
WHOLE_CHAIN = "chain"
"""Stands for all joints together in the name of a metric."""
CHAIN_METRICS = {
    "angle_mean_error_deg": "signed mean of the error of the joint's angle by the chain filter",
    "angle_mean_abs_error_deg": "mean magnitude of the error of the joint's angle by the chain "
    "filter",
    "angle_rmse_deg": "root mean square of the error of the joint's angle by the chain filter",
    "angle_max_abs_error_deg": "largest magnitude of the error of the joint's angle by the chain "
    "filter",
    "angle_covered_percent": "part of the errors of the joint's angle within 1.96 of the "
    "uncertainty that the filter states",
}
"""Metrics of a joint of the arm, and of all joints together but for the signed mean."""


class ChainPlacement(StrictModel):
    """How well it is known where the sensors sit: what of it the readings tell is fitted."""

    rotation_sd_deg: float = Field(
        default=3.0,
        gt=0,
        le=30,
        description="Standard deviation of each sensor's mounting about each axis [deg].",
    )
    position_sd_mm: float = Field(
        default=10.0,
        gt=0,
        le=200,
        description="Standard deviation of each sensor's place along each axis [mm].",
    )
    length_sd_percent: float = Field(
        default=0.0,
        ge=0,
        le=30,
        description="Standard deviation of each segment's length [%]; 0: as the model has them.",
    )


ASSUMED_SHEET = "xsens_dot"
"""Data sheet that a sensor of an import is taken to have where none is named: a MEMS part of the
kind that is worn.
"""
FARTHEST_MM = 1000.0
"""A sensor farther than this from its link is not meant [mm]."""


class ChainSensor(StrictModel):
    """A sensor of an import on a link of the model."""

    link: str = Field(description="Link that carries it, by its URDF name.")
    mounting: Placement = Field(
        default_factory=Placement, description="Sensor axes and position in the link, as believed."
    )
    preset: str | None = Field(
        default=None,
        description="Data sheet that ships with the bench, for what rest does not tell of its "
        "errors; null: that of an Xsens DOT.",
    )

    @field_validator("mounting")
    @classmethod
    def _near_its_link(cls, placement: Placement) -> Placement:
        farthest = max(abs(value) for value in placement.position_mm)
        if farthest > FARTHEST_MM:
            raise ValueError(
                f"position_mm: a sensor {farthest / 1000:g} m from its link is not meant; "
                f"positions end at {FARTHEST_MM:g} mm"
            )
        return placement

    @field_validator("preset")
    @classmethod
    def _known(cls, preset: str | None) -> str | None:
        if preset is not None and preset not in list_presets():
            raise ValueError(f"unknown preset '{preset}'; known: {', '.join(list_presets())}")
        return preset

    def imu(self) -> ImuParameters:
        """The data sheet."""
        return load_preset(self.preset or ASSUMED_SHEET)


class ChainModel(StrictModel):
    """What an import is a recording of: rotating joints, and the sensors on their links."""

    robot: str = Field(
        min_length=1,
        max_length=1000,
        description="A robot's name, e.g. lower_limb, or the path of a robot.yaml or URDF.",
    )
    sensors: dict[Name, ChainSensor] = Field(
        min_length=1, max_length=64, description="Which link carries each sensor, and how."
    )
    stature_mm: float | None = Field(
        default=None,
        gt=500,
        lt=2500,
        description="Of the person [mm]: scales a model that states its own; null: as it is.",
    )
    lengths_mm: dict[str, Annotated[float, Field(gt=0, le=2000)]] = Field(
        default={},
        description="Distances of joints from the joint before them [mm], e.g. knee_r_flexion: 410 "
        "for the thigh; they come before stature_mm.",
    )
    start_deg: dict[str, float] = Field(
        default={},
        description="Joint angles at the rest that it starts from [deg]; others as at home, which "
        "is standing for lower_limb.",
    )
    rest_s: Annotated[list[float], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="Begin and end of that rest on the session's time axis [s]; null: the first of "
        "all sensors together.",
    )

    @field_validator("rest_s")
    @classmethod
    def _ordered(cls, rest: list[float] | None) -> list[float] | None:
        if rest is not None and rest[1] - rest[0] < 0.5:
            raise ValueError("rest_s: [begin, end] of a rest of at least 0.5 s")
        return rest


class ChainEstimation(StrictModel):
    """Joint angles of the arm from the rates and forces of several sensors together, by an extended
    Kalman filter.
    """

    model: ChainModel | None = Field(
        default=None,
        description="Of an import alone: the joints and the links that the sensors are on; a "
        "protocol has its arm.",
    )
    states: list[ChainState] = Field(
        default=["kinematic"],
        min_length=1,
        description="kinematic: angles, rates, accelerations under white jerk; fourier: a series "
        "whose frequency is estimated.",
    )
    sensors: list[Name] = Field(
        default=[],
        description="Sensors to use, the one whose instants count first; none named: all.",
    )
    joints: list[str] = Field(
        default=[],
        description="Joints to estimate; the others stand still as planned. None named: all that "
        "carry a sensor.",
    )
    sections: list[Name] = Field(
        default=[],
        description="Sections to run over, each anew from the rest before it; none named: those "
        "that are judged.",
    )
    start_sd_deg: float | None = Field(
        default=None,
        gt=0,
        le=45,
        description="Standard uncertainty of each joint's planned angle at that rest [deg]; null: "
        "0.5, or of a body what two segments may be from their pose (alignment.axes_sd_deg).",
    )
    settling_s: float = Field(
        default=0.0,
        ge=0,
        description="Left out of the evaluation at either end of each judged step: fades are not "
        "periodic [s].",
    )
    harmonics: int = Field(default=4, ge=1, le=10, description="Harmonics of the Fourier series.")
    frequency_hz: float | None = Field(
        default=None,
        gt=0,
        le=20,
        description="First guess of its base frequency [Hz]; null: from the period of the rates.",
    )
    jerk_deg_s3_sqrthz: float | None = Field(
        default=None,
        gt=0,
        description="Density of the white jerk, kinematic [deg/s^3/sqrt(Hz)]; null: the most "
        "likely one.",
    )
    walk_deg_sqrts: float | None = Field(
        default=None,
        gt=0,
        description="Random walk of the first harmonic, fourier [deg/sqrt(s)]; null: the most "
        "likely one.",
    )
    biases: bool = Field(
        default=True,
        description="Whether the biases of gyroscopes and accelerometers, and how late their "
        "clocks are, are states.",
    )
    scales: bool = Field(
        default=True,
        description="Whether, beside the biases, errors of scale, axes and linearity are states; "
        "without, the stated "
        "uncertainty leaves them out.",
    )
    limits: bool = Field(
        default=True, description="Whether the joint limits of the robot file hold the estimate."
    )
    placement: ChainPlacement | None = Field(
        default=None,
        description="Fit where the sensors sit, and how long the segments are, to their readings; "
        "null: they are where they are stated to be.",
    )
    smooth: bool = Field(
        default=False,
        description="Smooth backwards as well: better, but not to be had while it moves.",
    )

    @model_validator(mode="after")
    def _each_once(self) -> ChainEstimation:
        for key in ("states", "sensors", "joints", "sections"):
            names = getattr(self, key)
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{key}: {', '.join(twice)} stands more than once")
        return self
