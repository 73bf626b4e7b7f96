"""Record a run: the session's folder, its streams and its events."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from testbench.clock import Clock
from testbench.drivers.imus.base import Imu
from testbench.exceptions import StorageError
from testbench.execution.guards import Trip
from testbench.execution.truth import write_truth
from testbench.frames import NANOSECONDS
from testbench.records.plan import Plan, PlannedStep
from testbench.records.replacing import disk_reason, stored
from testbench.records.samples import IMU_NOTES, TABLE_UNITS, ArmSamples, ImuSamples
from testbench.records.session import ARM, PLAN, Event, RunStatus, Session, step_events
from testbench.records.session_writer import SessionWriter
from testbench.records.storage import last_value

KEPT = "nothing of the recording is lost; make room, then `testbench run --resume {}`"
ARM_NOTES = {"content": "joint angles sent and measured", **TABLE_UNITS}


class Recorder:
    """Writes one run.

    Args:
        plan: What is run.
        imus: The sensors, by name.
        folder: The session's folder, to be made.
        clock: For the time of start and the rhythm of syncing.
        seed: Of the run; None where nothing is drawn.
        details: Further entries of the manifest.
        arm_columns: What the arm's samples hold beyond angles and rates, name to type.
        resumed: Go on with this session; what it holds already is not written again.

    Raises:
        StorageError: The disk does not take it; a session that was to be gone on with keeps
            everything.
    """

    def __init__(
        self,
        plan: Plan,
        imus: dict[str, Imu],
        folder: Path,
        clock: Clock,
        seed: int | None,
        details: dict[str, Any],
        arm_columns: dict[str, Any] | None = None,
        resumed: Session | None = None,
    ):
        self.plan, self.imus, self.clock = plan, imus, clock
        self._noted: set[tuple[int, str, Any]] = set()
        path = folder if resumed is None else resumed.path
        comfort = (
            "nothing was recorded; make room, then run it again"
            if resumed is None
            else KEPT.format(path)
        )
        with stored(path, comfort):
            self._writer = (
                self._new(folder, clock, seed, details) if resumed is None else self._again(resumed)
            )
            try:
                self._open(arm_columns or {})
            except BaseException:
                self._writer.abandon()
                raise
            if resumed is None:
                self._writer.announce()
        self._synced_ns = clock.monotonic_ns()

    def _open(self, arm_columns: dict[str, Any]) -> None:
        """Begin the streams, or go on with those that there are."""
        self._writer.open_journal(
            ARM, ArmSamples.columns(self.plan.robot.joint_names) | arm_columns, ARM_NOTES
        )
        for name, imu in self.imus.items():
            self._writer.open_journal(f"imu_{name}", imu.columns(), IMU_NOTES)
        streams = [ARM, *(f"imu_{name}" for name in self.imus)]
        self._present = {name: self._writer.rows(name) for name in streams}

    def _new(
        self, folder: Path, clock: Clock, seed: int | None, details: dict[str, Any]
    ) -> SessionWriter:
        """A new session with everything that is known before anything moves."""
        plan, imus, spec = self.plan, self.imus, self.plan.protocol.spec
        writer = SessionWriter(
            folder,
            spec.analysis(),
            {name: imu.describe() for name, imu in imus.items()},
            clock.utc(),
            {
                "kind": "run",
                "seed": seed,
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
                **details,
            },
            announced=False,
        )
        writer.add_text("protocol.yaml", plan.protocol.document.text)
        for name, text in plan.protocol.texts().items():
            if name != plan.protocol.document.file.name:
                writer.add_text(f"included_{name}", text)
        writer.add_text("robot.yaml", plan.robot.text)
        writer.add_text("robot.urdf", plan.robot.urdf.read_text(encoding="utf-8"))
        plan.save(folder / PLAN)
        return writer

    def _again(self, session: Session) -> SessionWriter:
        """A session to go on with; its events are not written a second time."""
        self._noted = {
            (event.host_time_ns, event.event, event.details.get("index"))
            for event in session.events
        }
        duration = session.manifest.get("duration_s")
        writer = SessionWriter.reopen(session.path, {"at_s": duration, "was": str(session.status)})
        if (
            session.status is RunStatus.INTERRUPTED
        ):  # it ends with the arm's stop, which must not stay in the middle
            for stream in [ARM, *(f"imu_{name}" for name in self.imus)]:
                (session.path / f"{stream}.parquet").unlink(missing_ok=True)
        return writer

    @property
    def path(self) -> Path:
        """The session's folder."""
        return self._writer.path

    def event(self, host_time_ns: int, event: str, **details: Any) -> None:
        """Note that something happened."""
        self._writer.event(Event(host_time_ns, event, details))

    def step_events(self, begin_ns: int, end_ns: int) -> None:
        """Note what the steps of the plan did in [begin, end) [ns]."""
        near = (
            step for step in self.plan.steps if step.start_ns < end_ns and step.end_ns >= begin_ns
        )
        for event in step_events(near):
            if begin_ns <= event.host_time_ns < end_ns:
                self._once(event)

    def step_event(self, host_time_ns: int, event: str, step: PlannedStep) -> None:
        """Note that a step started, settled or ended, at a time that is not the plan's."""
        details = next(planned.details for planned in step_events([step]) if planned.event == event)
        self._once(Event(host_time_ns, event, details))

    def _once(self, event: Event) -> None:
        """Note what a step did, but for what a resumed session says already."""
        if (event.host_time_ns, event.event, event.details.get("index")) not in self._noted:
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

    def samples(self, arm: ArmSamples, imus: dict[str, ImuSamples]) -> None:
        """Append what was read, and sync once a second."""
        self._append(ARM, arm.to_columns())
        for name, samples in imus.items():
            self._append(f"imu_{name}", samples.to_columns())
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

    def close(
        self, status: RunStatus, message: str = "", details: dict[str, Any] | None = None
    ) -> Session:
        """Compact the streams, add the truth, and finish the manifest with further entries.

        Raises:
            StorageError: The disk does not take it; the session is left unfinished, with everything
                that was written.
        """
        try:
            return self._close(status, message, details or {})
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

    def _close(self, status: RunStatus, message: str, details: dict[str, Any]) -> Session:
        self._writer.compact()
        write_truth(self.path, self.plan.robot, self.plan.protocol.spec.sensors)
        duration = (
            float(last_value(self.path / f"{ARM}.parquet", "host_time_ns") or 0) / NANOSECONDS
        )
        self._writer.close(status, message=message, duration_s=duration, **details)
        return Session(self.path)
