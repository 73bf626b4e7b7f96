"""Units of time: in which gravity turns as the gyroscope says."""

from __future__ import annotations

from testbench.consistency.excerpt import Excerpt
from testbench.consistency.factors import DEG
from testbench.consistency.fits import Reading, read_against
from testbench.consistency.still_intervals import find_rests

USUAL_RATES_HZ = (8.0, 4_000.0)
"""Rates that a unit of time must lead to."""
FACTORS = [10.0**power for power in range(-9, 10) if power != 0]
"""Seconds, milliseconds and so on taken for one another, and counts of 10 or 100 us for any."""


def read_at_other_times(excerpt: Excerpt, seconds: float) -> dict[float, Reading]:
    """Readings of the gyroscope by gravity, if the time is so many times what the stamps say.

    Args:
        excerpt: Of the recording.
        seconds: Of a step, by the stamps.

    Returns:
        By the factor, of those that lead to a usual rate and leave windows to compare them in.
    """
    lowest, highest = USUAL_RATES_HZ
    rate = excerpt.samples / seconds
    found = {}
    for factor in FACTORS:
        if lowest <= rate / factor <= highest:
            bias = find_rests(excerpt, seconds * factor).bias
            reading = read_against(excerpt, excerpt.acc, seconds * factor, bias, (1.0, DEG))
            if reading is not None:
                found[factor] = reading
    return found
