"""Protocol: what a person wants the bench to do, as a YAML file; docs/protocol_reference.md explains every key."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from testbench.exceptions import FileProblems, NotFoundError, Problem
from testbench.records.sensor import ImuParameters, list_presets, load_preset
from testbench.records.shipped import shipped_folder
from testbench.records.strict import Angles3, EulerSequence, Placement, StrictModel
from testbench.records.yaml_file import YamlDocument, load_yaml

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,63}$")]
Expression = float | Annotated[str, Field(min_length=1, max_length=200)]
NonNegative = Annotated[float, Field(ge=0)] | Annotated[str, Field(min_length=1, max_length=200)]
Fraction = Annotated[float, Field(gt=0, le=1)]

FILTER_NAMES = (
    "device", "vqf_6d", "vqf_9d", "vqf_offline", "madgwick_imu", "madgwick_marg", "mahony_imu", "mahony_marg", "fusion",
    "ecompass", "triad", "imufilter", "ahrsfilter", "complementary", "ekf", "mekf", "euler_ekf_simple", "euler_ekf", "gyro", "tilt",
)  # fmt: skip
"""Names that are reserved for orientation filters; `testbench filters` lists those this version has."""


class Range(StrictModel):
    """An arithmetic sequence, both ends included."""

    start: float
    stop: float
    step: float = Field(description="Positive or negative, never zero; stop must lie a whole number of steps from start.")

    @model_validator(mode="after")
    def _reaches_stop(self) -> Range:
        if self.step == 0:
            raise ValueError("step must not be zero")
        steps = (self.stop - self.start) / self.step
        if steps < 0 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(f"stop {self.stop} is not a whole number of steps of {self.step} from start {self.start}")
        if steps > 100_000:
            raise ValueError(f"a range of {steps:.0f} values is more than the 100000 allowed")
        return self

    def values(self) -> list[float]:
        """The values, from start to stop."""
        count = round((self.stop - self.start) / self.step)
        return [self.start + i * self.step for i in range(count + 1)]


class Motion(StrictModel):
    """How fast to move, as fractions of the robot's limits."""

    speed: Fraction = 0.5
    acceleration: Fraction = 0.5
    jerk: Fraction = 0.5


class Sine(StrictModel):
    """Joint angle = centre + amplitude * sin(2 pi frequency t + phase), faded in and out over `ramp_cycles`."""

    amplitude_deg: Expression
    frequency_hz: Expression
    cycles: Expression = Field(description="Number of cycles at full amplitude, without the ramps.")
    ramp_cycles: NonNegative = 1.0
    phase_deg: Expression = 0.0


class Trapezoid(StrictModel):
    """There and back at a constant rate, `cycles` times."""

    amplitude_deg: Expression
    rate_deg_s: Expression
    cycles: Expression = 1.0
    hold_s: NonNegative = 0.0


class Sweep(StrictModel):
    """The motion of one joint during a sweep."""

    sine: Sine | None = None
    trapezoid: Trapezoid | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Sweep:
        if (self.sine is None) == (self.trapezoid is None):
            raise ValueError("a sweep needs one of: sine, trapezoid")
        return self


class Step(StrictModel):
    """One thing to do: move (and dwell), dwell where the arm is, sweep, or repeat steps over variables."""

    name: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    move_to_deg: list[Expression] | dict[str, Expression] | None = Field(
        default=None, description="Joint angles in the robot's order, or by joint name (the others stay) [deg]."
    )
    move_to: Literal["home"] | None = None
    sweep: dict[str, Sweep] | None = Field(default=None, description="Continuous motion, by joint name.")
    dwell_s: NonNegative | None = Field(default=None, description="Time at rest after the motion [s].")
    motion: Motion | None = None
    for_each: list[Name] | None = None
    steps: list[Step] | None = None

    @model_validator(mode="after")
    def _one_action(self) -> Step:
        actions = [key for key in ("move_to_deg", "move_to", "sweep", "steps") if getattr(self, key) is not None]
        if len(actions) > 1:
            raise ValueError(f"a step does one thing; this one has {' and '.join(actions)}")
        if not actions and self.dwell_s is None:
            raise ValueError("a step needs one of: move_to_deg, move_to, sweep, dwell_s, steps")
        if self.for_each is not None and self.steps is None:
            raise ValueError("for_each in a step needs steps to repeat")
        if self.steps is not None and not self.steps:
            raise ValueError("steps must not be empty")
        if self.sweep is not None and not self.sweep:
            raise ValueError("sweep must name at least one joint")
        return self


