"""Session: a recording on disk; docs/session_format.md describes every file."""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from copy import copy
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from testbench.exceptions import NotFoundError, SessionError
from testbench.records.disk.html_table import html_table
from testbench.records.disk.json_record import first_problem
from testbench.records.disk.neighbouring_rows import Instants, is_long, read_near
from testbench.records.disk.tables import ROWS_PER_GROUP, parquet_shape, read_parquet
from testbench.records.session.body_joints import with_body
from testbench.records.session.layout import (
    ARM,
    CHAIN_ROBOT,
    CHAIN_URDF,
    EVENTS,
    JOURNALS,
    MANIFEST,
    ROBOT,
    URDF,
    angles_stream,
    imu_stream,
    table_file,
    truth_stream,
)
from testbench.records.session.manifest import Manifest
from testbench.records.session.manifest import RunStatus as RunStatus  # its status is one of these
from testbench.records.session.plan import PlannedStep, step_of
from testbench.records.session.samples import TRUE_ANGLES, ArmSamples, ImuSamples, TrueAngles, Truth
from testbench.records.session.sensor_file import SensorFile, TruthFile
from testbench.records.session.sound_tables import (
    LATEST_NS,
    RESTARTED_NS,
    refuse_no_numbers,
    refuse_other_kinds,
    refuse_times,
)
from testbench.records.specs.protocol import Analysis
from testbench.records.specs.robot import Robot, load_robot, robot_from_text
from testbench.records.specs.strict import Placement


@dataclass(frozen=True)
class Event:
    """Something that happened: host time [ns], kind, and its details."""

    host_time_ns: int
    event: str
    details: dict[str, Any]

    def to_json(self) -> str:
        """One line of events.jsonl."""
        return json.dumps({"host_time_ns": self.host_time_ns, "event": self.event, **self.details})


def event_of(line: str) -> Event | None:
    """The event of a line of events.jsonl; None of one that is cut off, empty, or damaged."""
    try:
        data = json.loads(line)
        time, name = data.pop("host_time_ns"), data.pop("event")
    except (ValueError, KeyError, AttributeError, RecursionError):
        return None
    return Event(time, name, data) if isinstance(time, int) and isinstance(name, str) else None


