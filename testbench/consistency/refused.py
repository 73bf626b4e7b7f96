"""What the gates refuse of a recording's samples, counted and told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from testbench.consistency import Consistency
from testbench.consistency.doubtful import (
    BEYOND,
    BIT,
    CLIPPED,
    EXCLUDED,
    SATURATED,
    SPIKE,
    STRAIGHT,
    STUCK,
    STUCK_AXIS,
    WRAPPED,
    ZEROS,
    Belief,
    Doubts,
    Gates,
    without,
)
from testbench.consistency.traits import Traits
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import AXES, ImuSamples
from testbench.records.session.sensor_file import SensorFile

CODES = {
    ZEROS: "samples.zeros",
    STUCK: "samples.stuck",
    STUCK_AXIS: "samples.stuck_axis",
    CLIPPED: "samples.clipped",
    SPIKE: "samples.spike",
    STRAIGHT: "samples.straight",
    WRAPPED: "samples.wrapped",
    BEYOND: "samples.beyond",
}
"""Findings of the reasons that a person may know better than."""
WORDS = {
    "gyr": "gyroscope",
    "acc": "accelerometer",
    "mag": "magnetometer",
    "device_q": "quaternion",
}
OUT_OF_RANGE = (CLIPPED, SATURATED, WRAPPED)
"""Reasons that no unit or scale which was taken wrongly gives: such readings are no evidence of
either.
"""
PIECE = 131_072
"""Samples of a recording that are in memory at once."""


class Tally:
    """Counts refused samples, chunk by chunk.

    Args:
        gates: Of the whole recording.

    Attributes:
        counts: Of samples by reason.
    """

    def __init__(self, gates: Gates):
        self._gates = gates
        self.counts: dict[str, int] = {}
        self._first: dict[str, int] = {}
        self._quantities: dict[str, set[str]] = {}

    def add(
        self,
        flags: Mapping[str, np.ndarray],
        time_ns: np.ndarray,
        quantities: Mapping[str, set[str]],
    ) -> None:
        """Count the next samples.

        Args:
            flags: By reason, each of shape (n,), bool.
            time_ns: Host time of them, shape (n,) [ns].
            quantities: Which quantities each reason is about.
        """
        for reason, flag in flags.items():
            count = int(flag.sum())
            self.counts[reason] = self.counts.get(reason, 0) + count
            if count and reason not in self._first:
                self._first[reason] = int(time_ns[int(np.argmax(flag))])
            self._quantities.setdefault(reason, set()).update(quantities.get(reason, ()))

    def findings(self) -> list[Finding]:
        """What was refused and why, and what else the readings show."""
        found = []
        for reason, count in self.counts.items():
            code = CODES.get(reason, "samples.excluded" if reason.startswith(EXCLUDED) else None)
            if code is None or not count:
                continue
            about = [WORDS[key] for key in WORDS if key in self._quantities[reason]]
            found.append(
                finding(
                    code,
                    count=count,
                    first_s=self._first[reason] / NANOSECONDS,
                    quantities=about,
                    reason=reason.removeprefix(EXCLUDED),
                )
            )
        for key in sorted(self._gates.dead):
            dead, twins = self._gates.dead_axes.get(key, []), self._gates.twin_axes.get(key, [])
            code = "samples.dead_axis" if dead else "samples.twin_axes" if twins else "samples.dead"
            axes = [AXES[axis] for axis in dead or twins]
            found.append(finding(code, quantity=WORDS[key], axes=axes))
        for key, rows in self._gates.slower().items():
            found.append(finding("samples.slower", quantity=WORDS[key], rows=rows))
        for key, rows in self._gates.resampled().items():
            found.append(finding("samples.resampled", quantity=WORDS[key], rows=rows))
        return found


class Refusals:
    """What the gates refuse of samples that go by on their way to a file.

    Args:
        belief: What a person says of them.

    Attributes:
        in_range: What the quantities say of one another where none is out of its range; None as
            long as no sample was found to be.
    """

    def __init__(self, belief: Belief):
        self._belief, self._traits = belief, Traits(belief.has_noise)
        self.in_range: Consistency | None = None

    def watch(self, chunks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        """The chunks as they are, each learned from before it goes on."""
        for chunk in chunks:
            self._traits.add(chunk)
            yield chunk

    def findings(self, file: SensorFile) -> list[Finding]:
        """What was noticed; the file is gone through only where any sample may be refused.

        Args:
            file: All of them, as written.
        """
        gates = Gates(self._traits, self._belief)
        tally = Tally(gates)
        in_range = Consistency()
        for piece, own in file.pieces(PIECE, gates.margin) if gates.suspects else ():
            doubts = gates.doubt(piece)
            flags = {reason: flag[own] for reason, flag in doubts.flags.items()}
            tally.add(flags, piece.host_time_ns[own], doubts.quantities)
            if gates.may_leave_range:
                in_range.look(_in_range(piece, doubts).rows(own))
        if any(tally.counts.get(reason) for reason in OUT_OF_RANGE):
            self.in_range = in_range
        return tally.findings()


def _in_range(samples: ImuSamples, doubts: Doubts) -> ImuSamples:
    """Samples whose quantities are NaN where they were out of their range."""
    lost = np.zeros(len(samples), dtype=np.uint8)
    for reason in OUT_OF_RANGE:
        if reason in doubts.flags:
            marks = sum(BIT[key] for key in doubts.quantities[reason])
            lost[doubts.flags[reason]] |= marks
    return without(samples, lost)
