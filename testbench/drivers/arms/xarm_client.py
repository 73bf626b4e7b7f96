"""A UFACTORY xArm controller through its client library xarm-python-sdk.

Commands go through the library. Samples come from the controller's report port 30000, which the
library does not read: only there is a time stamp, and only there are the angles sure to be those
that the encoders measured; `get_servo_angle` says where the controller wants the joints to be
(xArm-Python-SDK on GitHub, thread 73). Layout of the report: xArm-Developer/ufactory_docs,
firmware/report; states: xArm user manual, 2.1.3; modes and error codes: the library, x_config.py
and x_code.py (1.18.4).
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np

from testbench.clock import Clock, seconds
from testbench.drivers.arms.client import ArmClient, ArmFault, Row
from testbench.drivers.arms.controller_lock import USED_BY_ANOTHER_RUN, ControllerLock
from testbench.drivers.arms.receiver import Receiver
from testbench.drivers.arms.settings import LinkSettings
from testbench.drivers.arms.standing import RestWatch, Standing
from testbench.extras import missing_extra

CONTROL_PORT, REPORT_PORT = 502, 30000
REPORT = np.dtype(
    {
        "names": ["size", "time_us", "state_mode", "commands", "q_target", "q", "v", "current"],
        "formats": [">u4", ">u8", "u1", ">u2", "(7,)<f4", "(7,)<f4", "(7,)<f4", "(7,)<f4"],
        "offsets": [0, 4, 12, 13, 32, 116, 144, 200],
        "itemsize": 228,
    }
)
"""The part of a report that is read; a whole one is longer, and says how long."""
LONGEST_REPORT = 4096
OLDEST_FIRMWARE = (2, 1, 0)
"""The first with report port 30000."""
POSITION, SERVO = 0, 1
"""Modes: the controller plans; it follows targets."""
READY, PAUSED = {0, 1, 2}, 3
"""States in which commands are taken (ready, in motion, standing by), and that of a suspended
motion; higher ones are stops.
"""
STOP_STATE = 4
MOVING = 1
EMERGENCY, SERVO_ERRORS, COLLISIONS = {1, 2, 3}, set(range(10, 18)), {22, 31}
"""Error codes: stop buttons, motors, collisions found by model or by current."""
NOT_CONNECTED, NO_ANSWER, NOT_READY = {-1, 8}, 3, 9
"""What the library's calls return: the connection is gone; no answer came in time; the controller
takes no moves now.
"""
LOAD_S, LOAD_TOLERANCE = 2.0, 0.01
"""The weight of the tool shows in the slow reports within this time [s], to so much [kg, mm]."""
OTHER_LOAD_S = 0.5
"""The slow reports tell another weight for so long before that is believed [s]: in two of them."""
MODE_S, SURE_NS = 2.0, 50_000_000
"""A change of mode shows in the reports within this time [s], and counts when they have told of it
for so long [ns].
"""
REASON_S = 0.45
"""Slow reports come every 0.2 s; the reason of a stop is known within this time [s]."""
IN_TOUCH_S = 0.25
PATIENCE_S, LOOK_S = 2.0, 0.8
"""An arm is told to stop from outside for so long, and one look at it takes at most so long [s]."""
MODELS = {(5, 5): "xArm 5", (6, 6): "xArm 6", (7, 7): "xArm 7", (6, 9): "Lite 6", (6, 12): "850"}
"""By number of axes and device type."""


@dataclass(frozen=True)
class XArmSettings(LinkSettings):
    """How an xArm is driven.

    Attributes:
        settled: As for every arm; wider, for nobody knows how well this one holds a pose.
        control_port: For commands.
        answer: The controller must answer a command within this time [s].
    """

    settled: float = float(np.radians(0.05))
    control_port: int = CONTROL_PORT
    answer: float = 0.5
    unseen: ClassVar[str] = (
        "this controller has no watchdog, the arm goes on to the end of the move that it was sent: "
        "keep away from it, use the emergency stop, and go and look"
    )


def stop_at_once(host: str, port: int, timeout: float = 0.5) -> None:
    """Tell a controller to stop, over a connection of its own; never raises.

    The library is not used.

    The frame (docs.ufactory.cc/private_tcp_protocol): transaction, protocol 2, length 2, register
    12 (state), 4 (stop).
    """
    with suppress(OSError), socket.create_connection((host, port), timeout) as connection:
        connection.settimeout(timeout)
        connection.sendall(bytes([0, 1, 0, 2, 0, 2, 12, STOP_STATE]))
        connection.recv(64)


def stop_from_outside(
    host: str, port: int, joints: int, time: Clock, patience_s: float = PATIENCE_S
) -> Standing:
    """Stop the arm over connections of its own, and say what was seen of it; never raises.

    Args:
        host: Address of the controller.
        port: For commands.
        joints: How many.
        time: The host's clock.
        patience_s: How long to try [s].
    """
    end, seen = seconds(time) + patience_s, Standing.UNKNOWN
    while True:
        stop_at_once(host, port)
        standing = look(host, joints, time)
        seen = seen if standing is Standing.UNKNOWN else standing
        if standing is Standing.AT_REST:
            return standing
        if seconds(time) > end:
            halted = seen is Standing.UNKNOWN and _asked_state(host, port) == STOP_STATE
            return Standing.HALTED if halted else seen
        time.sleep(0.05)


def _asked_state(host: str, port: int, timeout: float = 0.5) -> int | None:
    """The controller's state, over a connection of its own, None where it does not say; never
    raises.

    The frame is that of `stop_at_once`, with register 13; the answer's data begin behind its eight
    bytes of head.
    """
    with suppress(OSError), socket.create_connection((host, port), timeout) as connection:
        connection.settimeout(timeout)
        connection.sendall(bytes([0, 2, 0, 2, 0, 1, 13]))
        answer = connection.recv(64)
        return answer[8] if len(answer) > 8 else None
    return None


def look(host: str, joints: int, time: Clock) -> Standing:
    """What reports of a new connection show; never raises.

    Args:
        host: Address of the controller.
        joints: How many.
        time: The host's clock.
    """
    watch, data, end = RestWatch(), bytearray(), seconds(time) + LOOK_S
    with suppress(OSError):
        receiver = Receiver(socket.create_connection((host, REPORT_PORT), 0.5), time)
        try:
            while watch.standing is not Standing.AT_REST and seconds(time) < end:
                data += b"".join(piece for _, piece in receiver.take())
                while (report := take_report(data)) is not None:
                    moving = int(report["state_mode"]) & 0x0F in {MOVING, PAUSED}
                    rates = report["v"][:joints].astype(float)
                    watch.look(1e-6 * int(report["time_us"]), rates, moving)
                if receiver.ended:
                    break
                time.sleep(0.004)
        finally:
            receiver.close()
    return watch.standing


def take_report(data: bytearray) -> Any | None:
    """Take the first report off some bytes; None while it is not whole.

    Raises:
        OSError: These bytes are none.
    """
    if len(data) < REPORT.itemsize:
        return None
    size = int.from_bytes(data[:4], "big")
    if not REPORT.itemsize <= size <= LONGEST_REPORT:
        raise OSError(f"a report of {size} bytes")
    if len(data) < size:
        return None
    report = np.frombuffer(bytes(data[: REPORT.itemsize]), REPORT)[0]
    del data[:size]
    return report


class XArmClient(ArmClient):
    """The library's connections, and one of ours for reports.

    Args:
        settings: Address, rates, tool.
        time: The host's clock; the machine's if None.
    """

    settings: XArmSettings

    def __init__(self, settings: XArmSettings, time: Clock | None = None):
        super().__init__(settings, time)
        self._arm: Any = None
        self._titles: dict[int, str] = {}
        self._report: Receiver | None = None
        self._bytes = bytearray()
        self._held: list[Row] = []
        self._state = self._mode = self._commands = -1
        self._wanted_mode: int | None = None
        self._lost = self._taken_over = self._unanswered = False
        self._load_told: tuple[float, list[float]] | None = None
        self._carried = 0.0
        self._lock = ControllerLock(settings.host)

    def connect(self) -> dict[str, Any]:
        host = self.settings.host
        try:
            address = socket.gethostbyname(host)
            socket.create_connection((address, self.settings.control_port), 2.0).close()
        except OSError:
            raise ArmFault(
                "connection", f"no controller answers at {host}, port {self.settings.control_port}"
            ) from None
        if not self._lock.take():
            return {"refused": USED_BY_ANOTHER_RUN}
        try:
            self._arm = self._open(address)
            info = self._ask()
            if info["refused"] is not None:
                return info
            connection = socket.create_connection((address, REPORT_PORT), 2.0)
            self._report = Receiver(connection, self.time, self.own_process)
            self.listening = True
            self._wait_for_sample()
            self._wait_for_motor_states()
            info |= {"q_rad": self.q.tolist(), "refused": self._refusal()}
        except ArmFault:
            raise
        except Exception as error:
            raise ArmFault(
                "connection", f"the controller at {host} cannot be driven: {error}"
            ) from None
        return info

    def _open(self, address: str) -> Any:
        """The library, connected; it prints, which goes nowhere in this process, and makes a folder
        in the user's home.
        """
        home = os.environ.get("HOME")
        try:
            with TemporaryDirectory() as folder:
                os.environ["HOME"] = folder
                from xarm.core.config.x_code import ControllerErrorCodeMap
                from xarm.core.config.x_config import XCONF
                from xarm.wrapper import XArmAPI
        except ImportError:
            raise ArmFault(
                "extra_missing", missing_extra("driving an xArm needs", "xarm")
            ) from None
        finally:
            os.environ.pop("HOME", None)
            if home is not None:
                os.environ["HOME"] = home
        self._titles = {
            code: entry["en"]["title"] for code, entry in ControllerErrorCodeMap.items()
        }
        XCONF.SocketConf.TCP_CONTROL_PORT = (
            self.settings.control_port
        )  # the library lets nobody choose it
        arm = XArmAPI(
            address,
            is_radian=True,
            report_type="rich",
            check_is_pause=False,  # it would wait for ever
            check_cmdnum_limit=False,
            forbid_uds=True,  # a local socket that somebody left must not divert it
        )
        arm.set_timeout(self.settings.answer)
        return arm

    def _ask(self) -> dict[str, Any]:
        """What the controller says of itself, and why it must be refused, if it must."""
        arm = self._arm
        version = tuple(arm.version_number)
        firmware = ".".join(str(number) for number in version)
        kind = (arm.axis, arm.device_type)
        info: dict[str, Any] = {
            "model": MODELS.get(kind, f"arm of {kind[0]} axes, type {kind[1]}"),
            "axes": kind[0],
            "device_type": kind[1],
            "serial": arm.sn,
            "firmware": firmware,
            "refused": None,
        }
        if version < OLDEST_FIRMWARE:
            info["refused"] = (
                f"the controller has firmware {firmware}; this driver needs "
                f"{'.'.join(map(str, OLDEST_FIRMWARE))} or later, "
                "which reports measured angles with time stamps"
            )
        return info

    def _wait_for_motor_states(self) -> None:
        end = self.now() + 3.0
        while -1 in self._arm.motor_enable_states[: self.settings.joints]:
            if self.now() > end:
                raise ArmFault("silence", "the controller does not report the state of its motors")
            self.time.sleep(0.01)
        self.time.sleep(0.05)  # the library takes in the rest of that report

    def _refusal(self) -> str | None:
        arm, joints = self._arm, self.settings.joints
        error = self._error()
        if error in EMERGENCY:
            return (
                "its emergency stop is pressed; release it, and enable the robot in UFACTORY Studio"
            )
        if error:
            return (
                f"its controller reports error {self._named(error)}; find its cause, then "
                "clear it in UFACTORY Studio"
            )
        ready = zip(arm.motor_enable_states[:joints], arm.motor_brake_states[:joints], strict=True)
        off = [str(i + 1) for i, states in enumerate(ready) if states != (1, 1)]
        if off:
            return (
                f"the motors of joints {', '.join(off)} are not enabled; enable the robot in "
                "UFACTORY Studio"
            )
        if arm.is_simulation_robot:
            return (
                "its controller simulates the arm instead of moving it; switch that off in "
                "UFACTORY Studio"
            )
        if arm.is_reduced_mode:
            return (
                "its controller is in reduced mode and would move slower than planned; switch "
                "that off in UFACTORY Studio"
            )
        if self._mode not in {POSITION, SERVO}:
            return (
                f"its controller is in mode {self._mode}, in which somebody else moves it; "
                "switch it to position mode"
            )
        if self._state == MOVING or self._commands > 0:
            return "it is moving, or has motions waiting: something else drives it"
        if self._state == PAUSED:
            return "it is paused in a motion; stop that in UFACTORY Studio"
        return None

    def _take_over(self) -> None:
        """Say what the tool weighs, and make the controller take moves; nothing moves."""
        self._taken_over = True
        self._enter(POSITION)
        mass, centre_mm = self.settings.mass, [1000 * value for value in self.settings.centre]
        if mass is None:
            return
        code = self._arm.set_tcp_load(mass, centre_mm)
        if code not in {
            0,
            NOT_READY,
        }:  # some versions want to be made ready anew when the load has changed
            raise ArmFault(
                "payload",
                f"the controller did not take the weight of the tool (code {code} of the client "
                "library)",
            )
        self._wanted_mode = None
        self._enter(POSITION)
        end = self.now() + LOAD_S
        while not self._carries(mass, centre_mm):
            if self.now() > end:
                raise ArmFault(
                    "payload",
                    "the controller does not report the weight of the tool that it was told",
                )
            self._held += self._read()
            self.time.sleep(0.01)
        self._load_told, self._carried = (mass, centre_mm), self.now()

    def _carries(self, mass: float, centre_mm: list[float]) -> bool:
        """Whether the controller goes by this weight of the tool [kg, mm]."""
        told = np.hstack(self._arm.tcp_load)
        return bool((np.abs(told - [mass, *centre_mm]) < LOAD_TOLERANCE).all())

    def _check_load(self) -> None:
        """Whether the controller still goes by the weight of the tool that it was told."""
        told = self._load_told
        if told is None or self._carries(*told):
            self._carried = self.now()
        elif self.now() - self._carried > OTHER_LOAD_S:
            kg = float(np.hstack(self._arm.tcp_load)[0])
            raise ArmFault(
                "payload",
                f"the controller goes by {kg:.3g} kg on the flange, or another centre of mass, and "
                f"was told {told[0]:g} kg",
            )

    def samples(self) -> list[Row]:
        rows, self._held = self._held, []
        return rows + self._read()

    def _read(self) -> list[Row]:
        if self._report is None:
            return []
        rows: list[Row | None] = []
        for arrival_ns, piece in self._report.take():
            self._bytes += piece
            try:
                while not self.garbled and (report := take_report(self._bytes)) is not None:
                    if (
                        np.isfinite(report["q"]).all() and np.isfinite(report["v"]).all()
                    ):  # without angles it counts as none
                        rows.append(self._row(report, arrival_ns))
            except OSError as error:
                self.garbled = str(error)
        self._lost = self._lost or bool(self._report.ended)
        return [row for row in rows if row is not None]

    def _row(self, report: Any, arrival_ns: int) -> Row | None:
        """A sample; None where it cannot be true."""
        n = self.settings.joints
        q, v, target, current = (
            report[name][:n].astype(float) for name in ("q", "v", "q_target", "current")
        )
        stamp_ns = 1000 * int(report["time_us"])
        noted = self._note(stamp_ns, arrival_ns, q, v, target)
        if noted is None:
            return None
        self._state, self._mode = int(report["state_mode"]) & 0x0F, int(report["state_mode"]) >> 4
        self._commands = int(report["commands"])
        self.may_move = self._state in {MOVING, PAUSED}
        heat = np.array(self._arm.temperatures[:n], dtype=float)
        return (
            noted[0],
            stamp_ns,
            q,
            v,
            current,
            heat,
            self._state,
            self._mode,
            self._arm.error_code,
            target,
            noted[1],
        )

    def check(self) -> None:
        self._check_sense()
        if self._arm.error_code or self._state > PAUSED:
            self._raise_reason()
        if self._lost or not self._arm.connected:
            self.listening = False
            which = self._report.ended if self._lost and self._report else "that for commands"
            raise ArmFault("disconnect", f"the connection to the controller was lost: {which}")
        if self.silent_for > self.settings.arm_silence:
            self.listening = False
            raise ArmFault(
                "report_silence",
                f"the controller sent no report for {self.settings.arm_silence:g} s",
            )
        if self._wanted_mode is not None and self._mode != self._wanted_mode:
            raise ArmFault("mode_changed", f"somebody switched the controller to mode {self._mode}")
        if self._state == PAUSED:
            raise ArmFault("program_stopped", "somebody paused the arm")
        self._check_load()

    def _error(self) -> int:
        """The error code of now, which the library's reports tell late."""
        code, words = self._arm.get_err_warn_code()
        return int(words[0]) if code == 0 else int(self._arm.error_code)

    def _named(self, error: int) -> str:
        return f"{error} ({self._titles.get(error, 'none' if error == 0 else 'unknown')})"

    def _raise_reason(self) -> None:
        """Why the arm stopped; the motors' state comes with the slow reports."""
        end, joints = self.now() + REASON_S, self.settings.joints
        while (
            not (error := self._error())
            and all(self._arm.motor_enable_states[:joints])
            and self.now() < end
        ):
            self.time.sleep(0.02)
        if error in EMERGENCY:
            raise ArmFault(
                "emergency_stop",
                f"the robot's emergency stop was pressed: error {self._named(error)}",
            )
        if error in COLLISIONS:
            raise ArmFault(
                "protective_stop", f"the controller found a collision: error {self._named(error)}"
            )
        if error in SERVO_ERRORS:
            raise ArmFault("servo_error", f"a motor failed: error {self._named(error)}")
        if error:
            raise ArmFault(
                "controller_error", f"the controller stopped the arm: error {self._named(error)}"
            )
        if not all(self._arm.motor_enable_states[:joints]):
            raise ArmFault("power_off", "the motors were switched off")
        raise ArmFault("program_stopped", "somebody stopped the arm")

    def keep_alive(self) -> None:
        """The controller has no watchdog that could be fed."""

    def move(self, target: np.ndarray, speed: float, acceleration: float) -> None:
        """Begin a move; the first one, to the start, takes the controller over.

        Args:
            target: Joint angles, shape (n,) [rad].
            speed: Of the leading joint [rad/s].
            acceleration: Of the leading joint [rad/s^2].
        """
        if not self._taken_over:
            self._take_over()
        self._enter(POSITION)
        move = partial(
            self._arm.set_servo_angle,
            angle=target.tolist(),
            speed=speed,
            mvacc=acceleration,
            wait=False,
        )
        self._command("a move was refused", move)

    def begin_stream(self) -> None:
        self._enter(SERVO)

    def stream(self, target: np.ndarray) -> None:
        self._command("a target was refused", self._arm.set_servo_angle_j, target.tolist())

    def stop_stream(self, deceleration: float) -> None:
        """End streaming; the arm is at rest, the controller holds it."""
        self._enter(POSITION)

    def _enter(self, mode: int) -> None:
        """Bring the controller, whose arm is at rest, into a mode in which it takes commands."""
        if self._wanted_mode == mode and self._state in READY:
            return
        self._wanted_mode = None
        self._command("the mode was not taken", self._arm.set_mode, mode)
        self._command("the state was not taken", self._arm.set_state, 0)
        end, since = self.now() + MODE_S, -1
        while (
            since < 0 or self._stamp_ns - since < SURE_NS
        ):  # the first reports may be older than the commands
            self._held += self._read()
            ready = self._mode == mode and self._state in READY
            since = -1 if not ready else since if since >= 0 else self._stamp_ns
            if self.now() > end:
                told = f"state {self._state}, mode {self._mode}, error {self._named(self._error())}"
                raise ArmFault(
                    "not_ready", f"the controller did not get ready in mode {mode}: {told}"
                )
            self.time.sleep(0.001)
        self._wanted_mode = mode

    def _command(self, failure: str, call: Callable[..., Any], *arguments: Any) -> None:
        code = call(*arguments)
        if code == 0:
            return
        if code in NOT_CONNECTED or not self._arm.connected:
            raise ArmFault("disconnect", "the connection to the controller was lost")
        if code == NO_ANSWER:
            self._unanswered = True
            raise ArmFault(
                "slow_response", f"the controller did not answer within {self.settings.answer:g} s"
            )
        self._held += self._read()
        if self._state > PAUSED or self._error():
            self._raise_reason()
        raise ArmFault("refused", f"{failure} (code {code} of the client library)")

    def stop(self, deceleration: float) -> None:
        """Tell the controller to stop, which it does at a rate of its own; where it does not
        answer, over a new connection.
        """
        if not self._taken_over:
            return
        with suppress(Exception):
            in_touch = self._arm.connected and self.silent_for < IN_TOUCH_S and not self._unanswered
            if in_touch and self._arm.set_state(STOP_STATE) == 0:
                return
        stop_at_once(self.settings.host, self.settings.control_port)

    def stop_from_outside(self, deceleration: float) -> Standing:
        if not self._taken_over:
            return Standing.AT_REST
        settings = self.settings
        return stop_from_outside(settings.host, settings.control_port, settings.joints, self.time)

    def close(self) -> None:
        """Let go of the controller, whose arm stays stopped; never raises."""
        if self._taken_over and self._state in READY:
            self.stop(0.0)
        if self._arm is not None:
            with suppress(Exception):
                self._arm.disconnect()
        if self._report is not None:
            self._report.close()
        self.listening = False
        self._lock.release()
