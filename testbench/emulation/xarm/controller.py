"""The emulated xArm controller: what it makes of commands, and what it reports."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from testbench.emulation.controller import EmulatedController
from testbench.emulation.faults import Faults
from testbench.emulation.joints import Mode as Motion
from testbench.emulation.xarm import protocol
from testbench.emulation.xarm.protocol import Register, floats, padded

REPORT_HZ = 200.0
"""Rate of port 30000 (xArm-Developer/ufactory_docs, firmware/report); the emulated controller's own
period follows it.
"""
POSITION, SERVO = 0, 1
"""Modes."""
SERVO_LAG_S, SERVO_GAIN = 0.03, 300.0
"""Lag of servo targets; the maker publishes none, this is UR's shortest."""
JOINT_RANGE, JOINT_SPEED = 23, 24
"""Error codes (client library, x_code.py): a joint beyond its range, or too fast."""
TEMPERATURE_DEGC = 30
KINDS = {"xarm5": (5, 5), "xarm6": (6, 6), "xarm7": (7, 7), "lite6": (6, 9), "850": (6, 12)}
"""Axes and device type that arms report (client library, x_config.py)."""


class State(IntEnum):
    """What a controller says that it does (xArm user manual, 2.1.3)."""

    MOVING = 1
    STANDBY = 2
    PAUSED = 3
    STOPPED = 4
    CHANGED = 5


@dataclass(frozen=True)
class Identity:
    """What a controller says of itself: a name of `KINDS`, serial number, firmware."""

    kind: str
    serial: str = "XI130000000001"
    firmware: str = "2.5.0"

    @property
    def version(self) -> bytes:
        """Answer of register 1."""
        axes, device_type = KINDS[self.kind]
        return f"{axes},{device_type},{self.serial},AC130000000001,v{self.firmware}\0".encode()


