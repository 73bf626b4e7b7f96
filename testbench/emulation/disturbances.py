"""What a bad network does to the bytes of a connection: late, held up, altered, out of order."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from testbench.emulation.faults import FaultKind
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS

UP, DOWN = "up", "down"
"""From the client to the controller, and back."""
DISTURBANCES: Mapping[str, FaultKind] = {
    "delay": FaultKind("what is sent comes so much later", "seconds"),
    "jitter": FaultKind("each piece comes later by up to so much, in order", "seconds"),
    "stall": FaultKind("nothing comes through; it waits"),
    "corrupt": FaultKind("this share of the bytes is replaced by others", "share"),
    "reorder": FaultKind("this share of the pieces comes after the one that follows", "share"),
    "half_close": FaultKind("one side of every connection is ended, the other stays open"),
    "reset": FaultKind("every connection is reset; new ones are taken"),
    "refuse": FaultKind("every connection is reset, and no new one is taken"),
}
"""By name."""
AT_ONCE = {"half_close", "reset"}
"""Those that happen once; the others last until they are cleared."""
USAGE = "say: fault NAME [VALUE] [port=NUMBER] [direction=up|down]"
USUAL = {"delay": 0.2, "jitter": 0.1, "corrupt": 0.001, "reorder": 0.5}
"""Sizes where nobody says one."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance, and of what.

    Attributes:
        fault: Its name.
        value: Its size; a usual one if None.
        port: Of the controller; all if None.
        direction: "up" or "down"; both if None.
    """

    fault: str
    value: float | None = None
    port: int | None = None
    direction: str | None = None

    def __post_init__(self) -> None:
        if self.fault not in DISTURBANCES:
            raise InputError(f"no disturbance '{self.fault}'; known: {', '.join(DISTURBANCES)}")
        DISTURBANCES[self.fault].check(self.fault, self.value)
        if self.direction not in {None, UP, DOWN}:
            raise InputError(f"'{self.direction}' is no direction: say {UP} or {DOWN}")

    def __str__(self) -> str:
        """As it is asked for."""
        words = [self.fault, *([f"{self.value:g}"] if self.value is not None else [])]
        words += [f"port={self.port}"] if self.port is not None else []
        words += [f"direction={self.direction}"] if self.direction is not None else []
        return " ".join(words)

    @property
    def size(self) -> float:
        """Its size."""
        return USUAL.get(self.fault, 0.0) if self.value is None else self.value

    def concerns(self, port: int, direction: str) -> bool:
        """Whether it is about what goes in one direction, to or from one port."""
        return self.port in {None, port} and self.direction in {None, direction}

    @staticmethod
    def of(words: list[str]) -> Disturbance:
        """From words: NAME [VALUE] [port=NUMBER] [direction=up|down].

        Raises:
            InputError: They are none.
        """
        if not words:
            raise InputError(f"{USAGE}; faults: {', '.join(DISTURBANCES)}")
        name, *others = words
        value, named = None, dict[str, str]()
        for word in others:
            key, sign, rest = word.partition("=")
            if sign and key in {"port", "direction"}:
                named[key] = rest
                continue
            try:
                value = float(word)
            except ValueError:
                raise InputError(f"the value '{word}' is no number; {USAGE}") from None
        port = named.get("port")
        if port is not None and not port.isdigit():
            raise InputError(f"the port '{port}' is no number")
        return Disturbance(name, value, None if port is None else int(port), named.get("direction"))


@dataclass
class Disturbances:
    """Those that last, at the moment.

    Attributes:
        lasting: In the order in which they began.
    """

    lasting: list[Disturbance] = field(default_factory=list)

    def of(self, port: int, direction: str) -> dict[str, Disturbance]:
        """The newest of each kind in one direction, to or from one port, by name."""
        return {own.fault: own for own in self.lasting if own.concerns(port, direction)}


class Passage:
    """One direction of one connection: pieces go in, and come out when and as they are due.

    Args:
        disturbances: What may happen to them.
        port: Of the controller.
        direction: "up" or "down".
        rng: Draws what is left to chance.
    """

    def __init__(
        self, disturbances: Disturbances, port: int, direction: str, rng: np.random.Generator
    ):
        self.port, self.direction = port, direction
        self._disturbances, self._rng = disturbances, rng
        self._pieces: deque[tuple[int, bytes]] = deque()
        self._held: bytes | None = None
        self._last_ns = 0
        self.waiting = 0

    def put(self, data: bytes, now_ns: int) -> None:
        """Take a piece in.

        Args:
            data: The bytes.
            now_ns: Time [ns].
        """
        active = self._disturbances.of(self.port, self.direction)
        if "corrupt" in active:
            data = self._corrupted(data, active["corrupt"].size)
        late = active["delay"].size if "delay" in active else 0.0
        if "jitter" in active:
            late += active["jitter"].size * float(self._rng.random())
        self._last_ns = max(self._last_ns, now_ns + round(late * NANOSECONDS))
        self.waiting += len(data)
        if (
            self._held is None
            and "reorder" in active
            and self._rng.random() < active["reorder"].size
        ):
            self._held = data
            return
        self._pieces.append((self._last_ns, data))
        if self._held is not None:
            self._pieces.append((self._last_ns, self._held))
            self._held = None

    def take(self, now_ns: int) -> bytes:
        """What is due by a time [ns]; nothing while it is held up."""
        if "stall" in self._disturbances.of(self.port, self.direction):
            return b""
        data = bytearray()
        while self._pieces and self._pieces[0][0] <= now_ns:
            data += self._pieces.popleft()[1]
        self.waiting -= len(data)
        return bytes(data)

    @property
    def due_ns(self) -> int | None:
        """When the next piece is due [ns]; None where none waits for its time."""
        stalled = "stall" in self._disturbances.of(self.port, self.direction)
        return self._pieces[0][0] if self._pieces and not stalled else None

    def _corrupted(self, data: bytes, share: float) -> bytes:
        values = np.frombuffer(data, np.uint8).copy()
        hit = self._rng.random(len(values)) < share
        values[hit] = self._rng.integers(0, 256, int(hit.sum()), dtype=np.uint8)
        return values.tobytes()
