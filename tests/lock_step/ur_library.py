"""A stand-in for ur_rtde 1.6.5 that speaks RTDE to the emulated controller over lock-step lines.

It does what the driver uses of the library, in the library's order: a command's number goes into
input integer register 24 and its arguments into the registers beside it; after a blocking command
it waits for "done", clears the number, and waits for "ready" before the next one. That the emulated
controller answers the real library as it answers this one is tested over TCP.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from testbench.emulation.ur import script
from testbench.emulation.ur.rtde import (
    DATA,
    FORMATS,
    PROTOCOL_VERSION,
    SETUP_INPUTS,
    SETUP_OUTPUTS,
    START,
    package,
)
from testbench.emulation.ur.state import OUTPUT_TYPES
from tests.lock_step.network import LOOK_S, Line, Network

OFFSET = 24
"""Of the registers, with the upper range."""
DASHBOARD, SCRIPT, RTDE = 29999, 30003, 30004
EXECUTION_S = 300.0
"""A command may take so long."""
PROGRAM = f"""\
def rtde_control():
  global reg_offset_int = # int register offset
  {OFFSET}
  signal_done_with_cmd()
end
"""
RUNNING = 1 << 1
"""Bit of `robot_status_bits`: a program runs."""
STOPPED_BY = 1 << 2 | 1 << 6 | 1 << 7
"""Bits of `safety_status_bits`: protective stop and emergency stops."""


class Rtde:
    """One connection to the RTDE port, which holds the newest value of every variable."""

    def __init__(self, network: Network, host: str, frequency: float, variables: Sequence[str]):
        self.clock = network.clock
        self.line: Line = network.connect((host, RTDE), 2.0)
        self.line.settimeout(0.0)
        self.values: dict[str, Any] = {}
        self._bytes, self._answers = bytearray(), list[tuple[int, bytes]]()
        self._inputs: dict[tuple[str, ...], tuple[int, struct.Struct]] = {}
        self._names = list(variables)
        self._packer = struct.Struct(
            ">B" + "".join(FORMATS[OUTPUT_TYPES[name]] for name in variables)
        )
        self._ask(PROTOCOL_VERSION, struct.pack(">H", 2))
        self._ask(SETUP_OUTPUTS, struct.pack(">d", frequency) + ",".join(variables).encode())
        self._ask(START, b"")

    @property
    def connected(self) -> bool:
        self.take()
        return not self.line.ended

    def take(self) -> None:
        """Take in what has come."""
        with contextlib.suppress(BlockingIOError):
            self._bytes += self.line.recv(1 << 20)
        while len(self._bytes) >= 3:
            size, kind = struct.unpack_from(">HB", self._bytes)
            # what is no package makes the library give up the connection
            if size < 3 or (kind == DATA and size != 3 + self._packer.size):
                self._bytes.clear()
                self.line.close()
                return
            if len(self._bytes) < size:
                return
            payload = bytes(self._bytes[3:size])
            del self._bytes[:size]
            if kind == DATA:
                self._read(payload)
            else:
                self._answers.append((kind, payload))

    def write(self, values: dict[str, float]) -> None:
        """Write input registers, all at once.

        Raises:
            RuntimeError: The connection is lost.
        """
        names = tuple(values)
        if names not in self._inputs:
            recipe = self._ask(SETUP_INPUTS, ",".join(names).encode())[0]
            codes = "".join("i" if "_int_" in name else "d" for name in names)
            self._inputs[names] = recipe, struct.Struct(">" + codes)
        recipe, packer = self._inputs[names]
        self._send(package(DATA, bytes([recipe]) + packer.pack(*values.values())))

    def _read(self, payload: bytes) -> None:
        numbers = list(self._packer.unpack(payload))[1:]
        for name in self._names:
            count = 6 if OUTPUT_TYPES[name].startswith("VECTOR6") else 1
            own, numbers = numbers[:count], numbers[count:]
            self.values[name] = own if count > 1 else own[0]

    def _ask(self, kind: int, payload: bytes) -> bytes:
        self._send(package(kind, payload))
        end_ns = self.clock.now_ns + 5_000_000_000
        while self.clock.now_ns < end_ns:
            self.take()
            found = next((answer for answer in self._answers if answer[0] == kind), None)
            if found is not None:
                self._answers.remove(found)
                return found[1]
            self.clock.sleep(LOOK_S)
        raise RuntimeError("RTDE: no answer")

    def _send(self, data: bytes) -> None:
        try:
            self.line.sendall(data)
        except OSError as error:
            raise RuntimeError(f"RTDE: {error}") from None


class Control:
    """`rtde_control.RTDEControlInterface`."""

    FLAG_NO_WAIT, FLAG_UPPER_RANGE_REGISTERS, FLAG_NO_EXT_FT = 1, 2, 4

    def __init__(self, network: Network, host: str, frequency: float, flags: int):
        assert flags == 7
        self._network, self._host = network, host
        self._state = f"output_int_register_{OFFSET}"
        self._answer = f"output_int_register_{OFFSET + 1}"
        variables = [self._state, self._answer, "robot_status_bits", "safety_status_bits"]
        self._rtde = Rtde(network, host, frequency, variables)
        self._write(0, [])  # what an earlier program was last told

    def reuploadScript(self) -> bool:
        with self._network.connect((self._host, SCRIPT), 5.0) as line:
            line.sendall(PROGRAM.encode())
        return True

    def isConnected(self) -> bool:
        return self._rtde.connected

    def isProgramRunning(self) -> bool:
        self._rtde.take()
        return bool(self._rtde.values.get("robot_status_bits", 0) & RUNNING)

    def moveJ(
        self, q: Sequence[float], speed: float, acceleration: float, asynchronous: bool = False
    ) -> bool:
        return self._command(script.MOVE_J, [*q, speed, acceleration], int(asynchronous))

    def servoJ(self, q: Sequence[float], *arguments: float) -> bool:
        return self._command(script.SERVO_J, [*q, *arguments])

    def servoStop(self, deceleration: float) -> bool:
        return self._command(script.SERVO_STOP, [deceleration])

    def stopJ(self, deceleration: float, asynchronous: bool = False) -> None:
        self._command(script.STOP_J, [deceleration], int(asynchronous))

    def setPayload(self, mass: float, centre: Sequence[float]) -> bool:
        return self._command(script.SET_PAYLOAD, [mass, *centre])

    def setWatchdog(self, frequency: float) -> bool:
        return self._command(script.SET_WATCHDOG, [frequency])

    def kickWatchdog(self) -> bool:
        return self._command(script.WATCHDOG_KICK, [])

    def isSteady(self) -> bool:
        return self._command(script.IS_STEADY, []) and self._rtde.values[self._answer] == 1

    def stopScript(self) -> None:
        if self._until(lambda: self._at(script.READY)):
            self._write(script.STOP_SCRIPT, [])
            self._until(lambda: not self.isProgramRunning(), 5.0)

    def disconnect(self) -> None:
        self._rtde.line.close()

    def _command(self, number: int, arguments: Sequence[float], integer: int = 0) -> bool:
        if not self._until(lambda: self._at(script.READY)):
            return False
        self._write(number, arguments, integer)
        if number in script.STREAMING:
            return True
        if not self._until(lambda: self._at(script.DONE)):
            return False
        self._write(0, [])
        return True

    def _write(self, number: int, arguments: Sequence[float], integer: int = 0) -> None:
        integers = {
            f"input_int_register_{OFFSET}": number,
            f"input_int_register_{OFFSET + 1}": integer,
        }
        doubles = {
            f"input_double_register_{OFFSET + k}": value for k, value in enumerate(arguments)
        }
        self._rtde.write(integers | doubles)

    def _at(self, state: int) -> bool:
        self._rtde.take()
        return self._rtde.values.get(self._state) == state

    def _until(self, done: Callable[[], bool], timeout: float = EXECUTION_S) -> bool:
        """Whether something comes true; not while a program that ran has ended, nor in a stop."""
        clock, end_ns = self._rtde.clock, self._rtde.clock.now_ns + round(1e9 * timeout)
        while clock.now_ns < end_ns:
            stopped = self._rtde.values.get("safety_status_bits", 0) & STOPPED_BY
            ended = timeout == EXECUTION_S and not self.isProgramRunning()
            if stopped or ended:
                return False
            if not self._rtde.connected:
                raise RuntimeError("RTDE: the connection is lost")
            if done():
                return True
            clock.sleep(LOOK_S)
        return False


class Dashboard:
    """`dashboard_client.DashboardClient`."""

    def __init__(self, network: Network, host: str):
        self._network, self._host = network, host
        self._line: Line | None = None

    def connect(self, timeout_ms: int) -> None:
        self._line = self._network.connect((self._host, DASHBOARD), timeout_ms / 1000)
        self._line.readline()

    def isConnected(self) -> bool:
        return self._line is not None and not self._line.ended

    def disconnect(self) -> None:
        if self._line is not None:
            self._line.close()

    def polyscopeVersion(self) -> str:
        return self._ask("PolyscopeVersion").split()[1]

    def getRobotModel(self) -> str:
        return self._ask("get robot model")

    def getSerialNumber(self) -> str:
        return self._ask("get serial number")

    def isInRemoteControl(self) -> bool:
        return self._ask("is in remote control") == "true"

    def robotmode(self) -> str:
        return self._ask("robotmode")

    def safetystatus(self) -> str:
        return self._ask("safetystatus")

    def programState(self) -> str:
        return self._ask("programState")

    def _ask(self, line: str) -> str:
        assert self._line is not None
        self._line.sendall(f"{line}\n".encode())
        return self._line.readline().strip()


def ur_library(network: Network) -> dict[str, ModuleType]:
    """The library's modules by their names, to be put into `sys.modules`."""
    kinds: dict[str, tuple[str, type]] = {
        "rtde_control": ("RTDEControlInterface", Control),
        "dashboard_client": ("DashboardClient", Dashboard),
    }
    modules = {}
    for name, (kind, own) in kinds.items():
        modules[name] = ModuleType(name)
        setattr(modules[name], kind, type(kind, (_On, own), {"network": network}))
    return modules


class _On:
    """A class of the library that finds the network by itself."""

    network: Network

    def __init__(self, *arguments: Any):
        super().__init__(self.network, *arguments)
