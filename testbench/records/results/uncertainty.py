"""Uncertainty budgets: how far the truth behind an error may itself be off (JCGM 100:2008)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from testbench.records.disk.json_record import Number

Kind = Literal["A", "B"]
LEVEL = 0.95
"""That every expanded uncertainty is stated for: k is Student's t for the effective degrees of
freedom (JCGM 100:2008, G.4.1).
"""


@dataclass(frozen=True)
class UncertaintySource:
    """One line of a budget.

    Attributes:
        source: What may be off.
        kind: "A" from the recording's own scatter, "B" from elsewhere (JCGM 100:2008, 4.2 and 4.3).
        value: As its source states it.
        unit: Of the value.
        distribution: That the value is taken to have, such as "normal" or "rectangular".
        divisor: What makes a standard uncertainty of the value.
        standard_uncertainty: value / divisor, in the same unit.
        sensitivity: Change of the mean error for a change of one unit of the source [deg/unit];
            smaller where it averages.
        contribution_deg: |sensitivity| times standard uncertainty: its part of the mean error's
            standard uncertainty.
        magnitude_deg: Its part in the standard uncertainty of mean magnitudes, RMS and largest
            errors, which do not cancel: an upper bound.
        degrees_of_freedom: None for infinitely many.
        why: Where the value comes from, and why it counts or does not.
        rests_on: What several lines have their value from, so that they are too small together or
            not at all; "" for a line by itself.
    """

    source: str
    kind: Kind
    value: Number
    unit: str
    distribution: str
    divisor: Number
    standard_uncertainty: Number
    sensitivity: Number
    contribution_deg: Number
    magnitude_deg: Number
    degrees_of_freedom: float | None
    why: str
    rests_on: str = ""


@dataclass(frozen=True)
class UncertaintyBudget:
    """The uncertainty of the truth behind one reported mean error; degrees.

    Attributes:
        owner: Joint of the protocol, joint of the arm, or sensor.
        quantity: "flexion", "angle" (of the arm's joint), "total", "heading" or "inclination".
        section: Of a joint's poses or sweeps; None for a sensor, which is evaluated over the whole
            session.
        sources: The lines.
        complete: Whether every source is known; where not, nothing below is stated.
        combined_deg: Combined standard uncertainty of the signed mean.
        combined_magnitude_deg: Combined standard uncertainty of magnitudes.
        degrees_of_freedom: Effective, of the signed mean (Welch-Satterthwaite); None for infinitely
            many.
        coverage_factor: k of the signed mean, for 95 %.
        expanded_deg: k times the combined uncertainty of the signed mean.
        expanded_magnitude_deg: k times the combined uncertainty of magnitudes.
        notes: What is missing.
        coverage_factor_magnitude: k of magnitudes, for 95 %; None where nothing is stated.
        assumed: What was taken where nobody said.
    """

    owner: str
    quantity: str
    section: str | None
    sources: list[UncertaintySource]
    complete: bool
    combined_deg: float | None
    combined_magnitude_deg: float | None
    degrees_of_freedom: float | None
    coverage_factor: float | None
    expanded_deg: float | None
    expanded_magnitude_deg: float | None
    notes: list[str] = field(default_factory=list)
    coverage_factor_magnitude: float | None = None
    assumed: list[str] = field(default_factory=list)
