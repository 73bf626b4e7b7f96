"""Raw counts of 16-bit sensors: how many are one unit, seen by gravity at rest and by the turns.

Counts are a hint and never an answer: other makers' parts have other sensitivities, so that a
person states the scale.
"""

from __future__ import annotations

from collections.abc import Collection

from testbench.consistency.evidence import Evidence
from testbench.formats.tables.units import find_unit, unit_names

COUNTS_PER_G = (16384.0, 8192.0, 4096.0, 2048.0)
"""Ranges of 2, 4, 8 and 16 g (InvenSense PS-MPU-6000A-00 rev. 3.4, section 6.2)."""
COUNTS_PER_DEG_S = (131.0, 65.5, 32.8, 16.4)
"""Ranges of 250, 500, 1000 and 2000 deg/s (the same, section 6.1)."""
COUNTS_WITHIN = 0.12
"""Part by which |acc| at rest may differ: 3 % of scale, 80 mg of bias (the same, section 6.2)."""
UNIT_OF_COUNTS = {"acc": "g", "gyr": "deg/s"}


def counts_per_unit(quantity: str, evidence: Evidence) -> float | None:
    """Counts that are one g, or one deg/s; None where the numbers look like no such counts.

    Args:
        quantity: "acc" or "gyr".
        evidence: Of the numbers as they are.
    """
    if quantity == "acc":
        norm = evidence.rest_norm
        return None if norm is None else _nearest(norm, COUNTS_PER_G)
    found = evidence.unit_of_rate(rate_factors())
    return None if found is None or found in unit_names("gyr") else float(found)


def rate_factors() -> dict[str, float]:
    """rad/s that one of each unit is, and one count of each range, by its counts to one deg/s.

    Units alone would leave counts to the unit that is least wrong.
    """
    units = {name: find_unit("gyr", name).factor for name in unit_names("gyr")}
    degree = find_unit("gyr", "deg/s").factor
    return units | {f"{counts:g}": degree / counts for counts in COUNTS_PER_DEG_S}


def _nearest(norm: float, among: Collection[float]) -> float | None:
    return next((counts for counts in among if abs(norm / counts - 1) < COUNTS_WITHIN), None)


def counts_hint(quantity: str, evidence: Evidence) -> str:
    """What to say of numbers that look like raw counts; "" where they do not."""
    counts = counts_per_unit(quantity, evidence)
    if counts is None:
        return ""
    unit = UNIT_OF_COUNTS[quantity]
    return (
        f" They look like raw counts, {counts:g} to one {unit}: if the data sheet says so, a "
        f"mapping states {quantity}.unit: {unit} and {quantity}.scale: {1 / counts:.8g}; "
        "`testbench import --guess FILE` writes it."
    )
