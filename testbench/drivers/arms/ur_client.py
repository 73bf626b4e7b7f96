"""A Universal Robots controller through its client library ur_rtde.

Commands go through the library. Samples come over a connection of ours, so that none is missed
while a command blocks, each with the time at which it arrived. The library, which would connect
again by itself and upload its program, is kept from both: `own_process.forbid_connections`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from testbench.clock import Clock
from testbench.drivers.arms.client import ArmClient, ArmFault, Row
from testbench.drivers.arms.controller_lock import USED_BY_ANOTHER_RUN, ControllerLock
from testbench.drivers.arms.own_process import forbid_connections, within
from testbench.drivers.arms.rtde import RtdeStream
from testbench.drivers.arms.settings import STOP_RAD_S2, LinkSettings
from testbench.drivers.arms.standing import Standing
from testbench.drivers.arms.ur_greeting import DASHBOARD_PORT, greet_dashboard
from testbench.drivers.arms.ur_outside import (
    EMERGENCY,
    FAULT,
    PROTECTIVE,
    SAFEGUARD,
    VIOLATION,
    nonsense,
    program_moves,
    stop_from_outside,
    tell_stop,
)
from testbench.extras import missing_extra

KEEP_ALIVE_S = 0.02
IN_TOUCH_S = 0.25
REASON_S = 0.1
"""Samples come slower than the client learns that a program ended; they say why within this time
[s].
"""
STOPPED_S = 1.0
"""The library must stop the arm within this time, or it is stopped without it [s]."""
STARTED_S = 5.0
"""The library's program must run within this time [s], as in the library itself."""
LOAD_S, LOAD_KG, LOAD_M = 2.0, 0.01, 0.001
"""The reports repeat the weight of the tool within this time after it was told [s], and its mass
and centre to so much [kg, m].
"""
MOST_UNFED = 3
"""Feeds of the watchdog that may fail one after the other."""
LATELY_S = 2.0
"""A program that ended is put down to a silence towards the controller within this time before
[s].
"""
ENDING_S = 0.5
"""A program that nobody feeds any more has ended this long after its watchdog's time [s]."""
PROGRAM_STATES = {"PLAYING": "running", "PAUSED": "paused"}
"""Answers to `programState` of the dashboard that are not STOPPED, in words."""
VARIABLES = [
    "timestamp",
    "target_q",
    "actual_q",
    "actual_qd",
    "actual_current",
    "joint_temperatures",
    "robot_mode",
    "safety_mode",
    "robot_status_bits",
    "safety_status_bits",
    "target_speed_fraction",
    "speed_scaling",
    "payload",
    "payload_cog",
]
"""Those of the weight of the tool need PolyScope 5.5.1 (RTDE guide)."""
RUNNING = 7
"""`robot_mode` of an arm that may move (RTDE guide)."""


@dataclass(frozen=True)
class UrSettings(LinkSettings):
    """How a Universal Robots arm is driven.

    Attributes:
        lookahead: Lookahead time of servoJ [s].
        gain: Gain of servoJ, a number without unit.
        watchdog: The controller ends the program, which stops the arm, when no input comes for so
            long [s]; it is the last resort, for when the driving process itself is gone.
        least_slider: Smallest position of the speed slider that does not stop the run.
    """

    lookahead: float = 0.03
    gain: float = 300.0
    watchdog: float = 0.5
    least_slider: float = 0.99
    unseen: ClassVar[str] = (
        "where the controller still runs, its watchdog ends the program within 0.5 s, which stops "
        "the arm; go and look"
    )


