"""What numbers whose units nobody states say of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.consistency.checks import Looked, check_time
from testbench.consistency.excerpt import thin
from testbench.consistency.fits import FEW_WINDOWS, Pair, is_clear
from testbench.consistency.rests import find_rests
from testbench.consistency.turning import MAPS
from testbench.frames import NANOSECONDS
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples


@dataclass(frozen=True)
class Evidence:
    """What the numbers say of their units.

    Attributes:
        rest_norm: |acc| at rest in the unit of the numbers, None if never at rest.
        pair: Gyroscope and accelerometer where they can be compared, else None.
        bias: What the gyroscope reads at rest, shape (3,).
        time: What is wrong with the times, which must be settled first; None if nothing is.
    """

    rest_norm: float | None
    pair: Pair | None
    bias: np.ndarray
    time: Finding | None

    def unit_of_rate(self, factors: Mapping[str, float]) -> str | None:
        """The unit of the gyroscope in which gravity turns as it says, None if it is not clear.

        Args:
            factors: rad/s that one of each unit is, by its name.
        """
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
    return Evidence(rests.norm, None if pair is None else pair.some(FEW_WINDOWS), bias, None)
