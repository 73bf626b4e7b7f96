"""Finding: what is seen in the data, what it means, and how a person says otherwise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from testbench.records.findings.templates.severity import Severity

__all__ = ["Finding", "Severity", "Value", "told_once"]

Value = str | int | float | list[str]
"""A named value of a finding; numbers in the unit that the name ends in."""


@dataclass(frozen=True)
class Finding:
    """What was noticed, at one place.

    Attributes:
        code: Which template its sentence comes from, such as "time.unit"; the part before the point
            is its subject.
        severity: How much it weighs.
        where: What it speaks of: a sensor, a joint, a file and line; "" for the whole session.
        sentence: What is seen, and what it means.
        values: What the sentence names, by name; numbers in the unit that the name ends in.
        remedy: How to say otherwise, or how to mend it: a flag, a key, a command; "" where there is
            nothing to be done.
    """

    code: str
    severity: Severity
    where: str
    sentence: str
    values: dict[str, Value] = field(default_factory=dict)
    remedy: str = ""

    def __str__(self) -> str:
        """One line for people: where, what is seen and means, how to say otherwise."""
        place = f"{self.where}: " if self.where else ""
        return place + self.sentence + (f" - {self.remedy}" if self.remedy else "")

    def at(self, where: str) -> Finding:
        """The same, of a place; one that already says where stays as it is."""
        return self if self.where else replace(self, where=where)


def told_once(findings: Iterable[Finding]) -> list[Finding]:
    """The same without repetitions of a line, in their order."""
    return list({str(finding): finding for finding in findings}.values())
