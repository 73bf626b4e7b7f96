"""Numbers as people read them."""

from __future__ import annotations


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
