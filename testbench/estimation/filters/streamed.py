"""Filters that are given samples as they come, while a recording grows."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.estimation.filters.base import FilterState, OrientationFilter, UniformSamples
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples

FIRST_S = 1.0
"""So long is looked at for the interval between samples, which filters must know before they begin
[s].
"""
LONG_GAP_S = 1.0
"""After a longer one filters begin anew, as in an estimate [s]."""


class StreamedFilters:
    """Several filters on one sensor, chunk by chunk.

    Lost samples are filled in by the next one, so that the filters' time goes on, and nothing is
    calibrated: what comes out is to be looked at, and is no estimate.

    Args:
        kinds: Of the filters; those that look ahead are left out, and once samples came those
            that need what the sensor does not have.

    Attributes:
        begun: How often they began; what was known of their headings ends with that.
    """

    def __init__(self, kinds: Iterable[OrientationFilter]):
        self._kinds = [kind for kind in kinds if kind.causal]
        self._waiting: list[ImuSamples] = []
        self._states: dict[str, FilterState | None] = {}
        self._interval = 0.0
        self._last: int | None = None
        self.begun = 0

    @property
    def names(self) -> list[str]:
        """Of the filters that run."""
        return [kind.name for kind in self._kinds]

    def take(self, samples: ImuSamples) -> tuple[ImuSamples | None, dict[str, np.ndarray]]:
        """Orientations at samples that came.

        Args:
            samples: In the order of time, after those of the call before.

        Returns:
            The samples that the orientations are of, and q_earth_from_sensor by filter, shape
            (n, 4) each. In the first second there are none; those of it come with the next.
        """
        if not self._interval:
            self._waiting.append(samples)
            samples = joined(self._waiting)
            self._interval = _interval(samples)
            if not self._interval:
                return None, {}
            self._waiting = []
            self._begin(samples)
        steps = np.maximum(np.diff(samples.counter, prepend=self._before(samples)), 1)
        self._last = int(samples.counter[-1])
        cuts = np.flatnonzero(steps * self._interval > LONG_GAP_S)
        parts = [self._advance(samples, steps, *ends) for ends in _between(cuts, len(samples))]
        return samples, {
            name: np.concatenate([part[name] for part in parts]) for name in self.names
        }

    def _before(self, samples: ImuSamples) -> int:
        """The counter before the first of some samples."""
        return int(samples.counter[0]) - 1 if self._last is None else self._last

    def _begin(self, samples: ImuSamples) -> None:
        """Leave out what cannot run on such samples, nor chunk by chunk."""
        first = _uniform(samples.rows(slice(0, 1)), np.ones(1, dtype=np.int64), self._interval)
        kinds = [kind for kind in self._kinds if not kind.missing(first)]
        self._kinds = []
        for kind in kinds:
            try:
                kind.advance(first)
            except InputError:
                continue
            self._kinds.append(kind)
        self._states = dict.fromkeys(self.names)
        self.begun = 1

    def _advance(
        self, samples: ImuSamples, steps: np.ndarray, begin: int, end: int, anew: bool
    ) -> dict[str, np.ndarray]:
        """Orientations of consecutive samples without a long gap between them."""
        own = steps[begin:end].copy()
        if anew:
            self._states = dict.fromkeys(self.names)
            self.begun += 1
            own[0] = 1
        uniform = _uniform(samples.rows(slice(begin, end)), own, self._interval)
        rows, found = np.cumsum(own) - 1, {}
        for kind in self._kinds:
            q, self._states[kind.name] = kind.advance(uniform, self._states[kind.name])
            found[kind.name] = q[rows]
        return found


def joined(parts: list[ImuSamples]) -> ImuSamples:
    """Samples of one sensor behind one another, as one."""
    columns = {key: column for key, column in vars(parts[0]).items() if column is not None}
    return ImuSamples.from_groups(
        {key: np.concatenate([getattr(part, key) for part in parts]) for key in columns}
    )


def _interval(samples: ImuSamples) -> float:
    """Mean time between samples by the sensor's own clock [s]; 0 where too few came."""
    span = (samples.device_time_ns[-1] - samples.device_time_ns[0]) / NANOSECONDS
    count = int(samples.counter[-1] - samples.counter[0])
    return float(span) / count if span >= FIRST_S and count > 0 else 0.0


def _between(cuts: np.ndarray, count: int) -> list[tuple[int, int, bool]]:
    """Stretches between samples at which something begins anew: begin, end, and whether it does."""
    begins = sorted({0, *cuts.tolist()})
    return [
        (begin, end, begin in cuts) for begin, end in zip(begins, [*begins[1:], count], strict=True)
    ]


def _uniform(samples: ImuSamples, steps: np.ndarray, interval: float) -> UniformSamples:
    """Samples on a regular grid; each stands for those that were lost before it as well.

    Args:
        samples: Of one stretch.
        steps: Of the grid that each comes after the one before, shape (n,).
        interval: Of the grid [s].
    """

    def spread(array: np.ndarray | None) -> np.ndarray | None:
        return None if array is None else np.repeat(array, steps, axis=0)

    gyr, acc = np.repeat(samples.gyr, steps, axis=0), np.repeat(samples.acc, steps, axis=0)
    return UniformSamples(
        interval, np.nan_to_num(gyr), acc, spread(samples.mag), spread(samples.device_q)
    )
