"""Protocol: what the bench shall do, as YAML; docs/protocol_reference.md explains every key."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from pydantic import Field, field_validator, model_validator

from testbench.records.disk.yaml_file import YamlDocument
from testbench.records.specs.exclusion import DoubtfulSamples, Exclusion
from testbench.records.specs.joint_definition import FlexionAngle, JointConstraint
from testbench.records.specs.magnetism import MagneticDipole
from testbench.records.specs.protocol_arm import ArmUse, Guards
from testbench.records.specs.protocol_chain import ChainEstimation
from testbench.records.specs.protocol_steps import Motion, Range, Section, Variable
from testbench.records.specs.segment_alignment import AlignmentMethod, SegmentAlignment
from testbench.records.specs.sensor import ImuParameters, load_preset
from testbench.records.specs.strict import (
    Angles3,
    EulerSequence,
    Name,
    Placement,
    Rotation,
    StrictModel,
)

MOST_VARIABLES = 100
FARTHEST_SENSOR_MM = 2000.0
"""Farther from its link than the longest arms reach no sensor is carried [mm]."""
RESERVED_NAMES = ("pi", "abs", "min", "max", "round", "sqrt")
"""Words of the expression language, which no variable may be called."""

FILTER_NAMES = (
    "device",
    "gyro",
    "tilt",
    "ecompass",
    "triad",
    "quest",
    "complementary",
    "complementary_marg",
    "mahony_imu",
    "mahony_marg",
    "madgwick_imu",
    "madgwick_marg",
    "madgwick_adaptive",
    "madgwick_zeta_as_printed",
    "madgwick_zeta_upstream",
    "imufilter",
    "ahrsfilter",
    "euler_ekf_simple",
    "euler_ekf",
    "euler_ekf_simple_as_printed",
    "euler_ekf_as_printed",
    "euler_ekf_listing",
    "ekf_imu",
    "ekf",
    "mekf_imu",
    "mekf",
    "vqf_6d",
    "vqf_9d",
    "vqf_offline",
    "fusion",
    "fusion_9d",
)
"""Orientation filters that a protocol may name; `testbench filters` lists them with their
parameters.
"""


class Segment(StrictModel):
    """The body segment a sensor stands for, and how its axes lie in the link."""

    name: Name = Field(description="E.g. forearm.")
    rotation_deg: Rotation = Field(
        default={},
        description="Segment axes in the link: one intrinsic Euler sequence and its three angles "
        "[deg].",
    )

    def placement(self) -> Placement:
        """The segment's frame in the link."""
        return Placement(rotation_deg=self.rotation_deg)


class Sensor(StrictModel):
    """An IMU on the arm."""

    preset: str | None = Field(
        default=None,
        description="A sensor that ships with the bench, e.g. xsens_dot, or a preset file beside "
        "the protocol.",
    )
    parameters: dict[str, Any] = Field(
        default={}, description="Parameters of the sensor, or changes to those of the preset."
    )
    part: int | None = Field(
        default=None,
        ge=0,
        description="Which specimen of its kind is simulated; one of the run's own seed if null.",
    )
    drawn_as: str | None = Field(
        default=None,
        description="Name that the errors of a simulated sensor are drawn by: sensors of one name "
        "are one device in several settings, such as at several rates; its own name if null.",
    )
    link: str = Field(description="Link of the arm that carries the sensor, by its URDF name.")
    segment: Segment | None = Field(
        default=None, description="Body segment the sensor stands for; joint angles need it."
    )
    mounting: Placement = Field(
        default_factory=Placement, description="Sensor axes and position in the link, as believed."
    )
    mounting_error: Placement = Field(
        default_factory=Placement,
        description="How the real mounting differs, seen in the sensor; the estimators do not know "
        "it.",
    )

    @field_validator("mounting", "mounting_error")
    @classmethod
    def _near_its_link(cls, placement: Placement) -> Placement:
        farthest = max(abs(value) for value in placement.position_mm)
        if farthest > FARTHEST_SENSOR_MM:
            raise ValueError(
                f"position_mm: a sensor {farthest / 1000:g} m from its link is not meant; "
                "positions are in millimetres and end "
                f"at {FARTHEST_SENSOR_MM:g}"
            )
        return placement

    @model_validator(mode="after")
    def _is_described(self) -> Sensor:
        if self.preset is None and not self.parameters:
            raise ValueError("a sensor needs a preset or parameters")
        return self

    def imu(self) -> ImuParameters:
        """The sensor's parameters, preset and changes merged."""
        base = load_preset(self.preset).model_dump() if self.preset else {}
        return ImuParameters.model_validate(merge(base, self.parameters))