class Controller(EmulatedController):
    """State of the controller."""

    identity: Identity
    period = 1 / REPORT_HZ

    def _switch_on(self) -> None:
        self.mode, self.error = POSITION, 0
        self.enabled, self.load = True, np.zeros(4)
        self._halt: State | None = None
        self._queue: list[tuple[np.ndarray, float, float]] = []
        self._commands: dict[int, Callable[[bytes], bytes | None]] = {
            Register.GET_VERSION: lambda data: self.identity.version,
            Register.GET_STATE: lambda data: bytes([self.state_now]),
            Register.GET_CMDNUM: lambda data: struct.pack(">H", len(self._queue)),
            Register.GET_ERROR: lambda data: bytes([self.error, 0]),
            Register.GET_TCP_POSE: lambda data: bytes(24),
            Register.GET_JOINT_POS: self._joint_positions,
            Register.MOTION_EN: self._enable,
            Register.SET_STATE: self._set_state,
            Register.CLEAN_ERR: self._clean_error,
            Register.CLEAN_WAR: lambda data: b"",
            Register.SET_MODE: self._set_mode,
            Register.SET_LOAD_PARAM: self._set_load,
            Register.MOVE_JOINT: self._move,
            Register.MOVE_SERVOJ: self._servo,
        }

    @property
    def state_now(self) -> State:
        """What the controller does."""
        if self._halt is not None:
            return self._halt
        moving = (
            self.joints.mode is Motion.MOVE
            or bool(self._queue)
            or float(np.abs(self.joints.v_reference).max()) > 1e-6
        )
        return State.MOVING if moving else State.STANDBY

    @property
    def state(self) -> str:
        motors = "ENABLED" if self.enabled else "DISABLED"
        return f"{self.state_now.name} {motors} error {self.error} mode {self.mode}"

    def execute(self, register: int, data: bytes) -> tuple[int, bytes]:
        """Carry a command out.

        Returns:
            State bits and data of the answer.
        """
        command = self._commands.get(register)
        result = None if command is None else command(data)
        if result is None:
            self.messages.append(
                f"command {register} was refused"
                if command
                else f"command {register} is not emulated"
            )
        bits = protocol.INVALID if result is None else 0
        bits |= protocol.ERROR if self.error else 0
        bits |= protocol.NOT_READY if self._halt in {State.STOPPED, State.CHANGED} else 0
        return bits, result or b""

    def _advance(self) -> None:
        if self._queue and self._halt is None and self.joints.at_rest:
            self.joints.move(*self._queue.pop(0))
        trip = self.joints.step(1.0)
        if trip is not None and not self.error:
            self.fail(JOINT_SPEED if "deg/s" in trip else JOINT_RANGE, trip)

    def fail(self, error: int, why: str) -> None:
        """Stop with an error."""
        self.messages.append(f"error {error}: {why}")
        self.error = error
        self.halt(State.STOPPED)

    def halt(self, state: State) -> None:
        """Come to rest and take no moves; what waits is forgotten unless this is a pause."""
        self._halt = state
        if state is not State.PAUSED:
            self._queue = []
        self.joints.stop_hard()

    def fault(self, name: str, value: float | None = None) -> None:
        """Let a fault happen; see `faults.FAULTS`."""
        if name == "protective_stop":
            self.fail(31, "collision")
        elif name == "servo_error":
            self.fail(11, "motor of joint 1")
        elif name in {"emergency_stop", "power_off"}:
            self.enabled = False
            self.error = 1 if name == "emergency_stop" else self.error
            self.halt(State.STOPPED)
        elif name == "clock_step":
            self.step_clock(value)
        elif name == "program_stop":
            self.halt(State.STOPPED)
        else:
            self.faults.strike(name.removeprefix("report_"), value, self.time)
        self.messages.append(f"fault {name}" + ("" if value is None else f" {value:g}"))

    def clear(self) -> None:
        """End every fault and stand by in position mode."""
        self.faults = Faults()
        self.error, self.enabled, self.mode = 0, True, POSITION
        self.halt(State.STOPPED)
        self._halt = None
        self.messages.append("cleared")

    def _joint_positions(self, data: bytes) -> bytes:
        """Where the joints are to be; with an argument, measured angles, rates and torques, as many
        as it says.
        """
        if not data:
            return padded(self.joints.q_reference).astype("<f4").tobytes()
        states = [
            padded(self.joints.q_measured),
            padded(self.joints.v_measured),
            np.zeros(protocol.JOINTS),
        ]
        return np.concatenate(states[: data[0] & 0x0F]).astype("<f4").tobytes()

    def _enable(self, data: bytes) -> bytes | None:
        if len(data) < 2:
            return None
        self.enabled = bool(data[1])
        self.halt(State.STOPPED)
        return b""

    def _set_state(self, data: bytes) -> bytes | None:
        if not data or data[0] not in {0, 3, 4}:
            return None
        if data[0] == 4:
            self.halt(State.STOPPED)
        elif data[0] == 3 and self._halt is None:
            self.halt(State.PAUSED)
        elif data[0] == 0 and self.enabled and not self.error:
            self._halt = None
        return b""

    def _clean_error(self, data: bytes) -> bytes:
        self.error = 0
        return b""

    def _set_mode(self, data: bytes) -> bytes | None:
        if not data or data[0] not in {POSITION, SERVO}:
            return None
        self.mode = data[0]
        self.halt(self._halt if self._halt is State.STOPPED else State.CHANGED)
        return b""

    def _set_load(self, data: bytes) -> bytes | None:
        load = floats(data, 4)
        if load is None or load[0] < 0:
            return None
        self.load = load
        self.halt(self._halt if self._halt is State.STOPPED else State.CHANGED)
        return b""

    def _move(self, data: bytes) -> bytes | None:
        values, n = floats(data, 10), len(self.robot.joint_names)
        if (
            values is None
            or not np.isfinite(values).all()
            or self.mode != POSITION
            or values[7] <= 0
            or values[8] <= 0
        ):
            return None
        if self._halt in {None, State.PAUSED}:
            self._queue.append((values[:n], float(values[7]), float(values[8])))
        return b""

    def _servo(self, data: bytes) -> bytes | None:
        values = floats(data, 10)
        if values is None or not np.isfinite(values).all() or self.mode != SERVO:
            return None
        if self._halt is None:
            self.joints.servo(values[: len(self.robot.joint_names)], SERVO_LAG_S, SERVO_GAIN)
        return b""

    def timely_report(self) -> bytes:
        """A report of port 30000."""
        report, joints = np.zeros(1, protocol.TIMELY), self.joints
        report["size"], report["time_us"] = (
            protocol.TIMELY.itemsize,
            max(round(1e6 * self.stamp), 0),
        )
        report["state_mode"], report["commands"] = self.state_now | self.mode << 4, len(self._queue)
        report["q_target"], report["v_target"] = (
            padded(joints.q_reference),
            padded(joints.v_reference),
        )
        report["a_target"] = padded(joints.a_reference)
        report["q"], report["v"], report["current"] = (
            padded(joints.q_measured),
            padded(joints.v_measured),
            padded(self.currents),
        )
        return report.tobytes()

    def rich_report(self) -> bytes:
        """A report of port 30002."""
        report, (axes, device_type) = np.zeros(1, protocol.RICH), KINDS[self.identity.kind]
        report["size"] = protocol.RICH.itemsize
        report["state_mode"], report["commands"] = self.state_now | self.mode << 4, len(self._queue)
        report["q_target"], report["v"] = (
            padded(self.joints.q_reference),
            padded(self.joints.v_reference),
        )
        report["brakes"] = report["motors"] = (1 << axes) - 1 if self.enabled else 0
        report["error"], report["load"] = self.error, self.load
        if self.faults.payload_kg is not None:
            report["load"][0, 0] = self.faults.payload_kg
        report["gravity"] = [0.0, 0.0, -1.0]
        report["axes"], report["device_type"] = axes, device_type
        report["temperatures"], report["currents"] = TEMPERATURE_DEGC, padded(self.currents)
        return report.tobytes()