class Session:
    """A recorded session.

    Args:
        path: Its folder.

    Raises:
        SessionError: The folder is not a session, or one of a newer schema.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._near: Instants | None = None
        self._sensors: dict[str, SensorFile] = {}
        self._truths: dict[str, TruthFile] = {}
        if not (self.path / MANIFEST).is_file():
            what = "is a file; a session is a folder" if self.path.is_file() else "does not exist"
            what = "is not a session: it has no manifest.json" if self.path.is_dir() else what
            raise SessionError(f"{self.path} {what}")
        self.manifest = Manifest.read(self.path)

    def __repr__(self) -> str:
        took = self.manifest.duration_s
        lasting = "" if took is None else f", {took:.1f} s"
        return (
            f"<Session {self.path}: {self.status.value}{lasting}, {', '.join(self.sensor_names)}>"
        )

    def _repr_html_(self) -> str:
        """What a notebook shows: what was recorded, how it ended, and the sensors."""
        manifest, took = self.manifest, self.manifest.duration_s
        rows = [
            ("what", manifest.protocol.name or str(manifest.kind)),
            ("robot", manifest.robot.name or "none"),
            ("status", self.status.value),
            ("duration", None if took is None else f"{took:.1f} s"),
            ("steps", f"{len(self.steps)} finished" if self.steps else None),
            ("simulated", ", ".join(self.simulated) or "nothing"),
        ]
        for name in self.sensor_names:
            own = manifest.sensors[name]
            rate = "" if own.rate_hz is None else f", {own.rate_hz:g} Hz"
            rows.append((f"sensor {name}", f"{own.description or own.driver}{rate}"))
        return html_table(str(self.path), (), rows)

    @property
    def name(self) -> str:
        return self.path.name

    @property
    def started(self) -> datetime:
        """When the run or recording began; of an import, when it was made.

        Raises:
            SessionError: The manifest has no date.
        """
        return self._date("started_utc", self.manifest.started_utc)

    @property
    def recorded_at(self) -> datetime | None:
        """When the samples were taken; None if unknown, as of an import whose files do not say.

        Raises:
            SessionError: What the manifest has is no date.
        """
        if self.manifest.kind != "import":
            return self.started
        recorded = self.manifest.recorded_utc
        return self._date("recorded_utc", recorded) if recorded else None

    def _date(self, key: str, text: str | None) -> datetime:
        try:
            moment = datetime.fromisoformat(text or "")
        except ValueError:
            raise SessionError(f"{self.path}: {key} of the manifest is no date: {text}") from None
        return moment if moment.tzinfo else moment.replace(tzinfo=UTC)

    @property
    def status(self) -> RunStatus:
        return self.manifest.status

    @cached_property
    def analysis(self) -> Analysis:
        """Sensors, joints, filters and limits, as of the recording.

        Raises:
            SessionError: The manifest does not hold them.
        """
        try:
            analysis = Analysis.model_validate(self.manifest.analysis)
        except ValidationError as error:
            raise SessionError(
                f"{self.path / MANIFEST}: the analysis is damaged: {first_problem(error)}"
            ) from None
        if self.has_protocol and set(analysis.sensors) != set(self.sensor_names):
            raise SessionError(
                f"{self.path / MANIFEST}: the analysis is damaged: it is of the sensors "
                f"{', '.join(analysis.sensors)}, and {', '.join(self.sensor_names)} were recorded"
            )
        return with_body(analysis, self.sensor_names, self.path / MANIFEST)

    @property
    def is_being_recorded(self) -> bool:
        """Whether a living process still writes it."""
        if self.status is not RunStatus.RUNNING or not (self.path / EVENTS).is_file():
            return False
        with (self.path / EVENTS).open("r", encoding="utf-8") as events:
            try:
                fcntl.flock(events, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
        return False

    @property
    def what_to_do_cut_off(self) -> str:
        """That it was cut off, and what helps, for people."""
        if self.manifest.kind == "import":
            return (
                f"{self.path} is an import that was cut off, and not whole; `testbench sessions "
                f"--logs {self.path.parent} --clean` removes it, then import its files again"
            )
        return (
            f"{self.path} was cut off while it was recorded; `testbench recover {self.path}` "
            "makes it readable"
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the manifest.

        It holds the hashes of every raw file and what to compute from them.
        """
        return hashlib.sha256((self.path / MANIFEST).read_bytes()).hexdigest()

    @property
    def has_protocol(self) -> bool:
        """Whether the bench ran it, step by step.

        Of an imported recording at most the poses of the arm are known.
        """
        return self.manifest.kind == "run"

    @property
    def simulated(self) -> list[str]:
        """What of a run was simulated: arm and sensors, the sensors alone, or nothing."""
        arm = self.manifest.arm.record
        if arm is not None and arm.simulated:
            return ["arm", "sensors"]
        return ["sensors"] if self.manifest.simulated_sensors else []

    @property
    def sensor_names(self) -> list[str]:
        return list(self.manifest.sensors)

    @cached_property
    def robot(self) -> Robot | None:
        """The arm, or None for an imported recording without one."""
        file, copy = self.path / ROBOT, self.path / URDF
        if not file.is_file():
            return None
        urdf = self.manifest.robot.urdf
        if urdf is None or "\0" in urdf:
            raise SessionError(
                f"{self.path / MANIFEST} is damaged: it does not say which URDF the robot has"
            )
        original = Path(urdf)  # its meshes lie beside it
        same = original.is_file() and copy.is_file() and original.read_bytes() == copy.read_bytes()
        return robot_from_text(file, original if same else copy)

    @cached_property
    def chain_robot(self) -> Robot | None:
        """What the chain filter runs on: the model that an import states, or the arm.

        Raises:
            NotFoundError: No such model; lists those that ship.
            FileProblems: The model is malformed.
        """
        chain = self.analysis.estimate.chain
        if chain is None or chain.model is None:
            return self.robot
        if chain.model.robot == CHAIN_ROBOT:
            return robot_from_text(self.path / CHAIN_ROBOT, self.path / CHAIN_URDF)
        return load_robot(chain.model.robot)

    def carried(self, sensor: str) -> tuple[str, Placement]:
        """Link that carries a sensor for the chain filter, and its mounting as stated."""
        chain = self.analysis.estimate.chain
        if chain is not None and chain.model is not None:
            own = chain.model.sensors[sensor]
            return own.link, own.mounting
        placed = self.analysis.sensors[sensor]
        return placed.link, placed.mounting

    def sensor(self, sensor: str) -> SensorFile:
        """The raw samples of a sensor, opened the first time that they are asked for.

        Raises:
            NotFoundError: No such sensor.
            SessionError: They are being recorded, were cut off, or are damaged.
        """
        self._check(sensor)
        self._check_closed()
        if sensor not in self._sensors:
            self._sensors[sensor] = SensorFile(self.path / table_file(imu_stream(sensor)))
        return self._sensors[sensor]

    def imu(
        self, sensor: str, begin: int = 0, end: int | None = None, every: int = 1
    ) -> ImuSamples:
        """Raw samples of a sensor.

        Args:
            sensor: Its name.
            begin: First sample.
            end: The one after the last; to the end if None.
            every: Only one sample of so many, the last of them.

        Raises:
            NotFoundError: No such sensor.
        """
        return self.sensor(sensor).read(begin, end, every)

    def imu_batches(self, sensor: str, rows: int = ROWS_PER_GROUP) -> Iterator[ImuSamples]:
        """Raw samples of a sensor in chunks, for recordings that do not fit in memory."""
        return self.sensor(sensor).batches(rows)

    def imu_columns(self, sensor: str) -> list[str]:
        """Names of the columns of a sensor's raw samples."""
        return self.sensor(sensor).columns

    def imu_column(
        self, sensor: str, column: str, begin: int = 0, end: int | None = None
    ) -> np.ndarray:
        """One column of a sensor's raw samples, from sample `begin` to before `end`, shape (n,)."""
        return self.sensor(sensor).column(column, begin, end)

    def sample_count(self, sensor: str) -> int:
        """How many samples of a sensor there are."""
        return self.sensor(sensor).count

    def near(self, instants: Instants) -> Session:
        """The same session, of whose long truths and arm only rows about the instants are read.

        What is interpolated at these instants is not changed by it, and the memory is bounded
        whatever the length. Of these truths the orientations alone are read. Truths that do not
        come from an arm are read whole: whether one of their orientations has jumped shows beside
        the others only.
        """
        copied = copy(self)
        copied._near = instants
        return copied

    def truth(self, sensor: str) -> Truth | None:
        """What the sensor went through, or None where nobody knows."""
        file = self.truth_file(sensor)
        if file is None:
            return None
        if self._near is not None and sensor in self._near.sensors:
            return file.near(self._near.sensors[sensor], rates=False)
        return file.read()

    def truth_file(self, sensor: str) -> TruthFile | None:
        """The same, opened the first time that it is asked for."""
        self._check(sensor)
        file = self._listed(truth_stream(sensor))
        if file is not None and sensor not in self._truths:
            self._truths[sensor] = TruthFile(file)
        return None if file is None else self._truths[sensor]

    def true_angles(self, joint: str) -> TrueAngles | None:
        """Angles of a joint according to another system, or None where there are none.

        Args:
            joint: Of the analysis.

        Raises:
            SessionError: They are missing, or damaged.
        """
        file = self._listed(angles_stream(joint))
        if file is None:
            return None
        refuse_other_kinds(file, ("host_time_ns", *TRUE_ANGLES))
        table = read_parquet(file)
        missing = [name for name in ("host_time_ns", *TRUE_ANGLES) if name not in table]
        if missing:
            raise SessionError(f"{file} is damaged: it has no column {missing[0]}")
        refuse_times(file, "host_time_ns", table["host_time_ns"])
        return TrueAngles.from_columns(table)

    def _listed(self, stream: str) -> Path | None:
        """The file of a table that a session may have, None where it has none.

        Raises:
            SessionError: It is missing, though the manifest lists it.
        """
        file = self.path / table_file(stream)
        if not file.is_file() and file.name in self.manifest.files:
            raise SessionError(
                f"{file} is missing, though the manifest lists it; the session is damaged"
            )
        return file if file.is_file() else None

    def arm(self) -> ArmSamples | None:
        """What the arm reported, or None when there was none."""
        file = self.path / table_file(ARM)
        if not file.is_file() or self.robot is None:
            return None
        names = self.robot.joint_names
        refuse_other_kinds(file, ArmSamples.columns(names))
        if self._near is not None and is_long(parquet_shape(file)[0]):
            near = read_near(file, ArmSamples.groups(names), self._near.arm)
            arm = ArmSamples(
                names, near["host_time_ns"], near["q_sent"], near["q_measured"], near["v_measured"]
            )
        else:
            arm = ArmSamples.from_columns(read_parquet(file), names)
        refuse_times(file, "host_time_ns", arm.host_time_ns, RESTARTED_NS)
        angles = {"q_sent": arm.q_sent, "q_measured": arm.q_measured}
        refuse_no_numbers(file, angles | {"v_measured": arm.v_measured})
        return arm

    def arm_joint(self, joint: str) -> tuple[np.ndarray, np.ndarray] | None:
        """Times [ns] and angles [rad] of one joint, shape (n,) each; None where there are none."""
        file = self.path / table_file(ARM)
        if not file.is_file() or self.robot is None or joint not in self.robot.joint_names:
            return None
        columns = ["host_time_ns", f"q_measured_{joint}_rad"]
        refuse_other_kinds(file, columns)
        if self._near is not None and is_long(parquet_shape(file)[0]):
            table = read_near(file, {name: name for name in columns}, self._near.arm)
        else:
            table = read_parquet(file, columns)
        refuse_times(file, columns[0], table[columns[0]], RESTARTED_NS)
        refuse_no_numbers(file, {columns[1]: table[columns[1]]})
        return table[columns[0]], table[columns[1]]

    @cached_property
    def events(self) -> list[Event]:
        """Everything that happened, in order; a last line cut off by a crash is left out."""
        file = self.path / EVENTS
        lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
        events = [event for line in lines if (event := event_of(line)) is not None]
        for event in events:
            if abs(event.host_time_ns) > LATEST_NS:
                raise SessionError(
                    f"{file} is damaged: {event.host_time_ns} is no time of an event"
                )
        return events

    @cached_property
    def steps(self) -> list[PlannedStep]:
        """The steps that were finished, with the times at which they happened."""
        started: dict[int, Event] = {}
        settled: dict[int, int] = {}
        steps = []
        for event in self.events:
            index = event.details.get("index")
            if not isinstance(index, int):
                continue
            if event.event == "step_started":
                started[index] = event
            elif event.event == "step_settled":
                settled[index] = event.host_time_ns
            elif event.event == "step_ended" and index in started:
                step = started[index]
                times = (
                    step.host_time_ns,
                    settled.get(index, step.host_time_ns),
                    event.host_time_ns,
                )
                keys = ("index", "section", "role", "name", "kind", "variables")
                if not all(key in step.details for key in keys):
                    raise SessionError(
                        f"{self.path / EVENTS} is damaged: step {index} says too little"
                    )
                data = {key: step.details[key] for key in keys}
                data |= dict(zip(("start_ns", "settled_ns", "end_ns"), times, strict=True))
                try:
                    steps.append(step_of(data | {"cycles": step.details.get("cycles")}))
                except ValueError as error:
                    raise SessionError(
                        f"{self.path / EVENTS} is damaged: of step {index}, {error}"
                    ) from None
        return steps

    def _check_closed(self) -> None:
        if self.is_being_recorded:
            raise SessionError(f"{self.path} is still being recorded")
        if self.status is RunStatus.RUNNING or any(self.path.glob(JOURNALS)):
            raise SessionError(self.what_to_do_cut_off)

    def _check(self, sensor: str) -> None:
        if sensor not in self.sensor_names:
            raise NotFoundError("sensor of this session", sensor, self.sensor_names)


