"""Record a session: its folder, its streams and its events, of an arm's run or of devices alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from testbench.clock import Clock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.imus.base import Imu
from testbench.exceptions import DriverError, StorageError
from testbench.execution.guards import Trip
from testbench.execution.options import RunOptions
from testbench.execution.sensors import Sensors
from testbench.execution.state_machine import RunState
from testbench.execution.truth import write_truth
from testbench.frames import NANOSECONDS
from testbench.records.disk.replacing import dated_folder, disk_reason, free_folder, stored
from testbench.records.disk.tables import last_value
from testbench.records.session.layout import (
    ARM,
    INCLUDED,
    MANIFEST,
    PLAN,
    PROTOCOL,
    ROBOT,
    URDF,
    imu_stream,
    table_file,
)
from testbench.records.session.plan import Plan
from testbench.records.session.samples import IMU_NOTES, TABLE_UNITS, ArmSamples, ImuSamples
from testbench.records.session.session import Event, RunStatus, Session, step_events
from testbench.records.session.session_writer import FolderTaken, SessionWriter

ARM_NOTES = {"content": "joint angles sent and measured", **TABLE_UNITS}
MOST_ATTEMPTS = 100
"""At a folder of one's own, where other runs begin in the same second."""
NOTHING_YET = "nothing was recorded; make room, then run it again"
KEPT = "nothing of the recording is lost; make room, then `testbench run --resume {}`"


class Recorder(ABC):
    """Writes a session while it is recorded.

    Args:
        path: Of the session.
        imus: The sensors, by name.
        clock: For the time of start and the rhythm of syncing.
        comfort: What became of the data, where the disk does not take the first of it.

    Attributes:
        kind: Of the session.

    Raises:
        StorageError: The disk does not take it.
    """

    kind: str

    def __init__(self, path: Path, imus: dict[str, Imu], clock: Clock, comfort: str = NOTHING_YET):
        self.path, self.imus, self.clock = path, imus, clock
        with stored(path, comfort):
            self._writer = self._open()
            try:
                for name, (columns, notes) in self._streams().items():
                    self._writer.open_journal(name, columns, notes)
                self._present = {name: self._writer.rows(name) for name in self._streams()}
            except BaseException:
                self._writer.abandon()
                raise
            if not (self.path / MANIFEST).is_file():
                self._writer.announce()
        self._synced_ns = clock.monotonic_ns()

    @abstractmethod
    def _open(self) -> SessionWriter:
        """The session, with everything that is known before anything moves."""

    def _streams(self) -> dict[str, tuple[Mapping[str, Any], Mapping[str, str]]]:
        """Columns and notes of every stream, by its name."""
        return {imu_stream(name): (imu.columns(), IMU_NOTES) for name, imu in self.imus.items()}

    @abstractmethod
    def began(self, arm: SteppingArm) -> None:
        """Note that everything runs."""

    def ended(self, host_time_ns: int, status: RunStatus, message: str) -> None:
        """Note how it ended."""
        self.event(host_time_ns, f"{self.kind}_{status}", message=message)

    def event(self, host_time_ns: int, event: str, **details: Any) -> None:
        """Note that something happened."""
        self._writer.event(Event(host_time_ns, event, details))

    def arm_event(self, event: Event) -> None:
        """Note what the arm did."""
        self._writer.event(event)

    def device_events(self, events: dict[str, list[Event]]) -> None:
        """Note what happened to the sensors, by name, in order of time."""
        named = [
            Event(own.host_time_ns, own.event, {"sensor": name, **own.details})
            for name in events
            for own in events[name]
        ]
        for event in sorted(named, key=lambda event: event.host_time_ns):
            self._writer.event(event)

    def guard_event(self, host_time_ns: int, trip: Trip) -> None:
        """Note that a limit was broken."""
        details = {
            "guard": trip.guard,
            "subject": trip.subject,
            "value": trip.value,
            "limit": trip.limit,
        }
        self.event(host_time_ns, "guard", **details, action=trip.action)

    def state_event(self, host_time_ns: int, old: RunState, new: RunState, why: str) -> None:
        """Note a change of the run's state; a disk that does not take it is told of by the rest."""
        details = {"why": why} if why else {}
        with suppress(StorageError):
            self.event(host_time_ns, "state", state=str(new), before=str(old), **details)

    @abstractmethod
    def arm_samples(self, samples: ArmSamples) -> None:
        """Append what the arm reported."""

    def sensor_samples(self, imus: dict[str, ImuSamples]) -> None:
        """Append what the sensors delivered, and sync once a second."""
        for name, samples in imus.items():
            self._append(imu_stream(name), samples.to_columns())
        self._writer.flush()
        if self.clock.monotonic_ns() - self._synced_ns >= NANOSECONDS:
            self._writer.sync()
            self._synced_ns = self.clock.monotonic_ns()

    def _append(self, stream: str, columns: dict[str, np.ndarray]) -> None:
        """Append rows, but for those which a resumed session holds already."""
        skipped = min(self._present[stream], len(columns["host_time_ns"]))
        self._present[stream] -= skipped
        self._writer.append(
            stream,
            {name: values[skipped:] for name, values in columns.items()} if skipped else columns,
        )

    def lacking(self) -> DriverError | None:
        """Why what was recorded is of no use, or None."""
        return None

    @property
    def kept(self) -> str:
        """What there is of it, for people."""
        return f"what was recorded is kept in {self.path}"

    def close(self, status: RunStatus, message: str, arm: dict[str, Any]) -> Session:
        """Compact the streams, and finish the manifest.

        Args:
            status: How it ended.
            message: Why it ended early.
            arm: What is known of the arm now.

        Raises:
            StorageError: The disk does not take it; the session is left unfinished, with everything
                that was written.
        """
        try:
            self._writer.compact()
            self._writer.close(status, message=message, **self._closing(arm))
        except (StorageError, OSError) as error:
            self._writer.abandon()
            reason = (
                str(error)
                if isinstance(error, StorageError)
                else f"{self.path} cannot be written: {disk_reason(error)}"
            )
            raise StorageError(
                f"{reason}; make room, then `testbench recover {self.path}`"
            ) from None
        return Session(self.path)

    @abstractmethod
    def _closing(self, arm: dict[str, Any]) -> dict[str, Any]:
        """Add what follows from the whole, and give the last entries of the manifest."""

    def _device_statistics(self) -> dict[str, Any]:
        """What the live sensors counted."""
        return {name: counted for name, imu in self.imus.items() if (counted := imu.statistics())}


