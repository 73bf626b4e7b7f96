"""An arm at the other end of a network, driven by a process of its own through a client library.

Static poses go by moves that the controller plans, sweeps target by target at the streaming rate.
The arm keeps its own time: a step ends when the joints rest in its pose, and what was recorded, not
what was planned, is the truth.
"""

from __future__ import annotations

from abc import abstractmethod
from contextlib import suppress
from typing import Any, ClassVar

import numpy as np

from testbench.clock import SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.client import ArmClient
from testbench.drivers.arms.link import Link, Message
from testbench.drivers.arms.settings import LinkSettings, Motion
from testbench.drivers.arms.standing import Standing
from testbench.drivers.arms.straight_path import StraightPaths
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import ArmRefused, DriverError
from testbench.frames import NANOSECONDS
from testbench.model.truth import WIDEST_GAP_NS
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event
from testbench.records.specs.robot import Robot

AHEAD = 4
"""Steps that the driving process knows in advance; a sweep of an hour is 87 MB."""
APPROACH_RAD_S, APPROACH_RAD_S2 = float(np.radians(15.0)), float(np.radians(30.0))
"""Speed of the way to the start."""
APPROACH_S = 120.0
SLOWEST = (0.01, 0.05)
"""Least speed [rad/s] and acceleration [rad/s^2] that a controller is asked for."""
MISSED_SHARE = 0.05
"""A larger share of the controller's samples that did not come is said at the end; a smaller one is
in the evaluation.
"""
LATE_SHARE, LATEST_S = 0.02, 0.1
"""A larger share of the driving loop's turns that were late is said at the end, and a turn that was
later [s]: a fifth of what the watchdogs of controllers wait.
"""


