"""Sockets and clock of emulated controllers: one thread, one loop, a tick each control period."""

from __future__ import annotations

import heapq
import hmac
import ipaddress
import select
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from itertools import count
from typing import ClassVar

from testbench.clock import Clock, SystemClock
from testbench.emulation.controller import EmulatedController
from testbench.emulation.faults import FaultKind, parse_command
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS

CONTROL, CONTROL_PORT = "control", 29998
"""The emulators' own port, for faults."""
LAST_PORT = 65535
LARGEST_TEXT = 1_000_000
MOST_CONNECTIONS = 64
REPORTED_TICKS = 250
"""Of the periods that are made up after a stall, the newest so many are reported; packages of older
ones are lost.
"""
LONGEST_DELAY_S = 1e6
"""Of an answer."""
MOVED_TICKS = 5000
"""In a longer stall the joints stand still at first: nobody watches a rehearsal that was held up
for so many periods.
"""


class Connection:
    """One client; what arrives on the maker's own ports is for subclasses."""

    def __init__(self, sock: socket.socket, kind: str, server: Server):
        self.socket, self.kind, self.server = sock, kind, server
        self.text = bytearray()
        self.trusted = server.loopback
        sock.setblocking(False)

    def send(self, data: bytes) -> None:
        """Send what the client takes; one that does not read any more is let go."""
        try:
            if self.socket.send(data) != len(data):
                self.server.drop(self)
        except OSError:
            self.server.drop(self)

    def received(self, data: bytes) -> None:
        """Take bytes from the client."""
        self.text += data
        if len(self.text) > LARGEST_TEXT:
            self.server.drop(self)
        else:
            self._taken()

    def _taken(self) -> None:
        """Look at what has arrived."""
        self._lines(self._control_line)

    def _lines(self, take: Callable[[str], None]) -> None:
        while b"\n" in self.text:
            line, _, rest = bytes(self.text).partition(b"\n")
            self.text = bytearray(rest)
            take(line.decode("utf-8", "replace").strip())

    def _control_line(self, line: str) -> None:
        if not self.trusted:
            self.trusted = line.startswith("token ") and self.server.has_token(line[6:])
            if self.trusted:
                self.server.admit(self)
            self.send(b"ok\n" if self.trusted else b"refused: say token TOKEN first\n")
            return
        self.send(f"{self._control(line)}\n".encode())

    def _control(self, line: str) -> str:
        controller = self.server.controller
        try:
            verb, name, value = parse_command(line, self.server.faults)
        except InputError as error:
            return f"refused: {error}"
        if verb == "fault":
            controller.fault(name, value)
        elif verb == "clear":
            controller.clear()
        elif verb == "quit":
            self.server.stop_asked = True
        elif verb == "clock":
            return str(self.server.offset_ns)
        else:
            return controller.status()
        return "ok"


