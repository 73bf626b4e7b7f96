"""How a run is made: the same record for every arm, simulated or real."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.clock import Clock
from testbench.drivers.session_time import Speed
from testbench.execution.run_progress import Progress
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Session


def nobody(what: object) -> None:
    """Nobody listens."""


@dataclass(frozen=True)
class RunOptions:
    """How a run is made.

    Attributes:
        logs: Folder that sessions are made in.
        seed: Of every random number of a simulated arm and of simulated sensors; the same seed
            gives the same raw files.
        speed: Of a simulated arm: "fast": virtual time as fast as the machine goes; "realtime": a
            second a second.
        clock: Source of the date, and of the rhythm of whatever is simulated; the machine's if
            None.
        session_name: Name of the session's folder; time and protocol if None.
        resumed: Go on with this session of a simulated arm, of the same plan and seed: the
            simulation runs again from its beginning, and what the session lacks is recorded.
        steps: Those that an arm in its own time does; all if None.
        checklist: What was confirmed before a real arm moves.
        resumes: Session and steps that this run goes on with, in a session of its own.
        analysis_request: How the session is to be analysed, as JSON, for the manifest: for whoever
            goes on with the run.
        keys: Listen to the keyboard: p pauses, r resumes, q stops.
        progress: Told after every reading how far the run is.
        notify: Told what a person must know of the arm, once it is connected.
        say: Told, a line at a time, what a person beside the arm must know.
        opened: Told the folder of the session once it is one.
    """

    logs: str | Path = "logs"
    seed: int = 0
    speed: Speed = "fast"
    clock: Clock | None = None
    session_name: str | None = None
    resumed: Session | None = None
    steps: list[PlannedStep] | None = None
    checklist: dict[str, Any] | None = None
    resumes: dict[str, Any] | None = None
    analysis_request: Mapping[str, Any] = field(default_factory=dict)
    keys: bool = False
    progress: Callable[[Progress], None] | None = None
    notify: Callable[[str], None] = nobody
    say: Callable[[str], None] = nobody
    opened: Callable[[Path], object] = nobody
