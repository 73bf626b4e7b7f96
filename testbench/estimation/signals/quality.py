"""Quality gates: which samples must not be averaged in, and what else is odd about a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.consistency.doubtful import (
    BIT,
    CLIPPED_RATE,
    NO_UNIT,
    NOT_FINITE,
    SATURATED,
    STUCK,
    Doubts,
    Gates,
)
from testbench.consistency.refused import Tally
from testbench.estimation.signals.rates import LARGEST_BIAS
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

AFTER_GAP = "after a gap"
LONG_GAP_S = 0.25
"""After a gap this long a filter has lost its way for `RECOVERY_S`."""
RECOVERY_S = 1.0
LOST_GAP_S = 1.0
"""After a gap this long nobody knows how the sensor turned meanwhile, and filters begin anew."""
REST_TOLERANCE = 0.05
"""Part of g by which the mean norm of the force at rest may differ before it is remarked on."""
FIELD_TOLERANCE = 0.2
"""Part of its median by which the magnetic norm may differ before a sample counts as disturbed."""


@dataclass(frozen=True)
class Quality:
    """What the gates found.

    Attributes:
        flags: Samples by reason, each of shape (n,), bool; flagged samples are not evaluated.
        findings: What is odd but excludes nothing.
        numbers: Samples refused by each gate; the flags may stand for several samples each.
    """

    flags: dict[str, np.ndarray]
    findings: list[Finding]
    numbers: dict[str, int]

    @property
    def flagged(self) -> np.ndarray:
        """Samples that any gate refuses, shape (n,), bool."""
        return np.logical_or.reduce(list(self.flags.values()))

    def without_rows(self, reason: str, rows: np.ndarray, each: int) -> Quality:
        """The same with further samples refused for a reason that there is.

        Args:
            reason: That they are refused for.
            rows: Those samples, shape (n,), bool.
            each: Samples of the recording that each stands for.
        """
        flags = self.flags[reason] | rows
        added = each * int(flags.sum() - self.flags[reason].sum())
        numbers = self.numbers | {reason: self.numbers[reason] + added}
        return Quality(self.flags | {reason: flags}, self.findings, numbers)

    def with_flags(self, further: dict[str, np.ndarray]) -> Quality:
        """The same with further samples refused.

        Args:
            further: By reason, each of shape (n,), bool.
        """
        counted = {reason: int(flags.sum()) for reason, flags in further.items()}
        return Quality(self.flags | further, self.findings, self.numbers | counted)


class AfterGaps:
    """Flags the samples after a gap until a filter has settled again, and finds where filters begin
    anew; goes on from call to call.
    """

    def __init__(self) -> None:
        self._last: int | None = None
        self._until = np.iinfo(np.int64).min
        self._row = self._done = 0

    def __call__(
        self, time_ns: np.ndarray, known: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Flags of the next samples, shape (n,), bool, and between which the orientation was lost,
        shape (k, 2): the last before and the first after, counted from the first of the recording.

        Args:
            time_ns: Their times, shape (n,) [ns].
            known: Samples that were measured, shape (n,), bool; the others are part of a gap. All
                if None.
        """
        rows = np.arange(len(time_ns)) if known is None else np.flatnonzero(known)
        time = time_ns[rows]
        gaps = np.diff(time, prepend=time[:1] if self._last is None else self._last)
        until = np.full(len(time_ns), self._until)
        long = gaps > LONG_GAP_S * NANOSECONDS
        until[rows[long]] = time[long] + round(RECOVERY_S * NANOSECONDS)
        np.maximum.accumulate(until, out=until)
        rows = rows + self._done
        before = np.concatenate([[self._row], rows])[:-1]
        lost = gaps > LOST_GAP_S * NANOSECONDS
        self._done += len(time_ns)
        if len(time):
            self._last, self._row = int(time[-1]), int(rows[-1])
        if len(until):
            self._until = int(until[-1])
        return np.asarray(time_ns <= until), np.column_stack([before, rows])[lost]


class Inspection:
    """Puts samples through the gates, chunk by chunk, and keeps count.

    Args:
        gates: Of the whole recording.

    Attributes:
        lost: Rows between which the orientation was lost, last before and first after.
    """

    def __init__(self, gates: Gates):
        self._gates = gates
        self._after = AfterGaps(), AfterGaps()
        self.lost: list[tuple[int, int]] = []
        always = [SATURATED, NOT_FINITE, STUCK, AFTER_GAP]
        always += [NO_UNIT] if gates.measures("device_q") else []
        self._tally = Tally(gates)
        self._tally.counts.update(dict.fromkeys(always, 0))

    def flags(self, samples: ImuSamples, doubts: Doubts, own: slice) -> dict[str, np.ndarray]:
        """Samples to be refused, by reason, each of shape (m,), bool.

        Args:
            samples: A chunk with its neighbours, n of them.
            doubts: What is doubtful in them.
            own: Those that are the chunk itself, m of them.
        """
        flags = {reason: flag[own] for reason, flag in doubts.flags.items()}
        unknown, time = doubts.unknown[own], samples.device_time_ns[own]
        after = np.zeros(len(time), dtype=bool)
        kinds = (("gyr", BIT["gyr"] | CLIPPED_RATE), ("acc", BIT["acc"]))
        for (key, marks), tell in zip(kinds, self._after, strict=True):
            if self._gates.measures(key) or key == "gyr":
                known = (unknown & marks) == 0 if self._gates.measures(key) else None
                settling, lost = tell(time, known)
                after |= settling
                if key == "gyr":
                    self.lost += [(int(last), int(first)) for last, first in lost]
        flags[AFTER_GAP] = after
        self._tally.add(flags, samples.host_time_ns[own], doubts.quantities)
        return flags

    @property
    def counts(self) -> dict[str, int]:
        """Samples refused, by reason."""
        return self._tally.counts

    def findings(self) -> list[Finding]:
        """What was refused and why, and what else the readings show."""
        return self._tally.findings()


def _read(samples: ImuSamples, rest: np.ndarray) -> bool:
    """Whether there are rates at rest."""
    return bool(np.isfinite(samples.gyr[rest]).all(axis=1).any())


def findings_on(samples: ImuSamples, rest: np.ndarray) -> list[Finding]:
    """What is odd about readings at rest and about the magnetic field.

    Args:
        samples: As recorded.
        rest: Whether each is at rest and sound, shape (n,), bool.
    """
    found = []
    norm = np.linalg.norm(samples.acc[rest], axis=1)
    norm = norm[np.isfinite(norm)]
    if len(norm) and abs(norm.mean() / STANDARD_GRAVITY - 1) > REST_TOLERANCE:
        mean = float(norm.mean())
        found.append(finding("rest.norm", norm_m_s2=mean, norm_g=mean / STANDARD_GRAVITY))
    bias = np.linalg.norm(np.nanmedian(samples.gyr[rest], axis=0)) if _read(samples, rest) else 0.0
    if bias > LARGEST_BIAS:
        found.append(finding("rest.rate", bias_deg_s=float(np.degrees(bias))))
    if samples.mag is not None and np.isfinite(samples.mag).any():
        field = np.linalg.norm(samples.mag, axis=1)
        usual = float(np.nanmedian(field))
        disturbed = float(np.mean(np.abs(field - usual) > FIELD_TOLERANCE * usual))
        if disturbed > 0.01:
            found.append(finding("field.norm", usual_ut=usual, disturbed_percent=100 * disturbed))
    return found
