"""The ports of the emulated xArm controller: commands and two kinds of reports."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar

from testbench.clock import Clock
from testbench.emulation.faults import FaultKind
from testbench.emulation.server import CONTROL, CONTROL_PORT, Connection, Server
from testbench.emulation.xarm.controller import REPORT_HZ, Controller
from testbench.emulation.xarm.faults import FAULTS
from testbench.emulation.xarm.protocol import PROTOCOLS, FrameError, answer_frame, take_frame
from testbench.exceptions import InputError

COMMANDS, TIMELY, RICH = "commands", "timely reports", "rich reports"
COMMAND_PORT = 502
REPORT_PORTS = {30000: TIMELY, 30002: RICH}
RICH_HZ = 5.0
"""Rate of port 30002 (developer manual)."""


class XArmConnection(Connection):
    """One client."""

    def __init__(self, sock: socket.socket, kind: str, server: Server, controller: Controller):
        super().__init__(sock, kind, server)
        self.controller = controller

    def _taken(self) -> None:
        if self.kind == CONTROL:
            super()._taken()
        elif self.kind == COMMANDS:
            try:
                while (frame := take_frame(self.text)) is not None:
                    self._execute(*frame)
            except FrameError as error:
                self.controller.messages.append(f"no command: {error}")
                self.server.drop(self)
        else:
            self.text.clear()  # nobody listens behind the ports of reports

    def _execute(self, transaction: int, protocol: int, register: int, data: bytes) -> None:
        if protocol not in PROTOCOLS:  # a sign of life
            return
        bits, result = self.controller.execute(register, data)
        reply = answer_frame(transaction, protocol, register, bits, result)
        self.server.later(self.controller.faults.response_delay_s, lambda: self.send(reply))


class XArmServer(Server):
    """Serves one emulated controller.

    Args:
        controller: What is served.
        address: To listen on.
        token: What a client must say first on an address that is not loopback, see `Server`.
        command_port: The controller's is 502, which needs privileges.
        clock: What the control periods go by; the machine's if None.
        port_shift: Added to the number of every port but `command_port`.
    """

    faults: ClassVar[Mapping[str, FaultKind]] = FAULTS

    def __init__(
        self,
        controller: Controller,
        address: str = "127.0.0.1",
        token: str | None = None,
        command_port: int = COMMAND_PORT,
        clock: Clock | None = None,
        port_shift: int = 0,
    ):
        faults, timely, rich = (port + port_shift for port in (CONTROL_PORT, *REPORT_PORTS))
        if command_port in {faults, timely, rich}:
            raise InputError(
                f"port {command_port} is taken: {faults} is for faults, {timely} and {rich} are "
                "for reports"
            )
        self._xarm = controller
        self.open_ports = f"commands {command_port}, reports {timely} and {rich}, faults {faults}"
        ports = {command_port - port_shift: COMMANDS, **REPORT_PORTS}
        super().__init__(controller, ports, address, token, clock, port_shift)

    def connection(self, sock: socket.socket, kind: str) -> Connection:
        return XArmConnection(sock, kind, self, self._xarm)

    def reports(self, connections: Iterable[Connection]) -> Iterator[tuple[Connection, bytes]]:
        rich = (
            self._xarm.rich_report() if self._xarm.ticks % round(REPORT_HZ / RICH_HZ) == 0 else None
        )
        timely: bytes | None = None
        for connection in connections:
            if connection.kind == TIMELY:
                timely = timely or self._xarm.timely_report()
                yield connection, timely
            elif connection.kind == RICH and rich is not None:
                yield connection, rich