Role = Literal["calibration", "reference", "evaluation"]


class Section(StrictModel):
    """A named part of the protocol, so that an evaluation can select it."""

    name: Name
    role: Role = Field(
        default="evaluation",
        description="calibration: fits sensor errors; reference: a known pose that aligns the frames; evaluation: is judged.",
    )
    include: str | None = Field(default=None, description="Another protocol file beside this one, whose steps are taken.")
    for_each: list[Name] = Field(default=[], description="Variables to loop over; the last changes fastest.")
    motion: Motion | None = None
    steps: list[Step] | None = None

    @model_validator(mode="after")
    def _steps_or_include(self) -> Section:
        if (self.steps is None) == (self.include is None):
            raise ValueError("a section needs either steps or include")
        if self.steps is not None and not self.steps:
            raise ValueError("steps must not be empty")
        if self.include is not None and self.for_each:
            raise ValueError("for_each does not go with include")
        return self


class Segment(StrictModel):
    """The body segment a sensor stands for, and how its axes lie in the link."""

    name: Name
    rotation_deg: dict[EulerSequence, Angles3] = Field(default={}, description="Segment axes in the link, as a rotation.")

    def placement(self) -> Placement:
        """The segment's frame in the link."""
        return Placement(rotation_deg=self.rotation_deg)


class Sensor(StrictModel):
    """An IMU on the arm."""

    preset: str | None = Field(default=None, description="A sensor that ships with the bench, e.g. xsens_dot.")
    parameters: dict[str, Any] = Field(default={}, description="Parameters of the sensor, or changes to those of the preset.")
    link: str
    segment: Segment | None = None
    mounting: Placement = Field(default_factory=Placement, description="Sensor axes and position in the link, as believed.")
    mounting_error: Placement = Field(
        default_factory=Placement,
        description="How the real mounting differs, seen in the sensor; the estimators do not know it.",
    )

    def imu(self) -> ImuParameters:
        """The sensor's parameters, preset and changes merged."""
        base = load_preset(self.preset).model_dump() if self.preset else {}
        return ImuParameters.model_validate(_merge(base, self.parameters))


class FlexionAngle(StrictModel):
    """Which Euler angle of the distal segment against the proximal one is the flexion."""

    sequence: EulerSequence
    flexion: Literal["first", "second", "third"] = "second"
    sign: Literal[1, -1] = 1


class JointDefinition(FlexionAngle):
    """A joint angle between two sensors' segments.

    The flexion that counts as true is the arm's joint `reference_joint` where one is named, else the same Euler angle of the
    segments' true orientations. Naming it makes the error of the Euler sequence itself visible.
    """

    proximal: Name
    distal: Name
    reference_joint: str | None = None
    compare: list[FlexionAngle] = Field(default=[], description="Further Euler sequences to report beside it.")
    misalignment: Name = Field(default="misalignment_deg", description="Variable that is the misalignment.")
    flexion_variable: Name = Field(default="flexion_deg", description="Variable that is the commanded flexion.")

    def definitions(self) -> list[FlexionAngle]:
        """This definition and those it is compared with."""
        own = FlexionAngle(sequence=self.sequence, flexion=self.flexion, sign=self.sign)
        return [own, *self.compare]


class Estimation(StrictModel):
    """What to compute from the recordings."""

    filters: list[Literal[FILTER_NAMES]] = Field(default=["device", "vqf_6d", "vqf_9d", "fusion"], min_length=1)  # type: ignore[valid-type]
    align: Literal["none", "heading", "reference_pose"] = Field(
        default="reference_pose",
        description="none: the filter's earth is the world; heading: one rotation about the vertical, from the reference "
        "section; reference_pose: that and the remaining mounting rotation.",
    )
    align_clock: bool = Field(default=True, description="Fit the sensor's clock to the arm's by the angular rate.")
    calibrate: Literal["none", "static_poses"] = Field(
        default="static_poses",
        description="Fit accelerometer and gyroscope errors to the calibration sections, if there are any.",
    )


