"""Run a plan on an arm that keeps its own time: a real or an emulated one, or a recorded motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.clock import Clock, utc_name
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.imus.base import Imu
from testbench.drivers.imus.following import ReportedMotion
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import BenchError, InputError, RunInterrupted, StorageError
from testbench.execution.device_recorder import Devices
from testbench.execution.executor import Progress
from testbench.execution.guards import GuardTripped, GuardWatch
from testbench.execution.operator import Operator, operator_requests
from testbench.execution.recorder import Recorder
from testbench.execution.run_progress import ProgressMeter
from testbench.execution.state_machine import RunState, StateMachine
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics
from testbench.model.magnetic_field import describe_environment
from testbench.model.truth import WIDEST_GAP_NS
from testbench.records.plan import Plan, PlannedStep
from testbench.records.protocol_arm import Guards
from testbench.records.replacing import free_folder
from testbench.records.samples import ArmSamples, ImuSamples
from testbench.records.session import Event, RunStatus, Session

CHUNK_NS = NANOSECONDS // 10
MISSED_SHARE = 0.05
"""A larger share of the controller's samples that did not come is said at the end; a smaller one is
in the evaluation.
"""
TAIL_NS = NANOSECONDS
"""Recording goes on this long after the last step, so that the last dwell is whole on every
clock.
"""


@dataclass
class Sensors:
    """The sensors of a run on a real arm: live ones, or simulated ones that follow the motion which
    the arm reports.

    Attributes:
        imus: By the names of the protocol.
        devices: What must be connected and released, for live ones.
        motion: What simulated ones feel.
    """

    imus: dict[str, Imu]
    devices: Devices | None = None
    motion: ReportedMotion | None = None

    @staticmethod
    def simulated(plan: Plan, seed: int) -> Sensors:
        """Simulated sensors on an arm that moves in real time."""
        motion = ReportedMotion(plan.robot.spec.rates.record_hz)
        kinematics, spec = Kinematics(plan.robot), plan.protocol.spec
        imus: dict[str, Imu] = {
            name: SimulatedImu(name, sensor, kinematics, spec.environment, motion.state, seed)
            for name, sensor in spec.sensors.items()
        }
        return Sensors(imus, motion=motion)

    @staticmethod
    def live(plan: Plan, devices: Devices) -> Sensors:
        """Live devices, which must be called like the protocol's sensors.

        Raises:
            InputError: A sensor has no device, or a device no sensor.
        """
        wanted, given = set(plan.protocol.spec.sensors), set(devices.imus)
        if wanted != given:
            raise InputError(
                f"the protocol's sensors are {', '.join(sorted(wanted))}; the devices are called "
                f"{', '.join(sorted(given))}: "
                "name each with --serial NAME=PORT:FORMAT or --dot NAME=ADDRESS"
            )
        return Sensors(dict(devices.imus), devices)

    def listen(self) -> None:
        """Make sure that live ones deliver, before anything moves.

        Raises:
            DriverError: One does not.
        """
        if self.devices is not None:
            self.devices.listen()

    def start(self) -> None:
        """Begin to record."""
        if self.devices is not None:
            self.devices.kickoff()
        else:
            for imu in self.imus.values():
                imu.kickoff()

    def read(self, until_ns: int, arm: ArmSamples) -> dict[str, ImuSamples]:
        """What came in up to a host time; simulated sensors lag behind the arm's report by a
        moment.
        """
        if self.motion is None:
            return {name: imu.read(until_ns) for name, imu in self.imus.items()}
        self.motion.add(arm)
        if self.motion.known_until_ns <= 0:
            return {}
        return {name: imu.read(self.motion.known_until_ns) for name, imu in self.imus.items()}

    def stop(self) -> None:
        """Stop all."""
        for imu in self.imus.values():
            with suppress(BenchError):
                imu.stop()

    def close(self) -> None:
        """Release all."""
        if self.devices is not None:
            self.devices.close()

    def statistics(self) -> dict[str, Any]:
        """What the live ones counted."""
        return {name: counted for name, imu in self.imus.items() if (counted := imu.statistics())}


@dataclass
class ArmRunOptions:
    """How a run is made.

    Attributes:
        logs: Folder that sessions are made in.
        seed: Of simulated sensors.
        steps: Those to do; all if None.
        checklist: What was confirmed.
        resumes: Session and step that this run goes on from.
        keys: Listen to the keyboard.
        progress: Called after every chunk of time.
        name: Of the session's folder; time and protocol if None.
        notify: Told what a person must know of the arm, once it is connected.
        say: Told, a line at a time, what a person beside the arm must know.
    """

    logs: Path = Path("logs")
    seed: int = 0
    steps: list[PlannedStep] | None = None
    checklist: dict[str, Any] | None = None
    resumes: dict[str, Any] | None = None
    keys: bool = False
    progress: Callable[[Progress], None] | None = None
    say: Callable[[str], None] = lambda line: None
    name: str | None = None
    notify: Callable[[str], None] | None = None
    details: dict[str, Any] = field(default_factory=dict)


def execute_on_arm(
    plan: Plan, arm: SteppingArm, sensors: Sensors, time: SessionTime, options: ArmRunOptions
) -> Session:
    """Run a plan on an arm that keeps its own time, and record it.

    Args:
        plan: A checked motion.
        arm: Not yet connected.
        sensors: On it.
        time: Of the session, shared by all.
        options: The rest.

    Raises:
        ArmRefused: The arm must not be driven; nothing moved and there is no session.
        DriverError: A live sensor delivers nothing, or no controller answers; nothing moved. Or
            arm, sensor or guard ended the run; the arm was stopped, the session is kept and closed
            as an error. Its notes say what to do.
        RunInterrupted: The operator stopped it; the session is kept.
    """
    try:
        sensors.listen()
        arm.connect()
        if arm.notice and options.notify is not None:
            options.notify(arm.notice)
        arm.check_way(plan, options.steps)
        return _ArmRun(plan, arm, sensors, time, options).run()
    finally:
        arm.close()
        sensors.close()


class _ArmRun:
    """One run, from a connected arm to a closed session."""

    def __init__(
        self,
        plan: Plan,
        arm: SteppingArm,
        sensors: Sensors,
        time: SessionTime,
        options: ArmRunOptions,
    ):
        self.plan, self.arm, self.sensors, self.time, self.options = (
            plan,
            arm,
            sensors,
            time,
            options,
        )
        self.clock: Clock = time.clock
        self.now_ns = 0
        self.done = 0
        self.steps = plan.steps if options.steps is None else options.steps
        self.fault = self.paused = self.why_paused = ""
        self.resting = self.pausing = False
        self.changed_ns: int | None = None
        self.meter = ProgressMeter(plan, self.steps, options.progress)
        self.trips: Counter[str] = Counter()
        self.received, self.gap_ns, self.newest_ns = 0, 0, np.zeros(0, dtype=np.int64)
        spec = plan.protocol.spec
        self.guards = GuardWatch(spec.guards or Guards(), list(sensors.imus))
        folder = free_folder(
            options.logs, options.name or f"{utc_name(self.clock.utc())}_{spec.name}"
        )
        simulated = sensors.motion is not None
        details = {
            "arm": arm.describe(),
            "simulated_sensors": simulated,
            "checklist": options.checklist,
            "resumes": options.resumes,
            **options.details,
        }
        if simulated:
            details["environment"] = describe_environment(spec.environment, Kinematics(plan.robot))
        seed = options.seed if simulated else None
        self.recorder = Recorder(
            plan, sensors.imus, folder, self.clock, seed, details, arm.extra_columns
        )
        self.machine = StateMachine(self._state_changed)

    def _state_changed(self, old: RunState, new: RunState, why: str) -> None:
        with suppress(StorageError):
            at_ns = self.now_ns if self.changed_ns is None else self.changed_ns
            self.recorder.event(
                at_ns, "state", state=str(new), before=str(old), **({"why": why} if why else {})
            )

    def run(self) -> Session:
        status, message, error = RunStatus.COMPLETED, "", None
        with operator_requests(self.options.keys) as operator:
            try:
                self.machine.to(RunState.APPROACHING)
                self.meter.say(0, "the arm goes to the start of the plan")
                self.arm.prepare(self.plan)
                self.sensors.start()
                self.arm.kickoff()
                self.recorder.event(0, "run_started", arm=type(self.arm).__name__)
                if self.arm.notice:
                    self.recorder.event(0, "arm_notice", message=self.arm.notice)
                self.machine.to(RunState.RUNNING)
                self._follow(operator)
                if operator.stop_asked:
                    status, message = RunStatus.INTERRUPTED, "stopped by the operator"
            except BaseException as failure:
                said = (
                    str(failure)
                    if isinstance(failure, BenchError)
                    else f"{type(failure).__name__}: {failure}"
                )
                status, message, error = RunStatus.ERROR, said, failure
            session = self._close(status, message)
        self._say_counts()
        if error is not None:
            self._advise(error, session)
            raise error
        if status is RunStatus.INTERRUPTED:
            raise RunInterrupted(f"interrupted by the operator; {self._kept(session)}", session)
        return session

    def _advise(self, error: BaseException, session: Session) -> None:
        """Say with an error what to do, and where the data are."""
        if isinstance(error, BenchError):
            error.session = session
        if self.fault in self.arm.remedies:
            error.add_note(f"what to do: {self.arm.remedies[self.fault]}")
        error.add_note(self._kept(session))

    def _kept(self, session: Session) -> str:
        return (
            f"what was recorded is kept in {session.path}: {self.done} of {len(self.steps)} "
            "steps are whole"
        )

    def _say_counts(self) -> None:
        """At the end: what the guards found, and what did not come from the controller."""
        if self.trips:
            self.options.say(
                "guards: "
                + ", ".join(self._count(*item) for item in sorted(self.guards.counts.items()))
            )
        missed = self.arm.describe().get("timing", {}).get("samples_missed", 0)
        due = missed + self.received
        if missed and (missed > MISSED_SHARE * due or self.gap_ns > WIDEST_GAP_NS):
            self.options.say(
                f"warning: {missed} of {due} ({100 * missed / due:.2g} %) of the controller's "
                "samples did not come, the "
                f"longest gap is {self.gap_ns / NANOSECONDS:.2g} s"
            )

    def _count(self, name: str, count: int) -> str:
        """How often a limit was broken, and how often that was told."""
        told = self.trips[name]
        return f"{name} {count}" + (f" (told {told})" if told < count else "")

    def _follow(self, operator: Operator) -> None:
        end_ns: int | None = None
        while end_ns is None or self.now_ns < end_ns:
            operator.look()
            if operator.stop_asked:
                return
            self._pause_or_resume(operator)
            self._advance(max(self.now_ns + CHUNK_NS, self.time.now_ns()), operator)
            if self.arm.finished and end_ns is None:
                end_ns = self.now_ns + TAIL_NS
            rests = "paused, the arm rests" if self.resting else ""
            self.meter.say(
                self.now_ns, "recording goes on for a second" if self.arm.finished else rests
            )

    def _pause_or_resume(self, operator: Operator) -> None:
        if operator.pause_asked and not self.pausing and self.machine.state is RunState.RUNNING:
            self.arm.pause()
            self.pausing, self.why_paused = True, operator.pause_reason or "asked for"
            why = self.why_paused
            self.recorder.event(self.time.now_ns(), "pause_requested", why=why)
            self.options.say(f"pause requested ({why}): the arm rests after this step")
            self.paused = f"PAUSED ({why}): {operator.how_to_go_on}"
        elif not operator.pause_asked and self.pausing:
            self.arm.resume()
            self.pausing, operator.pause_reason = False, ""
            if not self.resting:  # the step under way had not ended
                self.recorder.event(self.time.now_ns(), "pause_withdrawn")
            self.options.say("going on")

    def _paused_or_resumed(self, event: Event) -> None:
        """The arm rests, or goes on: that, and not the wish, changes the state."""
        self.resting = event.event == "paused"
        state, before = (
            (RunState.PAUSED, RunState.RUNNING)
            if self.resting
            else (RunState.RUNNING, RunState.PAUSED)
        )
        if self.machine.state is before:
            self.changed_ns = event.host_time_ns
            self.machine.to(state, self.why_paused if self.resting else "asked for")
            self.changed_ns = None
        if self.resting:
            self.options.say(self.paused)

    def _advance(self, until_ns: int, operator: Operator | None = None) -> None:
        arm = self.arm.read(until_ns)
        self.now_ns, self.received = until_ns, self.received + len(arm.host_time_ns)
        times = np.concatenate([self.newest_ns, arm.host_time_ns])
        self.gap_ns, self.newest_ns = (
            max(self.gap_ns, int(np.diff(times).max(initial=0))),
            times[-1:],
        )
        self._note(self.arm.events())
        imus = self.sensors.read(until_ns, arm)
        happened = self._note_devices()
        self.recorder.samples(arm, imus)
        if operator is not None:
            self._judge(arm, imus, happened, operator)

    def _note_devices(self) -> dict[str, list[Event]]:
        """Put what happened to the sensors, such as a lost connection, among the events of the run;
        the same by name.
        """
        happened = {name: imu.events() for name, imu in self.sensors.imus.items()}
        self.recorder.device_events(happened)
        return happened

    def _judge(
        self,
        arm: ArmSamples,
        imus: dict[str, ImuSamples],
        happened: dict[str, list[Event]],
        operator: Operator,
    ) -> None:
        motion = self.sensors.motion
        due = (
            self.now_ns if motion is None else motion.known_until_ns
        )  # simulated sensors are not silent, the arm is
        for trip in self.guards.look(due, arm, imus, happened):
            self.recorder.guard_event(self.now_ns, trip)
            self.trips[f"{trip.guard} of {trip.subject}"] += 1
            if trip.action == "stop":
                raise GuardTripped(f"a guard stopped the run: {trip.sentence}")
            self.options.say(f"warning: {trip.sentence}")
            if trip.action == "pause":
                operator.pause_asked, operator.pause_reason = True, f"guard: {trip.sentence}"

    def _note(self, events: Iterable[Event]) -> None:
        by_index = {step.index: step for step in self.plan.steps}
        for event in events:
            self.meter.note(event)
            if event.event in {"paused", "resumed"}:
                self._paused_or_resumed(event)
            if event.event == "arm_fault":
                self.fault = str(event.details.get("fault"))
            if event.event.startswith("step_"):
                self.done += event.event == "step_ended"
                self.recorder.step_event(
                    event.host_time_ns, event.event, by_index[event.details["index"]]
                )
            elif event.event.startswith("connecting_"):
                step = self.steps[min(self.done, len(self.steps) - 1)]
                self.recorder.event(
                    event.host_time_ns, event.event, towards=step.index, name=step.name
                )
            else:
                self.recorder.event(event.host_time_ns, event.event, **event.details)

    def _close(self, status: RunStatus, message: str) -> Session:
        """Stop the arm, keep what there is; a failure here must not hide the first one."""
        self.now_ns = max(self.now_ns, self.time.now_ns())
        finished = self.arm.finished
        if status is RunStatus.ERROR:
            self.machine.to(RunState.FAULTED, message)
        else:
            self.machine.to(RunState.STOPPING)
        self.arm.stop()
        with suppress(StorageError):
            self._note(self.arm.events())
        if self.now_ns > 0 and not finished:
            with suppress(BenchError):
                self._advance(self.now_ns)
        self.sensors.stop()
        if status is not RunStatus.ERROR:
            self.machine.to(RunState.DONE)
        with suppress(StorageError):
            self._note_devices()
            self.recorder.event(self.now_ns, f"run_{status}", message=message)
        details = {"arm": self.arm.describe(), "device_statistics": self.sensors.statistics()}
        return self.recorder.close(status, message, details)
