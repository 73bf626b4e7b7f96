"""Manifest: what a session is, how it went, with which versions, and the hashes of its raw files.

A manifest may come from anywhere, and from a newer version of the bench: what is known of it is
checked by its type, what is not known is kept and written again.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    StringConstraints,
    TypeAdapter,
    ValidationError,
)

from testbench.exceptions import SessionError
from testbench.records.disk.json_file import plain_values, read_json, write_json
from testbench.records.disk.json_record import first_problem
from testbench.records.findings.earlier import sentences_to_findings
from testbench.records.findings.finding import Finding
from testbench.records.session.arm_record import (
    MODEL,
    RECORDED_MOTION,
    REPORTED_MOTION,
    SIMULATED,
    ArmRecord,
)
from testbench.records.session.layout import MANIFEST
from testbench.records.specs.strict import EARLIER_NAME_PATTERN

SCHEMA_VERSION = 1
"""The only one so far. Within it `source` was the name of one file before it was a list, and an
arm's entry named only its driver.
"""


PASSING = {"statistics", "battery_percent", "rssi_dbm"}
"""Entries of a sensor that differ from one moment to the next."""
FASTEST_HZ = 1e6
"""No inertial sensor samples a hundredth as fast."""
LONGEST_DELAY_S = 10.0
"""Nor is a rate so much older than its stamp."""


class RunStatus(StrEnum):
    """How the bench fared; says nothing of the sensor."""

    RUNNING = "running"
    COMPLETED = "completed"
    ABORTED = "aborted"
    ERROR = "error"
    INTERRUPTED = "interrupted"


ENDED = {
    RunStatus.RUNNING: "the recording was not closed",
    RunStatus.ERROR: "the run ended in an error",
    RunStatus.INTERRUPTED: "the run was interrupted",
    RunStatus.ABORTED: "the run was aborted",
}
"""How a run ended that is not complete."""


class _Part(BaseModel):
    """A part of a manifest; keys that are not named here may be there, and are kept."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class _WholePart(_Part):
    """One of which also those keys are read that are not named here."""

    model_config = ConfigDict(extra="allow")

    def written(self) -> dict[str, Any]:
        """As it stands in the file."""
        return self.model_dump(mode="json", exclude_unset=True)


class FullScale(_WholePart):
    """Largest magnitude that each axis can report; None where nobody says.

    Attributes:
        acc_m_s2: Of the accelerometer [m/s^2].
        gyr_rad_s: Of the gyroscope [rad/s].
    """

    acc_m_s2: Annotated[float, Field(gt=0)] | None = None
    gyr_rad_s: Annotated[float, Field(gt=0)] | None = None


class SensorRecord(_WholePart):
    """What is known of a sensor, beside what the protocol says of it.

    Attributes:
        driver: Where its samples come from: simulated, imported, or the driver of a device.
        description: For people.
        preset: Data sheet that it is simulated from.
        rate_hz: Nominal, or as measured where nothing states one.
        magnetometer: Whether it has one.
        orientation: Whether it reports one of its own.
        temperature: Whether it reports the temperature of its part.
        sampling: "instantaneous" or "integrated".
        full_scale: Largest readings, where somebody states them.
        rate_delay_s: How much older than its stamp a rate is.
        device_tag: By which a stored calibration finds the device again.
        hemisphere: Where it was recorded, which tells whether the magnetic field points down; null
            where nobody says.
        truth: Where the truth of an import comes from.
        truth_link: Link of an arm whose joint angles made the truth; null where it is that of
            orientations.
        truth_otherwise: What of the joint angles must be read otherwise for that link to turn as
            the sensor does; null where nothing is known of it.
        truth_offset_s: What a person said is to be added to the truth's times, and was.
        truth_world: Whether the z axis of the truth's world points up ("z_up"), or nobody knows
            where up is in it ("unknown").
        truth_sd_deg: Standard uncertainty of the truth's orientations about each axis, about the
            worst one where they differ [deg]; null where nobody knows.
        truth_sd_from: Where that comes from.
        statistics: What a recorded device counted.
    """

    driver: str | None = None
    description: str | None = None
    preset: str | None = None
    rate_hz: float | None = Field(default=None, gt=0, le=FASTEST_HZ)
    magnetometer: bool = False
    orientation: bool = False
    temperature: bool = False
    sampling: str | None = None
    full_scale: FullScale | None = None
    rate_delay_s: float | None = Field(default=None, ge=-LONGEST_DELAY_S, le=LONGEST_DELAY_S)
    device_tag: str | None = None
    hemisphere: Literal["north", "south"] | None = None
    truth: str | None = None
    truth_link: str | None = None
    truth_otherwise: str | None = None
    truth_offset_s: float | None = None
    truth_world: Literal["z_up", "unknown"] = "z_up"
    truth_sd_deg: float | None = Field(default=None, ge=0)
    truth_sd_from: str | None = None
    statistics: dict[str, Any] = {}

    @property
    def simulated(self) -> bool:
        """Whether it is a model of a sensor."""
        return self.driver == SIMULATED

    @staticmethod
    def of(described: Mapping[str, Any]) -> SensorRecord:
        """What a sensor says of itself today."""
        return SensorRecord.model_validate(plain_values(described))

    def identity(self) -> dict[str, Any]:
        """What must not change of a sensor: not what it counted, nor how full its battery is."""
        return {key: value for key, value in self.written().items() if key not in PASSING}


