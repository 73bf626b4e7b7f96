"""From a controller's own time to the host's, by the packages that were delayed least."""

from __future__ import annotations

BLOCK_NS = 5_000_000_000
"""The least delayed package is sought in blocks of this length [ns]; that of the last two blocks counts."""
SLEW = 200e-6
"""The estimate follows the clocks' drift by at most this much (relative); quartz clocks differ by less."""


class ControllerClock:
    """Maps the controller's time stamps to host time.

    A package arrives late by a delay that is never negative, so the smallest difference between arrival and stamp is nearest to
    the offset between the clocks. The mapping is monotonic: it is slewed, never set, once it is in use.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._block_start = 0
        self._least = self._least_before = float("inf")
        self._last_ns = 0
        self._slewing = False

    @property
    def offset_ns(self) -> float:
        """Host time less controller time [ns]; zero before the first package."""
        return 0.0 if self._offset is None else self._offset

    def begin(self) -> None:
        """From now on the mapping is slewed only: samples are being recorded."""
        self._slewing = True

    def host_ns(self, controller_ns: int, arrival_ns: int) -> int:
        """Host time of a stamp, from a package that arrived just now [ns]."""
        difference = float(arrival_ns - controller_ns)
        if arrival_ns - self._block_start > BLOCK_NS:
            self._least_before, self._least, self._block_start = self._least, difference, arrival_ns
        self._least = min(self._least, difference)
        target = min(self._least, self._least_before)
        if self._offset is None or not self._slewing:
            self._offset = target
        else:
            most = SLEW * max(arrival_ns - self._last_ns, 0)
            self._offset += min(max(target - self._offset, -most), most)
        self._last_ns = arrival_ns
        return round(controller_ns + self._offset)
