"""Findings as the sentences that people read."""

from __future__ import annotations

from collections.abc import Iterable

from testbench.records.findings.finding import Finding


def told(findings: Iterable[Finding]) -> list[str]:
    """One sentence a finding."""
    return [str(finding) for finding in findings]