class JointTruthRecord(_Part):
    """What is known of the true angles that came with an import, of one joint.

    Attributes:
        truth: Where they come from.
        same_clock: Whether their times are on the clock of the samples.
        offset_s: What a person said is to be added to their times, and was.
    """

    truth: str | None = None
    same_clock: bool = False
    offset_s: float | None = None


class ProtocolRecord(_WholePart):
    """What was run; of an import or a recording its name, and a sentence."""

    name: str | None = None
    purpose: str | None = None
    file: str | None = None


class RobotRecord(_Part):
    """The arm, and where its files were read from."""

    name: str | None = None
    file: str | None = None
    urdf: str | None = None


class ArmTiming(_Part):
    """How the deadlines of a real arm were kept.

    Attributes:
        samples_missed: Of the controller's.
        clock_unsure_s: By how much the host times of its stamps may be off [s].
    """

    samples_missed: int = Field(default=0, ge=0)
    clock_unsure_s: float = Field(default=0.0, ge=0)


class ArmPart(_Part):
    """What moved, and what its controller said of itself.

    Attributes:
        driver: Of the arm.
        provenance: Where its motion comes from, in words that go on after "followed".
        commanded: Whether it was told to move.
        speed: Of a simulated arm, "fast" or "realtime".
        timing: Of a real arm.
    """

    driver: str | None = None
    provenance: str | None = None
    commanded: bool | None = None
    speed: Literal["fast", "realtime"] = "fast"
    timing: ArmTiming = ArmTiming()

    @property
    def record(self) -> ArmRecord | None:
        """The arm, or None where the bench drove none.

        Earlier sessions name only the driver: a model, a recorded motion, or that of some
        controller.
        """
        if self.driver is None:
            return None
        before = {"simulated": (MODEL, False), "replay": (RECORDED_MOTION, False)}
        provenance, commanded = before.get(self.driver, (REPORTED_MOTION, True))
        return ArmRecord(
            self.driver,
            provenance if self.provenance is None else self.provenance,
            commanded if self.commanded is None else self.commanded,
        )


class DipoleRecord(_Part):
    """A source that disturbs the earth's field."""

    name: str | None = None
    link: str | None = None
    position_mm: list[float]
    moment_A_m2: list[float]
    iron_radius_mm: float | None = Field(default=None, ge=0)


class EnvironmentRecord(_Part):
    """What simulated magnetometers feel.

    Attributes:
        magnetic_field_uT: Of the earth, in the world; empty where nothing was simulated.
        dipoles: What disturbs it.
        why: Where the robot file has them from.
    """

    magnetic_field_uT: list[float] = []
    dipoles: list[DipoleRecord] = []
    why: str | None = None


class JointUseRecord(_Part):
    """What the plan asked of a joint of the arm."""

    joint: str
    lowest_deg: float
    highest_deg: float
    peak_speed_deg_s: float = Field(ge=0)
    speed_limit_deg_s: float = Field(gt=0)
    peak_acceleration_deg_s2: float = Field(ge=0)
    acceleration_limit_deg_s2: float = Field(gt=0)


class ClearanceRecord(_Part):
    """The smallest distance between two bodies."""

    first: str
    second: str
    distance_mm: float
    time_s: float


class CheckRecord(_Part):
    """What `testbench check` found, of that which is read again."""

    steps: int | None = Field(default=None, ge=0)
    duration_s: float | None = Field(default=None, ge=0)
    joints: list[JointUseRecord] = []
    clearance: ClearanceRecord | None = None
    warnings: list[str] = []


class PlanRecord(_Part):
    """The plan that was run."""

    hash: str | None = None
    check: CheckRecord = CheckRecord()


class ResumesRecord(_Part):
    """The session that this one goes on with, and the steps of the plan that it was to do."""

    session: str
    steps: list[Annotated[int, Field(ge=0)]] | None = None


def _several(source: Any) -> Any:
    return [source] if isinstance(source, str) else source


