"""A stretch of bad network before a controller: connections go through it, and suffer on demand.

Clients connect to the proxy's address at the controller's own ports. It is for rehearsals and
tests, before an emulated controller; nothing in it knows what the bytes mean.
"""

from __future__ import annotations

import ipaddress
import select
import socket
import struct
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from queue import SimpleQueue
from typing import Any, Self

import numpy as np

from testbench.clock import Clock, SystemClock
from testbench.emulation.disturbances import (
    AT_ONCE,
    DOWN,
    UP,
    USAGE,
    Disturbance,
    Disturbances,
    Passage,
)
from testbench.emulation.server import CONTROL_PORT
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS

MOST_WAITING = 1_000_000
"""Bytes of one direction that wait; more are not read from the sender, as with a full network."""
CONNECT_S = 2.0
"""The controller must take a connection within this time [s]."""
LONGEST_WAIT_S = 0.5
ANSWER_S = 5.0
"""A disturbance is under way within this time of being asked for [s]."""


class _Side:
    """One direction of a connection: from a socket, through a passage, into another."""

    def __init__(self, source: socket.socket, sink: socket.socket, passage: Passage):
        self.source, self.sink, self.passage = source, sink, passage
        self.rest = b""
        self.ended = self.closed = False

    @property
    def readable(self) -> bool:
        """Whether more is wanted from the sender."""
        return not self.ended and self.passage.waiting < MOST_WAITING


class _Connection:
    """A client's connection, and that to the controller for it."""

    def __init__(self, port: int, client: socket.socket, controller: socket.socket, sides: Any):
        self.port, self.client, self.controller, self.sides = port, client, controller, sides

    def close(self, reset: bool = False) -> None:
        for own in (self.client, self.controller):
            with suppress(OSError):
                if reset:  # RFC 9293, 3.6: an abort instead of a close
                    linger = struct.pack("ii", 1, 0)
                    own.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                own.close()


