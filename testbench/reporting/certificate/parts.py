"""What one kind of certificate says of its own; the rest is the same for all kinds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from testbench.records.results.calibration_file import FindingEntry
from testbench.records.results.certificate import Figure, ResultTable

DIGITS = 3
"""Of the numbers that figures are drawn from."""


@dataclass(frozen=True)
class Parts:
    """What one kind of certificate says of its own.

    Attributes:
        title: Of the document.
        summary: What was found, in sentences.
        procedure: How, in sentences.
        results: The tables.
        figures: Pictures of them.
        findings: What may change a conclusion.
        uncertainty: What the uncertainties hold, in sentences.
        references: What the results were held against, in sentences.
        not_claimed: What is not stated, in sentences.
        conformity: By which rule limits are kept, in sentences.
        untraceable: Why the results are traceable to nothing, whatever the laboratory states, a
            sentence; empty where its references may count.
    """

    title: str
    summary: list[str]
    procedure: list[str]
    results: list[ResultTable]
    figures: list[Figure]
    findings: list[FindingEntry]
    uncertainty: list[str]
    references: list[str]
    not_claimed: list[str]
    conformity: list[str] = field(default_factory=list)
    untraceable: str = ""


def shortened(values: Iterable[float]) -> list[float]:
    """Numbers for a picture, to three digits."""
    return [float(f"{value:.{DIGITS - 1}e}") for value in values]
