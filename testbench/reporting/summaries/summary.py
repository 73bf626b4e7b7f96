"""What a summary says, whatever it is written as."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Case:
    """One thing that was asked, and its outcome, as build servers count them.

    Attributes:
        name: Of it.
        outcome: "skipped" where it could not be told and nothing is broken.
        message: Why, in a sentence.
    """

    name: str
    outcome: Literal["passed", "failed", "skipped"]
    message: str


@dataclass(frozen=True)
class Summary:
    """What was found, in short.

    Attributes:
        title: What was looked at.
        verdict: In a few words.
        sentences: The answer.
        columns: Of its table.
        rows: As many cells each as there are columns.
        cases: What was asked.
        facts: Names and values.
        started: ISO 8601, or "" where nobody knows.
        seconds: How long the recording took.
    """

    title: str
    verdict: str
    sentences: list[str]
    columns: list[str]
    rows: list[list[str]]
    cases: list[Case]
    facts: dict[str, str] = field(default_factory=dict)
    started: str = ""
    seconds: float = 0.0