class RunRecorder(Recorder):
    """Writes the run of an arm.

    Args:
        plan: What is run.
        arm: Connected.
        sensors: On it.
        options: Of the run; what a session that it goes on with holds already is not written again.

    Raises:
        StorageError: The disk does not take it; a session that was to be gone on with keeps
            everything.
    """

    kind = "run"

    def __init__(self, plan: Plan, arm: SteppingArm, sensors: Sensors, options: RunOptions):
        self.plan, self.sensors, self.options = plan, sensors, options
        self.steps = plan.steps if options.steps is None else options.steps
        self._by_index = {step.index: step for step in plan.steps}
        self._arm_columns, self._arm = arm.extra_columns, arm.describe()
        self._done = 0
        resumed, logs = options.resumed, Path(options.logs)
        past = resumed.events if resumed is not None else []
        self._noted = {
            (event.host_time_ns, event.event, event.details.get("index")) for event in past
        }
        self._whole = {event.details.get("index") for event in past if event.event == "step_ended"}
        self._again_ns = recorded_ns(resumed)
        clock, name = arm.time.clock, options.session_name
        if resumed is not None:
            super().__init__(resumed.path, sensors.imus, clock, KEPT.format(resumed.path))
        elif name is not None:
            super().__init__(free_folder(logs, name), sensors.imus, clock)
        else:
            folder = dated_folder(logs, plan.protocol.spec.name, clock)
            super().__init__(folder, sensors.imus, clock)

    def _open(self) -> SessionWriter:
        resumed = self.options.resumed
        return self._new() if resumed is None else self._again(resumed)

    def _claimed(self, details: dict[str, Any]) -> SessionWriter:
        """A new session in a folder that no other run took in the same second."""
        spec = self.plan.protocol.spec
        for attempt in range(MOST_ATTEMPTS):
            try:
                return SessionWriter(
                    self.path,
                    spec.analysis(),
                    {name: imu.describe() for name, imu in self.imus.items()},
                    self.clock.utc(),
                    details,
                    announced=False,
                )
            except FolderTaken:
                if self.options.session_name is not None or attempt == MOST_ATTEMPTS - 1:
                    raise
                self.path = dated_folder(self.path.parent, spec.name, self.clock)
        raise AssertionError("the last attempt ends the loop")

    def _new(self) -> SessionWriter:
        """A new session; its folder becomes one when everything is in it."""
        plan, spec, simulated = self.plan, self.plan.protocol.spec, self.sensors.are_simulated
        details: dict[str, Any] = {
            "kind": self.kind,
            "seed": self.options.seed if simulated else None,
            "protocol_path": str(plan.protocol.document.file.resolve()),
            "protocol": {
                "name": spec.name,
                "purpose": spec.purpose,
                "file": plan.protocol.document.file.name,
            },
            "robot": {
                "name": plan.robot.name,
                "file": None if plan.robot.file is None else str(plan.robot.file),
                "urdf": str(plan.robot.urdf),
            },
            "plan": {"hash": plan.hash, "check": plan.check.to_dict()},
            "arm": self._arm,
            "simulated_sensors": simulated,
            "checklist": self.options.checklist,
            "resumes": self.options.resumes,
            "analysis_request": dict(self.options.analysis_request),
        }
        if self.sensors.environment is not None:
            details["environment"] = self.sensors.environment
        writer = self._claimed(details)
        writer.add_text(PROTOCOL, plan.protocol.document.text)
        for name, text in plan.protocol.texts().items():
            if name != plan.protocol.document.file.name:
                writer.add_text(f"{INCLUDED}{name}", text)
        writer.add_text(ROBOT, plan.robot.text)
        writer.add_text(URDF, plan.robot.urdf.read_text(encoding="utf-8"))
        plan.save(self.path / PLAN)
        return writer

    def _again(self, session: Session) -> SessionWriter:
        """A session to go on with; its events are not written a second time."""
        duration = session.manifest.duration_s
        writer = SessionWriter.reopen(
            session.path,
            {"at_s": duration, "was": str(session.status)},
            {"analysis_request": dict(self.options.analysis_request)},
        )
        if (
            session.status is RunStatus.INTERRUPTED
        ):  # it ends with the arm's stop, which must not stay in the middle
            for stream in self._streams():
                (session.path / table_file(stream)).unlink(missing_ok=True)
        return writer

    def _streams(self) -> dict[str, tuple[Mapping[str, Any], Mapping[str, str]]]:
        columns = ArmSamples.columns(self.plan.robot.joint_names) | self._arm_columns
        return {ARM: (columns, ARM_NOTES)} | super()._streams()

    def began(self, arm: SteppingArm) -> None:
        name = "run_started" if self.options.resumed is None else "run_resumed"
        self.event(self._again_ns, name, arm=type(arm).__name__)
        if arm.notice:
            self.event(self._again_ns, "arm_notice", message=arm.notice)

    def arm_event(self, event: Event) -> None:
        """Note what the arm did; of a step with what it is, and once."""
        if event.event.startswith("step_"):
            step = self._by_index[event.details["index"]]
            details = next(own.details for own in step_events([step]) if own.event == event.event)
            if (event.host_time_ns, event.event, step.index) not in self._noted:
                self._writer.event(Event(event.host_time_ns, event.event, details))
            if event.event == "step_ended":
                self._done += 1
                self._whole.add(step.index)
        elif event.event.startswith("connecting_"):
            step = self.steps[min(self._done, len(self.steps) - 1)]
            self.event(event.host_time_ns, event.event, towards=step.index, name=step.name)
        else:
            self._writer.event(event)

    def arm_samples(self, samples: ArmSamples) -> None:
        self._append(ARM, samples.to_columns())

    @property
    def kept(self) -> str:
        return f"{super().kept}: {len(self._whole)} of {len(self.steps)} steps are whole"

    def _closing(self, arm: dict[str, Any]) -> dict[str, Any]:
        """Add the truth; the recording is as long as the arm's."""
        write_truth(self.path, self.plan.robot, self.plan.protocol.spec.sensors)
        last = last_value(self.path / table_file(ARM), "host_time_ns")
        return {
            "duration_s": float(last or 0) / NANOSECONDS,
            "arm": arm,
            "device_statistics": self._device_statistics(),
        }


def recorded_ns(session: Session | None) -> int:
    """How much a session holds that is to be gone on with [ns]."""
    return 0 if session is None else round((session.manifest.duration_s or 0) * NANOSECONDS)
