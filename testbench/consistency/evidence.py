"""What numbers whose units nobody states say of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.consistency.angular_rate import MAPS
from testbench.consistency.checks import check_time
from testbench.consistency.excerpt import Excerpt, thin
from testbench.consistency.fits import FEW_WINDOWS, Pair, is_clear
from testbench.consistency.looked import Looked
from testbench.consistency.still_intervals import find_rests
from testbench.frames import NANOSECONDS
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

BLOCK_S = 0.2
"""Long enough for vibration to average out, short enough for the chord to be the arc."""
SLOPE_WITHIN = 2.0
"""The slope may be wrong by this factor: scale errors, and linear acceleration, disturb it."""
LEAST_EXPLAINED = 0.5
"""Turning must explain this part of the changes of the specific force (R^2); linear acceleration
does the rest.
"""
FEWEST_ROWS = 45


@dataclass(frozen=True)
class Evidence:
    """What the numbers say of their units.

    Attributes:
        rest_norm: |acc| at rest in the unit of the numbers, None if never at rest.
        pair: Gyroscope and accelerometer where they can be compared, else None.
        bias: What the gyroscope reads at rest, shape (3,).
        time: What is wrong with the times, which must be settled first; None if nothing is.
        slope: Of the changes of the specific force against those by the rates as they are, which is
            1 for rad/s; None where the sensor hardly turns. It tells units, which lie far apart, of
            recordings too short for `pair`.
    """

    rest_norm: float | None
    pair: Pair | None
    bias: np.ndarray
    time: Finding | None
    slope: float | None = None

    def unit_of_rate(self, factors: Mapping[str, float]) -> str | None:
        """The unit of the gyroscope in which gravity turns as it says, None if it is not clear.

        Args:
            factors: rad/s that one of each unit is, by its name.
        """
        by_windows = self._by_windows(factors)
        return by_windows if by_windows is not None else self._by_slope(factors)

    def _by_slope(self, factors: Mapping[str, float]) -> str | None:
        if self.slope is None:
            return None
        fitting = [
            unit
            for unit, factor in factors.items()
            if 1 / SLOPE_WITHIN < self.slope / factor < SLOPE_WITHIN
        ]
        return fitting[0] if len(fitting) == 1 else None

    def _by_windows(self, factors: Mapping[str, float]) -> str | None:
        if self.pair is None:
            return None
        apart = self.pair.windows.independent
        nothing = self.pair.scatter(0.0, maps=MAPS[:1]).logs[0]
        fits = {}
        for unit, factor in factors.items():
            scatter = self.pair.scatter(factor, self.bias)
            fits[unit] = scatter.logs[scatter.best]
        best = min(fits, key=lambda unit: fits[unit].mean())
        others = [nothing, *(fits[unit] for unit in fits if unit != best)]
        return best if all(is_clear(other, fits[best], apart) for other in others) else None


def evidence_of(chunks: Iterable[ImuSamples]) -> Evidence:
    """Look at samples in any units.

    Args:
        chunks: In the order of time.
    """
    excerpt = thin(chunks)
    nothing = Evidence(None, None, np.zeros(3), None)
    if excerpt is None or excerpt.interval_ns <= 0:
        return nothing
    seconds = excerpt.interval_ns * excerpt.samples / NANOSECONDS
    looked = Looked(excerpt, seconds, [], [])
    if not check_time(looked):
        return Evidence(None, None, np.zeros(3), looked.findings[0])
    rests = find_rests(excerpt, seconds)
    pair = Pair.of(excerpt, excerpt.acc, seconds)
    bias = rests.bias if rests.bias is not None else np.zeros(3)
    some = None if pair is None else pair.some(FEW_WINDOWS)
    return Evidence(rests.norm, some, bias, None, _slope(excerpt, bias, seconds))


def _slope(excerpt: Excerpt, bias: np.ndarray, seconds: float) -> float | None:
    """Of da against -omega x a dt over blocks of `BLOCK_S`, through the origin; None if unclear.

    In a frame that turns, a vector fixed in space changes by -omega x a dt.
    """
    size = max(round(BLOCK_S / seconds), 1)
    count = len(excerpt.acc) // size
    if count < 3:
        return None
    acc = excerpt.acc[: count * size].reshape(count, size, 3).mean(axis=1)
    gyr = (excerpt.gyr - bias)[: count * size].reshape(count, size, 3).mean(axis=1)
    y, middle = np.diff(acc, axis=0), (acc[1:] + acc[:-1]) / 2
    x = -np.cross((gyr[1:] + gyr[:-1]) / 2, middle) * (size * seconds)
    # shocks say nothing of turning
    calm = np.linalg.norm(y, axis=1) < 0.5 * np.linalg.norm(middle, axis=1)
    known = calm & np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
    x, y = x[known], y[known]
    xx, xy, yy = float(np.sum(x * x)), float(np.sum(x * y)), float(np.sum(y * y))
    if 3 * len(x) < FEWEST_ROWS or xx <= 0 or yy <= 0 or xy * xy < LEAST_EXPLAINED * xx * yy:
        return None
    return xy / xx