_FINDINGS = TypeAdapter(list[Finding])


def _findings(written: Any) -> list[Finding]:
    return _FINDINGS.validate_python(written)  # not strict: JSON has no severities


class Manifest(_Part):
    """The content of manifest.json; docs/session_format.md says what each key means.

    Attributes:
        analysis: As it stands there; `Session.analysis` is what it means.
        analysis_request: How the run was to be analysed, where that is not as the protocol says.
        true_angles: Joints whose angles another system gave, by name.
    """

    schema_version: int
    status: RunStatus = Field(strict=False)
    sensors: dict[Annotated[str, StringConstraints(pattern=EARLIER_NAME_PATTERN)], SensorRecord]
    session: str | None = None
    kind: Literal["run", "import", "recording"] | None = None
    message: str | None = None
    started_utc: str | None = None
    recorded_utc: str | None = None
    recorded_by: str | None = None
    duration_s: float | None = Field(default=None, ge=0)
    clocks: dict[str, str] = {}
    software: dict[str, str] = {}
    protocol: ProtocolRecord = ProtocolRecord()
    protocol_path: str | None = None
    seed: int | None = Field(default=None, ge=0)
    robot: RobotRecord = RobotRecord()
    arm: ArmPart = ArmPart()
    environment: EnvironmentRecord | None = None
    simulated_sensors: bool = False
    checklist: dict[str, Any] | None = None
    device_statistics: dict[str, Any] = {}
    analysis_request: dict[str, Any] = {}
    resumed: list[dict[str, Any]] = []
    resumes: ResumesRecord | None = None
    plan: PlanRecord = PlanRecord()
    format: str | None = None
    source: Annotated[list[str], BeforeValidator(_several)] = []
    findings: Annotated[list[Finding], BeforeValidator(_findings)] = []
    samples: dict[str, Annotated[int, Field(ge=0)]] = {}
    analysis: dict[str, Any] = {}
    true_angles: dict[str, JointTruthRecord] = {}
    files: dict[str, str] = {}

    _content: dict[str, Any] = PrivateAttr(default_factory=dict)

    @property
    def notes(self) -> list[str]:
        """The findings as sentences."""
        return [str(finding) for finding in self.findings]

    @property
    def content(self) -> dict[str, Any]:
        """All that stands in the file, known or not; not to be changed."""
        return self._content

    @staticmethod
    def of(content: Any, file: Path) -> Manifest:
        """The manifest that a mapping is.

        Args:
            content: As read from JSON.
            file: Where it stands, for messages.

        Raises:
            SessionError: It is none, is damaged, or of a newer schema.
        """
        if not isinstance(content, dict):
            raise SessionError(f"{file} is damaged: it is no mapping")
        version = content.get("schema_version")
        if not isinstance(version, int) or version > SCHEMA_VERSION:
            raise SessionError(
                f"{file.parent} has session schema {version!r:.50}; this version reads up to "
                f"{SCHEMA_VERSION}"
            )
        content = dict(content)
        sentences_to_findings(content, "notes")
        try:
            manifest = Manifest.model_validate(content)
        except ValidationError as error:
            raise SessionError(f"{file} is {_fault(error, content)}") from None
        manifest._content = content
        return manifest

    @staticmethod
    def read(folder: Path) -> Manifest:
        """The manifest of a session.

        Raises:
            SessionError: It is missing or damaged, or of a newer schema.
        """
        return Manifest.of(read_json(folder / MANIFEST), folder / MANIFEST)

    def write(self, folder: Path) -> None:
        """Write it into the folder of a session, with all that was in it."""
        write_json(folder / MANIFEST, self._content)

    def changed(self, without: tuple[str, ...] = (), **entries: Any) -> Manifest:
        """The same with other entries.

        Args:
            without: Entries that it shall lack.
            entries: By key, as they are to stand in the file.
        """
        kept = {key: value for key, value in self._content.items() if key not in without}
        return Manifest.of(kept | plain_values(entries), Path(self.session or "") / MANIFEST)


def _fault(error: ValidationError, content: dict[str, Any]) -> str:
    """What is wrong with a manifest, in a few words."""
    fault = error.errors(include_url=False)[0]
    key, *rest = fault["loc"]
    if key == "status":
        return f"damaged: its status is {content.get('status')!r:.50}"
    if fault["type"] == "string_pattern_mismatch":
        return f"refused: '{str(fault['input'])[:50]}' is no name for a sensor"
    if key == "sensors" and len(rest) < 2:
        return "damaged: it names no sensors"
    if not rest and fault["type"] in {"model_type", "dict_type"}:
        return f"damaged: its {key} is no mapping"
    return f"damaged: {first_problem(error)}"