class JointDefinition(FlexionAngle):
    """A joint angle between two sensors' segments.

    The flexion that counts as true is the arm's joint `reference_joint` where one is named, else
    the same angle of the segments' true orientations. Naming it makes the error of the definition
    itself visible.
    """

    proximal: Name = Field(description="Sensor of the segment nearer to the trunk.")
    distal: Name = Field(description="Sensor of the segment farther from it.")
    reference_joint: str | None = Field(
        default=None,
        description="Joint of the arm whose angle is the true flexion; null: the same angle of the "
        "true frames.",
    )
    compare: list[FlexionAngle] = Field(
        default=[], description="Further definitions to report beside it."
    )
    constraint: JointConstraint | None = Field(
        default=None,
        description="Axes that keep the headings of both sensors together over time; null: nothing "
        "does.",
    )
    published: Literal["reference_1"] | None = Field(
        default=None,
        description="Published results of the same experiment, which the report shows beside this "
        "joint's; null: none.",
    )
    misalignment: Name = Field(
        default="misalignment_deg", description="Variable that is the misalignment."
    )
    flexion_variable: Name = Field(
        default="flexion_deg", description="Variable that is the commanded flexion."
    )

    @model_validator(mode="after")
    def _two_sensors(self) -> JointDefinition:
        if self.proximal == self.distal:
            raise ValueError("proximal and distal are the same sensor")
        labels = [angle.label for angle in self.definitions()]
        twice = sorted({label for label in labels if labels.count(label) > 1})
        if twice:
            kind = (
                "Euler sequence"
                if all(label in get_args(EulerSequence) for label in twice)
                else "definition"
            )
            raise ValueError(f"the {kind} {', '.join(twice)} stands more than once")
        return self

    def definitions(self) -> list[FlexionAngle]:
        """This definition and those it is compared with."""
        own = FlexionAngle(**{name: getattr(self, name) for name in FlexionAngle.model_fields})
        return [own, *self.compare]


class Estimation(StrictModel):
    """What to compute from the recordings."""

    filters: list[Literal[FILTER_NAMES]] = Field(  # type: ignore[valid-type]
        default=["device", "vqf_6d", "vqf_9d", "fusion"],
        min_length=1,
        description="Orientation filters to run; see `testbench filters`.",
    )
    filter_parameters: dict[
        Literal[FILTER_NAMES],  # type: ignore[valid-type]
        dict[str, float],
    ] = Field(
        default={},
        description="Parameters of filters that differ from their defaults, by filter and "
        "parameter; see `testbench filters`.",
    )
    align: Literal["none", "heading", "reference_pose", "motion", "rates"] = Field(
        default="reference_pose",
        description="none: the filter's earth is the world; heading: one rotation about the "
        "vertical, from the reference "
        "section; reference_pose: that and the remaining mounting rotation; motion: world and "
        "mounting together, from all "
        "motion before the first judged step; rates: the mounting from rates and gravity alone, "
        "over the same part.",
    )
    align_clock: bool = Field(
        default=True, description="Fit the sensor's clock to the arm's by the angular rate."
    )
    calibrate: Literal["none", "static_poses"] = Field(
        default="static_poses",
        description="Fit accelerometer and gyroscope errors to the calibration sections, if there "
        "are any.",
    )

    euler_ranges: dict[Name, EulerSequence] = Field(
        default={},
        description="Sections over which the range of each sensor's own Euler angles is reported "
        "(limit tests).",
    )

    chain: ChainEstimation | None = Field(
        default=None,
        description="Joints of the arm from several sensors together; null: not computed.",
    )

    euler_sequence: EulerSequence | None = Field(
        default=None,
        description="Of the Euler angles of each sensor that nobody judges; null: ZYX (heading, "
        "pitch, roll), or ZXY for a sensor that ZYX is in gimbal lock for.",
    )
    compare: Literal[FILTER_NAMES] | None = Field(  # type: ignore[valid-type]
        default=None,
        description="Filter, such as device, that all others are compared with; it is not taken "
        "for the truth. null: every pair, of sensors without truth.",
    )
    returned: bool = Field(
        default=False,
        description="Whether each sensor ended at rest in the orientation it began in, so that "
        "what its orientation changed by is the closure error of the loop.",
    )

    exclude: list[Exclusion] = Field(
        default=[],
        description="Intervals whose samples count as lost, each with a reason.",
    )

    keep: list[DoubtfulSamples] = Field(
        default=[],
        description="Kinds of doubtful samples that are real in these recordings and stay in: "
        "zeros, stuck, clipped, spike, straight.",
    )

    @model_validator(mode="after")
    def _each_filter_once(self) -> Estimation:
        twice = sorted({name for name in self.filters if self.filters.count(name) > 1})
        if twice:
            raise ValueError(f"filters: {', '.join(twice)} stands more than once")
        idle = sorted(set(self.filter_parameters) - set(self.filters))
        if idle:
            raise ValueError(f"filter_parameters: {', '.join(idle)} is not among filters")
        return self


