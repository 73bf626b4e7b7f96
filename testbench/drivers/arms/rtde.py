"""The reports of a Universal Robots controller over RTDE, protocol version 2, read by ourselves.

Every package is read, with the time at which it arrived; a connection that is lost stays lost.
Format: Universal Robots, Real-Time Data Exchange (RTDE) guide. A package is its size (2 bytes) and
its type (1 byte), all big endian, and a payload.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from typing import Any

from testbench.clock import Clock, seconds
from testbench.drivers.arms.receiver import Receiver

RTDE_PORT = 30004
VERSION, TEXT, DATA = ord("V"), ord("M"), ord("U")
SETUP_OUTPUTS, START = ord("O"), ord("S")
HEADER = struct.Struct(">HB")
FORMATS = {
    "VECTOR6D": "6d",
    "VECTOR3D": "3d",
    "DOUBLE": "d",
    "VECTOR6INT32": "6i",
    "INT32": "i",
    "UINT32": "I",
}
"""struct codes of RTDE's types, of those that are asked for."""
LARGEST_PACKAGE = 4096
ROUND_TRIPS = 5
"""Questions whose answers are timed before the reports begin."""


class RtdeError(OSError):
    """The controller does not speak RTDE as it must."""


class RtdeStream:
    """Reports of chosen variables, from the connection on until it ends.

    Args:
        host: Address of the controller.
        frequency: Of the reports [Hz].
        variables: Their names.
        time: The host's clock.
        threaded: Read in a thread of its own, see `Receiver`.
        patience_s: For the connection, and for each answer [s].

    Raises:
        OSError: Nobody answers, or not as RTDE must.

    Attributes:
        round_trip_ns: The fastest answer to a question took so long [ns]: no package that came as
            fast was under way for longer.
        ended: Why nothing more comes; empty while something may.
        garbled: Whether that is because what came is no RTDE.
    """

    def __init__(
        self,
        host: str,
        frequency: float,
        variables: Sequence[str],
        time: Clock,
        threaded: bool = False,
        patience_s: float = 2.0,
    ):
        self._time, self._names = time, tuple(variables)
        self._bytes, self.garbled = bytearray(), False
        self.round_trip_ns = 0
        connection = socket.create_connection((host, RTDE_PORT), patience_s)
        try:
            connection.settimeout(patience_s)
            trips = [
                self._ask(connection, VERSION, struct.pack(">H", 2)) for _ in range(ROUND_TRIPS)
            ]
            if trips[0][0] != b"\x01":
                raise RtdeError("the controller does not speak version 2 of RTDE")
            self.round_trip_ns = min(trip for _, trip in trips)
            recipe = struct.pack(">d", frequency) + ",".join(self._names).encode()
            answer = self._ask(connection, SETUP_OUTPUTS, recipe)[0]
            self._unpacker, self._slices = self._layout(answer[1:].decode("ascii", "replace"))
            if self._ask(connection, START, b"")[0] != b"\x01":
                raise RtdeError("the controller does not start to report")
        except BaseException:
            connection.close()
            raise
        self._receiver = Receiver(connection, time, threaded)

    @property
    def ended(self) -> str:
        """Why nothing more comes; empty while something may."""
        return "what came is no RTDE" if self.garbled else self._receiver.ended

    def take(self) -> list[tuple[int, dict[str, Any]]]:
        """Reports since the last call: when each arrived [ns], and its values by their names."""
        reports = []
        for arrived_ns, piece in self._receiver.take():
            self._bytes += piece
            while not self.garbled and (payload := self._next()) is not None:
                if payload:
                    reports.append((arrived_ns, self._values(payload)))
        return reports

    def close(self) -> None:
        """Let go of the connection."""
        self._receiver.close()

    def _next(self) -> bytes | None:
        """Payload of the next package, empty where it is no report; None until it is whole."""
        if len(self._bytes) < HEADER.size:
            return None
        size, kind = HEADER.unpack_from(self._bytes)
        report = kind == DATA
        if not HEADER.size <= size <= LARGEST_PACKAGE or (
            report and size != HEADER.size + self._unpacker.size
        ):
            self.garbled = True
            return None
        if len(self._bytes) < size:
            return None
        payload = bytes(self._bytes[HEADER.size : size]) if report else b""
        del self._bytes[:size]
        return payload

    def _values(self, payload: bytes) -> dict[str, Any]:
        numbers = self._unpacker.unpack(payload)
        return {
            name: numbers[own] if isinstance(own, int) else list(numbers[own])
            for name, own in zip(self._names, self._slices, strict=True)
        }

    def _layout(self, types: str) -> tuple[struct.Struct, list[int | slice]]:
        """How the values of a report lie in its payload, behind the recipe's number."""
        kinds = types.split(",")
        if len(kinds) != len(self._names) or any(kind not in FORMATS for kind in kinds):
            raise RtdeError(f"the controller does not report what it is asked for ({types})")
        places: list[int | slice] = []
        at = 1
        for kind in kinds:
            width = int(FORMATS[kind][:-1] or 1)
            places.append(at if width == 1 else slice(at, at + width))
            at += width
        return struct.Struct(">B" + "".join(FORMATS[kind] for kind in kinds)), places

    def _ask(self, connection: socket.socket, kind: int, payload: bytes) -> tuple[bytes, int]:
        """The answer's payload, and how long it took [ns]."""
        begin_ns, end = self._time.monotonic_ns(), seconds(self._time) + 5.0
        connection.sendall(HEADER.pack(HEADER.size + len(payload), kind) + payload)
        while seconds(self._time) < end:
            size, found = HEADER.unpack(_exactly(connection, HEADER.size))
            if not HEADER.size <= size <= LARGEST_PACKAGE:
                break
            answer = _exactly(connection, size - HEADER.size)
            if found == kind:
                return answer, self._time.monotonic_ns() - begin_ns
            if found not in {TEXT, DATA}:
                break
        raise RtdeError("the controller does not answer as RTDE must")


def _exactly(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        piece = connection.recv(count - len(data))
        if not piece:
            raise RtdeError("the controller closed the connection")
        data += piece
    return data