def step_events(steps: Iterable[PlannedStep]) -> list[Event]:
    """What the steps of an arm did, as the events that `Session.steps` is read from, in order."""
    events = []
    for step in steps:
        details = {
            key: getattr(step, key)
            for key in ("index", "section", "role", "name", "kind", "variables")
        }
        details |= {"cycles": asdict(step.cycles)} if step.cycles is not None else {}
        events.append(Event(step.start_ns, "step_started", details))
        events.append(Event(step.settled_ns, "step_settled", {"index": step.index}))
        events.append(Event(step.end_ns, "step_ended", {"index": step.index}))
    return events


def list_sessions(logs: Path) -> list[Session]:
    """Sessions below a folder, oldest first; other folders and unreadable ones are passed over."""
    sessions = []
    for path in _manifests(logs):
        with suppress(SessionError):
            sessions.append(Session(path.parent))
    return sessions


def damaged_sessions(logs: Path) -> dict[str, str]:
    """Folders with a manifest that are no readable session, by name, and what is wrong."""
    damaged = {}
    for path in _manifests(logs):
        try:
            Session(path.parent)
        except SessionError as error:
            damaged[path.parent.name] = str(error)
    return damaged


def _manifests(logs: Path) -> list[Path]:
    """Those of the folders below; what is being written, or never became whole, is hidden."""
    return sorted(
        path for path in logs.glob(f"*/{MANIFEST}") if not path.parent.name.startswith(".")
    )
