"""Summaries in Markdown and JUnit XML say what was found, and no more."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import pytest

from testbench.records.results.evaluation import Outcome
from testbench.reporting.summaries.junit import junit_text
from testbench.reporting.summaries.markdown import markdown_text
from testbench.reporting.summaries.of_session import session_summary
from testbench.reporting.summaries.summary import Case, Summary

SUMMARY = Summary(
    title="quick",
    verdict="fail",
    sentences=["One | of <two>."],
    columns=["metric", "outcome"],
    rows=[["a_b|c", "fail"], ["`x`", "pass"]],
    cases=[
        Case("a [vqf_6d]", "failed", "2 deg; limit at most 1 deg: fail"),
        Case("b", "passed", "ok"),
        Case("c", "skipped", "not known: \x07"),
    ],
    facts={"session": "s"},
    started="2026-12-01T10:00:00.123+00:00",
    seconds=24.5,
)


def test_junit_counts_its_cases() -> None:
    suites = ElementTree.fromstring(junit_text(SUMMARY))
    (suite,) = suites
    assert suites.tag == "testsuites"
    counts = {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "3", "failures": "1", "errors": "0", "skipped": "1"}
    assert suite.get("timestamp") == "2026-12-01T10:00:00"
    cases = suite.findall("testcase")
    assert [case.get("name") for case in cases] == ["a [vqf_6d]", "b", "c"]
    assert [case.get("classname") for case in cases] == ["quick"] * 3
    assert cases[0].find("failure").get("message") == "2 deg; limit at most 1 deg: fail"
    assert cases[1].find("failure") is None
    assert cases[2].find("skipped").get("message") == "not known: ?"


ALLOWED = {
    "testsuites": ({"name", "time", "tests", "failures", "errors"}, {"testsuite"}),
    "testsuite": (
        {"name", "tests", "failures", "errors", "skipped", "time", "timestamp"},
        {"properties", "testcase", "system-out"},
    ),
    "properties": (set(), {"property"}),
    "property": ({"name", "value"}, set()),
    "testcase": ({"name", "time", "classname"}, {"failure", "skipped", "system-out"}),
    "failure": ({"type", "message"}, set()),
    "skipped": ({"type", "message"}, set()),
    "system-out": (set(), set()),
}
"""Attributes and children of each element, of those that junit-10.xsd of Jenkins' xUnit plugin has,
the strictest of the schemas in use.
"""


def test_junit_holds_nothing_that_its_strictest_reader_refuses() -> None:
    for element in ElementTree.fromstring(junit_text(SUMMARY)).iter():
        attributes, children = ALLOWED[element.tag]
        assert set(element.keys()) <= attributes, element.tag
        assert {child.tag for child in element} <= children, element.tag


def test_markdown_is_a_table_whose_cells_stay_cells() -> None:
    lines = markdown_text(SUMMARY).splitlines()
    assert lines[0] == "### quick: fail"
    assert "- One \\| of \\<two\\>." in lines
    table = [line for line in lines if line.startswith("|")]
    assert table[:2] == ["| metric | outcome |", "| --- | --- |"]
    assert table[2] == "| a_b\\|c | fail |"
    assert table[3] == "| \\`x\\` | pass |"


def test_a_session_has_a_case_for_each_limit(quick) -> None:
    summary = session_summary(quick.session, quick.evaluation)
    limited = [m for m in quick.evaluation.metrics if m.outcome is not None]
    assert len(summary.cases) == len(summary.rows) == len(limited)
    assert summary.title == "quick"
    assert summary.verdict == quick.evaluation.verdict
    assert summary.facts["simulated"] == "arm and sensors"
    assert summary.seconds == pytest.approx(quick.session.manifest.duration_s)
    assert quick.evaluation.headline == summary.sentences[0]


@pytest.mark.parametrize(
    ("outcome", "counted"),
    [
        (Outcome.PASS, "passed"),
        (Outcome.MARGINAL, "passed"),
        (Outcome.FAIL, "failed"),
        (Outcome.NOT_MEASURED, "failed"),
    ],
)
def test_cases_follow_the_exit_code(quick, outcome, counted) -> None:
    """Only what makes the command end with 1 is a failure."""
    metrics = [
        replace(m, outcome=None if m.outcome is None else outcome) for m in quick.evaluation.metrics
    ]
    summary = session_summary(quick.session, replace(quick.evaluation, metrics=metrics))
    assert {case.outcome for case in summary.cases} == {counted}


def test_without_limits_nothing_is_passed(quick) -> None:
    metrics = [replace(m, outcome=None) for m in quick.evaluation.metrics]
    evaluation = replace(quick.evaluation, metrics=metrics, outcome=Outcome.NOT_MEASURED)
    (case,) = session_summary(quick.session, evaluation).cases
    assert case.outcome == "skipped"
    assert "No limits were stated" in case.message
