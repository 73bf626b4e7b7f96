"""A Universal Robots controller through its client library ur_rtde.

Samples are read as one piece: the time stamp is read before and after the values, and where it
changed they are read again.
"""

from __future__ import annotations

import math
import re
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Thread
from typing import Any, ClassVar

import numpy as np

from testbench.clock import Clock
from testbench.drivers.arms.client import ArmClient, ArmFault, Row
from testbench.drivers.arms.controller_lock import USED_BY_ANOTHER_RUN, ControllerLock
from testbench.drivers.arms.settings import LinkSettings
from testbench.drivers.arms.ur_greeting import DASHBOARD_PORT, greet_dashboard

SECONDARY_PORT = 30002
KEEP_ALIVE_S = 0.02
IN_TOUCH_S = 0.25
REASON_S = 0.1
"""Samples come slower than the client learns that a program ended; they say why within this time
[s].
"""
ANSWERED_NS = 50_000_000
"""Samples come over another connection than answers, and may be older than these by so much
[ns].
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
    "runtime_state",
    "robot_status_bits",
    "safety_status_bits",
    "target_speed_fraction",
    "speed_scaling",
]
PROTECTIVE, SAFEGUARD, EMERGENCY, VIOLATION, FAULT = 1 << 2, 1 << 4, 1 << 7, 1 << 8, 1 << 9
"""Bits of `safety_status_bits` (RTDE guide)."""
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
    orphaned: ClassVar[str] = "the controller's watchdog stops the arm"


class UrClient(ArmClient):
    """The client's three connections.

    Args:
        settings: Address, rates, tool.
        time: The host's clock; the machine's if None.
    """

    settings: UrSettings

    def __init__(self, settings: UrSettings, time: Clock | None = None):
        super().__init__(settings, time)
        self._control: Any = None
        self._receive: Any = None
        self._stamp = -1.0
        self._fed = 0.0
        self._modes = (0, 0)
        self._bits = 0
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
            import rtde_receive
        except ImportError:
            raise ArmFault(
                "extra_missing",
                "driving a Universal Robots arm needs the extra 'ur': pip install "
                "'imu-testbench[ur]' "
                "(its client library exists for x86-64 and Python up to 3.12)",
            ) from None
        host = self.settings.host
        if not self._lock.take():
            return {"refused": USED_BY_ANOTHER_RUN}
        dashboard = dashboard_client.DashboardClient(host)
        info = self._ask(dashboard)
        if info["refused"] is not None:
            return info
        try:
            self._receive = rtde_receive.RTDEReceiveInterface(
                host, self.settings.record_hz, VARIABLES, False, True
            )
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
        """Let the client library's program run on the controller, with tool and watchdog set."""
        settings = self.settings
        flags = (
            interface.FLAG_UPLOAD_SCRIPT
            | interface.FLAG_UPPER_RANGE_REGISTERS
            | interface.FLAG_NO_EXT_FT
        )
        self._control = interface(settings.host, settings.control_hz, flags)
        if settings.mass is not None and not self._control.setPayload(
            settings.mass, list(settings.centre)
        ):
            raise ArmFault("payload", "the controller did not take the weight of the tool")
        if not self._control.setWatchdog(1 / settings.watchdog):
            raise ArmFault("watchdog", "the controller's watchdog could not be set")
        self._program_seen, self._said_at = True, self.now()

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
        row = self._sample()
        return [] if row is None else [row]

    def _sample(self) -> Row | None:
        """The newest sample if there is one since the last call."""
        receive = self._receive
        for _ in range(4):
            stamp = receive.getTimestamp()
            if stamp == self._stamp:
                return None
            q, v, target = receive.getActualQ(), receive.getActualQd(), receive.getTargetQ()
            current, heat = receive.getActualCurrent(), receive.getJointTemperatures()
            modes, bits = (
                (receive.getRobotMode(), receive.getSafetyMode()),
                receive.getSafetyStatusBits(),
            )
            slider, scaling = receive.getTargetSpeedFraction(), receive.getSpeedScaling()
            if not q:  # nothing has come yet
                return None
            if receive.getTimestamp() == stamp:
                break
        else:
            return None
        self._stamp, self._modes, self._bits, self.slider = stamp, modes, bits, slider
        controller_ns = round(stamp * 1e9)
        host_ns, missed = self._note(controller_ns, np.array(q), np.array(v), np.array(target))
        return (
            host_ns,
            controller_ns,
            self.q,
            self.v,
            np.array(current),
            np.array(heat),
            *modes,
            scaling,
            self.q_target,
            missed,
        )

    def check(self) -> None:
        """Look at safety, power, program and data.

        Raises:
            ArmFault: The arm must stop, or has stopped.
        """
        settings = self.settings
        self._check_state()
        if not self._receive.isConnected():
            raise ArmFault("disconnect", "the connection to the controller was lost")
        if self.silent_for > settings.arm_silence:
            raise ArmFault(
                "report_silence", f"the controller sent no data for {settings.arm_silence:g} s"
            )
        if self.slider < settings.least_slider - 0.005:
            raise ArmFault(
                "speed_slider", f"the speed slider was turned down to {100 * self.slider:.0f} %"
            )
        if self._program_seen and not self._control.isProgramRunning():
            self._look_again()
            raise self._program_ended()

    def _program_ended(self) -> ArmFault:
        """Who ended the program: its watchdog, where nothing reached it for longer than that waits,
        or somebody else.
        """
        now, watchdog = self.now(), self.settings.watchdog
        gap, waited, at = self._unfed
        if now - self._said_at > watchdog:
            gap, waited = now - self._said_at, 0.0
        elif gap <= watchdog or now - at > LATELY_S:
            return ArmFault("program_stopped", "the program on the controller was stopped")
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
        asked_ns = self.now_ns()
        self._command(
            "moveJ was refused", self._control.moveJ, target.tolist(), speed, acceleration, True
        )
        # The controller answers after it was asked: where the newest stamp says otherwise the
        # clocks have parted.
        self.clock.not_before(round(1e9 * self._receive.getTimestamp()), asked_ns, ANSWERED_NS)

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
        """Whether the controller took a command."""
        begin = self.now()
        try:
            done = call(*arguments)
        except Exception as error:
            raise ArmFault(
                "disconnect", f"the connection to the controller was lost: {error}"
            ) from None
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
            self._check_state()
            if not self._receive.isConnected():
                raise ArmFault("disconnect", "the connection to the controller was lost")
            self.time.sleep(0.002)
        if self._program_seen and not self._control.isProgramRunning():
            raise self._program_ended()
        if self.silent_for > IN_TOUCH_S:
            raise ArmFault(
                "report_silence", f"the controller sent no data for {1000 * self.silent_for:.0f} ms"
            )

    def _in_touch(self) -> bool:
        """Whether the controller spoke lately; if not, the client's commands would wait for an
        answer for minutes.
        """
        return bool(self._receive.isConnected()) and self.silent_for < IN_TOUCH_S

    def stop(self, deceleration: float) -> None:
        """Bring the arm to rest by every way there is; never raises.

        Where the controller is out of touch, a program of its own goes to its script interface and
        replaces the one that moves.
        """
        if self._control is not None and self._in_touch():
            with suppress(Exception):
                if self._control.isConnected() and self._control.isProgramRunning():
                    if self._streaming:
                        self._control.servoStop(deceleration)
                    else:
                        self._control.stopJ(deceleration, True)
                    self._control.stopScript()
                    return
        if self._receive is None or math.isinf(deceleration):
            return
        with (
            suppress(OSError),
            socket.create_connection((self.settings.host, SECONDARY_PORT), 0.5) as script,
        ):
            script.sendall(f"def stop_bench():\n  stopj({deceleration})\nend\n".encode())

    def close(self) -> None:
        """Let go of the controller; never raises."""
        if self._control is not None and self._in_touch():
            with suppress(Exception):
                if self._control.isConnected() and self._control.isProgramRunning():
                    self._control.stopScript()
        endings = [
            Thread(target=_disconnect, args=(own,))
            for own in (self._control, self._receive)
            if own is not None
        ]
        for ending in endings:
            ending.start()
        for ending in endings:
            ending.join()
        self.listening = False
        self._lock.release()


def _disconnect(interface: Any) -> None:
    """Close a connection of the client library, which waits half a second in it."""
    with suppress(Exception):
        interface.disconnect()
