"""Tuning: the parameters of a filter that suit some sessions best, and how they were found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pydantic import Field

from testbench.exceptions import InputError
from testbench.records.disk.json_file import json_text
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.session.layout import imu_stream, table_file
from testbench.records.session.session import Session
from testbench.records.specs.strict import StrictModel, UtcText

Parameters = dict[str, float]


class SessionTuning(StrictModel):
    """What the parameters come to on one session."""

    session: str = Field(description="Its name.")
    fingerprint: str = Field(description="SHA-256 of its manifest.")
    samples: dict[str, str] = Field(description="SHA-256 of the raw samples of each sensor.")
    role: Literal["tuning", "test"] = Field(
        description="Whether it chose the parameters, or only shows what they are worth."
    )
    default_value: float | None = Field(
        description="Objective by what the search began with; null: the filter failed."
    )
    value: float | None = Field(description="Objective by the one set for all.")
    own_parameters: Parameters | None = Field(
        default=None, description="Best for this session alone; null for a test."
    )
    own_value: float | None = Field(default=None, description="Objective by them.")
    left_out_parameters: Parameters | None = Field(
        default=None, description="Best for all other tuning sessions."
    )
    left_out_value: float | None = Field(
        default=None, description="Objective by them: this session as a test."
    )

    def is_recording_of(self, other: SessionTuning) -> bool:
        """Whether both are the same recording, be it renamed or analysed in another way."""
        return self.fingerprint == other.fingerprint or bool(
            set(self.samples.values()) & set(other.samples.values())
        )


class Split(StrictModel):
    """How the sessions were divided; always whole sessions."""

    method: Literal["given", "seeded", "none"] = Field(
        description="By the user, drawn, or nothing held out."
    )
    seed: int | None = Field(default=None, description="Of the draw.")
    leave_one_out: bool = Field(
        default=False, description="Whether each tuning session was also a test of the others' set."
    )


class GridPoint(StrictModel):
    """One point of the grid."""

    parameters: Parameters = Field(description="Those tuned.")
    values: list[float | None] = Field(
        description="Objective on each tuning session, in their order; null: it failed."
    )


class Search(StrictModel):
    """How the optimum was looked for."""

    design: Literal["every combination", "one parameter after the other"] = Field(
        description="Of the grid."
    )
    grid: dict[str, list[float]] = Field(description="Values of each tuned parameter.")
    points: list[GridPoint] = Field(description="What they came to; of the set for all sessions.")
    refinement: Literal["nelder-mead", "none"] = Field(description="After the grid.")
    evaluations: int = Field(
        description="Sets of parameters tried on all tuning sessions, grid and refinement."
    )
    converged: bool = Field(description="Whether the refinement came to rest.")


class Tuning(StrictModel):
    """The content of a tuning file."""

    schema_version: Literal[1] = Field(description="1.")
    tuned_utc: UtcText = Field(description="When, ISO 8601.")
    software: dict[str, str] = Field(description="Versions that did it.")
    filter: str = Field(description="Which filter.")
    filter_source: str = Field(
        default="", description="Where it came from, if it is none of the bench's own."
    )
    objective: str = Field(description="The metric that was made small, as evaluate spells it.")
    unit: str = Field(description="Of the metric.")
    comparison: str | None = Field(
        default=None,
        description="Filter, such as device, that took the place of the truth: the values are "
        "differences from it and no errors. null: a truth judged.",
    )
    tuned: list[str] = Field(
        description="Parameters that were tuned; the others kept their defaults, or what was set."
    )
    parameters: Parameters = Field(description="The one set for all sessions, whole.")
    value: float = Field(description="Mean of the objective over the tuning sessions by that set.")
    default_value: float | None = Field(
        description="By what the search began with: the defaults, or what was set."
    )
    at_edge: list[str] = Field(
        description="Tuned parameters whose best value is an end of their range."
    )
    search: Search
    split: Split
    sessions: list[SessionTuning] = Field(
        min_length=1, description="Every session, tuning and test."
    )

    def of_role(self, role: Literal["tuning", "test"]) -> list[SessionTuning]:
        """The sessions of one kind."""
        return [entry for entry in self.sessions if entry.role == role]

    def used_on(self, session: Session, replaced: Sequence[str] | None = None) -> UsedTuning:
        """What is said of a session's estimate that uses these parameters.

        Args:
            session: The recording.
            replaced: Names of those that a person set to other values.
        """
        own = describe(session, "test")
        return UsedTuning(
            self.objective,
            self.tuned_utc,
            self.software.get("imu-testbench", ""),
            [name for name in self.tuned if name not in (replaced or ())],
            [entry.session for entry in self.of_role("tuning")],
            any(entry.is_recording_of(own) for entry in self.of_role("tuning")),
            self.comparison,
        )

    def save(self, file: Path) -> None:
        """Write it.

        Raises:
            InputError: The file exists already, or cannot be written.
        """
        refuse_file(file)
        with stored_where_asked(file):
            write_text(file, json_text(self.model_dump()), anew=True)


@dataclass(frozen=True)
class UsedTuning:
    """That a filter ran with tuned parameters.

    Attributes:
        objective: What they were tuned for.
        tuned_utc: When.
        software: Version of the bench that tuned them.
        tuned: Names of the parameters.
        tuned_on: Names of the sessions.
        on_this_session: Whether this recording was among them, under any name.
        comparison: Filter that took the place of the truth; None where a truth judged.
    """

    objective: str
    tuned_utc: str
    software: str
    tuned: list[str] = field(default_factory=list)
    tuned_on: list[str] = field(default_factory=list)
    on_this_session: bool = False
    comparison: str | None = None


def describe(session: Session, role: Literal["tuning", "test"]) -> SessionTuning:
    """A session by what tells it from others, not judged yet."""
    files = session.manifest.files
    samples = {
        name: files[file]
        for name in session.sensor_names
        if (file := table_file(imu_stream(name))) in files
    }
    return SessionTuning(
        session=session.name,
        fingerprint=session.fingerprint,
        samples=samples,
        role=role,
        default_value=None,
        value=None,
    )


def refuse_repeated(sessions: Sequence[SessionTuning]) -> None:
    """Refuse one recording that stands in a list twice, under whatever name or role.

    Raises:
        InputError: It does.
    """
    for i, entry in enumerate(sessions):
        for other in sessions[:i]:
            if entry.is_recording_of(other):
                names = (
                    entry.session
                    if entry.session == other.session
                    else f"{other.session} and {entry.session}"
                )
                what = (
                    "given twice"
                    if entry.role == other.role
                    else "given for tuning and for the test"
                )
                raise InputError(
                    f"{names}: one recording is {what}; what was tuned on cannot test the result"
                )


def refuse_file(file: Path) -> None:
    """Refuse a place that a tuning cannot be written to.

    Raises:
        InputError: Why not.
    """
    if file.suffix != ".json":
        raise InputError(f"{file}: a tuning is a .json file")
    if file.exists():
        raise InputError(f"{file} exists already; tunings are kept, not replaced")
    if not file.parent.is_dir():
        raise InputError(f"{file} cannot be written: there is no folder {file.parent}")


def load_tunings(files: Iterable[Path] | None) -> list[Tuning]:
    """Read tuning files.

    Raises:
        FileProblems: One is missing or malformed; every problem at once.
    """
    return [load_yaml(file, Tuning).value for file in files or []]  # JSON is YAML
