"""A board on a serial port, and the driver's thread that reads it, on the lock-step clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from testbench.drivers.imus import serial_line
from testbench.drivers.imus.line_format import load_line_format
from testbench.drivers.imus.serial_line import READ_TIMEOUT_S, SerialImu
from testbench.drivers.session_time import SessionTime
from tests.lock_step.clock import LockStep, Task


class VirtualBoard:
    """Writes lines steadily from the clock's start on; it can be muted, unplugged and plugged in.

    Args:
        clock: What it goes by, and the driver's threads that are started from now on.
        patch: Lets them.
        rate: Of its lines [Hz].
        line: The line of a number; `t ax ay az gx gy gz` of a board at rest if None.
    """

    def __init__(
        self,
        clock: LockStep,
        patch: pytest.MonkeyPatch,
        rate: float = 100.0,
        line: Callable[[int], bytes] | None = None,
    ):
        self.clock, self.muted, self.plugged = clock, False, True
        self.period_ns, self.line = round(1e9 / rate), line or _line
        own = SimpleNamespace(Thread=_thread_on(clock), Event=lambda: _Event(clock))
        patch.setattr(serial_line, "threading", own)

    def sensor(self, time: SessionTime) -> SerialImu:
        """The driver of the board."""
        return SerialImu("board", load_line_format("mpu6050_plain"), time, self.open)

    def open(self, name: str, baud_rate: int) -> Port:
        """Open its port.

        Raises:
            OSError: It is unplugged.
        """
        if not self.plugged:
            raise FileNotFoundError(2, "No such file or directory")
        return Port(self)


class Port:
    """What the driver uses of `serial.Serial`."""

    in_waiting = 0

    def __init__(self, board: VirtualBoard):
        self._board, self._next = board, board.clock.now_ns // board.period_ns + 1

    def read(self, size: int = 1) -> bytes:
        """The lines of one reading; none when the timeout ends.

        Raises:
            OSError: The board was unplugged.
        """
        clock = self._board.clock
        end_ns = clock.now_ns + round(1e9 * READ_TIMEOUT_S)
        while clock.now_ns < end_ns:
            if not self._board.plugged:
                raise OSError(5, "Input/output error")
            due_ns = self._next * self._board.period_ns
            if due_ns <= clock.now_ns:
                self._next += 1
                if not self._board.muted:
                    return self._board.line(self._next - 1)
            else:
                clock.sleep(1e-9 * min(due_ns - clock.now_ns, end_ns - clock.now_ns))
        return b""

    def write(self, data: bytes) -> int:
        return len(data)

    def close(self) -> None:
        pass


def _line(k: int) -> bytes:
    force, rate = 1 + 0.001 * math.sin(k), 0.01 * math.sin(3 * k)
    return f"{10 * k} 0.0 0.0 {force:.4f} {rate:.4f} 0.0 0.0\n".encode()


class _Event:
    """`threading.Event`."""

    def __init__(self, clock: LockStep):
        self._clock, self._set = clock, False

    def set(self) -> None:
        self._set = True

    def is_set(self) -> bool:
        return self._set

    def wait(self, timeout: float) -> bool:
        end_ns = self._clock.now_ns + round(1e9 * timeout)
        while not self._set and self._clock.now_ns < end_ns:
            self._clock.sleep(0.01)
        return self._set


def _thread_on(clock: LockStep) -> Callable[..., Any]:
    """`threading.Thread` for threads that take turns on a clock."""

    class Thread:
        def __init__(self, target: Callable[..., object], args: tuple[Any, ...], **names: Any):
            self._work, self._task = lambda: target(*args), None

        def start(self) -> None:
            self._task: Task | None = clock.start(self._work)

        def join(self, timeout: float) -> None:
            assert self._task is not None
            self._task.wait(timeout)

    return Thread
