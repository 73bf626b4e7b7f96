"""Who looks on while a request is carried out, and what a person allows.

They live, so they are no part of a request.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.clock import Clock, SystemClock

if TYPE_CHECKING:
    from testbench.execution.run_progress import Progress
    from testbench.pipeline.prepared import Prepared


def nothing(*_: object) -> None:
    """Take no notice."""


@dataclass(frozen=True)
class Consent:
    """What a person allows a real arm to do, in this one run.

    It is no part of a request: a request may be kept and carried out again, and then nobody has
    looked.

    Attributes:
        motion: Somebody wants the arm to move; without it a run is shown, and refused.
        hazards_checked: The physical hazards were looked at; they are not asked for.
        ask: Shows a sentence to a person beside the arm, and says whether it was confirmed; None
            where there is nobody to ask.
        asked: Where it asks, for the manifest.
    """

    motion: bool = False
    hazards_checked: bool = False
    ask: Callable[[str], bool] | None = None
    asked: str = "asked on the terminal"


@dataclass(frozen=True)
class Watcher:
    """Who looks on while a request is carried out, and the clock that it goes by.

    Attributes:
        clock: Source of dates and of the rhythm.
        prepared: Told what will be done, before anything is: what it raises stops the run.
        motion: Told the whole motion of a real arm, before a person is asked to allow it.
        progress: Told after every reading how far a run is.
        say: Told, a line at a time, what a person beside the arm must know.
        notify: Told what a person must know of the arm, once it is connected, or which devices are.
        keys: Listen to the keyboard: p pauses, r resumes, q stops.
        consent: What a person allows.
        opened: Told the folder of the session once it is one, before anything moves; what it does
            must be quick.
    """

    clock: Clock = field(default_factory=SystemClock)
    prepared: Callable[[Prepared], None] = nothing
    motion: Callable[[Prepared], None] = nothing
    progress: Callable[[Progress], None] | None = None
    say: Callable[[str], None] = nothing
    notify: Callable[[str], None] = nothing
    keys: bool = False
    consent: Consent = Consent()
    opened: Callable[[Path], object] = nothing
