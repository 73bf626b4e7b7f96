"""Comparison of sessions: how much larger errors became from one side to the other, and whether
that is shown; docs/comparing.md explains it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from testbench.records.disk.json_file import plain_values
from testbench.records.disk.json_record import Number
from testbench.records.results.evaluation_rows import Interval

SCHEMA_VERSION = 1


class Told(StrEnum):
    """What may be said of a difference."""

    WORSE = "worse"
    BETTER = "better"
    NOT_SHOWN = "not_shown"
    NOT_KNOWN = "not_known"

    @property
    def words(self) -> str:
        """For people."""
        return _WORDS[self]


_WORDS = {
    Told.WORSE: "worse",
    Told.BETTER: "better",
    Told.NOT_SHOWN: "no difference shown",
    Told.NOT_KNOWN: "not known",
}


@dataclass(frozen=True)
class ComparedSession:
    """A session of one side.

    Attributes:
        session: Its name.
        folder: Where it lies.
        part: What tells its sensors from those of another one; None where nothing does.
        recorded: When, ISO 8601; None where nobody knows.
    """

    session: str
    folder: str
    part: str | None
    recorded: str | None


@dataclass(frozen=True)
class Differing:
    """Something that is not the same on both sides.

    Attributes:
        what: For people, such as "firmware of forearm".
        base: What it is on the side that is compared with, each value once.
        new: What it is on the other side.
    """

    what: str
    base: list[str]
    new: list[str]


@dataclass(frozen=True)
class ComparedMetric:
    """A metric on both sides.

    Attributes:
        name: E.g. elbow.flexion_mean_abs_error_deg.
        filter: That it belongs to, or None.
        sequence: Label of the joint's definition that it belongs to, or None.
        section: That it belongs to, or None.
        unit: Of all values.
        base: Its value on the side that is compared with; over several sessions the geometric mean.
        new: The same of the other side.
        difference: New less base, of what was compared in pairs; positive where errors became
            larger.
        ci95: 95 % confidence interval of that; None where it is not known.
        standard_error: Of the difference; None likewise.
        freedom: Degrees of freedom of that.
        p: Of a difference of the margin showing as much, by itself.
        p_holm: That of no difference after Holm's correction for all metrics of the comparison, or
            `p` where that is larger; below 0.05 a difference is told.
        paired_by: "step", "cycle", "sample", "part", or "nothing" where both sides stand alone.
        told: What may be said.
        why: Why nothing is known, or what the difference is not of; None where all is said.
    """

    name: str
    filter: str | None
    sequence: str | None
    section: str | None
    unit: str
    base: Number
    new: Number
    difference: Number | None
    ci95: Interval
    standard_error: Number | None
    freedom: int
    p: Number | None
    p_holm: Number | None
    paired_by: str
    told: Told
    why: str | None = None

    @property
    def place(self) -> str:
        """Filter, sequence and section, for people."""
        return ", ".join(part for part in (self.filter, self.sequence, self.section) if part)


@dataclass(frozen=True)
class Overlay:
    """The errors of a metric over time on both sides, for a figure.

    Attributes:
        metric: Its place in the metrics of the comparison.
        errors: By side ("base", "new") and session: time since its start, shape (n,) [s], and error
            [deg], shape (n,), NaN where nothing is evaluated.
    """

    metric: int
    errors: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]


@dataclass(frozen=True)
class SessionComparison:
    """What a comparison of sessions came to.

    Attributes:
        base: Sessions that are compared with.
        new: The others.
        margin: A larger difference counts, in the unit of each metric.
        metrics: What was compared.
        differing: What is not the same on both sides.
        left_out: What was not compared, and why, in sentences.
        notes: What a reader must know, in sentences.
        simulated: What of the sessions was not real.
        overlays: Errors over time.
    """

    base: list[ComparedSession]
    new: list[ComparedSession]
    margin: float
    metrics: list[ComparedMetric]
    differing: list[Differing]
    left_out: list[str]
    notes: list[str]
    simulated: list[str]
    overlays: list[Overlay] = field(default_factory=list)

    def of(self, told: Told) -> list[ComparedMetric]:
        """The metrics of which so much may be said."""
        return [metric for metric in self.metrics if metric.told is told]

    @property
    def told(self) -> Told:
        """Of all metrics together: the worst that is shown of one."""
        found = {metric.told for metric in self.metrics}
        order = (Told.WORSE, Told.BETTER, Told.NOT_SHOWN)
        return next((own for own in order if own in found), Told.NOT_KNOWN)

    @property
    def regression(self) -> bool:
        """Whether an error was shown to have become larger."""
        return self.told is Told.WORSE

    @property
    def verdict(self) -> str:
        """In the words that terminal and report share, with its scope where that is not all."""
        known = len(self.metrics) - len(self.of(Told.NOT_KNOWN))
        scope = "" if known in (0, len(self.metrics)) else f", in {known} of {len(self.metrics)}"
        if self.told is Told.NOT_SHOWN:
            return f"{self.told.words}{scope}"
        return {Told.WORSE: "regression", Told.BETTER: "improvement"}.get(
            self.told, self.told.words
        )

    def to_dict(self) -> dict[str, Any]:
        """For JSON; without the errors over time."""
        kept = {key: value for key, value in vars(self).items() if key != "overlays"}
        head = {"schema_version": SCHEMA_VERSION, "outcome": self.told, "verdict": self.verdict}
        result: dict[str, Any] = plain_values(head | kept)
        return result
