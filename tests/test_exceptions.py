"""Errors that another process raised say here what they said there."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor

import pytest

from testbench.exceptions import (
    BenchError,
    Excess,
    FileProblems,
    LimitError,
    NotFoundError,
    Problem,
    SessionError,
)
from tests.processes import FORKS

EXCESS = Excess("wrist_3_joint", "position", 400.0, 360.0, "deg", 1.5, "out", 410.0)


def errors() -> list[BenchError]:
    named = LimitError(EXCESS)
    named.place = "elbow.yaml:12"
    noted = SessionError("it is being written")
    noted.add_note("try again")
    return [
        FileProblems("a.yaml", [Problem("is no number", "steps.0", 3, 7), Problem("is missing")]),
        NotFoundError("robot", "ur4", ["ur3e"]),
        named,
        noted,
    ]


@pytest.mark.parametrize("error", errors(), ids=lambda error: type(error).__name__)
def test_an_error_is_the_same_after_a_pipe(error: BenchError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error) and str(again) == str(error)
    assert again.__dict__ == error.__dict__ and again.exit_code == error.exit_code


def refuse() -> None:
    raise FileProblems("a.yaml", [Problem("is no number", "steps.0", 3, 7)])


def test_a_pool_hands_a_refusal_on() -> None:
    with (
        ProcessPoolExecutor(1, mp_context=FORKS) as pool,
        pytest.raises(FileProblems, match=r"a\.yaml:3:7: steps\.0: is no number"),
    ):
        pool.submit(refuse).result()
