"""CDR, the wire format of ROS 2 messages, many messages at once.

OMG DDS-XTypes 1.3, 7.4.1: plain CDR, little endian.

Strings and lengths of arrays stay the same from message to message of a channel, and so does the
place of every number: a layout is one template of bytes and the places of the numbers in it, which
numpy fills for all messages together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

HEADER = b"\x00\x01\x00\x00"
"""Plain CDR, little endian, no options; alignment counts from behind it."""


class CdrLayout:
    """The bytes of a message whose strings and array lengths are known.

    Fields are in the order of its definition.
    """

    def __init__(self) -> None:
        self._template = bytearray(HEADER)
        self._names: list[str] = []
        self._kinds: list[tuple[str, tuple[int, ...]]] = []
        self._offsets: list[int] = []

    def string(self, text: str) -> CdrLayout:
        """A string that is the same in every message."""
        content = text.encode() + b"\0"
        self.constant("<u4", [len(content)])
        self._template += content
        return self

    def constant(self, kind: str, values: Sequence[float]) -> CdrLayout:
        """Numbers that are the same in every message.

        Args:
            kind: As numpy spells it, e.g. "<f8".
            values: One after the other.
        """
        if len(values):  # an empty sequence has no elements to align
            self._align(np.dtype(kind).itemsize)
            self._template += np.asarray(values, dtype=kind).tobytes()
        return self

    def slot(self, name: str, kind: str, count: int = 1) -> CdrLayout:
        """Numbers that differ from message to message.

        Args:
            name: To fill them by.
            kind: As numpy spells it.
            count: How many, one after the other.
        """
        size = np.dtype(kind).itemsize
        self._align(size)
        self._names.append(name)
        self._kinds.append((kind, (count,) if count > 1 else ()))
        self._offsets.append(len(self._template))
        self._template += bytes(size * count)
        return self

    def fill(self, count: int, **values: np.ndarray) -> np.ndarray:
        """The bytes of `count` messages.

        Args:
            count: Number of messages.
            values: By slot, shape (count,) or (count, k).

        Returns:
            Shape (count, length), uint8.
        """
        dtype = np.dtype(
            {
                "names": self._names,
                "formats": self._kinds,
                "offsets": self._offsets,
                "itemsize": len(self._template),
            }
        )
        rows = np.tile(np.frombuffer(bytes(self._template), dtype=np.uint8), (count, 1))
        records = rows.view(dtype).reshape(count)
        for name in self._names:
            records[name] = values[name]
        return rows

    def _align(self, size: int) -> None:
        self._template += bytes(-(len(self._template) - len(HEADER)) % size)
