"""Filters begin anew after a gap over which nobody knows how the sensor turned.

Each stretch between such gaps goes through a filter as a recording of its own. A filter without a
magnetometer begins with any heading: it is given the one that the filter had before the gap, so
that the orientation does not step by more than what the sensor turned meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from testbench.estimation.filters import OrientationFilter, UniformSamples
from testbench.estimation.signals.timing import usual_interval
from testbench.estimation.signals.uniform import fill_gaps
from testbench.model import rotation
from testbench.records.results.estimate import ClockFit
from testbench.records.session.samples import ImuSamples


class Carried:
    """The orientations of a filter, with the heading carried on where it began anew.

    Args:
        kind: The filter.

    Attributes:
        last: The last of them, shape (4,); no rotation before the first.
    """

    def __init__(self, kind: OrientationFilter):
        self._kind, self._turn, self._begun = kind, 0.0, False
        self.last: np.ndarray = np.array([1.0, 0.0, 0.0, 0.0])

    def __call__(self, q: np.ndarray, given: UniformSamples, anew: bool) -> np.ndarray:
        """The next orientations, shape (n, 4).

        Args:
            q: q_earth_from_sensor as the filter gave them, shape (n, 4).
            given: What it got.
            anew: Whether it began anew with the first of them.
        """
        if anew and self._begun and not self._kind.knows_heading(given):
            step = rotation.multiply(self.last, rotation.conjugate(q[0]))
            self._turn = float(rotation.heading_angle(step))
        if self._turn:
            q = rotation.multiply(rotation.from_heading(self._turn), q)
        self.last, self._begun = q[-1], True
        return q


@dataclass(frozen=True)
class Stretches:
    """Samples between gaps that no rate bridges.

    Attributes:
        parts: Each on a regular grid, and the row of each sample in it.
        holes: Samples without a rate after each.
    """

    parts: list[tuple[UniformSamples, np.ndarray]]
    holes: list[int] = field(default_factory=lambda: [0])

    @staticmethod
    def cut(
        samples: ImuSamples, lost: np.ndarray, clock: ClockFit, bridges: Mapping[str, int]
    ) -> Stretches:
        """The stretches of a recording.

        Args:
            samples: All of it, n of them.
            lost: Samples before and after each gap, shape (k, 2).
            clock: Gives the true interval.
            bridges: As for `fill_rows`.
        """
        usual = float(np.nan_to_num(usual_interval(np.diff(samples.device_time_ns))))
        parts = []
        begins, ends = [0, *lost[:, 1].tolist()], [*(lost[:, 0] + 1).tolist(), len(samples)]
        for begin, end in zip(begins, ends, strict=True):
            uniform, rows = fill_gaps(samples.rows(slice(begin, end)), clock, bridges)
            if uniform.interval <= 0:  # a single sample has none
                uniform = replace(uniform, interval=usual)
            parts.append((uniform, rows))
        holes = [after - end for after, end in zip([*begins[1:], ends[-1]], ends, strict=True)]
        return Stretches(parts, holes)

    def corrected(self, correct: Callable[[UniformSamples], UniformSamples]) -> Stretches:
        """The same with a calibration applied.

        Args:
            correct: The calibration.
        """
        return replace(self, parts=[(correct(uniform), rows) for uniform, rows in self.parts])

    def run(self, kind: OrientationFilter) -> np.ndarray:
        """q_earth_from_sensor of a filter at every sample, shape (n, 4); over a hole it stays.

        Args:
            kind: The filter.
        """
        carried, found = Carried(kind), []
        for (uniform, rows), hole in zip(self.parts, self.holes, strict=True):
            found.append(carried(kind.run(uniform)[rows], uniform, anew=True))
            if hole:
                found.append(np.repeat(carried.last[None], hole, axis=0))
        return found[0] if len(found) == 1 else np.concatenate(found)
