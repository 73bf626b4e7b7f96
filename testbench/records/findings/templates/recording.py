"""Findings on devices while they are recorded."""

from __future__ import annotations

from testbench.records.findings.templates.template import WARNING, Template

TEMPLATES = {
    "device.silent": Template(WARNING, "no samples; it sent nothing"),
    "device.unreadable": Template(
        WARNING, "no samples; {refused} lines or packets came that do not fit its format"
    ),
    "device.rate": Template(
        WARNING, "{rate_hz:.1f} samples in a second arrived, {expected_hz:g} were expected"
    ),
    "device.malformed": Template(WARNING, "{refused} lines or packets did not fit its format"),
    "device.dropped": Template(
        WARNING,
        "{dropped} {dropped:sample was|samples were} dropped because this machine was too slow",
    ),
}
