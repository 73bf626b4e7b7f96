"""Where a study is kept."""

from __future__ import annotations

from pathlib import Path

from testbench.clock import Clock
from testbench.exceptions import InputError
from testbench.records.disk.replacing import dated_folder


def new_folder(logs: Path, name: str, clock: Clock) -> Path:
    """Make `<logs>/<date>_study_<name>`, beside the sessions.

    Raises:
        InputError: It cannot be made.
    """
    folder = dated_folder(logs, f"study_{name}", clock)
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}") from None
    return folder
