"""Sockets and the clock of the emulated controller: one thread, one loop, a tick each control period."""

from __future__ import annotations

import heapq
import hmac
import ipaddress
import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count

from testbench.emulation.ur.controller import Controller
from testbench.emulation.ur.dashboard import GREETING, answer
from testbench.emulation.ur.faults import parse_command
from testbench.emulation.ur.rtde import ProtocolError, RtdeConnection
from testbench.exceptions import InputError

CONTROL, DASHBOARD, RTDE, SCRIPT = "control", "dashboard", "rtde", "script"
PORTS = {29998: CONTROL, 29999: DASHBOARD, 30001: SCRIPT, 30002: SCRIPT, 30003: SCRIPT, 30004: RTDE}
"""The controller's ports, which clients do not let one choose; 29998 is the emulator's own, for faults."""
LARGEST_SCRIPT = 1_000_000
MOST_CONNECTIONS = 64
LATEST_TICKS = 250
"""After a stall the clock makes up at most this many periods; older ones are skipped, as a busy controller skips packages."""


class Connection:
    """One client."""

    def __init__(self, sock: socket.socket, kind: str, server: UrServer):
        self.socket, self.kind, self.server = sock, kind, server
        self.text = bytearray()
        self.trusted = server.loopback
        self.rtde = RtdeConnection(server.controller, self.send) if kind == RTDE else None
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if kind == DASHBOARD:
            self.send(f"{GREETING}\n".encode())

    def send(self, data: bytes) -> None:
        """Send what the client takes; one that does not read any more is let go."""
        try:
            if self.socket.send(data) != len(data):
                self.server.drop(self)
        except OSError:
            self.server.drop(self)

    def received(self, data: bytes) -> None:
        """Take bytes from the client."""
        if self.rtde is not None:
            try:
                self.rtde.received(data)
            except (ProtocolError, UnicodeError) as error:
                self.server.controller.messages.append(f"RTDE: {error}")
                self.server.drop(self)
            return
        self.text += data
        if len(self.text) > LARGEST_SCRIPT:
            self.server.drop(self)
            return
        if self.kind == SCRIPT:
            self._programs()
        else:
            while b"\n" in self.text:
                line, _, rest = bytes(self.text).partition(b"\n")
                self.text = bytearray(rest)
                self._line(line.decode("utf-8", "replace").strip())

    def _programs(self) -> None:
        """Whole programs: from `def` to the `end` at the margin; anything else is a line of its own."""
        while b"\n" in self.text:
            text = bytes(self.text).decode("utf-8", "replace")
            if text.lstrip().startswith(("def ", "sec ")):
                stop = text.find("\nend\n")
                if stop < 0:
                    return
                program, rest = text[: stop + 5], text[stop + 5 :]
            else:
                program, _, rest = text.partition("\n")
            self.text = bytearray(rest.encode())
            if program.strip():
                self.server.controller.upload(program)

    def _line(self, line: str) -> None:
        controller = self.server.controller
        if self.kind == DASHBOARD:
            reply = "Disconnected" if line == "quit" else answer(controller, line)
            self.server.later(controller.faults.response_delay_s, lambda: self.send(f"{reply}\n".encode()))
            return
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
            verb, name, value = parse_command(line)
        except InputError as error:
            return f"refused: {error}"
        if verb == "fault":
            controller.fault(name, value)
        elif verb == "clear":
            controller.clear()
        elif verb == "quit":
            self.server.stop_asked = True
        else:
            rest = f"{'at rest' if controller.joints.steady else 'moving'}, moved {controller.moving_ticks} periods"
            return f"{controller.mode.name} {controller.safety.name} {controller.runtime.name}, {rest}"
        return "ok"


