"""Where a study is kept."""

from __future__ import annotations

from pathlib import Path

from testbench.clock import Clock
from testbench.exceptions import InputError


def new_folder(logs: Path, name: str, clock: Clock) -> Path:
    """Make `<logs>/<date>_study_<name>`, beside the sessions.

    Raises:
        InputError: It cannot be made.
    """
    stem = f"{clock.utc():%Y%m%dT%H%M%SZ}_study_{name}"
    folder, count = logs / stem, 1
    while folder.exists():
        count += 1
        folder = logs / f"{stem}_{count}"
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}") from None
    return folder
