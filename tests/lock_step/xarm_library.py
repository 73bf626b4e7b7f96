"""A stand-in for xarm-python-sdk 1.18.4 that speaks to the emulated controller over lock-step
lines.

It does what the driver uses of the library: commands as frames that are answered, and slow reports
of port 30002. What calls return follows x3/base.py (`_check_code`) and
core/wrapper/uxbus_cmd_tcp.py (`check_private_protocol`).
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from testbench.emulation.xarm import protocol
from testbench.emulation.xarm.protocol import RICH, Register
from tests.lock_step.network import Line, Network

RICH_PORT = 30002
NO_ANSWER, NOT_READY, INVALID, NOT_CONNECTED = 3, 9, 10, -1
TITLES = {
    1: "The Emergency Stop Button on the xArm Controller is pushed in to stop",
    11: "Servo motor 1 error",
    31: "Collision Caused Abnormal Current",
}
"""Of the library's error codes, those that the emulated controller has."""


class XArmAPI:
    """The library's one class."""

    network: Network
    sockets: SimpleNamespace

    def __init__(self, address: str, **options: Any):
        self._line: Line = self.network.connect((address, self.sockets.TCP_CONTROL_PORT), 2.0)
        self._slow: Line = self.network.connect((address, RICH_PORT), 2.0)
        self._slow.settimeout(0.0)
        self._bytes, self._number, self._ready = bytearray(), 0, False
        self._report: Any = None
        _, version = self._ask(Register.GET_VERSION)
        axes, device_type, self.sn, _, firmware = version.rstrip(b"\0").decode().split(",")
        self.axis, self.device_type = int(axes), int(device_type)
        self.version_number = tuple(int(part) for part in firmware.removeprefix("v").split("."))
        self.is_simulation_robot = self.is_reduced_mode = False

    def set_timeout(self, timeout: float) -> None:
        self._line.settimeout(timeout)

    @property
    def connected(self) -> bool:
        self._take()
        return not self._line.ended

    @property
    def motor_enable_states(self) -> list[int]:
        return self._bits("motors")

    @property
    def motor_brake_states(self) -> list[int]:
        return self._bits("brakes")

    @property
    def temperatures(self) -> list[int]:
        self._take()
        return [0] * 7 if self._report is None else self._report["temperatures"].tolist()

    @property
    def error_code(self) -> int:
        self._take()
        return 0 if self._report is None else int(self._report["error"])

    @property
    def tcp_load(self) -> list[Any]:
        self._take()
        mass, *centre = [0.0] * 4 if self._report is None else self._report["load"].tolist()
        return [mass, centre]

    def get_err_warn_code(self) -> tuple[int, list[int]]:
        code, data = self._ask(Register.GET_ERROR)
        return code, list(data) if data else [0, 0]

    def set_mode(self, mode: int) -> int:
        return self._ask(Register.SET_MODE, bytes([mode, 0]))[0]

    def set_state(self, state: int) -> int:
        code = self._ask(Register.SET_STATE, bytes([state]))[0]
        self._ask(Register.GET_STATE)
        return code

    def set_tcp_load(self, mass: float, centre_mm: Sequence[float]) -> int:
        code = self._ask(Register.SET_LOAD_PARAM, struct.pack("<4f", mass, *centre_mm))[0]
        return code or (0 if self._ready else NOT_READY)

    def set_servo_angle(
        self, angle: Sequence[float], speed: float, mvacc: float, wait: bool
    ) -> int:
        assert not wait
        return self._move(Register.MOVE_JOINT, angle, speed, mvacc)

    def set_servo_angle_j(self, angles: Sequence[float]) -> int:
        return self._move(Register.MOVE_SERVOJ, angles, 0.0, 0.0)

    def disconnect(self) -> None:
        self._line.close()
        self._slow.close()

    def _move(
        self, register: Register, angles: Sequence[float], speed: float, acceleration: float
    ) -> int:
        q = [*angles, *[0.0] * (protocol.JOINTS - len(angles))]
        code = self._ask(register, struct.pack("<10f", *q, speed, acceleration, 0.0))[0]
        return code or (0 if self._ready else NOT_READY)

    def _ask(self, register: Register, data: bytes = b"") -> tuple[int, bytes]:
        """The library's code, and the data of the answer."""
        if self._line.ended:
            return NOT_CONNECTED, b""
        self._number = (self._number + 1) % 65536
        head = struct.pack(">3HB", self._number, 2, len(data) + 1, register)
        try:
            self._line.sendall(head + data)
            while True:
                head = self._line.recv(6, 0x100)
                if len(head) < 6:
                    return NOT_CONNECTED, b""
                number, _, length = struct.unpack(">3H", head)
                body = self._line.recv(length, 0x100)
                if number == self._number:  # others came too late for their question
                    break
        except TimeoutError:
            return NO_ANSWER, b""
        except OSError:
            return NOT_CONNECTED, b""
        self._ready = not body[1] & protocol.NOT_READY
        return INVALID if body[1] & protocol.INVALID else 0, body[2:]

    def _bits(self, name: str) -> list[int]:
        self._take()
        if self._report is None:
            return [-1] * 8
        return [int(self._report[name]) >> k & 1 for k in range(8)]

    def _take(self) -> None:
        """Take the newest slow report in, which the library does in a thread."""
        with contextlib.suppress(BlockingIOError):
            self._bytes += self._slow.recv(1 << 20)
        while len(self._bytes) >= RICH.itemsize:
            self._report = np.frombuffer(bytes(self._bytes[: RICH.itemsize]), RICH)[0]
            del self._bytes[: RICH.itemsize]


def xarm_library(network: Network) -> dict[str, ModuleType]:
    """The library's modules by their names, to be put into `sys.modules`."""
    sockets = SimpleNamespace(TCP_CONTROL_PORT=502)
    parts = {
        "xarm": {},
        "xarm.core": {},
        "xarm.core.config": {},
        "xarm.core.config.x_code": {
            "ControllerErrorCodeMap": {
                code: {"en": {"title": title}} for code, title in TITLES.items()
            }
        },
        "xarm.core.config.x_config": {"XCONF": SimpleNamespace(SocketConf=sockets)},
        "xarm.wrapper": {
            "XArmAPI": type("XArmAPI", (XArmAPI,), {"network": network, "sockets": sockets})
        },
    }
    modules = {}
    for name, values in parts.items():
        modules[name] = ModuleType(name)
        vars(modules[name]).update(values)
    return modules
