"""The stage `execute`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from testbench.clock import Clock, SystemClock, utc_name
from testbench.drivers.arms.base import Arm
from testbench.drivers.arms.catalogue import SIM
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.arms.simulated import SimulatedArm, simulated_arm
from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.exceptions import BenchError, RunInterrupted, StorageError
from testbench.execution.guards import GuardTripped, GuardWatch
from testbench.execution.operator import Operator, operator_requests
from testbench.execution.recorder import Recorder
from testbench.execution.state_machine import RunState, StateMachine
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics
from testbench.model.magnetic_field import describe_environment
from testbench.records.plan import Plan
from testbench.records.replacing import free_folder
from testbench.records.session import RunStatus, Session

REALTIME_CHUNK_NS = NANOSECONDS // 10
FAST_CHUNK_NS = 10 * NANOSECONDS
TAIL_NS = NANOSECONDS
"""Recording goes on this long after the last step, so that the last dwell is whole on every
clock.
"""


@dataclass(frozen=True)
class Progress:
    """How far a run is; times in seconds from its start. `doing`: What happens in place of a step,
    for people.
    """

    step: str
    index: int
    steps: int
    time: float
    duration: float
    doing: str = ""


def execute(
    plan: Plan,
    logs: str | Path = "logs",
    seed: int = 0,
    speed: Literal["fast", "realtime"] = "fast",
    clock: Clock | None = None,
    progress: Callable[[Progress], None] | None = None,
    session_name: str | None = None,
    resumed: Session | None = None,
    keys: bool = False,
    say: Callable[[str], None] = lambda line: None,
) -> Session:
    """Run a plan on the simulated arm and record it.

    Args:
        plan: A checked motion.
        logs: Folder that sessions are made in.
        seed: Of every random number of the simulation; the same seed gives the same raw files.
        speed: "fast": virtual time as fast as the machine goes; "realtime": a second a second.
        clock: Source of the date and of the rhythm; the machine's if None.
        progress: Called after every chunk of time.
        session_name: Name of the session's folder; time and protocol if None.
        resumed: Go on with this session, of the same plan and seed: the simulation runs again from
            its beginning, and what the session lacks is recorded.
        keys: Listen to the keyboard.
        say: Takes a line for the operator.

    Raises:
        RunInterrupted: The operator pressed Ctrl-C; the session is kept and closed as interrupted.
        DriverError: The arm or a sensor failed; the session is kept and closed as an error.
    """
    clock = clock or SystemClock()
    spec = plan.protocol.spec
    arm = simulated_arm(plan, WantedArm(seed=seed))
    kinematics = Kinematics(plan.robot)
    imus = _simulated_imus(plan, kinematics, arm, seed)
    folder = free_folder(Path(logs), session_name or f"{utc_name(clock.utc())}_{spec.name}")
    details = {
        "arm": SIM.record.to_dict() | {"speed": speed},
        "environment": describe_environment(spec.environment, kinematics),
    }
    recorder = Recorder(plan, imus, folder, clock, seed, details, resumed=resumed)
    return _Run(plan, arm, imus, recorder, clock, speed, progress, resumed, keys, say).run()


class _Run:
    """One run from kickoff to a closed session."""

    def __init__(
        self,
        plan: Plan,
        arm: Arm,
        imus: dict[str, Imu],
        recorder: Recorder,
        clock: Clock,
        speed: str,
        progress: Callable[[Progress], None] | None,
        resumed: Session | None,
        keys: bool,
        say: Callable[[str], None],
    ):
        self.plan, self.arm, self.imus, self.recorder, self.clock = plan, arm, imus, recorder, clock
        self.realtime, self.progress = speed == "realtime", progress
        self.now_ns, self.keys, self.say = 0, keys, say
        self.again_ns = (
            round((resumed.manifest.get("duration_s") or 0) * NANOSECONDS)
            if resumed is not None
            else 0
        )
        self.resumed = resumed is not None
        guards = plan.protocol.spec.guards
        self.guards = GuardWatch(guards, list(imus)) if guards is not None else None
        self.machine = StateMachine()

    def run(self) -> Session:
        status, message = RunStatus.COMPLETED, ""
        error: BaseException | None = None
        with operator_requests(self.keys) as operator:
            try:
                self.machine.to(RunState.APPROACHING)
                self.arm.prepare(self.plan)
                self.arm.kickoff()
                for imu in self.imus.values():
                    imu.kickoff()
                self.machine.to(RunState.RUNNING)
                name = "run_resumed" if self.resumed else "run_started"
                self.recorder.event(self.again_ns, name, arm=type(self.arm).__name__)
                self._follow(operator)
                if operator.stop_asked:
                    status, message = RunStatus.INTERRUPTED, "stopped by the operator"
            except BenchError as failure:
                status, message, error = RunStatus.ERROR, str(failure), failure
            except BaseException as failure:
                status, message, error = (
                    RunStatus.ERROR,
                    f"{type(failure).__name__}: {failure}",
                    failure,
                )
            session = self._close(status, message)
        whole = f"{len(session.steps)} of {len(self.plan.steps)} steps are whole"
        kept = f"what was recorded is kept in {session.path}: {whole}"
        if status is RunStatus.INTERRUPTED:
            raise RunInterrupted(f"interrupted by the operator; {kept}", session)
        if error is not None:
            if isinstance(error, BenchError):
                error.session = session
            error.add_note(kept)
            raise error
        return session

    def _follow(self, operator: Operator) -> None:
        end_ns = int(self.plan.trajectory.time_ns[-1]) + TAIL_NS
        chunk = REALTIME_CHUNK_NS if self.realtime else FAST_CHUNK_NS
        begin = self.clock.monotonic_ns() - self.again_ns
        while self.now_ns < end_ns and not operator.stop_asked:
            begin += self._wait_while_paused(operator)
            until = min(self.now_ns + chunk, end_ns)
            if self.realtime and until > self.again_ns:
                self.clock.sleep((begin + until - self.clock.monotonic_ns()) / NANOSECONDS)
            self._advance(until, operator)
            self.recorder.step_events(self.now_ns, until)
            self.now_ns = until
            if self.progress is not None:
                step = self.plan.step_at(until)
                times = (until / NANOSECONDS, end_ns / NANOSECONDS)
                self.progress(Progress(step.name, step.index, len(self.plan.steps), *times))

    def _wait_while_paused(self, operator: Operator) -> int:
        """Let virtual time stand still while the operator wants it; says for how long that was
        [ns].
        """
        operator.look()
        if not operator.pause_asked:
            return 0
        self.machine.to(RunState.PAUSED)
        self.recorder.event(self.now_ns, "paused")
        self.say(f"PAUSED ({operator.pause_reason or 'asked for'}): {operator.how_to_go_on}")
        operator.pause_reason = ""
        start = self.clock.monotonic_ns()
        while operator.pause_asked and not operator.stop_asked:
            self.clock.sleep(0.02)
            operator.look()
        self.machine.to(RunState.RUNNING)
        self.recorder.event(self.now_ns, "resumed")
        self.say("going on")
        return self.clock.monotonic_ns() - start

    def _advance(self, until_ns: int, operator: Operator | None = None) -> None:
        arm = self.arm.read(until_ns)
        imus = {name: imu.read(until_ns) for name, imu in self.imus.items()}
        self.recorder.samples(arm, imus)
        self._note_devices()
        if self.guards is None or operator is None:
            return
        for trip in self.guards.look(until_ns, arm, imus):
            self.recorder.guard_event(until_ns, trip)
            if trip.action == "stop":
                raise GuardTripped(f"a guard stopped the run: {trip.sentence}")
            self.say(f"warning: {trip.sentence}")
            if trip.action == "pause":
                operator.pause_asked, operator.pause_reason = True, f"guard: {trip.sentence}"

    def _note_devices(self) -> None:
        """Put what happened to the sensors, such as a lost connection, among the events of the
        run.
        """
        self.recorder.device_events({name: imu.events() for name, imu in self.imus.items()})

    def _close(self, status: RunStatus, message: str) -> Session:
        """Stop everything, keep what there is; a failure here must not hide the first one."""
        self.machine.to(RunState.FAULTED if status is RunStatus.ERROR else RunState.STOPPING)
        self.arm.stop()
        try:
            if status is RunStatus.INTERRUPTED:
                self._advance(self.now_ns + NANOSECONDS)  # the arm comes to rest
                self.now_ns += NANOSECONDS
        except BenchError:
            pass
        for imu in self.imus.values():
            imu.stop()
        with suppress(StorageError):
            self._note_devices()
            self.recorder.event(self.now_ns, f"run_{status}", message=message)
        try:
            session = self.recorder.close(status, message)
        finally:
            self.arm.close()
        if status is not RunStatus.ERROR:
            self.machine.to(RunState.DONE)
        return session


def _simulated_imus(
    plan: Plan, kinematics: Kinematics, arm: SimulatedArm, seed: int
) -> dict[str, Imu]:
    spec = plan.protocol.spec
    return {
        name: SimulatedImu(name, sensor, kinematics, spec.environment, arm.true_state, seed)
        for name, sensor in spec.sensors.items()
    }


def simulated_sensors(plan: Plan) -> dict[str, Any]:
    """How the manifest describes the sensors of a simulated run."""
    imus = _simulated_imus(plan, Kinematics(plan.robot), SimulatedArm(plan.robot, 0), 0)
    return {name: imu.describe() for name, imu in imus.items()}
