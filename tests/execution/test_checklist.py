"""The look at the hazards: every question is answered by itself."""

from __future__ import annotations

import io
import os

import pytest

from testbench.cli.running import consent_of
from testbench.exceptions import ArmRefused
from testbench.execution.checklist import HAZARDS, confirm_hazards


class Person(io.StringIO):
    """Reads the questions on a terminal, and types an answer once each of them stands there.

    Args:
        keys: The other end of the terminal.
        answers: One for each question.
    """

    def __init__(self, keys: int, answers: list[str]):
        super().__init__()
        self.keys, self.answers = keys, answers

    def flush(self) -> None:
        if self.getvalue().endswith("[y/N] "):
            os.write(self.keys, f"{self.answers.pop(0)}\n".encode())


@pytest.fixture
def keys(monkeypatch):
    """The keys of a terminal, which is the standard input."""
    end, other = os.openpty()
    with os.fdopen(other, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield end
    os.close(end)


def test_what_was_typed_before_a_question_is_no_answer_to_it(keys, monkeypatch):
    os.write(keys, b"y\n" * len(HAZARDS))
    person = Person(keys, ["n"])
    monkeypatch.setattr("sys.stderr", person)
    with pytest.raises(ArmRefused, match="the hazard 'area' was not confirmed"):
        confirm_hazards(consent_of(True, False).ask)
    assert person.getvalue().count("[y/N]") == 1


def test_answers_typed_in_advance_to_later_questions_are_not_taken_either(keys, monkeypatch):
    person = Person(keys, ["y\ny\ny\ny\ny\ny\ny", "n"])
    monkeypatch.setattr("sys.stderr", person)
    with pytest.raises(ArmRefused, match="the hazard 'emergency_stop' was not confirmed"):
        confirm_hazards(consent_of(True, False).ask)


def test_a_person_who_answers_every_question_confirms_them_all(keys, monkeypatch):
    monkeypatch.setattr("sys.stderr", Person(keys, ["y"] * len(HAZARDS)))
    assert confirm_hazards(consent_of(True, False).ask) == {
        "confirmed": list(HAZARDS),
        "sentences": list(HAZARDS.values()),
    }
    assert consent_of(True, False).asked == "asked on the terminal"
