"""The robot's side of RTDE, protocol version 2: recipes, data packages, start and pause.

Format: Universal Robots, Real-Time Data Exchange (RTDE) guide. A package is its size (2 bytes) and
its type (1 byte), all big endian, and a payload.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from testbench.emulation.ur.state import INPUT_TYPES, OUTPUT_TYPES

if TYPE_CHECKING:
    from testbench.emulation.ur.controller import Controller

PROTOCOL_VERSION, GET_VERSION, TEXT, DATA = ord("V"), ord("v"), ord("M"), ord("U")
SETUP_OUTPUTS, SETUP_INPUTS, START, PAUSE = ord("O"), ord("I"), ord("S"), ord("P")
LARGEST_PACKAGE = 4096
FORMATS = {
    "VECTOR6D": "6d",
    "VECTOR3D": "3d",
    "DOUBLE": "d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "UINT8": "B",
    "BOOL": "?",
}
"""struct codes of RTDE's types."""


class ProtocolError(Exception):
    """A client sent what is no RTDE package."""


def package(kind: int, payload: bytes) -> bytes:
    """A package with its header."""
    return struct.pack(">HB", len(payload) + 3, kind) + payload


class RtdeConnection:
    """One client of the RTDE port.

    Args:
        controller: Whose variables it reads and writes.
        send: Takes bytes to the client.
    """

    def __init__(self, controller: Controller, send: Callable[[bytes], None]):
        self._controller, self._send = controller, send
        self._buffer = bytearray()
        self._outputs: list[str] = []
        self._packer = struct.Struct(">B")
        self._every, self.started = 1, False
        self._recipes: dict[int, tuple[list[str], struct.Struct]] = {}

    def received(self, data: bytes) -> None:
        """Take bytes from the client.

        Raises:
            ProtocolError: They are no RTDE.
        """
        self._buffer += data
        while len(self._buffer) >= 3:
            size, kind = struct.unpack_from(">HB", self._buffer)
            if not 3 <= size <= LARGEST_PACKAGE:
                raise ProtocolError(f"a package of {size} bytes")
            if len(self._buffer) < size:
                return
            payload = bytes(self._buffer[3:size])
            del self._buffer[:size]
            self._handle(kind, payload)

    def tick(self) -> bytes | None:
        """The data package of this control period, if one is due."""
        if not self.started or self._controller.ticks % self._every:
            return None
        outputs, registers = self._controller.outputs(), self._controller.registers
        values: list[Any] = [1]
        for name in self._outputs:
            if name in outputs:
                value = outputs[name]
            elif "_register_" in name:
                value = getattr(registers, name.rpartition("_register_")[0])[
                    int(name.rpartition("_")[2])
                ]
            else:
                value = _zero(OUTPUT_TYPES[name])
            try:
                values.extend(value)
            except TypeError:
                values.append(value)
        return package(DATA, self._packer.pack(*values))

    def _handle(self, kind: int, payload: bytes) -> None:
        if kind == PROTOCOL_VERSION:
            accepted = len(payload) == 2 and struct.unpack(">H", payload)[0] == 2
            self._send(package(kind, bytes([accepted])))
        elif kind == GET_VERSION:
            self._send(package(kind, struct.pack(">4I", *self._controller.identity.version)))
        elif kind == SETUP_OUTPUTS:
            self._setup_outputs(payload)
        elif kind == SETUP_INPUTS:
            self._setup_inputs(payload)
        elif kind in {START, PAUSE}:
            self.started = kind == START
            self._send(package(kind, b"\x01"))
        elif kind == DATA:
            self._write_inputs(payload)
        elif kind != TEXT:
            raise ProtocolError(f"a package of type {kind}")

    def _setup_outputs(self, payload: bytes) -> None:
        if len(payload) < 8:
            raise ProtocolError("an output recipe without a frequency")
        frequency = struct.unpack_from(">d", payload)[0]
        control = self._controller.robot.spec.rates.control_hz
        if not 1 <= frequency <= control:
            raise ProtocolError(f"an output frequency of {frequency:g} Hz")
        self._outputs = [name for name in payload[8:].decode("ascii", "replace").split(",") if name]
        types = [OUTPUT_TYPES.get(name, "NOT_FOUND") for name in self._outputs]
        found = "NOT_FOUND" not in types
        self._every = max(round(control / frequency), 1)
        self._packer = (
            struct.Struct(">B" + "".join(FORMATS[kind] for kind in types))
            if found
            else struct.Struct(">B")
        )
        self._send(package(SETUP_OUTPUTS, bytes([int(found)]) + ",".join(types).encode()))

    def _setup_inputs(self, payload: bytes) -> None:
        names = [name for name in payload.decode("ascii", "replace").split(",") if name]
        types = [INPUT_TYPES.get(name, "NOT_FOUND") for name in names]
        recipe = 0
        if "NOT_FOUND" not in types:
            recipe = len(self._recipes) + 1
            self._recipes[recipe] = (
                names,
                struct.Struct(">" + "".join(FORMATS[kind] for kind in types)),
            )
        self._send(package(SETUP_INPUTS, bytes([recipe]) + ",".join(types).encode()))

    def _write_inputs(self, payload: bytes) -> None:
        names, packer = self._recipes.get(payload[0] if payload else 0, ([], struct.Struct(">")))
        if len(payload) - 1 != packer.size:
            raise ProtocolError(
                f"input data of {len(payload) - 1} bytes for a recipe of {packer.size}"
            )
        values = packer.unpack_from(payload, 1)
        controller, at = self._controller, 0
        written: dict[str, Any] = {}
        for name in names:
            width = 6 if INPUT_TYPES[name] == "VECTOR6D" else 1
            written[name] = values[at] if width == 1 else values[at : at + width]
            at += width
        for name, value in written.items():
            if "_register_" in name:
                kind, _, number = name.rpartition("_register_")
                getattr(controller.registers, kind)[int(number)] = value
                if kind == "input_int" and controller.script is not None:
                    controller.script.input_written(int(number), controller.time)
        if written.get("speed_slider_mask"):
            controller.slider = min(max(float(written["speed_slider_fraction"]), 0.0), 1.0)


def _zero(kind: str) -> Any:
    count = int(FORMATS[kind][0]) if FORMATS[kind][0].isdigit() else 1
    return [0] * count if count > 1 else 0
