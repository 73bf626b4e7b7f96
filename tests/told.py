"""Findings as the sentences that people read."""

from __future__ import annotations

from collections.abc import Iterable

from testbench.records.findings.finding import Finding
from testbench.records.session.session import Session


def told(findings: Iterable[Finding]) -> list[str]:
    """One sentence a finding."""
    return [str(finding) for finding in findings]


def codes(session: Session) -> set[str]:
    """Codes of the findings of a session."""
    return {finding.code for finding in session.manifest.findings}
