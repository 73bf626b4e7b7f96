"""The stage `execute`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from testbench.clock import Clock, SystemClock
from testbench.drivers.arms.base import Arm
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.exceptions import BenchError, RunInterrupted
from testbench.execution.interruption import on_interrupt
from testbench.execution.recorder import Recorder
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics
from testbench.records.plan import Plan
from testbench.records.session import RunStatus, Session

REALTIME_CHUNK_NS = NANOSECONDS // 10
FAST_CHUNK_NS = 10 * NANOSECONDS
TAIL_NS = NANOSECONDS
"""Recording goes on this long after the last step, so that the last dwell is whole on every clock."""


@dataclass(frozen=True)
class Progress:
    """How far a run is; times in seconds from its start."""

    step: str
    index: int
    steps: int
    time: float
    duration: float


def execute(
    plan: Plan,
    logs: str | Path = "logs",
    seed: int = 0,
    speed: Literal["fast", "realtime"] = "fast",
    clock: Clock | None = None,
    progress: Callable[[Progress], None] | None = None,
    session_name: str | None = None,
) -> Session:
    """Run a plan on the simulated arm and record it.

    Args:
        plan: A checked motion. logs: Folder that sessions are made in. seed: Of every random number of the simulation; the same
        seed gives the same raw files. speed: "fast": virtual time as fast as the machine goes; "realtime": a second a second.
        clock: Source of the date and of the rhythm; the machine's if None. progress: Called after every chunk of time.
        session_name: Name of the session's folder; time and protocol if None.

    Raises:
        RunInterrupted: The operator pressed Ctrl-C; the session is kept and closed as interrupted.
        DriverError: The arm or a sensor failed; the session is kept and closed as an error.
    """
    clock = clock or SystemClock()
    spec = plan.protocol.spec
    arm = SimulatedArm(plan.robot, seed, spec.environment.joint_errors)
    kinematics = Kinematics(plan.robot)
    imus: dict[str, Imu] = {
        name: SimulatedImu(name, sensor, kinematics, spec.environment, arm.true_state, seed)
        for name, sensor in spec.sensors.items()
    }
    folder = _session_folder(Path(logs), session_name or f"{clock.utc():%Y%m%dT%H%M%SZ}_{spec.name}")
    recorder = Recorder(plan, imus, folder, clock, seed, {"arm": {"driver": "simulated", "speed": speed}})
    return _Run(plan, arm, imus, recorder, clock, speed, progress).run()


class _Run:
    """One run from kickoff to a closed session."""

    def __init__(
        self, plan: Plan, arm: Arm, imus: dict[str, Imu], recorder: Recorder, clock: Clock, speed: str,
        progress: Callable[[Progress], None] | None,
    ):  # fmt: skip
        self.plan, self.arm, self.imus, self.recorder, self.clock = plan, arm, imus, recorder, clock
        self.realtime, self.progress = speed == "realtime", progress
        self.now_ns = 0
        self.stop_asked = False

    def run(self) -> Session:
        status, message = RunStatus.COMPLETED, ""
        error: BaseException | None = None
        with on_interrupt(self._ask_to_stop):
            try:
                self.arm.prepare(self.plan)
                self.arm.kickoff()
                for imu in self.imus.values():
                    imu.kickoff()
                self.recorder.event(0, "run_started", arm=type(self.arm).__name__)
                self._follow()
                if self.stop_asked:
                    status, message = RunStatus.INTERRUPTED, "stopped by the operator"
            except BenchError as failure:
                status, message, error = RunStatus.ERROR, str(failure), failure
            except BaseException as failure:
                status, message, error = RunStatus.ERROR, f"{type(failure).__name__}: {failure}", failure
            session = self._close(status, message)
        if status is RunStatus.INTERRUPTED:
            raise RunInterrupted(f"interrupted by the operator; what was recorded is kept in {session.path}", session)
        if error is not None:
            raise error
        return session

    def _ask_to_stop(self) -> None:
        self.stop_asked = True

    def _follow(self) -> None:
        end_ns = int(self.plan.trajectory.time_ns[-1]) + TAIL_NS
        chunk = REALTIME_CHUNK_NS if self.realtime else FAST_CHUNK_NS
        begin = self.clock.monotonic_ns()
        while self.now_ns < end_ns and not self.stop_asked:
            until = min(self.now_ns + chunk, end_ns)
            if self.realtime:
                self.clock.sleep((begin + until - self.clock.monotonic_ns()) / NANOSECONDS)
            self._advance(until)
            self.recorder.step_events(self.now_ns, until)
            self.now_ns = until
            if self.progress is not None:
                step = self.plan.step_at(until)
                times = (until / NANOSECONDS, end_ns / NANOSECONDS)
                self.progress(Progress(step.name, step.index, len(self.plan.steps), *times))

    def _advance(self, until_ns: int) -> None:
        arm = self.arm.read(until_ns)
        self.recorder.samples(arm, {name: imu.read(until_ns) for name, imu in self.imus.items()})
        self._note_devices()

    def _note_devices(self) -> None:
        """Put what happened to the sensors, such as a lost connection, among the events of the run."""
        self.recorder.device_events({name: imu.events() for name, imu in self.imus.items()})

    def _close(self, status: RunStatus, message: str) -> Session:
        """Stop everything, keep what there is; a failure here must not hide the first one."""
        self.arm.stop()
        try:
            if status is RunStatus.INTERRUPTED:
                self._advance(self.now_ns + NANOSECONDS)  # the arm comes to rest
                self.now_ns += NANOSECONDS
        except BenchError:
            pass
        for imu in self.imus.values():
            imu.stop()
        self._note_devices()
        self.recorder.event(self.now_ns, f"run_{status}", message=message)
        session = self.recorder.close(status, message)
        self.arm.close()
        return session


def _session_folder(logs: Path, name: str) -> Path:
    folder, count = logs / name, 1
    while folder.exists():
        count += 1
        folder = logs / f"{name}_{count}"
    return folder