class RemoteArm(SteppingArm):
    """What the drivers of all makers' arms have in common.

    Args:
        robot: What the plan is for.
        settings: Address, rates, limits.
        time: Of the session; a new one if None.
        serial: Number that the arm must have; any if None.

    Raises:
        InputError: The plan is for an arm that the driver is not for.

    Attributes:
        client: The client library that drives it.
        joint_columns: Columns that samples have for every joint, with {} for its name.
        columns: Their other columns, and the type of each.
        told: Keys of what the controller says of itself that the manifest keeps.
    """

    client: ClassVar[type[ArmClient]]
    joint_columns: ClassVar[tuple[str, ...]]
    columns: ClassVar[dict[str, Any]]
    told: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        robot: Robot,
        settings: LinkSettings,
        time: SessionTime | None = None,
        serial: str | None = None,
    ):
        self.entry.refuse_other(robot.name)
        self.robot, self.settings, self.time = robot, settings, time or SessionTime(SystemClock())
        self.clock, self.serial = self.time.clock, serial
        each = {
            column.format(joint): np.float64
            for column in self.joint_columns
            for joint in robot.joint_names
        }
        self.extra_columns = {"controller_time_ns": np.int64} | each | self.columns
        self.info: dict[str, Any] = {}
        self.timing: dict[str, Any] = {}
        self._link: Link | None = None
        self._waiting: list[Motion] = []
        self._batches: list[list[np.ndarray]] = []
        self._events: list[Event] = []
        self._origin_ns = 0
        self._last_ns = 0
        self._received = self._widest_gap_ns = 0
        self._fault: str | None = None
        self._finished = self._stopped = False
        self._unseen = ""
        self.streamed_moves = 0

    @property
    def finished(self) -> bool:
        return self._finished

    def connect(self) -> None:
        """Connect, and refuse an arm that must not be driven; nothing moves.

        Raises:
            ArmRefused: Stopped by its safety system, another model, or in a state that the driver
                does not take over.
            DriverError: There is no controller at the address, or it does not answer.
        """
        self._link = Link(self.client, self.settings, self.entry, self.clock)
        try:
            (_, info), _ = self._link.wait_for("info")
        except BaseException:
            self.close()
            raise
        self.info = {key: value for key, value in info.items() if key != "refused"}
        refusal = info["refused"] or self._wrong_arm(info)
        if refusal is not None:
            self.close()
            raise ArmRefused(f"the robot at {self.settings.host} was refused: {refusal}")

    def _wrong_arm(self, info: dict[str, Any]) -> str | None:
        """Why this is not the arm that the plan is for, or None if it is."""
        if self.serial is not None and info.get("serial") != self.serial:
            return f"the calibration belongs to the arm {self.serial}, this is {info.get('serial')}"
        return self._wrong_model(info)

    @abstractmethod
    def _wrong_model(self, info: dict[str, Any]) -> str | None:
        """Why the model is not the plan's, or None if it is."""

    @abstractmethod
    def _stop_orphan(self) -> Standing:
        """Stop an arm whose driving process is gone, and say what was seen of it; bounded, and
        never raises.
        """

    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """Look at every straight path that the controller would plan, before anything moves.

        Args:
            plan: The motion.
            steps: Those of its steps to do, in order; all if None.

        Raises:
            ArmRefused: The way to the start, or to a step that does not follow on the one before,
                is not free.
        """
        paths = StraightPaths(self.robot)
        start, now = plan.trajectory.q[0], np.array(self.info["q_rad"])
        nearest = paths.blocked(now, start)
        if nearest is not None:
            raise ArmRefused(
                "the straight way from where the arm stands to the start of the plan brings "
                f"{nearest.first} and "
                f"{nearest.second} to {1000 * nearest.distance:.1f} mm; move the arm nearer to "
                f"{np.degrees(start).round(1).tolist()} deg by hand"
            )
        self._waiting = self._motions(plan, plan.steps if steps is None else steps, paths)

    def prepare(self, plan: Plan) -> None:
        """Go to the start of the plan at reduced speed, by a straight path of the joints."""
        if self._link is None:
            self.connect()
            self.check_way(plan)
        assert self._link is not None
        start, now = plan.trajectory.q[0], np.array(self.info["q_rad"])
        duration = float(np.abs(start - now).max()) / APPROACH_RAD_S
        approach = Motion(-1, "move", start, APPROACH_RAD_S, APPROACH_RAD_S2, duration=duration)
        try:
            self._link.begin("approach", approach)
            self._wait_for_start()
        except DriverError as error:
            if self._fault is None:  # the process itself is gone or silent
                self._orphaned(error)
                raise DriverError(self._fault) from None
            raise

    def _wait_for_start(self) -> None:
        assert self._link is not None
        end = self.clock.monotonic_ns() + round(APPROACH_S * NANOSECONDS)
        while self.clock.monotonic_ns() < end:
            with suppress(DriverError):  # what it said before it ended comes first
                self._link.tell("alive")
            for message in self._link.take():
                if message[0] == "approached":
                    return
                if message[0] in {"fault", "stopped"}:
                    self._fail(message)
                    raise DriverError(f"the start of the plan was not reached: {self._fault}")
            self.clock.sleep(0.02)
        raise DriverError(f"the start of the plan was not reached within {APPROACH_S:g} s")

    def kickoff(self) -> None:
        """Time 0 of the session is now."""
        if self._link is None:
            raise DriverError("the arm was started before it was prepared")
        self.time.start()
        self._origin_ns = self.clock.monotonic_ns() - self.time.now_ns()
        self._link.begin("run", self._origin_ns)
        self._feed(AHEAD)

    def read(self, until_ns: int) -> ArmSamples:
        """Wait for a host time, then hand over what the controller reported.

        Raises:
            DriverError: The arm stopped by itself; what it reported until then was handed over
                before.
        """
        if self._link is None:
            raise DriverError("the arm was read before it was prepared")
        if self._fault is not None:
            raise DriverError(self._fault)
        with suppress(DriverError):  # what it said before it ended comes first
            self._link.tell("alive")
        self.clock.sleep((self._origin_ns + until_ns - self.clock.monotonic_ns()) / NANOSECONDS)
        self._take()
        return self._samples()

    def _take(self) -> None:
        assert self._link is not None
        try:
            messages = self._link.take()
        except DriverError as error:
            self._orphaned(error)
            return
        for message in messages:
            if message[0] == "samples":
                self._batches.append(message[1])
            elif message[0] == "event":
                _, time, name, details = message
                self._events.append(Event(max(time, 0), name, details))
                if name in {"step_ended", "connecting_ended"}:
                    self._feed(1)
            elif message[0] == "timing":
                self.timing = message[1]
            elif message[0] == "done":
                self._finished = True
            elif message[0] in {"fault", "stopped"}:
                self._fail(message)

    def _orphaned(self, error: DriverError) -> None:
        """Stop an arm whose driving process is gone, and tell of it."""
        if self._fault is None:
            found_ns = self.clock.monotonic_ns()
            self._tell_fault("driver", str(error), found_ns, self._stop_orphan())

    def _fail(self, message: Message) -> None:
        """Take note of a fault: ("fault", kind, sentence, when it was found, what was seen of the
        arm), or of a stop that nobody asked for: ("stopped", sentence, what was seen).

        An arm that the driving process did not see at rest is stopped once more, from here.
        """
        if self._fault is not None or (message[0] == "stopped" and self._stopped):
            return
        if message[0] == "fault":
            _, kind, said, found_ns, standing = message
        else:
            (_, said, standing), kind, found_ns = message, "stopped", self.clock.monotonic_ns()
        if not standing.stopped:
            again = self._stop_orphan()
            standing = standing if again is Standing.UNKNOWN else again
        self._tell_fault(kind, str(said), found_ns, standing)

    def _tell_fault(self, kind: str, said: str, found_ns: int, standing: Standing) -> None:
        """Keep what ended the motion, and what was seen of the arm afterwards."""
        self._fault = f"the arm was stopped: {said}"
        if not standing.stopped:
            unseen = f"nobody saw the arm come to rest: {self.settings.unseen}"
            self._fault = f"the run was ended: {said}; {unseen}"
        self._note(found_ns, "arm_fault", fault=kind, message=said, arm=str(standing))

    def _note(self, host_ns: int, event: str, **details: Any) -> None:
        """Tell of something [ns of the host's clock]."""
        at_ns = max(host_ns - self._origin_ns, 0) if self._origin_ns else 0
        self._events.append(Event(at_ns, event, details))

    def _feed(self, count: int) -> None:
        assert self._link is not None
        for _ in range(count):
            if self._waiting:
                self._link.tell("motion", self._waiting.pop(0))
        if not self._waiting:
            self._link.tell("no_more")

    def _samples(self) -> ArmSamples:
        joints = self.robot.joint_names
        n = len(joints)
        if self._batches:
            host, controller, q, v, *others, sent = (
                np.concatenate(columns) for columns in zip(*self._batches, strict=True)
            )
        else:
            host = controller = np.zeros(0, np.int64)
            q = v = sent = np.zeros((0, n))
            others = [np.zeros((0, n))] * len(self.joint_columns) + [np.zeros(0)] * len(
                self.columns
            )
        self._batches = []
        kept, before = np.zeros(len(host), dtype=bool), self._last_ns
        for i, time in enumerate(host):  # never back in time, whatever the clocks do
            if time > self._last_ns:
                kept[i], self._last_ns = True, int(time)
        gaps = np.diff(host[kept], prepend=[before] if self._received else [])
        self._widest_gap_ns = max(self._widest_gap_ns, int(gaps.max(initial=0)))
        self._received += int(kept.sum())
        extras: dict[str, np.ndarray] = {"controller_time_ns": controller[kept].astype(np.int64)}
        for column, values in zip(self.joint_columns, others, strict=False):
            extras |= {column.format(joint): values[kept][:, i] for i, joint in enumerate(joints)}
        for (column, kind), values in zip(
            self.columns.items(), others[len(self.joint_columns) :], strict=True
        ):
            extras[column] = values[kept].astype(kind)
        return ArmSamples(joints, host[kept].astype(np.int64), sent[kept], q[kept], v[kept], extras)

    def events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def pause(self) -> bool:
        if self._link is not None:
            self._link.tell("pause")
        return False

    def resume(self) -> None:
        if self._link is not None:
            self._link.tell("resume")

    def stop(self) -> None:
        """Bring the arm to rest; a second call does nothing."""
        if self._link is None or self._stopped:
            return
        self._stopped = True
        if not self._finished and self._fault is None:
            self._ask_to_stop()
        if self._link.words:
            self._note(self.clock.monotonic_ns(), "driver_words", text=self._link.words)

    def _ask_to_stop(self) -> None:
        """Let the driving process stop the arm, or do so without it."""
        assert self._link is not None
        with suppress(DriverError):
            self._link.tell("stop", "the bench asked for it")
        try:
            end = self.clock.monotonic_ns() + 5 * NANOSECONDS
            while self.clock.monotonic_ns() < end:
                for message in self._link.take():
                    if message[0] == "samples":
                        self._batches.append(message[1])
                    elif message[0] == "timing":
                        self.timing = message[1]
                    elif message[0] in {"stopped", "fault", "done"}:
                        standing = Standing.AT_REST if message[0] == "done" else message[-1]
                        self._note_standing(standing)
                        return
                self.clock.sleep(0.01)
        except DriverError:
            pass
        self._link.kill()
        self._note_standing(self._stop_orphan())

    def _note_standing(self, standing: Standing) -> None:
        """Tell of an arm that was told to stop, and that nobody saw at rest."""
        if not standing.stopped:
            self._note(self.clock.monotonic_ns(), "arm_not_seen_at_rest", arm=str(standing))
            self._unseen = f"warning: nobody saw the arm come to rest: {self.settings.unseen}"

    def close(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None

    def describe(self) -> dict[str, Any]:
        return super().describe() | {
            "host": self.settings.host,
            **{key: self.info[key] for key in self.told if key in self.info},
            "tool": self._tool(),
            "control_hz": self.settings.control_hz,
            "record_hz": self.settings.record_hz,
            "streamed_moves": self.streamed_moves,
            "timing": self.timing,
        }

    def afterwards(self) -> list[str]:
        """What was not as it should be: the controller's data, this machine's deadlines, the
        stop.
        """
        told = [self._unseen] if self._unseen else []
        missed = self.timing.get("samples_missed", 0)
        due = missed + self._received
        if missed and (missed > MISSED_SHARE * due or self._widest_gap_ns > WIDEST_GAP_NS):
            share, gap = 100 * missed / due, self._widest_gap_ns / NANOSECONDS
            what = f"{missed} of {due} ({share:.2g} %) of the controller's samples did not come"
            told.append(f"warning: {what}, the longest gap is {gap:.2g} s")
        cycles, overruns = self.timing.get("cycles", 0), self.timing.get("overruns", 0)
        latest = self.timing.get("late_max_s", 0.0)
        if overruns > LATE_SHARE * cycles or latest > LATEST_S:
            share = 100 * overruns / max(cycles, 1)
            how = "" if self.timing.get("realtime_priority") else ", without real-time priority"
            told.append(
                f"warning: this machine was busy{how}: {overruns} of {cycles} ({share:.2g} %) "
                f"turns of the driving loop were more than 1 ms late, the latest by {latest:.2g} s"
            )
        return told

    def _tool(self) -> dict[str, Any] | None:
        """The weight that the controller was told of, or None where it was left as it was."""
        mass, centre = self.settings.mass, self.settings.centre
        return (
            None
            if mass is None
            else {"mass_kg": mass, "centre_mm": [round(1000 * x, 6) for x in centre]}
        )

    def _motions(self, plan: Plan, steps: list[PlannedStep], paths: StraightPaths) -> list[Motion]:
        """Steps of a plan as the process is told of them; where one was left out, a move to the
        next one's beginning.
        """
        motions, before = [], plan.trajectory.q[0]
        for step in steps:
            begin = plan.trajectory.at(np.array([step.start_ns]))[0][0]
            if not np.allclose(begin, before, atol=1e-9):
                nearest = paths.blocked(before, begin)
                if nearest is not None:
                    raise ArmRefused(
                        f"the way to step '{step.name}' brings {nearest.first} and "
                        f"{nearest.second} too near"
                    )
                duration = float(np.abs(begin - before).max()) / APPROACH_RAD_S
                motions.append(
                    Motion(-1, "move", begin, APPROACH_RAD_S, APPROACH_RAD_S2, duration=duration)
                )
                before = begin
            motion = self._motion(plan, step, before, paths)
            motions.append(motion)
            before = motion.target
        return motions

    def _motion(
        self, plan: Plan, step: PlannedStep, before: np.ndarray, paths: StraightPaths
    ) -> Motion:
        knots = plan.trajectory
        target = knots.at(np.array([step.settled_ns]))[0][0]
        dwell, duration = (
            (step.end_ns - step.settled_ns) / NANOSECONDS,
            (step.settled_ns - step.start_ns) / NANOSECONDS,
        )
        if step.settled_ns == step.start_ns:
            return Motion(step.index, "hold", target, dwell=dwell)
        direct = step.kind == "move" and paths.blocked(before, target) is None
        if not direct:
            self.streamed_moves += step.kind == "move"
            times = np.arange(
                step.start_ns, step.settled_ns, round(NANOSECONDS / self.settings.control_hz)
            )
            path = knots.at(np.append(times, step.settled_ns))[0]
            return Motion(step.index, "stream", target, path=path, dwell=dwell, duration=duration)
        inside = (knots.time_ns >= step.start_ns) & (knots.time_ns <= step.settled_ns)
        speed = max(float(np.abs(knots.v[inside]).max()), SLOWEST[0])
        acceleration = max(float(np.abs(knots.a[inside]).max()), SLOWEST[1])
        return Motion(step.index, "move", target, speed, acceleration, None, dwell, duration)


def common_settings(plan: Plan) -> dict[str, Any]:
    """What the driving process of every arm must know of a plan: values of `LinkSettings`."""
    use, rates = plan.protocol.spec.arm, plan.robot.spec.rates
    x, y, z = use.tool.centre_mm if use.tool else (0.0, 0.0, 0.0)
    return {
        "joints": len(plan.robot.joint_names),
        "joint_names": tuple(plan.robot.joint_names),
        "control_hz": rates.control_hz,
        "record_hz": rates.record_hz,
        "tracking": float(np.radians(use.tracking_error_deg)),
        "mass": use.tool.mass_kg if use.tool else None,
        "centre": (x / 1000, y / 1000, z / 1000),
    }
