"""The catalogue of findings: one template a code, so that a sentence is written in one place."""

from __future__ import annotations

from collections.abc import Iterable
from string import Formatter
from typing import Any

from testbench.records.findings.finding import Finding, Value
from testbench.records.findings.templates import (
    alignment,
    calibration,
    consistency,
    derived,
    estimation,
    evaluation,
    gait,
    general,
    orientations,
    recording,
    samples,
    structure,
    time,
    tracking,
    truth,
    units,
)
from testbench.records.findings.templates.template import Template

SUBJECTS: tuple[dict[str, Template], ...] = (
    general.TEMPLATES,
    alignment.TEMPLATES,
    calibration.TEMPLATES,
    consistency.TEMPLATES,
    derived.TEMPLATES,
    estimation.TEMPLATES,
    evaluation.TEMPLATES,
    orientations.TEMPLATES,
    gait.TEMPLATES,
    recording.TEMPLATES,
    samples.TEMPLATES,
    structure.TEMPLATES,
    time.TEMPLATES,
    tracking.TEMPLATES,
    truth.TEMPLATES,
    units.TEMPLATES,
)
"""The templates by subject, one module each."""
TEMPLATES: dict[str, Template] = {code: own for part in SUBJECTS for code, own in part.items()}


class _Words(Formatter):
    """`str.format`, and `{count:one|many}`: the word after a number, by whether that is 1."""

    def format_field(self, value: Any, format_spec: str) -> str:
        one, parted, many = format_spec.partition("|")
        if parted:
            return one if value == 1 else many
        return str(super().format_field(value, format_spec))


def finding(code: str, where: str = "", **values: Value) -> Finding:
    """A finding, its sentence by the template of its code.

    Args:
        code: Of the template.
        where: What it speaks of: a sensor, a joint, a file and line; "" for the whole session.
        values: What the template names; numbers in the unit that the name ends in.

    Raises:
        KeyError: No such template, or it names a value that is not given.
    """
    template = TEMPLATES[code]
    shown = {
        name: ", ".join(map(_apart, value)) if isinstance(value, list) else value
        for name, value in values.items()
    }
    words = _Words()
    parts = [words.format(text, **shown) for text in (template.seen, template.means)]
    sentence = " - ".join(part for part in parts if part)
    remedy = words.format(template.remedy, **shown)
    return Finding(code, template.severity, where, sentence, dict(values), remedy)


def of_filters_together(findings: Iterable[Finding]) -> list[Finding]:
    """The same, what holds alike for several filters said once, in the order of the first.

    Args:
        findings: Those whose value `filter` is a filter's name are put together.
    """
    alike: dict[str, list[Finding]] = {}
    for own in findings:
        others = {key: value for key, value in own.values.items() if key != "filter"}
        alike.setdefault(repr((own.code, own.where, others)), []).append(own)
    together = []
    for group in alike.values():
        names = list(dict.fromkeys(str(own.values.get("filter", "")) for own in group))
        first = group[0]
        if len(names) > 1:
            values = {**first.values, "filter": ", ".join(names)}
            together.append(finding(first.code, first.where, **values))
        else:
            together += group
    return together


def _apart(item: str) -> str:
    """One of a list; a map of axes, which has commas of its own, in braces."""
    return f"{{{item}}}" if item.startswith("x: ") else item
