"""The script that ur_rtde uploads, as a machine: commands in input registers, answers in output.

The client writes a command's number into input integer register 0 and its arguments into the input
double registers (both shifted by 24 with the upper range). The script writes 1 into output integer
register 0 when it is ready and 2 when it has done a command; streaming commands leave it at 1.
Numbers and order follow the script text inside the client (ur_rtde 1.6.5, MIT).
"""

from __future__ import annotations

import re
from typing import Protocol

from testbench.emulation.faults import Faults
from testbench.emulation.joints import Joints
from testbench.emulation.ur.state import Registers

READY, DONE = 1, 2
MOVE_J, SPEED_J, SERVO_J, SPEED_STOP, SERVO_STOP, SET_PAYLOAD, WATCHDOG_KICK = (
    1,
    9,
    11,
    15,
    16,
    17,
    24,
)
STEP_TIME, PROTECTIVE_STOP, STOP_L, STOP_J, SET_WATCHDOG, JOINTS_WITHIN, IS_STEADY, STOP_SCRIPT = (
    26,
    31,
    33,
    34,
    35,
    37,
    47,
    255,
)
STREAMING = {6, 9, 10, 11, 24, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71}
"""Commands after which the script is ready at once."""

_OFFSET = re.compile(r"reg_offset_int\s*=\s*#[^\n]*\n\s*(\d+)")


class Machine(Protocol):
    """What the script reads and moves of the controller that runs it."""

    registers: Registers
    joints: Joints
    faults: Faults
    heard_until: float
    payload: float
    payload_cog: list[float]

    @property
    def time(self) -> float:
        """Time since the controller was started [s]."""

    def protective_stop(self, why: str) -> None:
        """Stop hard."""


def is_control_script(text: str) -> bool:
    """Whether an uploaded program is the control script of ur_rtde."""
    return "def rtde_control" in text and "signal_done_with_cmd" in text


class ControlScript:
    """The running control script.

    Args:
        text: As uploaded; it holds the offset of the registers.
    """

    def __init__(self, text: str):
        found = _OFFSET.search(text)
        self.offset = int(found.group(1)) if found else 0
        self._executing = False
        self._waiting = False
        self._asynchronous = False
        self._writes = self._operations = 0
        self._watchdog_period: float | None = None
        self._last_input = 0.0
        self._answer_at = 0.0

    def input_written(self, register: int, now: float) -> None:
        """Take note that a client wrote an input integer register, which feeds the watchdog."""
        if register == self.offset:
            self._last_input = now

    def begin(self, controller: Machine) -> None:
        """The script's first lines."""
        self._last_input = controller.time
        self._signal(controller, READY)
        self._progress(controller, -1)

    def tick(self, controller: Machine) -> str | None:
        """Run for one control period.

        Returns:
            Why the program ends, or None while it goes on.
        """
        silence = min(controller.time, controller.heard_until) - self._last_input
        if self._watchdog_period is not None and silence > self._watchdog_period:
            return f"RTDE watchdog: no input for {self._watchdog_period:.2f} s"
        if self._asynchronous and controller.joints.at_rest:
            self._asynchronous = False
            self._progress(controller, -1)
        if self._waiting:
            moving = not self._asynchronous and not controller.joints.at_rest
            if moving or controller.time < self._answer_at:
                return None
            self._waiting = False
            self._signal(controller, DONE)
            return None
        command = controller.registers.input_int[self.offset]
        if command in STREAMING:
            ended = self._process(controller, command)
            self._signal(controller, READY)
            return ended
        if command == 0:
            self._executing = False
            self._signal(controller, READY)
            return None
        if self._executing:
            return None
        self._executing = True
        ended = self._process(controller, command)
        if ended is None:
            self._answer_at = controller.time + controller.faults.response_delay_s
            self._waiting = True  # a command that moves nothing is done at the next instant
        return ended

    # One branch a command of the client library's script.
    def _process(self, controller: Machine, command: int) -> str | None:
        joints, first = controller.joints, self.offset
        value = controller.registers.input_double
        if command == MOVE_J:
            q = controller.registers.doubles(first, 6)
            joints.move(q, value[first + 6], value[first + 7])
            self._begin_asynchronous(controller)
        elif command == SERVO_J:
            q = controller.registers.doubles(first, 6)
            joints.servo(q, value[first + 9], value[first + 10])
        elif command == SPEED_J:
            joints.speed(controller.registers.doubles(first, 6), value[first + 6])
        elif command in {SPEED_STOP, SERVO_STOP, STOP_J, STOP_L}:
            joints.stop(value[first])
            if command in {STOP_J, STOP_L}:
                self._begin_asynchronous(controller)
        elif command == SET_PAYLOAD:
            controller.payload, controller.payload_cog = (
                value[first],
                list(value[first + 1 : first + 4]),
            )
        elif command == SET_WATCHDOG:
            self._watchdog_period = 1 / value[first] if value[first] > 0 else None
        elif command == PROTECTIVE_STOP:
            controller.protective_stop("asked for by the program")
        elif command == STEP_TIME:
            controller.registers.output_double[first] = joints.period
        elif command == JOINTS_WITHIN:
            low, high = joints.robot.position_limits.T
            q = controller.registers.doubles(first, 6)
            controller.registers.output_int[first + 1] = int(bool(((q >= low) & (q <= high)).all()))
        elif command == IS_STEADY:
            controller.registers.output_int[first + 1] = int(joints.steady)
        elif command == STOP_SCRIPT:
            return "stopped by the client"
        elif command != WATCHDOG_KICK:
            return f"command {command} is not emulated"
        return None

    def _begin_asynchronous(self, controller: Machine) -> None:
        if controller.registers.input_int[self.offset + 1] == 1:
            self._asynchronous = True
            self._progress(controller, 0)

    def _signal(self, controller: Machine, value: int) -> None:
        controller.registers.output_int[self.offset] = value

    def _progress(self, controller: Machine, value: int) -> None:
        """Progress of an asynchronous operation in output integer register 2, in the script's own
        coding.
        """
        self._writes = (self._writes + 1) % 128
        if value == 0:
            self._operations = (self._operations + 1) % 128
        coded = self._writes * 65536 + self._operations * 16777216
        controller.registers.output_int[self.offset + 2] = coded + (
            32768 + value if value >= 0 else 0
        )