class Server(ABC):
    """Serves one emulated controller.

    Args:
        controller: What is served.
        ports: Number and kind of those beside that for faults.
        address: To listen on.
        token: What a client must say on port 29998 before any port answers it; needed for an
            address that is not loopback.
        clock: What the control periods go by; the machine's if None.
        port_shift: Added to the number of every port, that for faults too.

    Raises:
        InputError: The address is none, is not loopback and has no token, a port is taken, or would
            be none.

    Attributes:
        faults: Those that the controller knows.
        kinds: What its ports are for, by their numbers.
        open_ports: What answers where, for a person.
    """

    faults: ClassVar[Mapping[str, FaultKind]]
    open_ports: str

    def __init__(
        self,
        controller: EmulatedController,
        ports: Mapping[int, str],
        address: str = "127.0.0.1",
        token: str | None = None,
        clock: Clock | None = None,
        port_shift: int = 0,
    ):
        self.clock = clock or SystemClock()
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError:
            raise InputError(f"'{address}' is no IP address") from None
        self.loopback = parsed.is_loopback
        if not self.loopback and not token:
            raise InputError(
                f"{address} can be reached from outside this machine: give a token, or listen on "
                "127.0.0.1"
            )
        self.controller, self.address, self._token = controller, address, token
        self._admitted: set[str] = set()
        self._listeners: dict[socket.socket, str] = {}
        self._connections: dict[socket.socket, Connection] = {}
        self._later: list[tuple[int, int, Callable[[], None]]] = []
        self._number = count()
        self.stop_asked = False
        self.kinds = {
            port + port_shift: kind for port, kind in {CONTROL_PORT: CONTROL, **ports}.items()
        }
        if not all(0 < port <= LAST_PORT for port in self.kinds):
            raise InputError(f"ports shifted by {port_shift} would not be from 1 to {LAST_PORT}")
        self._said = 0
        self._period_ns = round(controller.joints.period * NANOSECONDS)
        self.begin()
        family = socket.AF_INET6 if parsed.version == 6 else socket.AF_INET
        try:
            for port, kind in self.kinds.items():
                listener = socket.socket(family, socket.SOCK_STREAM)
                self._listeners[listener] = kind
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                listener.bind((address, port))
                listener.listen()
                listener.setblocking(False)
        except OSError as error:
            self.close()
            raise InputError(
                f"port {port} of {address} cannot be opened: {error.strerror}"
            ) from None

    def has_token(self, said: str) -> bool:
        """Whether a client said the token."""
        return self._token is not None and hmac.compare_digest(
            said.strip().encode(), self._token.encode()
        )

    def admit(self, connection: Connection) -> None:
        """Let the address of a client that said the token use the other ports."""
        with suppress(OSError):
            self._admitted.add(connection.socket.getpeername()[0])

    def later(self, delay_s: float, action: Callable[[], None]) -> None:
        """Do something after a delay."""
        if delay_s <= 0:
            action()
        else:
            at_ns = self.clock.monotonic_ns() + round(min(delay_s, LONGEST_DELAY_S) * NANOSECONDS)
            heapq.heappush(self._later, (at_ns, next(self._number), action))

    def drop(self, connection: Connection) -> None:
        """Close a connection."""
        if self._connections.pop(connection.socket, None) is not None:
            connection.socket.close()

    def close(self) -> None:
        """Close every socket."""
        for sock in [*self._listeners, *self._connections]:
            sock.close()
        self._listeners, self._connections = {}, {}

    @property
    def due_ns(self) -> int:
        """When the next control period begins, on the clock [ns]."""
        return self._due_ns

    @property
    def offset_ns(self) -> int:
        """Host's monotonic time less that of the controller's stamps [ns], as it truly is."""
        next_stamp = self.controller.stamp + self._period_ns / NANOSECONDS
        return self._due_ns - round(next_stamp * NANOSECONDS)

    def begin(self) -> None:
        """The first control period begins one period from now."""
        self._due_ns = self.clock.monotonic_ns() + self._period_ns

    def run(self, say: Callable[[str], None] = lambda text: None) -> None:
        """Serve until asked to stop, on a clock that goes on by itself.

        Args:
            say: Told of what happens.
        """
        self.begin()
        while not self.stop_asked:
            early_ns = self._due_ns - self.clock.monotonic_ns()
            if early_ns > 0:
                self.serve(early_ns / NANOSECONDS)
                continue
            if self.step() > 1:
                self.serve()
            for message in self.controller.messages[self._said :]:
                say(f"{self.controller.time:9.3f} s: {message}")
            self._said = len(self.controller.messages)
        self.close()

    def step(self) -> int:
        """Let the control periods pass that are due by now, and say how many there were.

        What was put off until now is done as well.
        """
        passed = self._catch_up()
        while self._later and self._later[0][0] <= self.clock.monotonic_ns():
            heapq.heappop(self._later)[2]()
        return passed

    def _catch_up(self) -> int:
        late_ns = self.clock.monotonic_ns() - self._due_ns
        passed = late_ns // self._period_ns + 1 if late_ns >= 0 else 0
        self._advance(passed)
        self._due_ns += passed * self._period_ns
        return passed

    def _advance(self, passed: int) -> None:
        """Let control periods pass.

        After a stall they are made up before any client is heard: a controller's clock does not
        stop, and what a client asks for now must not happen in a period that is over.
        """
        controller = self.controller
        controller.ticks += max(passed - MOVED_TICKS, 0)
        left = min(passed, MOVED_TICKS)
        while left:
            controller.tick()
            if left <= REPORTED_TICKS:
                self._broadcast()
            left -= 1

    @abstractmethod
    def connection(self, sock: socket.socket, kind: str) -> Connection:
        """A client that came in at a port of a kind."""

    @abstractmethod
    def reports(self, connections: Iterable[Connection]) -> Iterator[tuple[Connection, bytes]]:
        """What is due to each client after a tick."""

    def _broadcast(self) -> None:
        faults = self.controller.faults
        if self.controller.cut_off:
            for connection in list(self._connections.values()):
                if connection.kind != CONTROL:
                    self.drop(connection)
            return
        for connection, data in self.reports(list(self._connections.values())):
            if faults.report_silent or (faults.report_loss and self.controller.lost_package()):
                continue
            self.later(faults.report_delay_s, partial(connection.send, data))

    def serve(self, wait_s: float = 0.0) -> None:
        """Hear the clients; where none says anything, wait for one [s]."""
        self.controller.heard_until = self.controller.time
        sockets = [*self._listeners, *self._connections]
        readable, _, _ = select.select(sockets, [], [], wait_s)
        for sock in readable:
            self._catch_up()
            if sock in self._listeners:
                self._accept(sock)
            elif sock in self._connections:
                self._receive(self._connections[sock])

    def _accept(self, listener: socket.socket) -> None:
        try:
            sock, peer = listener.accept()
        except OSError:
            return
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.take_in(sock, self._listeners[listener], peer[0])

    def take_in(self, sock: socket.socket, kind: str, host: str) -> None:
        """A client has connected.

        Args:
            sock: To the client.
            kind: Of the port that it came in at.
            host: Its address.
        """
        allowed = self.loopback or kind == CONTROL or host in self._admitted
        if (
            not allowed
            or (self.controller.cut_off and kind != CONTROL)
            or len(self._connections) >= MOST_CONNECTIONS
        ):
            sock.close()
            return
        self._connections[sock] = self.connection(sock, kind)

    def _receive(self, connection: Connection) -> None:
        try:
            data = connection.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        # This process may have been held up since it looked at the clock: what was sent meanwhile
        # must not act in a period that was over when it was sent.
        self._catch_up()
        if connection.socket not in self._connections:
            return
        if data:
            connection.received(data)
        else:
            self.drop(connection)
