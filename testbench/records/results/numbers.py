"""Numbers as people read them."""

from __future__ import annotations

from math import isfinite

MOST_DECIMALS = 9


def show_number(value: float) -> str:
    """Three decimals below 100, fewer above, and a plain 0 for what rounds to it."""
    magnitude = abs(value)
    if magnitude < 1e-9:
        return "0.000"
    if magnitude >= 1e6 or magnitude < 5e-4:
        return f"{value:.2g}"
    return (
        f"{value:.3f}"
        if magnitude < 100
        else f"{value:.1f}"
        if magnitude < 10_000
        else f"{value:.0f}"
    )


def decimals_by(sd: float | None) -> int | None:
    """Decimals that show a value to the second significant digit of its standard uncertainty.

    None where that is unknown, or too small to be written out.
    """
    if sd is None or not isfinite(sd) or sd <= 0:
        return None
    decimals = max(1 - exponent_of(sd), 0)
    return decimals if decimals <= MOST_DECIMALS else None


def exponent_of(value: float) -> int:
    """Power of ten of a number that is rounded to two significant digits: 0 of 9.94, 1 of 9.96."""
    return int(f"{value:.1e}".partition("e")[2])
