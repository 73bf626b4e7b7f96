"""Findings: one record, its sentence by one template a code."""

from __future__ import annotations

import json
from string import Formatter

import pytest

from testbench.records.findings.catalogue import SUBJECTS, TEMPLATES, finding, of_filters_together
from testbench.records.findings.earlier import sentences_to_findings
from testbench.records.findings.finding import Severity, told_once
from testbench.records.findings.templates import derived, orientations, truth, units
from tests.house import ROOT, files


def test_every_code_stands_once_and_names_its_subject() -> None:
    codes = [code for part in SUBJECTS for code in part]
    assert len(codes) == len(set(codes)) == len(TEMPLATES)
    assert all(code.count(".") == 1 and all(code.split(".")) for code in codes)


@pytest.mark.parametrize("code", sorted(TEMPLATES))
def test_every_template_is_a_sentence_of_named_values(code) -> None:
    template = TEMPLATES[code]
    for text in (template.seen, template.means, template.remedy):
        names = [name for _, name, _, _ in Formatter().parse(text) if name is not None]
        assert all(name.isidentifier() for name in names)
        assert text == text.strip() and not text.endswith(".")
    assert template.seen


def test_a_finding_says_where_what_and_keeps_its_values() -> None:
    found = finding("judged.samples_left_out", "hand", count=3, reason="stuck")
    assert str(found) == "hand: 3 samples left out: stuck"
    assert found.values == {"count": 3, "reason": "stuck"}
    assert found.severity is Severity.WARNING
    assert found.at("elsewhere") is found
    assert str(finding("clock.unfitted").at("hand")).startswith("hand: its clock could not be")


def test_a_value_that_the_template_names_must_be_given() -> None:
    with pytest.raises(KeyError):
        finding("judged.samples_left_out", "hand", count=3)


def test_lines_that_repeat_themselves_are_told_once() -> None:
    one = finding("date.unknown")
    assert told_once([one, finding("clock.unfitted"), one]) == [one, finding("clock.unfitted")]


def test_sentences_of_earlier_versions_become_findings() -> None:
    data = json.loads('{"notes": ["a", "b"]}')
    sentences_to_findings(data, "notes")
    assert [own["sentence"] for own in data["findings"]] == ["a", "b"] and "notes" not in data
    both = {"notes": ["a"], "findings": []}
    sentences_to_findings(both, "notes")
    assert both == {"findings": []}


def test_every_code_is_told_somewhere() -> None:
    rooms = [file for file in files("testbench") if "templates" not in file.parts]
    source = "\n".join(file.read_text(encoding="utf-8") for file in rooms)
    # those of consistency are put together from the quantity and what is wrong with it
    whole = {code for code in TEMPLATES if not code.startswith("consistency.")}
    assert not [code for code in whole if f'"{code}"' not in source]


def test_subjects_and_assumptions_stand_in_the_docs() -> None:
    pages = {
        name: (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
        for name in ("session_format", "formats")
    }
    findings = pages["session_format"].partition("\n## Findings")[2]
    subjects = {code.partition(".")[0] for code in TEMPLATES}
    assert not [subject for subject in subjects if f"`{subject}`" not in findings]
    assumed = [derived, orientations, truth, units]
    codes = [code for part in assumed for code in part.TEMPLATES]
    assert not [code for code in codes if f"`{code}`" not in pages["formats"]]


def test_what_holds_for_several_filters_is_said_once() -> None:
    one, two, other = (
        finding("joint.not_computed", filter=key, why=why)
        for key, why in (("vqf_6d", "no rest"), ("fusion", "no rest"), ("ekf", "no motion"))
    )
    first, second = of_filters_together([one, other, two])
    assert first.sentence.startswith("vqf_6d, fusion: ") and second == other
    assert of_filters_together([one, one]) == [one, one]


@pytest.mark.parametrize(("count", "said"), [(1, "1 stride is"), (2, "2 strides are")])
def test_a_word_goes_with_its_number(count, said) -> None:
    assert finding("gait.usual", count=count, why="it turns").sentence.startswith(said)