JOINT_METRICS = {
    "flexion_mean_error_deg": "signed mean of the flexion error, every pose or sweep alike",
    "flexion_mean_abs_error_deg": "mean magnitude of the flexion error, every pose or sweep alike",
    "flexion_rmse_deg": "root mean square of the flexion error, every pose or sweep alike",
    "flexion_max_abs_error_deg": "largest magnitude of the flexion error in any sample",
    "flexion_median_error_deg": "median of the signed flexion error, every sample alike",
    "flexion_iqr_deg": "upper less lower quartile of the signed flexion error, every sample alike",
    "flexion_p95_abs_error_deg": "95th percentile of the magnitude of the flexion error, every "
    "sample alike",
    "flexion_latency_ms": "delay of the flexion behind the true one in sweeps, beyond that of the "
    "sensor's clock",
    "flexion_convergence_s": "time from the end of a move until the flexion error stays near its "
    "settled value; median",
}
SENSOR_METRICS = {
    "total_rmse_deg": "root mean square of the whole orientation error",
    "heading_rmse_deg": "root mean square of the error about the vertical",
    "inclination_rmse_deg": "root mean square of the error against the vertical",
    "total_mean_error_deg": "mean of the whole orientation error, which has no sign",
    "heading_mean_error_deg": "signed mean of the error about the vertical",
    "inclination_mean_error_deg": "mean of the error against the vertical, which has no sign",
    "total_p95_error_deg": "95th percentile of the whole orientation error",
    "total_latency_ms": "delay of the orientation behind the true one in motion, beyond that of "
    "the sensor's clock",
}


class AcceptanceLimit(StrictModel):
    """A limit that decides pass or fail."""

    metric: str = Field(
        description="<joint>.<joint metric>, <sensor>.<sensor metric>, <joint of the arm>.<chain "
        "metric> or "
        "chain.<chain metric>, e.g. elbow.flexion_rmse_deg."
    )
    filter: str | None = Field(
        default=None,
        description="One of estimate.filters, for a chain metric of estimate.chain.states; null: "
        "every one.",
    )
    sequence: Name | None = Field(
        default=None,
        description="Euler sequence or other definition of a joint metric, e.g. YXZ or isb_elbow; "
        "null: its own.",
    )
    section: str | None = Field(
        default=None, description="Section of the protocol; null: every section that is evaluated."
    )
    min: float | None = Field(
        default=None,
        allow_inf_nan=False,
        description="Smallest value that passes, in the metric's unit.",
    )
    max: float | None = Field(
        default=None,
        allow_inf_nan=False,
        description="Largest value that passes, in the metric's unit.",
    )
    marginal_percent: float = Field(
        default=10.0, ge=0, lt=100, description="Values this near to the limit are marginal [%]."
    )
    repeatability: str | None = Field(
        default=None,
        description="Folder of evaluated sessions of the same protocol, whose scatter widens the "
        "guard band; from the folder that this session lies in, which . is. null: the verdict is "
        "on this session alone.",
    )

    @model_validator(mode="after")
    def _has_limit(self) -> AcceptanceLimit:
        if self.min is None and self.max is None:
            raise ValueError("an acceptance limit needs min or max")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ValueError(f"min {self.min:g} is greater than max {self.max:g}")
        return self


class Environment(StrictModel):
    """The field the sensors feel, and whether the simulated arm's joints have wrong zeros."""

    magnetic_field_uT: Angles3 = Field(
        default=[0.0, 24.0, -39.0],
        description="Earth's field in the world [uT]; default: north along y, about that of "
        "northern Spain (IGRF-13).",
    )
    temperature_deg_c: float = Field(
        default=25.0, ge=-40, le=125, description="Of the sensors at the start [deg C]."
    )
    warm_up_deg_c: float = Field(
        default=0.0, ge=-100, le=100, description="By how much they warm up in the end [deg C]."
    )
    warm_up_time_s: float = Field(default=600.0, gt=0, description="Time constant of that [s].")
    arm_magnetism: bool = Field(
        default=True,
        description="Whether what the robot file says of the arm's magnetism disturbs the field.",
    )
    dipoles: list[MagneticDipole] = Field(
        default=[], description="Further magnetised parts and iron."
    )
    joint_errors: bool = Field(
        default=False,
        description="Draw an error of each simulated joint's zero by the robot file's uncertainty; "
        "encoders do not see it.",
    )
    link_errors: bool = Field(
        default=False,
        description="Draw errors of the simulated arm's twists, lengths and offsets by the robot "
        "file's uncertainty; the kinematics that the truth is computed with do not know them.",
    )


