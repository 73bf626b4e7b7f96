"""Template: the words of one code."""

from __future__ import annotations

from dataclasses import dataclass

from testbench.records.findings.templates.severity import Severity


@dataclass(frozen=True)
class Template:
    """The words of one code, with named values in braces as `str.format` takes them.

    Attributes:
        severity: How much such a finding weighs.
        seen: What is seen.
        means: What it means; "" where that is plain.
        remedy: How to say otherwise or mend it; "" where there is nothing to be done.
    """

    severity: Severity
    seen: str
    means: str = ""
    remedy: str = ""


NOTE, WARNING = Severity.NOTE, Severity.WARNING
