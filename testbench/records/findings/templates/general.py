"""Sentences of sessions that were written before findings had codes."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, Template

TEMPLATES = {
    "general.noted": Template(NOTE, "{text}"),
}