class BodyJoint(JointDefinition):
    """A joint between sensors of an import, which no arm carries."""

    alignment: AlignmentMethod | None = Field(
        default=None, description="In place of that of the body, for this joint."
    )

    def aligned(self, body: Body) -> SegmentAlignment:
        """How its sensors sit on their segments."""
        own = body.alignment
        return own if self.alignment is None else own.model_copy(update={"method": self.alignment})


class Body(StrictModel):
    """What a person says of the body that carries the sensors of an imported recording."""

    segments: dict[Name, Segment] = Field(
        default={}, description="Body segment that each sensor stands for, by sensor."
    )
    joints: dict[Name, BodyJoint] = Field(default={}, description="Joints between them, by name.")
    alignment: SegmentAlignment = Field(
        default_factory=SegmentAlignment, description="How the sensors sit on their segments."
    )

    def segment(self, sensor: str) -> Segment:
        """The segment that a sensor stands for; called after it, in its axes, where none is
        named.
        """
        return self.segments.get(sensor) or Segment.model_construct(name=sensor, rotation_deg={})


class Analysis(StrictModel):
    """What estimate and evaluate need to know; kept in every session, imported ones too."""

    sensors: dict[Name, Sensor] = Field(default={}, description="IMUs on the arm, by name.")
    joints: dict[Name, JointDefinition] = Field(
        default={}, description="Joint angles to compute, by name."
    )
    estimate: Estimation = Field(
        default_factory=Estimation, description="What to compute from the recordings."
    )
    accept: list[AcceptanceLimit] = Field(
        default=[], description="Limits that decide pass or fail."
    )
    body: Body | None = Field(
        default=None, description="Segments and joints of an import, whose sensors no arm carries."
    )


class ProtocolSpec(StrictModel):
    """What the bench shall do: which arm moves how, which sensors it carries, and what is computed
    and judged.
    """

    name: Name = Field(description="Name of the protocol; sessions are called after it.")
    purpose: str = Field(min_length=1, description="What it is for, in a sentence.")
    robot: str = Field(
        min_length=1,
        max_length=200,
        description="A robot's name, or the path of a robot.yaml or URDF.",
    )
    sensors: dict[Name, Sensor] = Field(min_length=1, description="IMUs on the arm, by name.")
    joints: dict[Name, JointDefinition] = Field(
        default={}, description="Joint angles to compute, by name."
    )
    variables: dict[Name, Variable] = Field(
        default={},
        max_length=MOST_VARIABLES,
        description="Names for expressions and loops: a number, a list or a range.",
    )
    motion: Motion = Field(
        default_factory=Motion, description="How fast to move, as fractions of the robot's limits."
    )
    environment: Environment = Field(
        default_factory=Environment,
        description="The field the sensors feel, and errors of the simulated arm.",
    )
    sections: list[Section] = Field(min_length=1, description="What to do, in order.")
    arm: ArmUse = Field(default_factory=ArmUse, description="Tool and speed of a real arm.")
    guards: Guards | None = Field(
        default=None,
        description="What is watched during a run; null: the guards' own values on a real arm, "
        "nothing in simulation.",
    )
    estimate: Estimation = Field(
        default_factory=Estimation, description="What to compute from the recordings."
    )
    accept: list[AcceptanceLimit] = Field(
        default=[], description="Limits that decide pass or fail."
    )

    @field_validator("estimate")
    @classmethod
    def _has_its_arm(cls, estimate: Estimation) -> Estimation:
        if estimate.chain is not None and estimate.chain.model is not None:
            raise ValueError(
                "chain.model is for imports; the chain of a protocol is its arm, with the sensors "
                "on it"
            )
        return estimate

    def analysis(self) -> Analysis:
        """The part that concerns estimation and evaluation."""
        return Analysis(
            sensors=self.sensors, joints=self.joints, estimate=self.estimate, accept=self.accept
        )

    def values(self, variable: str) -> list[float]:
        """The values a variable takes."""
        value = self.variables[variable]
        if isinstance(value, Range):
            return value.values()
        return value if isinstance(value, list) else [value]


@dataclass
class Protocol:
    """A protocol with the file it was read from.

    With it come the protocols it includes, and the texts of its sensor presets, by name.
    """

    document: YamlDocument[ProtocolSpec]
    included: dict[str, Protocol] = field(default_factory=dict)
    presets: dict[str, str] = field(default_factory=dict)

    @property
    def spec(self) -> ProtocolSpec:
        return self.document.value

    def texts(self) -> dict[str, str]:
        """Every file that makes up the protocol, verbatim, by its name."""
        own = {self.document.file.name: self.document.text} | self.presets
        for protocol in self.included.values():
            own |= protocol.texts()
        return own


def merge(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Nested mappings, `changes` over `base`."""
    merged = dict(base)
    for key, value in changes.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = merge(merged[key], value) if both else value
    return merged
