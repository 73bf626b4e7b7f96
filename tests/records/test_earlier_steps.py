"""A session that goes on from another one says what of the plan lies there: on the terminal, and at
the top of the report.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import pytest

from testbench.evaluation import evaluate
from testbench.records.session.earlier_steps import MOST_NAMES, EarlierSteps, earlier_steps
from testbench.records.session.layout import PLAN
from testbench.records.session.session import RunStatus, Session
from testbench.reporting.report import render


@pytest.fixture
def resumed(quick, tmp_path):
    """The run `quick` as if it had been made in two sessions, and this were the second one."""

    def make(steps: list[int], **manifest) -> Session:
        folder = tmp_path / "second"
        shutil.copytree(quick.session.path, folder)
        file = folder / "manifest.json"
        data = (
            json.loads(file.read_text())
            | manifest
            | {"resumes": {"session": "first", "steps": steps}}
        )
        file.write_text(json.dumps(data))
        return Session(folder)

    return make


def test_the_steps_of_the_first_session_are_counted_and_named(quick, resumed):
    judged = [step for step in quick.session.steps if step.role == "evaluation"]
    there = judged[:2]
    session = resumed([step.index for step in quick.session.steps if step not in there])
    found = earlier_steps(session)
    assert found == EarlierSteps("first", [step.name for step in there], len(judged))
    said = (
        f"this session goes on from session first: 2 of {len(judged)} evaluated steps lie there "
        "and are not in these results"
    )
    notes = evaluate(session, quick.estimate).notes
    assert [said in note and there[1].name in note for note in notes].count(True) == 1
    head = render(session, None, None).partition("<main>")[0]
    assert said.replace("this", "This", 1) in head


def test_a_session_of_its_own_says_nothing(quick):
    assert earlier_steps(quick.session) is None
    assert not any("goes on from" in note for note in evaluate(quick.session, quick.estimate).notes)
    assert "goes on from" not in render(quick.session, None, None)


def test_many_steps_are_not_all_named():
    said = EarlierSteps("first", [f"pose {k}" for k in range(30)], 40).sentence
    assert (
        "30 of 40 evaluated steps" in said
        and f"pose {MOST_NAMES - 1}; and {30 - MOST_NAMES} more" in said
    )
    assert (
        EarlierSteps("first", [], 7).sentence
        == "goes on from session first, and has all 7 evaluated steps itself"
    )


def test_a_plan_that_is_gone_or_damaged_is_passed_over(resumed):
    session = resumed([0, 1])
    (session.path / PLAN).write_bytes(b"PAR1")
    assert earlier_steps(session) is None
    Path(session.path / PLAN).unlink()
    assert earlier_steps(session) is None


@pytest.mark.parametrize(
    ("status", "said"),
    [
        ("error", "the run ended in an error: a cable"),
        ("interrupted", "the run was interrupted: a cable"),
        ("aborted", "the run was aborted: a cable"),
    ],
)
def test_how_a_run_ended_reads_as_a_sentence(quick, resumed, status, said):
    session = resumed([], status=status, message="a cable")
    assert session.status is RunStatus(status)
    assert said in evaluate(session, dataclasses.replace(quick.estimate, joints={})).notes