class Proxy:
    """Passes bytes between clients and a controller.

    Args:
        address: To listen on; loopback.
        target: Address of the controller.
        ports: Of the controller, which are those of the proxy too.
        seed: Of what is left to chance.
        clock: What delays go by; the machine's if None.

    Raises:
        InputError: An address is none or not loopback, or a port is taken.

    Attributes:
        messages: What happened, for whoever watches.
    """

    def __init__(
        self,
        address: str,
        target: str,
        ports: Iterable[int],
        seed: int = 0,
        clock: Clock | None = None,
    ):
        self.address, self.target, self.ports = address, target, tuple(ports)
        try:
            loopback = ipaddress.ip_address(address).is_loopback
        except ValueError:
            raise InputError(f"'{address}' is no IP address") from None
        if not loopback:
            raise InputError(f"the proxy listens on loopback addresses only, not on {address}")
        if address == target:
            raise InputError(f"the proxy needs an address of its own, not {address}")
        self.clock, self._rng = clock or SystemClock(), np.random.default_rng(seed)
        self.disturbances, self.messages = Disturbances(), list[str]()
        self.stop_asked = False
        self._connections: list[_Connection] = []
        self._talks: dict[socket.socket, bytearray] = {}
        self._asked: SimpleQueue[tuple[Callable[[], None], threading.Event]] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._waker, self._woken = socket.socketpair()
        self._woken.setblocking(False)
        self._listeners: dict[socket.socket, int] = {}
        try:
            for port in (*self.ports, CONTROL_PORT):
                self._listen(port)
        except OSError as error:
            self.close()
            raise InputError(
                f"port {port} of {address} cannot be opened: {error.strerror}"
            ) from None

    def _listen(self, port: int) -> None:
        listener = socket.socket()
        self._listeners[listener] = port
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((self.address, port))
        listener.listen()
        listener.setblocking(False)

    def strike(
        self,
        fault: str,
        value: float | None = None,
        port: int | None = None,
        direction: str | None = None,
    ) -> None:
        """Let a disturbance begin; it has begun when this returns.

        Args:
            fault: Its name.
            value: Its size; a usual one if None.
            port: Of the controller; all if None.
            direction: "up" (to the controller) or "down"; both if None.

        Raises:
            InputError: There is no such disturbance.
        """
        disturbance = Disturbance(fault, value, port, direction)
        self._do(lambda: self._strike(disturbance))

    def clear(self) -> None:
        """End every disturbance; what was held up comes."""
        self._do(self._clear)

    def start(self) -> Self:
        """Serve in a thread of its own, until closed."""
        self._thread = threading.Thread(target=self.run, name="proxy", daemon=True)
        self._thread.start()
        return self

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *error: object) -> None:
        self.stop_asked = True
        self._wake()
        if self._thread is not None:
            self._thread.join()
        self.close()

    def run(self, say: Callable[[str], None] = lambda text: None) -> None:
        """Serve until asked to stop.

        Args:
            say: Told of what happens.
        """
        said = 0
        while not self.stop_asked:
            self.serve(LONGEST_WAIT_S)
            for message in self.messages[said:]:
                say(message)
            said = len(self.messages)

    def close(self) -> None:
        """Close every socket."""
        for own in (*self._listeners, *self._talks, self._waker, self._woken):
            own.close()
        for connection in self._connections:
            connection.close()
        self._listeners, self._connections, self._talks = {}, [], {}

    def serve(self, wait_s: float = 0.0) -> None:
        """Pass on what is due, and wait for more [s]."""
        sides = [side for connection in self._connections for side in connection.sides]
        for side in sides:
            self._pass_on(side)
        now_ns = self.clock.monotonic_ns()
        dues = [due for side in sides if (due := side.passage.due_ns) is not None]
        if dues:
            wait_s = min(wait_s, max(min(dues) - now_ns, 0) / NANOSECONDS)
        sources = {side.source: side for side in sides if side.readable}
        full = [side.sink for side in sides if side.rest]
        watched = [self._woken, *self._listeners, *self._talks, *sources]
        readable, _, _ = select.select(watched, full, [], wait_s)
        for own in readable:
            if own is self._woken:
                self._heed()
            elif own in self._listeners:
                self._accept(own)
            elif own in self._talks:
                self._talk(own)
            elif own in sources and own.fileno() >= 0:
                self._receive(sources[own])
        self._connections = [
            own for own in self._connections if own.client.fileno() >= 0 and not _over(own)
        ]

    def _accept(self, listener: socket.socket) -> None:
        port = self._listeners[listener]
        with suppress(OSError):
            client, _ = listener.accept()
            if port == CONTROL_PORT:
                self._talks[client] = bytearray()
                return
            try:
                controller = socket.create_connection((self.target, port), CONNECT_S)
            except OSError as error:
                self.messages.append(f"port {port} of {self.target}: {error.strerror}")
                _Connection(port, client, client, ()).close(reset=True)
                return
            self._connections.append(self._between(port, client, controller))

    def _between(self, port: int, client: socket.socket, controller: socket.socket) -> _Connection:
        for own in (client, controller):
            own.setblocking(False)
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sides = (
            _Side(client, controller, Passage(self.disturbances, port, UP, self._rng)),
            _Side(controller, client, Passage(self.disturbances, port, DOWN, self._rng)),
        )
        return _Connection(port, client, controller, sides)

    def _receive(self, side: _Side) -> None:
        try:
            data = side.source.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            self._end(side, reset=True)
            return
        if data:
            now_ns = self.clock.monotonic_ns()
            side.passage.put(data, now_ns)
            self._pass_on(side)
        else:
            side.ended = True

    def _pass_on(self, side: _Side) -> None:
        """Send what is due; when all is sent of a side that has ended, the other hears of the
        end.
        """
        if side.closed or side.sink.fileno() < 0:
            return
        data = side.rest + side.passage.take(self.clock.monotonic_ns())
        try:
            sent = side.sink.send(data) if data else 0
        except BlockingIOError:
            sent = 0
        except OSError:
            self._end(side, reset=True)
            return
        side.rest = data[sent:]
        if side.ended and not side.rest and not side.passage.waiting:
            side.closed = True
            with suppress(OSError):
                side.sink.shutdown(socket.SHUT_WR)

    def _end(self, side: _Side, reset: bool) -> None:
        for connection in self._connections:
            if side in connection.sides:
                connection.close(reset)

    def _strike(self, disturbance: Disturbance) -> None:
        if disturbance.fault not in AT_ONCE:
            self.disturbances.lasting.append(disturbance)
        if disturbance.fault == "refuse":
            for listener, port in list(self._listeners.items()):
                if port in self.ports and disturbance.port in {None, port}:
                    del self._listeners[listener]
                    listener.close()
        for connection in self._connections:
            _hit(connection, disturbance)
        self.messages.append(f"disturbance: {disturbance}")

    def _clear(self) -> None:
        self.disturbances.lasting.clear()
        for port in set(self.ports) - set(self._listeners.values()):
            self._listen(port)
        self.messages.append("cleared")

    def _do(self, action: Callable[[], None]) -> None:
        """Do something in the thread that serves, and wait for it."""
        if self._thread is None or threading.current_thread() is self._thread:
            action()
            return
        done = threading.Event()
        self._asked.put((action, done))
        self._wake()
        if not done.wait(ANSWER_S):
            raise TimeoutError("the proxy does not serve")

    def _wake(self) -> None:
        with suppress(OSError):
            self._waker.send(b".")

    def _heed(self) -> None:
        with suppress(BlockingIOError):
            self._woken.recv(4096)
        while not self._asked.empty():
            action, done = self._asked.get()
            action()
            done.set()

    def _talk(self, own: socket.socket) -> None:
        """A line at the port for faults."""
        try:
            data = own.recv(4096)
        except OSError:
            data = b""
        text = self._talks[own]
        text += data
        if not data or len(text) > MOST_WAITING:
            del self._talks[own]
            own.close()
            return
        while b"\n" in text:
            line, _, rest = bytes(text).partition(b"\n")
            text[:] = rest
            with suppress(OSError):
                own.sendall(f"{self._answer(line.decode('utf-8', 'replace'))}\n".encode())

    def _answer(self, line: str) -> str:
        verb, *words = line.split() or [""]
        if verb == "fault":
            try:
                self._strike(Disturbance.of(words))
            except InputError as error:
                return f"refused: {error}"
        elif verb == "clear":
            self._clear()
        elif verb == "quit":
            self.stop_asked = True
        elif verb == "status":
            lasting = ", ".join(own.fault for own in self.disturbances.lasting) or "nothing"
            return f"{len(self._connections)} connections, {lasting}"
        else:
            return f"refused: {USAGE}, clear, status or quit"
        return "ok"


def _over(connection: _Connection) -> bool:
    """Whether nothing goes either way any more; closes it then."""
    over = all(side.closed and side.ended for side in connection.sides)
    if over:
        connection.close()
    return over


def _hit(connection: _Connection, disturbance: Disturbance) -> None:
    """Let a connection suffer what happens once."""
    sides = [
        side
        for side in connection.sides
        if disturbance.concerns(connection.port, side.passage.direction)
    ]
    if sides and disturbance.fault in {"reset", "refuse"}:
        connection.close(reset=True)
    elif disturbance.fault == "half_close":
        for side in sides:
            side.ended = side.closed = True
            with suppress(OSError):
                side.sink.shutdown(socket.SHUT_WR)
