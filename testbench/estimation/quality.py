"""Quality gates: which samples must not be averaged in, and what else is odd about a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.records.samples import ImuSamples

STUCK_SAMPLES = 5
"""This many identical samples in a row, of a sensor that usually hisses, are stuck."""
LONG_GAP_S = 0.25
"""After a gap this long a filter has lost its way for `RECOVERY_S`."""
RECOVERY_S = 1.0
LOST_GAP_S = 1.0
"""After a gap this long nobody knows how the sensor turned meanwhile, and a heading without a magnetometer is lost for good."""
NORM_TOLERANCE = 0.01
"""Quaternions further from unit length than this are refused [1]."""
REST_TOLERANCE = 0.05
"""Part of g by which the mean norm of the specific force at rest may differ before it is remarked on."""
FIELD_TOLERANCE = 0.2
"""Part of its median by which the magnetic norm may differ before a sample counts as disturbed."""


@dataclass(frozen=True)
class Quality:
    """What the gates found.

    Attributes:
        flags: Samples by reason, each of shape (n,), bool; flagged samples are not judged.
        remarks: Sentences on what is odd but excludes nothing.
    """

    flags: dict[str, np.ndarray]
    remarks: list[str]

    @property
    def flagged(self) -> np.ndarray:
        """Samples that any gate refuses, shape (n,), bool."""
        return np.logical_or.reduce(list(self.flags.values()))

    def counts(self) -> dict[str, int]:
        """Number of samples refused by each gate."""
        return {reason: int(flags.sum()) for reason, flags in self.flags.items()}


def assess(samples: ImuSamples, time_ns: np.ndarray, static: np.ndarray) -> Quality:
    """Put a recording through the gates.

    Args:
        samples: As recorded. time_ns: Their host times, shape (n,). static: At rest, shape (n,).
    """
    reported = [array for array in (samples.gyr, samples.acc, samples.mag, samples.device_q) if array is not None]
    present = [array for array in reported if np.isfinite(array).any()]  # a column the file lacks is NaN throughout
    finite = np.ones(len(samples), dtype=bool)
    for array in present:
        finite &= np.isfinite(array).all(axis=1)
    flags = {
        "saturated": samples.saturated.astype(bool),
        "not finite": ~finite,
        "stuck": _stuck(samples),
        "after a gap": _after_gap(time_ns),
    }
    if samples.device_q is not None:
        flags["quaternion not of unit length"] = np.abs(np.linalg.norm(samples.device_q, axis=1) - 1) > NORM_TOLERANCE
    return Quality(flags, _remarks(samples, static & finite))


def _stuck(samples: ImuSamples) -> np.ndarray:
    """Runs of samples identical in every axis; none for a sensor without noise, which is so whenever it rests."""
    repeated = np.ones(len(samples), dtype=bool)
    noisy = False
    for array in (samples.gyr, samples.acc):
        if np.isfinite(array).any():
            same = np.concatenate([[False], (array[1:] == array[:-1]).all(axis=1)])
            noisy |= bool(same.mean() < 0.5)
            repeated &= same
    return _runs(repeated, STUCK_SAMPLES - 1) if noisy else np.zeros(len(samples), dtype=bool)


def _runs(mask: np.ndarray, length: int) -> np.ndarray:
    """The parts of a mask that are at least `length` long, shape (n,), bool."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    result = np.zeros(len(mask), dtype=bool)
    for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        if end - begin >= length:
            result[begin:end] = True
    return result


def _after_gap(time_ns: np.ndarray) -> np.ndarray:
    flags = np.zeros(len(time_ns), dtype=bool)
    gaps = np.diff(time_ns)
    for i in np.flatnonzero(gaps > LONG_GAP_S * NANOSECONDS):
        recovered = time_ns[i + 1] + RECOVERY_S * NANOSECONDS if gaps[i] <= LOST_GAP_S * NANOSECONDS else np.inf
        flags |= (time_ns > time_ns[i]) & (time_ns <= recovered)
    return flags


def _remarks(samples: ImuSamples, rest: np.ndarray) -> list[str]:
    remarks = []
    norm = np.linalg.norm(samples.acc[rest], axis=1)
    norm = norm[np.isfinite(norm)]
    if len(norm) and abs(norm.mean() / STANDARD_GRAVITY - 1) > REST_TOLERANCE:
        remarks.append(f"at rest the specific force is {norm.mean():.2f} m/s^2, {norm.mean() / STANDARD_GRAVITY:.3f} g")
    if samples.mag is not None and np.isfinite(samples.mag).any():
        field = np.linalg.norm(samples.mag, axis=1)
        usual = float(np.nanmedian(field))
        disturbed = float(np.mean(np.abs(field - usual) > FIELD_TOLERANCE * usual))
        if disturbed > 0.01:
            remarks.append(
                f"the magnetic field differs from its median of {usual:.1f} uT by over 20 % in {disturbed:.0%} of the samples"
            )
    return remarks