JOINT_METRICS = {
    "flexion_mean_error_deg": "signed mean of the flexion error, every pose or sweep alike",
    "flexion_mean_abs_error_deg": "mean magnitude of the flexion error, every pose or sweep alike",
    "flexion_rmse_deg": "root mean square of the flexion error, every pose or sweep alike",
    "flexion_max_abs_error_deg": "largest magnitude of the flexion error in any sample",
}
SENSOR_METRICS = {
    "total_rmse_deg": "root mean square of the whole orientation error",
    "heading_rmse_deg": "root mean square of the error about the vertical",
    "inclination_rmse_deg": "root mean square of the error against the vertical",
}


class AcceptanceLimit(StrictModel):
    """A limit that decides pass or fail."""

    metric: str = Field(description="<joint>.<joint metric> or <sensor>.<sensor metric>, e.g. elbow.flexion_rmse_deg.")
    filter: str | None = Field(default=None, description="null: every filter.")
    sequence: EulerSequence | None = Field(default=None, description="null: the joint's own.")
    section: str | None = None
    min: float | None = None
    max: float | None = None
    marginal_percent: float = Field(default=10.0, ge=0, lt=100, description="Values this near to the limit are marginal [%].")

    @model_validator(mode="after")
    def _has_limit(self) -> AcceptanceLimit:
        if self.min is None and self.max is None:
            raise ValueError("an acceptance limit needs min or max")
        return self


class MagneticDipole(StrictModel):
    """A magnetised part of the arm, such as a motor."""

    link: str
    position_mm: Angles3 = [0.0, 0.0, 0.0]
    moment_A_m2: Angles3


class Environment(StrictModel):
    """The field the sensors feel."""

    magnetic_field_uT: Angles3 = Field(
        default=[0.0, 24.0, -39.0],
        description="Earth's field in the world frame [uT]; default: magnetic north along y, about that of northern Spain (IGRF-13).",
    )
    dipoles: list[MagneticDipole] = Field(default=[], description="Magnetic disturbance by the arm.")


class Analysis(StrictModel):
    """What estimate and evaluate need to know; kept in every session, imported ones too."""

    sensors: dict[Name, Sensor] = Field(default={})
    joints: dict[Name, JointDefinition] = Field(default={})
    estimate: Estimation = Field(default_factory=Estimation)
    accept: list[AcceptanceLimit] = []


class ProtocolSpec(StrictModel):
    """The content of a protocol file."""

    name: Name
    purpose: str
    robot: str = Field(description="A robot's name, or the path of a robot.yaml or URDF.")
    sensors: Annotated[dict[Name, Sensor], Field(min_length=1)]
    joints: dict[Name, JointDefinition] = {}
    variables: dict[Name, float | list[float] | Range] = {}
    motion: Motion = Field(default_factory=Motion)
    environment: Environment = Field(default_factory=Environment)
    sections: list[Section] = Field(min_length=1)
    estimate: Estimation = Field(default_factory=Estimation)
    accept: list[AcceptanceLimit] = []

    def analysis(self) -> Analysis:
        """The part that concerns estimation and evaluation."""
        return Analysis(sensors=self.sensors, joints=self.joints, estimate=self.estimate, accept=self.accept)

    def values(self, variable: str) -> list[float]:
        """The values a variable takes."""
        value = self.variables[variable]
        if isinstance(value, Range):
            return value.values()
        return value if isinstance(value, list) else [value]


@dataclass
class Protocol:
    """A protocol with the file it was read from and the protocols it includes (by path)."""

    document: YamlDocument[ProtocolSpec]
    included: dict[str, Protocol] = field(default_factory=dict)

    @property
    def spec(self) -> ProtocolSpec:
        return self.document.value

    def texts(self) -> dict[str, str]:
        """Every file that makes up the protocol, verbatim, by its name."""
        own = {self.document.file.name: self.document.text}
        for protocol in self.included.values():
            own |= protocol.texts()
        return own


def load_protocol(path: str | Path) -> Protocol:
    """Read, validate and cross-check a protocol and those it includes.

    Args:
        path: A file, or the name of a protocol that ships with the bench.

    Raises:
        FileProblems: The file is malformed; every problem at once, with line and column.
        NotFoundError: Neither a file nor the name of a shipped protocol.
    """
    file = Path(path)
    if file.suffix not in {".yaml", ".yml"} and not file.exists():
        if str(path) not in list_protocols():
            raise NotFoundError("protocol", str(path), sorted(list_protocols()))
        file = shipped_folder("protocols") / f"{path}.yaml"
    return _load(file, ())


