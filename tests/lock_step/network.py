"""Connections to emulated controllers that carry bytes on the lock-step clock: what is sent is
heard at once, and whoever waits for an answer sleeps on that clock.
"""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Self

import numpy as np

from testbench.emulation.disturbances import (
    AT_ONCE,
    DOWN,
    UP,
    Disturbance,
    Disturbances,
    Passage,
)
from testbench.emulation.server import CONTROL_PORT, Server
from tests.lock_step.clock import LockStep

LOOK_S = 0.001
"""One who waits for bytes looks so often [s]."""
_connect = socket.create_connection


class Line:
    """Our end of a connection: what callers use of a socket.

    Args:
        clock: Of everybody.
        sock: The end itself.
        hear: Lets the controller hear what was sent.
        ways: What happens to the bytes on their way to the controller, and back.
    """

    def __init__(
        self,
        clock: LockStep,
        sock: socket.socket,
        hear: Callable[[], None],
        ways: tuple[Passage, Passage],
    ):
        self._clock, self._socket, self._hear = clock, sock, hear
        self._timeout: float | None = None
        self._data = bytearray()
        self._up, self._down = ways
        self.port = self._up.port
        self.ended = self._deaf = self._broken = False
        sock.setblocking(False)

    def take(self) -> None:
        """Take in what has come, so that the other end never finds the line full."""
        if self._socket.fileno() < 0:
            return
        over = False
        try:
            while data := self._socket.recv(65536):
                self._down.put(data, self._clock.now_ns)
            over = True
        except BlockingIOError:
            pass
        except OSError:
            over = True
        if not self.ended and not self._deaf:
            self._data += self._down.take(self._clock.now_ns)
        self.ended = self.ended or over
        self._send_due()

    def sendall(self, data: bytes) -> None:
        if self._socket.fileno() < 0 or self.ended:
            raise BrokenPipeError("the connection is closed")
        self._up.put(data, self._clock.now_ns)
        self._send_due()

    def _send_due(self) -> None:
        due = self._up.take(self._clock.now_ns)
        if due:
            with suppress(OSError):
                self._socket.sendall(due)
            self._hear()

    def suffer(self, disturbance: Disturbance) -> None:
        """Be reset, or half closed."""
        if disturbance.fault in {"reset", "refuse"}:
            self._broken = True
            self.close()
        elif disturbance.concerns(self.port, DOWN):
            self.ended = self._deaf = True
        else:
            self._socket.shutdown(socket.SHUT_WR)

    def recv(self, count: int, flags: int = 0) -> bytes:
        whole = count if flags & socket.MSG_WAITALL else 1
        end_ns = None if self._timeout is None else self._clock.now_ns + round(1e9 * self._timeout)
        while True:
            self.take()
            if self._broken:
                raise ConnectionResetError(104, "Connection reset by peer")
            if len(self._data) >= whole or self.ended:
                data = bytes(self._data[:count])
                del self._data[:count]
                return data
            if self._timeout == 0:
                raise BlockingIOError
            if end_ns is not None and self._clock.now_ns >= end_ns:
                raise TimeoutError("timed out")
            self._clock.sleep(LOOK_S)

    def readline(self) -> str:
        line = b""
        while not line.endswith(b"\n") and (byte := self.recv(1)):
            line += byte
        return line.decode()

    def settimeout(self, timeout: float | None) -> None:
        self._timeout = timeout

    def setblocking(self, flag: bool) -> None:
        self._timeout = None if flag else 0.0

    def close(self) -> None:
        self._socket.close()
        self.ended = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Network:
    """Emulated controllers by their addresses; anything else is the machine's own network.

    Args:
        clock: On which the controllers run from now on.
    """

    def __init__(self, clock: LockStep):
        self.clock, self.disturbances = clock, Disturbances()
        self.servers: dict[str, Server] = {}
        self._lines: list[Line] = []
        clock.due_ns, clock.do = self._due_ns, self._step

    def add(self, server: Server) -> None:
        """Let a controller run."""
        self.servers[server.address] = server
        server.begin()

    def connect(
        self, place: tuple[str, int], timeout: float | None = None, *others: Any, **more: Any
    ) -> Any:
        """`socket.create_connection`."""
        server = self.servers.get(place[0])
        if server is None:
            return _connect(place, timeout, *others, **more)
        task = self.clock.task
        lasting = self.disturbances.of(place[1], UP)
        refused = "refuse" in lasting and place[1] != CONTROL_PORT
        if refused or place[1] not in server.kinds or (task is not None and task.dying):
            raise ConnectionRefusedError(111, "Connection refused")
        ours, theirs = socket.socketpair()
        rng = np.random.default_rng(len(self._lines))
        up, down = (Passage(self.disturbances, place[1], way, rng) for way in (UP, DOWN))
        line = Line(self.clock, ours, server.serve, (up, down))
        line.settimeout(timeout)
        self._lines.append(line)
        if task is not None:
            task.at_death.append(line.close)
        server.take_in(theirs, server.kinds[place[1]], place[0])
        return line

    def strike(self, disturbance: Disturbance) -> None:
        """Let the network become bad, at every port but that for faults."""
        if disturbance.fault not in AT_ONCE:
            self.disturbances.lasting.append(disturbance)
        if disturbance.fault in {*AT_ONCE, "refuse"}:
            for line in self._lines:
                hit = any(disturbance.concerns(line.port, way) for way in (UP, DOWN))
                if hit and line.port != CONTROL_PORT and not line.ended:
                    line.suffer(disturbance)

    def close(self) -> None:
        for server in self.servers.values():
            server.close()
        for line in self._lines:
            line.close()

    def _due_ns(self) -> int | None:
        return min((server.due_ns for server in self.servers.values()), default=None)

    def _step(self) -> None:
        for server in self.servers.values():
            if server.due_ns <= self.clock.now_ns:
                server.serve()
                server.step()
        self._lines = [line for line in self._lines if not line.ended]
        for line in self._lines:
            line.take()
