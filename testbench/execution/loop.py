"""The loop of every run: simulated, emulated, replayed or real arm, and devices alone.

Everything is asked for what it recorded up to the same host time, again and again: the arm first,
for sensors may follow what it reports. What time is - a simulation's, which passes because somebody
waits for it, or this machine's - only the arm knows.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from testbench.drivers.arms.base import SteppingArm
from testbench.exceptions import BenchError, RunInterrupted, StorageError
from testbench.execution.device_words import DeviceWords
from testbench.execution.guards import GuardTripped, GuardWatch
from testbench.execution.operator import Operator, operator_requests
from testbench.execution.options import RunOptions
from testbench.execution.pausing import Pausing
from testbench.execution.recorder import Recorder
from testbench.execution.run_progress import Meter
from testbench.execution.sensors import Sensors
from testbench.execution.state_machine import RunState, StateMachine
from testbench.records.session.plan import Plan
from testbench.records.session.session import Event, RunStatus, Session


class RunLoop:
    """One run, from connected devices to a closed session.

    Args:
        arm: Connected.
        sensors: On it, or alone.
        recorder: Of the session.
        meter: Tells how far the run is.
        options: Keys, and who is told what.
        plan: What the arm does; None without an arm.
    """

    def __init__(
        self,
        arm: SteppingArm,
        sensors: Sensors,
        recorder: Recorder,
        meter: Meter,
        options: RunOptions,
        plan: Plan | None = None,
    ):
        self.arm, self.sensors, self.recorder, self.meter = arm, sensors, recorder, meter
        self.options, self.plan = options, plan
        guards = plan.protocol.spec.guards if plan is not None else None
        guards = guards or arm.usual_guards
        live = not sensors.are_simulated
        self.guards = GuardWatch(guards, list(sensors.imus), live) if guards is not None else None
        self.words = DeviceWords()
        self.machine = StateMachine(recorder.state_event if arm.attended else _unnoted)
        self.pausing = Pausing(arm, recorder, self.machine, options.say)
        self.now_ns = 0
        self.fault = ""

    def run(self) -> Session:
        """Record until the end, a fault, or the operator's stop.

        Raises:
            RunInterrupted: The operator stopped it; the session is kept.
            BenchError: Arm, sensor or guard ended it; the session is kept, and is closed as an
                error. Its notes say what to do.
        """
        with operator_requests(self.options.keys, self.arm.takes_pauses) as operator:
            error = self._attempt(operator)
            interrupted = error is None and operator.stop_asked and self.arm.ends
            error = self._come_to_rest(error, interrupted) or self.recorder.lacking()
            try:
                session = self._close(error, interrupted)
            except BenchError as failure:
                if error is None:
                    raise
                error.add_note(f"the session could not be closed either: {failure}")
                raise error from None
        self._sum_up()
        if error is not None:
            self._advise(error, session)
            raise error
        if interrupted:
            raise RunInterrupted(f"interrupted by the operator; {self.recorder.kept}", session)
        return session

    def _attempt(self, operator: Operator) -> BaseException | None:
        """What ended the run early, or None; the operator's stop is no error."""
        try:
            self._start()
            self._follow(operator)
        except BaseException as error:
            return error
        return None

    def _start(self) -> None:
        """Bring the arm to its start, and let everything run; time 0 is now."""
        self.machine.to(RunState.APPROACHING, self.now_ns)
        self.meter.say(0, self.arm.coming)
        if self.plan is not None:
            self.arm.prepare(self.plan)
        self.sensors.start()
        self.arm.kickoff()
        self.recorder.began(self.arm)
        self.machine.to(RunState.RUNNING, self.now_ns)

    def _follow(self, operator: Operator) -> None:
        """Record until the arm is done, or the operator wants no more."""
        end_ns: int | None = None
        while end_ns is None or self.now_ns < end_ns:
            operator.look()
            if operator.stop_asked:
                return
            self.pausing.heed(operator)
            until_ns = self.arm.next_ns(self.now_ns)
            self._advance(until_ns if end_ns is None else min(until_ns, end_ns), operator)
            doing = "paused, the arm rests" if self.pausing.resting else ""
            if self.arm.finished:
                end_ns = self.now_ns + self.arm.tail_ns if end_ns is None else end_ns
                doing = "recording goes on for a second"
            self.meter.say(self.now_ns, doing)

    def _advance(self, until_ns: int, operator: Operator | None = None) -> None:
        """Record everything up to a host time.

        Args:
            until_ns: The host time.
            operator: Who acts on guards; nobody if None, where the run is over anyhow.
        """
        arm = self.arm.read(until_ns)
        self.now_ns = until_ns
        self.recorder.arm_samples(arm)  # a sensor that fails does not lose them
        imus = self.sensors.read(until_ns, arm)
        self.recorder.sensor_samples(imus)
        self._note(self.arm.events())
        happened = self._note_devices()
        if operator is None or self.guards is None:
            return
        for trip in self.guards.look(self.sensors.known_until_ns(until_ns), arm, imus, happened):
            self.recorder.guard_event(until_ns, trip)
            if trip.action == "stop":
                raise GuardTripped(f"a guard stopped the run: {trip.sentence}")
            self.options.say(f"warning: {trip.sentence}")
            if trip.action == "pause":
                operator.pause(f"guard: {trip.sentence}")

    def _note(self, events: Iterable[Event]) -> None:
        """Keep what the arm did."""
        for event in events:
            self.meter.note(event)
            self.pausing.happened(event)
            if event.event == "arm_fault":
                self.fault = str(event.details.get("fault"))
            self.recorder.arm_event(event)

    def _note_devices(self) -> dict[str, list[Event]]:
        """Keep what happened to the sensors, such as a lost connection; the same by name."""
        happened = {name: imu.events() for name, imu in self.sensors.imus.items()}
        self.recorder.device_events(happened)
        for line in self.words.lines(happened):
            self.options.say(line)
        return happened

    def _come_to_rest(self, error: BaseException | None, interrupted: bool) -> BaseException | None:
        """Stop the arm and the sensors, and take what they recorded until then.

        Returns:
            What ended the run, or else what failed here; a failure must not hide the first one.
        """
        finished, time = self.arm.finished, self.arm.time
        self.now_ns = max(self.now_ns, time.now_ns())
        if error is not None:
            self.machine.to(RunState.FAULTED, self.now_ns, sentence(error))
        else:
            self.machine.to(RunState.STOPPING, self.now_ns)
        try:
            self.arm.stop()
            if interrupted:
                time.wait_until(self.now_ns + self.arm.rests_after_ns)
        except Exception as failure:
            error = error or failure
        with suppress(Exception):
            if self.now_ns > 0 and not finished:
                self._advance(max(self.now_ns, time.now_ns()))
        with suppress(StorageError):
            # A step whose last samples were lost has not ended.
            self._note(own for own in self.arm.events() if not own.event.startswith("step_"))
        try:
            self.sensors.stop()
        except Exception as failure:
            error = error or failure
        return error

    def _close(self, error: BaseException | None, interrupted: bool) -> Session:
        """Say how it ended, and close the session."""
        status, message = RunStatus.COMPLETED, ""
        if error is not None:
            status, message = RunStatus.ERROR, sentence(error)
        elif interrupted:
            status, message = RunStatus.INTERRUPTED, "stopped by the operator"
        if error is None:
            self.machine.to(RunState.DONE, self.now_ns)
        with suppress(StorageError):
            self._note_devices()
            self.recorder.ended(self.now_ns, status, message)
        return self.recorder.close(status, message, self.arm.describe())

    def _sum_up(self) -> None:
        """Say what a person beside the arm should know once it is over."""
        lines = self.arm.afterwards()
        if self.guards is not None and self.arm.attended and self.guards.summary:
            lines = [self.guards.summary, *lines]
        for line in lines:
            self.options.say(line)

    def _advise(self, error: BaseException, session: Session) -> None:
        """Say with an error what to do, and where the data are."""
        if isinstance(error, BenchError):
            error.session = session
        remedy = self.arm.entry.remedy(self.fault)
        if remedy is not None:
            error.add_note(f"what to do: {remedy}")
        error.add_note(self.recorder.kept)


def _unnoted(at_ns: int, old: RunState, new: RunState, why: str) -> None:
    """States of a run that nobody attends are no events."""


def sentence(error: BaseException) -> str:
    """What went wrong; of what is no error of the bench, with its kind."""
    return str(error) if isinstance(error, BenchError) else f"{type(error).__name__}: {error}"