class UrServer:
    """Serves one emulated controller.

    Args:
        controller: What is served. address: To listen on. token: What a client must say on port 29998 before any port answers
        it; needed for an address that is not loopback.

    Raises:
        InputError: The address is none, is not loopback and has no token, or a port is taken.
    """

    def __init__(self, controller: Controller, address: str = "127.0.0.1", token: str | None = None):
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError:
            raise InputError(f"'{address}' is no IP address") from None
        self.loopback = parsed.is_loopback
        if not self.loopback and not token:
            raise InputError(f"{address} can be reached from outside this machine: give a token, or listen on 127.0.0.1")
        self.controller, self.address, self._token = controller, address, token
        self._admitted: set[str] = set()
        self._listeners: dict[socket.socket, str] = {}
        self._connections: dict[socket.socket, Connection] = {}
        self._later: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self.stop_asked = False
        self._said = 0
        family = socket.AF_INET6 if parsed.version == 6 else socket.AF_INET
        try:
            for port, kind in PORTS.items():
                listener = socket.socket(family, socket.SOCK_STREAM)
                self._listeners[listener] = kind
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                listener.bind((address, port))
                listener.listen()
                listener.setblocking(False)
        except OSError as error:
            self.close()
            raise InputError(f"port {port} of {address} cannot be opened: {error.strerror}") from None

    def has_token(self, said: str) -> bool:
        """Whether a client said the token."""
        return self._token is not None and hmac.compare_digest(said.strip().encode(), self._token.encode())

    def admit(self, connection: Connection) -> None:
        """Let the address of a client that said the token use the other ports."""
        with suppress(OSError):
            self._admitted.add(connection.socket.getpeername()[0])

    def later(self, delay_s: float, action: Callable[[], None]) -> None:
        """Do something after a delay."""
        if delay_s <= 0:
            action()
        else:
            heapq.heappush(self._later, (time.monotonic() + delay_s, next(self._number), action))

    def drop(self, connection: Connection) -> None:
        """Close a connection."""
        if self._connections.pop(connection.socket, None) is not None:
            connection.socket.close()

    def close(self) -> None:
        """Close every socket."""
        for sock in [*self._listeners, *self._connections]:
            sock.close()
        self._listeners, self._connections = {}, {}

    def run(self, say: Callable[[str], None] = lambda text: None) -> None:
        """Serve until asked to stop.

        Args:
            say: Told of what happens.
        """
        period = self.controller.joints.period
        due = time.monotonic() + period
        while not self.stop_asked:
            now = time.monotonic()
            if now < due:
                self._serve(due - now)
                continue
            if now - due > LATEST_TICKS * period:
                due = now
            if now - due > period:
                self._serve(0.0)  # behind: do not make the clients wait as well
            self.controller.tick()
            self._broadcast()
            due += period
            while self._later and self._later[0][0] <= now:
                heapq.heappop(self._later)[2]()
            for message in self.controller.messages[self._said :]:
                say(f"{self.controller.time:9.3f} s: {message}")
            self._said = len(self.controller.messages)
        self.close()

    def _cut(self) -> bool:
        return self.controller.time < self.controller.faults.disconnected_until

    def _broadcast(self) -> None:
        faults = self.controller.faults
        if self._cut():
            for connection in list(self._connections.values()):
                if connection.kind != CONTROL:
                    self.drop(connection)
            return
        for connection in self._rtde():
            assert connection.rtde is not None
            data = connection.rtde.tick()
            if data is None or faults.rtde_silent or (faults.rtde_loss and self.controller.lost_package()):
                continue
            self.later(faults.rtde_delay_s, lambda connection=connection, data=data: connection.send(data))  # type: ignore[misc]

    def _rtde(self) -> Iterator[Connection]:
        yield from [connection for connection in self._connections.values() if connection.rtde is not None]

    def _serve(self, timeout: float) -> None:
        sockets = [*self._listeners, *self._connections]
        readable, _, _ = select.select(sockets, [], [], timeout)
        for sock in readable:
            if sock in self._listeners:
                self._accept(sock)
            elif sock in self._connections:
                self._receive(self._connections[sock])

    def _accept(self, listener: socket.socket) -> None:
        kind = self._listeners[listener]
        try:
            sock, peer = listener.accept()
        except OSError:
            return
        allowed = self.loopback or kind == CONTROL or peer[0] in self._admitted
        if not allowed or (self._cut() and kind != CONTROL) or len(self._connections) >= MOST_CONNECTIONS:
            sock.close()
            return
        self._connections[sock] = Connection(sock, kind, self)

    def _receive(self, connection: Connection) -> None:
        try:
            data = connection.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            connection.received(data)
        else:
            self.drop(connection)
