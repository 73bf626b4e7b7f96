"""Record a run: the session's folder, its streams and its events."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from testbench.clock import Clock
from testbench.drivers.imus.base import Imu
from testbench.execution.truth import write_truth
from testbench.frames import NANOSECONDS
from testbench.records.plan import Plan
from testbench.records.samples import ArmSamples, ImuSamples
from testbench.records.session import ARM, PLAN, Event, RunStatus, Session, step_events
from testbench.records.session_writer import SessionWriter
from testbench.records.storage import read_parquet

IMU_NOTES = {
    "content": "raw samples of an inertial sensor, in the sensor frame",
    "device_q": "q_earth_from_sensor of the vendor's filter, w x y z, Hamilton",
    "units": "the suffix of each column; times in nanoseconds",
}
ARM_NOTES = {"content": "joint angles sent and measured", "units": "the suffix of each column; times in nanoseconds"}


class Recorder:
    """Writes one run.

    Args:
        plan: What is run. imus: The sensors, by name. folder: The session's folder, to be made. clock: For the time of start
        and the
        rhythm of syncing. seed: Of the run. details: Further entries of the manifest.
    """

    def __init__(self, plan: Plan, imus: dict[str, Imu], folder: Path, clock: Clock, seed: int, details: dict[str, Any]):
        self.plan, self.imus, self.clock = plan, imus, clock
        spec = plan.protocol.spec
        self._writer = SessionWriter(
            folder,
            spec.analysis(),
            {name: imu.describe() for name, imu in imus.items()},
            clock.utc(),
            {
                "kind": "run",
                "seed": seed,
                "protocol": {"name": spec.name, "purpose": spec.purpose, "file": plan.protocol.document.file.name},
                "robot": {"name": plan.robot.name, "urdf": str(plan.robot.urdf)},
                "plan": {"hash": plan.hash, "check": plan.check.to_dict()},
                **details,
            },
        )
        self._writer.add_text("protocol.yaml", plan.protocol.document.text)
        for name, text in plan.protocol.texts().items():
            if name != plan.protocol.document.file.name:
                self._writer.add_text(f"included_{name}", text)
        self._writer.add_text("robot.yaml", plan.robot.text)
        self._writer.add_text("robot.urdf", plan.robot.urdf.read_text(encoding="utf-8"))
        plan.save(folder / PLAN)
        self._writer.open_journal(ARM, ArmSamples.columns(plan.robot.joint_names), ARM_NOTES)
        for name, imu in imus.items():
            self._writer.open_journal(f"imu_{name}", imu.columns(), IMU_NOTES)
        self._synced_ns = clock.monotonic_ns()

    @property
    def path(self) -> Path:
        """The session's folder."""
        return self._writer.path

    def event(self, host_time_ns: int, event: str, **details: Any) -> None:
        """Note that something happened."""
        self._writer.event(Event(host_time_ns, event, details))

    def step_events(self, begin_ns: int, end_ns: int) -> None:
        """Note what the steps of the plan did in [begin, end) [ns]."""
        near = (step for step in self.plan.steps if step.start_ns < end_ns and step.end_ns >= begin_ns)
        for event in step_events(near):
            if begin_ns <= event.host_time_ns < end_ns:
                self._writer.event(event)

    def device_events(self, events: dict[str, list[Event]]) -> None:
        """Note what happened to the sensors, by name, in order of time."""
        named = [Event(own.host_time_ns, own.event, {"sensor": name, **own.details}) for name in events for own in events[name]]
        for event in sorted(named, key=lambda event: event.host_time_ns):
            self._writer.event(event)

    def samples(self, arm: ArmSamples, imus: dict[str, ImuSamples]) -> None:
        """Append what was read, and sync once a second."""
        self._writer.append(ARM, arm.to_columns())
        for name, samples in imus.items():
            self._writer.append(f"imu_{name}", samples.to_columns())
        self._writer.flush()
        if self.clock.monotonic_ns() - self._synced_ns >= NANOSECONDS:
            self._writer.sync()
            self._synced_ns = self.clock.monotonic_ns()

    def close(self, status: RunStatus, message: str = "") -> Session:
        """Compact the streams, add the truth, and finish the manifest."""
        self._writer.compact()
        write_truth(self.path, self.plan.robot, self.plan.protocol.spec.sensors)
        times = read_parquet(self.path / f"{ARM}.parquet", ["host_time_ns"])["host_time_ns"]
        duration = float(times[-1]) / NANOSECONDS if len(times) else 0.0
        self._writer.close(status, message=message, duration_s=duration)
        return Session(self.path)
