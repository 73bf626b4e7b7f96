"""Quality gates: which samples must not be averaged in, and what else is odd about a recording."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

STUCK_SAMPLES = 5
"""This many identical samples in a row, of a sensor that is usually noisy, are stuck."""
LONG_GAP_S = 0.25
"""After a gap this long a filter has lost its way for `RECOVERY_S`."""
RECOVERY_S = 1.0
LOST_GAP_S = 1.0
"""After a gap this long a heading without a magnetometer is lost for good."""
NORM_TOLERANCE = 0.01
"""Quaternions further from unit length than this are refused [1]."""
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
        numbers: Samples refused by each gate, where the flags stand for several samples each; None
            to count the flags.
    """

    flags: dict[str, np.ndarray]
    findings: list[Finding]
    numbers: dict[str, int] | None = None

    @property
    def flagged(self) -> np.ndarray:
        """Samples that any gate refuses, shape (n,), bool."""
        return np.logical_or.reduce(list(self.flags.values()))

    def with_flags(self, further: dict[str, np.ndarray]) -> Quality:
        """The same with further samples refused, by reason, each of shape (n,), bool."""
        counted = {reason: int(flags.sum()) for reason, flags in further.items()}
        numbers = None if self.numbers is None else self.numbers | counted
        return Quality(self.flags | further, self.findings, numbers)

    def counts(self) -> dict[str, int]:
        """Number of samples refused by each gate."""
        return self.numbers or {reason: int(flags.sum()) for reason, flags in self.flags.items()}


@dataclass
class Traits:
    """What must be known of a whole recording before a sample can be refused.

    It may be told chunk by chunk.

    Attributes:
        has_noise: False for a model without noise, which no repetition can be held against.
        present: Quantities of which any value is finite; a column that the file lacks is NaN
            throughout.
    """

    has_noise: bool = True
    present: set[str] = field(default_factory=set)
    _same: dict[str, int] = field(default_factory=lambda: {"gyr": 0, "acc": 0})
    _count: int = 0
    _last: ImuSamples | None = None

    def add(self, samples: ImuSamples) -> Traits:
        """Take note of the next samples."""
        for key in ("gyr", "acc", "mag", "device_q"):
            array = getattr(samples, key)
            if key not in self.present and array is not None and np.isfinite(array).any():
                self.present.add(key)
        for key in self._same:
            array = getattr(samples, key)
            before = array[:1] * np.nan if self._last is None else getattr(self._last, key)[-1:]
            self._same[key] += int(
                (array[:1] == before).all(axis=1).sum()
                + (array[1:] == array[:-1]).all(axis=1).sum()
            )
        self._count += len(samples)
        self._last = samples if len(samples) else self._last
        return self

    def finite(self, samples: ImuSamples) -> np.ndarray:
        """Samples of which every quantity that is present at all is finite, shape (n,), bool."""
        finite = np.ones(len(samples), dtype=bool)
        for key in self.present:
            for column in getattr(samples, key).T:  # twice as fast as all(axis=1) of three
                finite &= np.isfinite(column)
        return finite

    @property
    def noisy(self) -> bool:
        """Whether readings differ from sample to sample as a rule, as those of a real sensor do."""
        return self.has_noise and any(
            2 * same < self._count for key, same in self._same.items() if key in self.present
        )


class AfterGaps:
    """Flags the samples after a gap until a filter has settled again; goes on from call to call."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._until = np.iinfo(np.int64).min

    def __call__(self, time_ns: np.ndarray) -> np.ndarray:
        """Flags of the next samples, shape (n,), bool.

        Args:
            time_ns: Their host times, shape (n,) [ns].
        """
        gaps = np.diff(time_ns, prepend=time_ns[:1] if self._last is None else self._last)
        until = np.full(len(time_ns), self._until)
        for i in np.flatnonzero(gaps > LONG_GAP_S * NANOSECONDS):
            lost = gaps[i] > LOST_GAP_S * NANOSECONDS
            until[i] = (
                np.iinfo(np.int64).max if lost else time_ns[i] + round(RECOVERY_S * NANOSECONDS)
            )
        np.maximum.accumulate(until, out=until)
        if len(time_ns):
            self._last, self._until = int(time_ns[-1]), int(until[-1])
        return np.asarray(time_ns <= until)


def assess(
    samples: ImuSamples, time_ns: np.ndarray, static: np.ndarray, has_noise: bool = True
) -> Quality:
    """Put a recording through the gates.

    Args:
        samples: As recorded.
        time_ns: Their host times, shape (n,) [ns].
        static: Whether each is at rest, shape (n,), bool.
        has_noise: As in `Traits`.
    """
    flags = {
        **sample_flags(samples, Traits(has_noise).add(samples)),
        "after a gap": AfterGaps()(time_ns),
    }
    return Quality(flags, findings_on(samples, static & ~flags["not finite"]))


def sample_flags(samples: ImuSamples, traits: Traits) -> dict[str, np.ndarray]:
    """Samples to be refused for what they read, by reason, each of shape (n,), bool.

    `STUCK_SAMPLES` neighbouring rows matter on each side.

    Args:
        samples: All or a chunk.
        traits: Of the whole recording.
    """
    flags = {
        "saturated": samples.saturated.astype(bool),
        "not finite": ~traits.finite(samples),
        "stuck": _stuck(samples, traits),
    }
    if samples.device_q is not None:
        flags["quaternion not of unit length"] = (
            np.abs(np.linalg.norm(samples.device_q, axis=1) - 1) > NORM_TOLERANCE
        )
    return flags


def _stuck(samples: ImuSamples, traits: Traits) -> np.ndarray:
    """Runs of samples identical in every axis; none of a sensor without noise."""
    repeated = np.full(len(samples), traits.noisy)
    for key in traits.present & {"gyr", "acc"}:
        array = getattr(samples, key)
        repeated[:1] = False
        repeated[1:] &= (array[1:] == array[:-1]).all(axis=1)
    return _runs(repeated, STUCK_SAMPLES - 1)


def _runs(mask: np.ndarray, length: int) -> np.ndarray:
    """The parts of a mask that are at least `length` long, shape (n,), bool."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    result = np.zeros(len(mask), dtype=bool)
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if end - begin >= length:
            result[begin:end] = True
    return result


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
    if samples.mag is not None and np.isfinite(samples.mag).any():
        field = np.linalg.norm(samples.mag, axis=1)
        usual = float(np.nanmedian(field))
        disturbed = float(np.mean(np.abs(field - usual) > FIELD_TOLERANCE * usual))
        if disturbed > 0.01:
            found.append(finding("field.norm", usual_ut=usual, disturbed_percent=100 * disturbed))
    return found
