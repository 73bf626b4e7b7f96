"""What is said on the terminal of things that happen to live sensors, while they are recorded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from testbench.frames import NANOSECONDS
from testbench.records.session.session import Event

AGAIN_NS = 10 * NANOSECONDS
"""The same of one sensor is said again after so long [ns]; all of it is in the events."""
WORDS = {
    "disconnected": "its connection was lost: {reason}",
    "reconnected": "it is connected again, after {gap_s:.3g} s",
    "silent": "it sends nothing",
    "heard_again": "it is heard again, after {gap_s:.3g} s",
    "malformed_lines": "{count} lines within a second do not fit its format, the first {why}; is "
    "the speed of the line the board's?",
    "malformed_packets": "{count} packets within a second do not fit its format",
    "untimely_lines": "{count} lines within a second have times that cannot be",
    "samples_dropped": "{count} samples were dropped: {why}",
    "device_clock_restarted": "its clock began anew",
}
"""By event; what is not here is in the events alone."""


class _Known(dict[str, Any]):
    def __missing__(self, key: str) -> str:
        return "?"


class DeviceWords:
    """Says what happens, and the same not too often."""

    def __init__(self) -> None:
        self._said_ns: dict[tuple[str, str], int] = {}

    def lines(self, happened: Mapping[str, list[Event]]) -> Iterator[str]:
        """What is to be said of events.

        Args:
            happened: Events by the sensors' names.
        """
        for name, events in happened.items():
            for event in events:
                key, now_ns = (name, event.event), event.host_time_ns
                last_ns = self._said_ns.get(key)
                if event.event not in WORDS or (
                    last_ns is not None and now_ns - last_ns < AGAIN_NS
                ):
                    continue
                self._said_ns[key] = now_ns
                said = WORDS[event.event].format_map(_Known(event.details))
                yield f"warning: {name}: {said}"
