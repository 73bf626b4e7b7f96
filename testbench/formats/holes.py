"""Gaps between the samples of an import, counted as they go by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

LEAST_S, LEAST_INTERVALS = 0.05, 4.0
"""A gap lasts so long, and so many usual intervals: what jitters, or lost a packet or two, is the
audit of the timing's.
"""
FIRST = 4096
"""Intervals that tell the usual one."""


class Holes:
    """Counts the gaps of a recording.

    Attributes:
        count: Of gaps.
    """

    def __init__(self) -> None:
        self.count = 0
        self._limit = self._total = self._longest = self._longest_at = 0
        self._last: int | None = None

    def watch(self, chunks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        """The chunks as they are, each looked at before it goes on."""
        for chunk in chunks:
            self._add(chunk.host_time_ns)
            yield chunk

    def _add(self, time_ns: np.ndarray) -> None:
        if not len(time_ns):
            return
        steps = np.diff(time_ns, prepend=time_ns[:1] if self._last is None else self._last)
        self._last = int(time_ns[-1])
        if not self._limit:
            some = steps[1:FIRST]
            moving = some[some > 0]
            usual = float(np.median(moving)) if len(moving) else 0.0
            self._limit = round(max(LEAST_S * NANOSECONDS, LEAST_INTERVALS * usual))
        if int(steps.max()) <= self._limit:
            return
        rows = np.flatnonzero(steps > self._limit)
        self.count += len(rows)
        self._total += int(steps[rows].sum())
        widest = int(rows[np.argmax(steps[rows])])
        if int(steps[widest]) > self._longest:
            self._longest = int(steps[widest])
            self._longest_at = int(time_ns[widest]) - self._longest

    def findings(self) -> list[Finding]:
        """What is said of them; empty where there are none."""
        if not self.count:
            return []
        total, longest, at = (
            value / NANOSECONDS for value in (self._total, self._longest, self._longest_at)
        )
        return [finding("time.gaps", count=self.count, total_s=total, longest_s=longest, at_s=at)]
