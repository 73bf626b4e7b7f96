"""What was written before findings had codes: plain sentences."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from testbench.records.findings.finding import Finding, Severity

_FINDING = TypeAdapter(Finding)

NOTED = "general.noted"
"""Code of a sentence that was written before there were codes."""


def sentences_to_findings(data: dict[str, Any], key: str) -> None:
    """Put findings in the place of sentences, in a mapping that was read from JSON.

    Args:
        data: Is changed; sentences that stand beside findings only repeat them and are dropped.
        key: Of the sentences, such as "notes".
    """
    sentences = data.pop(key, None)
    if isinstance(sentences, list) and "findings" not in data:
        data["findings"] = [
            {"code": NOTED, "severity": Severity.NOTE, "where": "", "sentence": sentence}
            for sentence in sentences
        ]


def read_again(written: dict[str, Any]) -> Finding:
    """A finding as a file has it, in the words of the version that wrote it."""
    return _FINDING.validate_python(written)
