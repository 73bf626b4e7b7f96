"""The ports of the emulated Universal Robots controller: dashboard, scripts and RTDE."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar

from testbench.clock import Clock
from testbench.emulation.faults import FaultKind
from testbench.emulation.server import CONTROL, CONTROL_PORT, Connection, Server
from testbench.emulation.ur.controller import Controller
from testbench.emulation.ur.dashboard import GREETING, answer
from testbench.emulation.ur.faults import FAULTS
from testbench.emulation.ur.rtde import ProtocolError, RtdeConnection

DASHBOARD, RTDE, SCRIPT = "dashboard", "rtde", "script"
PORTS = {29999: DASHBOARD, 30001: SCRIPT, 30002: SCRIPT, 30003: SCRIPT, 30004: RTDE}
"""The controller's ports, which clients do not let one choose."""


class UrConnection(Connection):
    """One client."""

    def __init__(self, sock: socket.socket, kind: str, server: Server, controller: Controller):
        super().__init__(sock, kind, server)
        self.controller = controller
        self.rtde = RtdeConnection(controller, self.send) if kind == RTDE else None
        if kind == DASHBOARD:
            self.send(f"{GREETING}\n".encode())

    def received(self, data: bytes) -> None:
        """Take bytes from the client."""
        if self.rtde is None:
            super().received(data)
            return
        try:
            self.rtde.received(data)
        except (ProtocolError, UnicodeError) as error:
            self.controller.messages.append(f"RTDE: {error}")
            self.server.drop(self)

    def _taken(self) -> None:
        if self.kind == SCRIPT:
            self._programs()
        else:
            self._lines(self._control_line if self.kind == CONTROL else self._dashboard_line)

    def _programs(self) -> None:
        """Whole programs: from `def` to the `end` at the margin; anything else is a line of its
        own.
        """
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
                self.controller.upload(program)

    def _dashboard_line(self, line: str) -> None:
        reply = "Disconnected" if line == "quit" else answer(self.controller, line)
        self.server.later(
            self.controller.faults.response_delay_s, lambda: self.send(f"{reply}\n".encode())
        )


class UrServer(Server):
    """Serves one emulated controller.

    Args:
        controller: What is served.
        address: To listen on.
        token: What a client must say first on an address that is not loopback, see `Server`.
        clock: What the control periods go by; the machine's if None.
        port_shift: Added to the number of every port.
    """

    faults: ClassVar[Mapping[str, FaultKind]] = FAULTS

    def __init__(
        self,
        controller: Controller,
        address: str = "127.0.0.1",
        token: str | None = None,
        clock: Clock | None = None,
        port_shift: int = 0,
    ):
        self._ur = controller
        dashboard, first, last, rtde, faults = (
            port + port_shift for port in (29999, 30001, 30003, 30004, CONTROL_PORT)
        )
        self.open_ports = (
            f"dashboard {dashboard}, scripts {first} to {last}, RTDE {rtde}, faults {faults}"
        )
        super().__init__(controller, PORTS, address, token, clock, port_shift)

    def connection(self, sock: socket.socket, kind: str) -> Connection:
        return UrConnection(sock, kind, self, self._ur)

    def reports(self, connections: Iterable[Connection]) -> Iterator[tuple[Connection, bytes]]:
        for connection in connections:
            if isinstance(connection, UrConnection) and connection.rtde is not None:
                data = connection.rtde.tick()
                if data is not None:
                    yield connection, data
