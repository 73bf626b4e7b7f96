"""Findings on a session as a whole."""

from __future__ import annotations

from testbench.records.findings.words.template import NOTE, Template

TEMPLATES = {
    "general.noted": Template(NOTE, "{text}"),
}