def list_protocols() -> dict[str, str]:
    """Names and purposes of the protocols that ship with the bench."""
    return {
        path.stem: load_yaml(path, ProtocolSpec).value.purpose for path in sorted(shipped_folder("protocols").glob("*.yaml"))
    }


def _load(file: Path, including: tuple[Path, ...]) -> Protocol:
    document = load_yaml(file, ProtocolSpec)
    protocol = Protocol(document)
    problems = _cross_check(document)
    for i, section in enumerate(document.value.sections):
        if section.include is None:
            continue
        target = (file.parent / section.include).resolve()
        where = ("sections", i, "include")
        if target.parent != file.parent.resolve():
            problems.append(_problem(document, "an include must lie in the folder of the protocol", where))
        elif target in (*including, file.resolve()):
            problems.append(_problem(document, f"'{section.include}' includes itself", where))
        elif not target.is_file():
            problems.append(_problem(document, f"no file '{section.include}' beside this protocol", where))
        else:
            protocol.included[section.include] = _load(target, (*including, file.resolve()))
    if problems:
        raise FileProblems(file, problems)
    return protocol


def _cross_check(document: YamlDocument[ProtocolSpec]) -> list[Problem]:
    """Names that must agree with one another inside the file."""
    spec, problems = document.value, []

    def check(known: list[str], name: str, kind: str, *where: Any) -> None:
        if name not in known:
            problems.append(_problem(document, str(NotFoundError(kind, name, known)), where))

    for name, variable in spec.variables.items():
        if isinstance(variable, list) and not variable:
            problems.append(_problem(document, "a list of values must not be empty", ("variables", name)))
    for name, sensor in spec.sensors.items():
        where = ("sensors", name)
        if sensor.preset is not None and sensor.preset not in list_presets():
            check(list_presets(), sensor.preset, "sensor preset", *where, "preset")
            continue
        try:
            sensor.imu()
        except ValidationError as error:
            for fault in error.errors(include_url=False):
                place = (*where, "parameters", *fault["loc"])
                problems.append(_problem(document, f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].lower()}", place))
    for name, joint in spec.joints.items():
        for side in ("proximal", "distal"):
            sensor_name = getattr(joint, side)
            check(list(spec.sensors), sensor_name, "sensor", "joints", name, side)
            if sensor_name in spec.sensors and spec.sensors[sensor_name].segment is None:
                message = (
                    f"sensor '{sensor_name}' needs a segment: a joint angle is between segments, whose axes must be stated"
                )
                problems.append(_problem(document, message, ("joints", name, side)))
    names: list[str] = []
    for i, section in enumerate(spec.sections):
        if section.name in names:
            problems.append(_problem(document, f"two sections are called '{section.name}'", ("sections", i, "name")))
        names.append(section.name)
        for k, variable_name in enumerate(section.for_each):
            check(list(spec.variables), variable_name, "variable", "sections", i, "for_each", k)
        _check_steps(document, section.steps or [], ("sections", i, "steps"), check)
    for i, limit in enumerate(spec.accept):
        known = [f"{joint}.{kind}" for joint in spec.joints for kind in JOINT_METRICS]
        check(
            [*known, *(f"{name}.{kind}" for name in spec.sensors for kind in SENSOR_METRICS)],
            limit.metric,
            "metric",
            "accept",
            i,
            "metric",
        )
        if limit.section is not None:
            check(names, limit.section, "section", "accept", i, "section")
        if limit.filter is not None:
            check(list(spec.estimate.filters), limit.filter, "filter of this protocol", "accept", i, "filter")
    return problems


def _check_steps(document: YamlDocument[ProtocolSpec], steps: list[Step], where: tuple[Any, ...], check: Any) -> None:
    for k, step in enumerate(steps):
        for m, name in enumerate(step.for_each or []):
            check(list(document.value.variables), name, "variable", *where, k, "for_each", m)
        _check_steps(document, step.steps or [], (*where, k, "steps"), check)


def _problem(document: YamlDocument[ProtocolSpec], message: str, where: tuple[Any, ...]) -> Problem:
    return document.problem(message, *where).problems[0]


def _merge(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in changes.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merge(merged[key], value) if both else value
    return merged