class UrClient(ArmClient):
    """The library's connections, and one of ours for samples.

    Args:
        settings: Address, rates, tool.
        time: The host's clock; the machine's if None.
    """

    settings: UrSettings

    def __init__(self, settings: UrSettings, time: Clock | None = None):
        super().__init__(settings, time)
        self._control: Any = None
        self._stream: RtdeStream | None = None
        self._began: float | None = None
        self._hung = self._told_outside = False
        self._fed = 0.0
        self._modes: tuple[int, int] = (0, 0)
        self._told: tuple[Any, ...] | None = None
        self._bits = 0
        self._load: tuple[float, list[float]] = (0.0, [0.0, 0.0, 0.0])
        self._load_told = False
        self._program_seen = self._streaming = False
        self._lock = ControllerLock(settings.host)
        self._said_at = self.now()
        # The longest time of late between two commands [s], what of it was waiting for an answer
        # [s], and when that was.
        self._unfed = (0.0, 0.0, 0.0)
        self._unfed_in_a_row = 0

    def connect(self) -> dict[str, Any]:
        """Connect, and say what there is; nothing moves.

        Raises:
            ArmFault: There is no controller, or none that this client can drive.
        """
        try:
            import dashboard_client
            import rtde_control
        except ImportError:
            needs = "driving a Universal Robots arm needs"
            raise ArmFault("extra_missing", missing_extra(needs, "ur")) from None
        host = self.settings.host
        if not self._lock.take():
            return {"refused": USED_BY_ANOTHER_RUN}
        dashboard = dashboard_client.DashboardClient(host)
        info = self._ask(dashboard)
        if info["refused"] is not None:
            return info
        try:
            self._stream = RtdeStream(
                host, self.settings.record_hz, VARIABLES, self.time, self.own_process
            )
            self.clock.round_trip_ns = self._stream.round_trip_ns
            self.listening = True
            self._wait_for_sample()
            info |= {
                "q_rad": self.q.tolist(),
                "speed_slider": self.slider,
                "robot_mode": self._modes[0],
            }
            refusal = self._refusal()
            if refusal is not None:
                return info | {"refused": refusal}
            self._start_program(rtde_control.RTDEControlInterface)
        except ArmFault:
            raise
        except Exception as error:
            raise ArmFault(
                "connection", f"the controller at {host} cannot be driven: {error}"
            ) from None
        return info

    def _start_program(self, interface: Any) -> None:
        """Let the client library's program run on the controller, with tool and watchdog set.

        The library is told not to upload it when it connects, and then to do so once: what it was
        told it would do again whenever it connects again.
        """
        settings = self.settings
        flags = (
            interface.FLAG_NO_WAIT | interface.FLAG_UPPER_RANGE_REGISTERS | interface.FLAG_NO_EXT_FT
        )
        self._control = interface(settings.host, settings.control_hz, flags)
        self._control.reuploadScript()
        end = self.now() + STARTED_S
        while not self.may_move:
            if self.now() > end:
                raise ArmFault(
                    "connection", f"the control program did not start within {STARTED_S:g} s"
                )
            self.samples()
            self.time.sleep(0.002)
        if self.own_process:
            forbid_connections()
        if settings.mass is not None:
            self._tell_load(settings.mass, list(settings.centre))
        if not self._control.setWatchdog(1 / settings.watchdog):
            raise ArmFault("watchdog", "the controller's watchdog could not be set")
        self._program_seen, self._said_at = True, self.now()

    def _tell_load(self, mass: float, centre: list[float]) -> None:
        """Say what the tool weighs, until the reports repeat it.

        Args:
            mass: Of the tool [kg].
            centre: Its centre of mass in the flange [m].
        """
        if not self._control.setPayload(mass, centre):
            raise ArmFault("payload", "the controller did not take the weight of the tool")
        end = self.now() + LOAD_S
        while not self._carries(mass, centre):
            if self.now() > end:
                raise ArmFault(
                    "payload",
                    f"the controller was told that the tool weighs {mass:g} kg, and reports "
                    f"{self._load[0]:.3g} kg, or another centre of mass",
                )
            self.samples()
            self.time.sleep(0.002)
        self._load_told = True

    def _carries(self, mass: float, centre: Sequence[float]) -> bool:
        """Whether the controller goes by this weight of the tool."""
        away = max(abs(own - told) for own, told in zip(self._load[1], centre, strict=True))
        return abs(self._load[0] - mass) < LOAD_KG and away < LOAD_M

    # One piece, since the questions go over one connection and every failure of it is one fault.
    def _ask(self, dashboard: Any) -> dict[str, Any]:
        """What the dashboard says of the arm, and why it must be refused, if it must."""
        host = self.settings.host
        problem = greet_dashboard(host)
        if problem is not None:
            raise ArmFault("connection", problem)
        try:
            dashboard.connect(2000)
            if not dashboard.isConnected():
                raise ArmFault(
                    "connection", f"no controller answers at {host}, port {DASHBOARD_PORT}"
                )
            version = dashboard.polyscopeVersion()
            found = re.match(r"(\d+)\.(\d+)", version)
            numbers = (int(found.group(1)), int(found.group(2))) if found else (0, 0)
            info: dict[str, Any] = {"polyscope": version, "refused": None}
            if numbers < (5, 6) or numbers[0] > 5:
                info["refused"] = (
                    f"the controller has PolyScope {version}; this driver needs 5.6 or a later 5"
                )
                return info
            info |= {
                "model": dashboard.getRobotModel(),
                "serial": dashboard.getSerialNumber(),
                "remote_control": dashboard.isInRemoteControl(),
                "safety_status": dashboard.safetystatus().partition(": ")[2],
            }
            sound = info["safety_status"] in {
                "NORMAL",
                "REDUCED",
            }  # of a stopped arm the cause of its stop is said first
            program = self._program_of_others(dashboard) if sound else None
            dashboard.disconnect()
        except ArmFault:
            raise
        except Exception as error:
            raise ArmFault(
                "connection", f"the dashboard at {host} does not answer: {error}"
            ) from None
        if not info["remote_control"]:
            info["refused"] = "the robot is not in remote control; switch it on the teach pendant"
        elif program is not None:
            whose = (
                "another bench, or the pendant?"
                if program == "running"
                else "of a run that was stopped, or another's?"
            )
            info["refused"] = (
                f"a program is {program} on this controller ({whose}); "
                "look at who uses the arm, then stop the program on the teach pendant"
            )
        return info

    def _program_of_others(self, dashboard: Any) -> str | None:
        """Whether a program is "running" or "paused"; that of a bench that is just gone has the
        time to end by its watchdog.
        """
        end = self.now() + self.settings.watchdog + ENDING_S
        while True:
            state = str(dashboard.programState()).partition(" ")[0]
            if state not in PROGRAM_STATES or self.now() > end:
                return PROGRAM_STATES.get(state)
            self.time.sleep(0.05)

    def _refusal(self) -> str | None:
        if self._bits & PROTECTIVE:
            return (
                "the robot is in a protective stop; find its cause, then unlock it on the "
                "teach pendant"
            )
        if self._bits & (EMERGENCY | SAFEGUARD | VIOLATION | FAULT):
            return "the robot's safety system has stopped it; see the teach pendant"
        if self._modes[0] != RUNNING:
            return (
                f"the arm is not running (robot mode {self._modes[0]}); power it on and "
                "release the brakes"
            )
        if self.slider < self.settings.least_slider:
            return (
                f"the speed slider stands at {100 * self.slider:.0f} %, below the "
                f"{100 * self.settings.least_slider:.0f} % "
                "that the plan needs"
            )
        return None

    def samples(self) -> list[Row]:
        taken = [] if self._stream is None else self._stream.take()
        rows = [self._row(arrival_ns, report) for arrival_ns, report in taken]
        self.listening = self._stream is not None and not self._stream.ended
        return [row for row in rows if row is not None]

    def _row(self, arrival_ns: int, report: dict[str, Any]) -> Row | None:
        """A sample; None where it cannot be true."""
        self.garbled = self.garbled or nonsense(report)
        if self.garbled:
            return None
        controller_ns = round(report["timestamp"] * 1e9)
        angles = [np.array(report[name]) for name in ("actual_q", "actual_qd", "target_q")]
        noted = self._note(controller_ns, arrival_ns, *angles)
        if noted is None:
            return None
        modes = report["robot_mode"], report["safety_mode"]
        self._take_state(report)
        return (
            noted[0],
            controller_ns,
            self.q,
            self.v,
            np.array(report["actual_current"]),
            np.array(report["joint_temperatures"]),
            *modes,
            report["speed_scaling"],
            self.q_target,
            noted[1],
        )

    def _take_state(self, report: dict[str, Any]) -> None:
        """Believe in a state that two samples tell, one after the other: single ones may have been
        altered on their way.
        """
        names = ("robot_mode", "safety_mode", "robot_status_bits", "safety_status_bits")
        more = ("target_speed_fraction", "payload", "payload_cog")
        state = tuple(report[name] for name in (*names, *more))
        if state == self._told or self._told is None:
            self._modes, self._bits, self.slider = state[:2], state[3], state[4]
            self._load = state[5:]
            self.may_move = program_moves(report)
        self._told = state

    def check(self) -> None:
        """Look at safety, power, program and data.

        Raises:
            ArmFault: The arm must stop, or has stopped.
        """
        settings = self.settings
        self._check_sense()
        self._check_state()
        self._check_connections()
        if self.silent_for > settings.arm_silence:
            raise ArmFault(
                "report_silence", f"the controller sent no data for {settings.arm_silence:g} s"
            )
        if self.slider < settings.least_slider - 0.005:
            raise ArmFault(
                "speed_slider", f"the speed slider was turned down to {100 * self.slider:.0f} %"
            )
        if self._program_seen and not self.may_move:
            self._look_again()
            raise self._program_ended()
        mass = settings.mass
        if self._load_told and mass is not None and not self._carries(mass, settings.centre):
            raise ArmFault(
                "payload",
                f"the controller goes by {self._load[0]:.3g} kg on the flange, or another centre "
                f"of mass, and was told {mass:g} kg",
            )

    def _check_connections(self) -> None:
        """Whether those of samples and of commands are there."""
        assert self._stream is not None
        if self._stream.garbled:
            self.garbled = self._stream.ended
            self._check_sense()
        if self.lost:
            raise ArmFault("disconnect", f"the connection to the controller was lost: {self.lost}")

    def _program_ended(self) -> ArmFault:
        """Who ended the program: its watchdog, where nothing reached it for longer than that waits,
        or somebody else.
        """
        now, watchdog = self.now(), self.settings.watchdog
        gap, waited, at = self._unfed
        if now - self._said_at > watchdog:
            gap, waited = now - self._said_at, 0.0
        elif gap <= watchdog or now - at > LATELY_S:
            return ArmFault(
                "program_stopped",
                "the program on the controller was stopped: by somebody, or by its watchdog "
                f"because no command reached it for {watchdog:g} s",
            )
        ended = f"its watchdog, which waits {watchdog:g} s, ended the program"
        if waited > 0.5 * gap:
            return ArmFault(
                "slow_response",
                f"the controller did not answer a command within {waited:.1f} s: {ended}",
            )
        return ArmFault(
            "slow_response",
            f"nothing was sent to the controller for {gap:.1f} s, this machine is too busy: "
            f"{ended}",
        )

    def _check_state(self) -> None:
        if self._bits & EMERGENCY:
            raise ArmFault("emergency_stop", "the robot's emergency stop was triggered")
        if self._bits & PROTECTIVE:
            raise ArmFault("protective_stop", "the robot made a protective stop")
        if self._bits & (SAFEGUARD | VIOLATION | FAULT):
            raise ArmFault(
                "safety_stop",
                f"the robot's safety system stopped it (safety mode {self._modes[1]})",
            )
        if self._modes[0] != RUNNING:
            raise ArmFault("power_off", f"the arm lost its power (robot mode {self._modes[0]})")

    def keep_alive(self) -> None:
        """Feed the controller's watchdog.

        A feed that is lost is repeated, for the watchdog itself decides what is too late.
        """
        now = self.now()
        if self._control is not None and now - self._fed > KEEP_ALIVE_S:
            self._fed = now
            fed = self._call(self._control.kickWatchdog)
            self._unfed_in_a_row = 0 if fed else self._unfed_in_a_row + 1
            if not fed:
                self._look_again()
            if self._unfed_in_a_row >= MOST_UNFED:
                raise ArmFault("refused", "the watchdog could not be fed")

    def move(self, target: np.ndarray, speed: float, acceleration: float) -> None:
        """Begin a moveJ.

        Args:
            target: Joint angles, shape (n,) [rad].
            speed: Of the leading joint [rad/s].
            acceleration: Of the leading joint [rad/s^2].
        """
        self._command(
            "moveJ was refused", self._control.moveJ, target.tolist(), speed, acceleration, True
        )

    def stream(self, target: np.ndarray) -> None:
        """Send a target of servoJ, which also feeds the controller's watchdog.

        Args:
            target: Joint angles, shape (n,) [rad].
        """
        settings, period = self.settings, 1.0 / self.settings.control_hz
        self._fed, self._streaming = self.now(), True
        self._command(
            "servoJ was refused",
            self._control.servoJ,
            target.tolist(),
            0.0,
            0.0,
            period,
            settings.lookahead,
            settings.gain,
        )

    def stop_stream(self, deceleration: float) -> None:
        """End servoJ."""
        self._command("servoStop was refused", self._control.servoStop, deceleration)
        self._streaming = False

    def _command(self, failure: str, call: Callable[..., Any], *arguments: Any) -> None:
        if not self._call(call, *arguments):
            self._look_again()
            raise ArmFault("refused", failure)

    def _call(self, call: Callable[..., Any], *arguments: Any) -> bool:
        """Whether the controller took a command.

        The library is not called over a connection that is lost: its two threads would take it
        apart at the same time.
        """
        if self.lost:
            raise ArmFault("disconnect", f"the connection to the controller was lost: {self.lost}")
        self._began = begin = self.now()
        try:
            done = call(*arguments)
        except Exception:  # what it says is about its own attempt to connect again
            which = self.lost or "that for commands"
            raise ArmFault(
                "disconnect", f"the connection to the controller was lost: {which}"
            ) from None
        finally:
            self._began = None
        now = self.now()
        gap, self._said_at = now - self._said_at, now
        if gap >= self._unfed[0] or now - self._unfed[2] > LATELY_S:
            self._unfed = (gap, now - begin, now)
        return bool(done)

    def _look_again(self) -> None:
        """A command that is refused, or a program that ended, has a reason, which the next samples
        may tell.
        """
        end = self.now() + REASON_S
        while self.now() < end and self.listening:
            self.samples()
            self._check_sense()
            self._check_state()
            self._check_connections()
            self.time.sleep(0.002)
        if self._program_seen and not self.may_move:
            raise self._program_ended()
        if self.silent_for > IN_TOUCH_S:
            raise ArmFault(
                "report_silence", f"the controller sent no data for {1000 * self.silent_for:.0f} ms"
            )

    def _in_touch(self) -> bool:
        """Whether the controller spoke lately; if not, the client's commands would wait for an
        answer for minutes.
        """
        return (
            self._stream is not None
            and not self._stream.ended
            and not self.garbled
            and self.silent_for < IN_TOUCH_S
            and bool(self._control.isConnected())
        )

    @property
    def lost(self) -> str:
        if self._stream is not None and self._stream.ended:
            return f"that for reports, {self._stream.ended}"
        if self._control is not None and not self._control.isConnected():
            return "that for commands"
        return ""

    @property
    def stuck_for(self) -> float:
        began = self._began
        return 0.0 if began is None else self.now() - began

    def stop(self, deceleration: float) -> None:
        """Bring the arm to rest by every way there is; never raises.

        Where the controller is out of touch, a program of its own goes to its script interface and
        replaces the one that moves.
        """
        if self._control is None:  # nothing of ours moves it
            return
        if self._in_touch() and (
            not self.may_move or self._within(lambda: self._end(deceleration))
        ):
            return
        self._outside(tell_stop, self.settings.host, deceleration)

    def _end(self, deceleration: float) -> None:
        """Stop the arm and end the program, by the library."""
        if self._streaming:
            self._control.servoStop(deceleration)
        else:
            self._control.stopJ(deceleration, True)
        self._control.stopScript()

    def _within(self, call: Callable[[], object]) -> bool:
        """Whether a call of the library did its work in time."""
        if self._hung:
            return False
        if self.own_process:
            self._hung = not within(call, STOPPED_S)
            return not self._hung
        with suppress(Exception):
            call()
            return True
        return False

    def _outside(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a function says that makes connections, which this process may not."""
        if self.helper is not None:
            return self.helper.ask(function, *arguments)
        return function(*arguments)

    def stop_from_outside(self, deceleration: float) -> Standing:
        if self._control is None:
            return Standing.AT_REST
        self._told_outside = True
        seen = self._outside(stop_from_outside, self.settings.host, deceleration, self.time)
        return Standing.UNKNOWN if seen is None else Standing(seen)

    def close(self) -> None:
        """Let go of the controller; never raises."""
        if self._control is not None and self._in_touch():
            if self.may_move:
                self._within(self._control.stopScript)
        elif self._control is not None and not self._told_outside:
            self.stop_from_outside(STOP_RAD_S2)
        if self._control is not None:
            self._within(self._control.disconnect)
        if self._stream is not None:
            self._stream.close()
        self.listening = False
        self._lock.release()
