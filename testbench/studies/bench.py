"""What a study is given to work with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from testbench.clock import Clock


def _nothing(text: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class StudyBench:
    """The simulated bench of a study.

    Attributes:
        logs: Folder that its sessions are kept in. clock: Source of dates and run times. seed: Of the first part; the others
        take the numbers that follow. parts: How many sensors of the same kind. say: Called with what is being done.
    """

    logs: Path
    clock: Clock
    seed: int = 0
    parts: int = 5
    say: Callable[[str], None] = _nothing
