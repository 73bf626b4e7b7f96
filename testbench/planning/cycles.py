"""Whole cycles of periodic sweeps: how long one lasts, and which are free of the fades."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from testbench.planning.expansion import FourierCommand, SineCommand, TrapezoidCommand
from testbench.records.session.plan import PlannedCycles

HIGHEST_RATIO = 1000
"""Largest denominator of a ratio of frequencies: with larger ones no sweep is long enough for a
common cycle.
"""
LEAST_AGREEMENT = 1e-9
"""Relative difference at which a ratio of frequencies counts as that fraction: rounding of what a
file says.
"""
ROUNDING = 1e-6
"""Part of a cycle by which a border may lie beside a whole number of them."""


def planned_cycles(
    sweeps: Sequence[SineCommand | FourierCommand | TrapezoidCommand], motion_s: float
) -> PlannedCycles | None:
    """The whole cycles of a sweep at full amplitude.

    Args:
        sweeps: Of all joints of one step, which start together.
        motion_s: How long the sweep lasts.

    Returns:
        None where there is not one whole cycle, or no joint moves.
    """
    moving = [sweep for sweep in sweeps if _moves(sweep)]
    there_and_back = [sweep for sweep in moving if isinstance(sweep, TrapezoidCommand)]
    if there_and_back:  # one joint alone, from rest to rest: all its cycles last equally long
        (sweep,) = there_and_back
        return PlannedCycles(sweep.cycles / motion_s, 0.0, sweep.cycles, motion_s)
    waves = [sweep for sweep in moving if not isinstance(sweep, TrapezoidCommand)]
    frequency = common_frequency([wave.frequency for wave in waves]) if waves else None
    if frequency is None:
        return None
    begin = max(wave.ramp_cycles / wave.frequency for wave in waves)
    end = min((wave.cycles + wave.ramp_cycles) / wave.frequency for wave in waves)
    first = math.ceil(begin * frequency - ROUNDING)
    count = math.floor(end * frequency + ROUNDING) - first
    return PlannedCycles(frequency, first / frequency, count, motion_s) if count > 0 else None


def common_frequency(frequencies: Sequence[float]) -> float | None:
    """The highest frequency of which all are whole multiples [Hz].

    Args:
        frequencies: At least one, above 0 [Hz].

    Returns:
        None where their ratios are no fractions.
    """
    lowest = min(frequencies)
    ratios = [
        Fraction(frequency / lowest).limit_denominator(HIGHEST_RATIO) for frequency in frequencies
    ]
    if any(
        abs(float(ratio) * lowest / own - 1) > LEAST_AGREEMENT
        for ratio, own in zip(ratios, frequencies, strict=True)
    ):
        return None
    return lowest / math.lcm(*(ratio.denominator for ratio in ratios))


def _moves(sweep: SineCommand | FourierCommand | TrapezoidCommand) -> bool:
    return any(sweep.amplitudes) if isinstance(sweep, FourierCommand) else sweep.amplitude != 0
