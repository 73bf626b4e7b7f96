"""Findings as the report says them."""

from __future__ import annotations

from collections.abc import Iterable

from testbench.records.findings.finding import Finding
from testbench.reporting.page.page import Sentence


def finding_sentences(findings: Iterable[Finding]) -> list[Sentence]:
    """One sentence a finding: how much it weighs, where, what is seen and means, what to do."""
    return [Sentence(_sentence(finding), finding.severity) for finding in findings]


def _sentence(finding: Finding) -> str:
    place = f"{finding.where}: " if finding.where else ""
    said = f"{finding.severity.capitalize()}: {place}{finding.sentence.rstrip('.')}."
    return f"{said} What to do: {finding.remedy.rstrip('.')}." if finding.remedy else said
