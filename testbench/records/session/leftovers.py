"""What killed commands have left among sessions, and is none: shown, and removed if asked.

Nothing that holds a sample is ever taken for such.
"""

from __future__ import annotations

import fcntl
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from testbench.exceptions import SessionError
from testbench.records.disk.journal import journal_batches
from testbench.records.disk.replacing import PARTIAL, clear_partials, remove
from testbench.records.session.layout import (
    EVENTS,
    INCLUDED,
    JOURNALS,
    MANIFEST,
    PLAN,
    PROTOCOL,
    ROBOT,
    URDF,
)
from testbench.records.session.manifest import RunStatus
from testbench.records.session.session import list_sessions

BEGUN = {EVENTS, PROTOCOL, ROBOT, URDF, PLAN}
"""What a session may have before its manifest."""
DATED = re.compile(r"\d{8}T\d{6}Z_\w+")
"""How folders of runs and recordings are called; an empty one of another name may be anybody's."""


@dataclass(frozen=True)
class Leftover:
    """A file or folder that is no session.

    Attributes:
        path: Where it lies.
        what: It is, for people.
    """

    path: Path
    what: str


def leftovers(logs: Path) -> list[Leftover]:
    """What was left in a folder of sessions, in the order of the names.

    Args:
        logs: The folder.
    """
    if not logs.is_dir():
        return []
    found = [
        Leftover(path, "what a command wrote that was cut off, or writes just now")
        for path in logs.glob(f".*{PARTIAL}")
    ]
    found += [
        Leftover(path, "a run or recording that was cut off before it began")
        for path in logs.iterdir()
        if _is_begun(path)
    ]
    found += [
        Leftover(session.path, "an import that was cut off; its files can be imported again")
        for session in list_sessions(logs)
        if session.manifest.kind == "import"
        and session.status is RunStatus.RUNNING
        and not session.is_being_recorded
    ]
    return sorted(found, key=lambda one: one.path.name)


def clean(logs: Path) -> list[Path]:
    """Remove what was left in a folder of sessions, and what was left within them.

    What another process writes just now stays.

    Args:
        logs: The folder.

    Returns:
        What is gone.
    """
    gone = clear_partials(logs) if logs.is_dir() else []
    for session in list_sessions(logs):
        gone += clear_partials(session.path)
    for left in leftovers(logs):
        if not left.path.name.endswith(PARTIAL):
            remove(left.path)
            gone.append(left.path)
    return gone


def _is_begun(path: Path) -> bool:
    """Whether a folder holds only what a session has before its manifest, and nobody is at it."""
    if path.is_symlink() or not path.is_dir() or (path / MANIFEST).exists():
        return False
    names = [own for own in path.iterdir() if not _is_before_manifest(own)]
    if names or not (any(path.iterdir()) or DATED.fullmatch(path.name)):
        return False
    return not _is_written(path / EVENTS)


def _is_before_manifest(own: Path) -> bool:
    if own.is_symlink() or not own.is_file():
        return False
    if own.match(JOURNALS):
        return not _holds_rows(own)
    named = own.name in BEGUN or own.name.startswith(INCLUDED)
    return named or (own.name.startswith(".") and own.name.endswith(PARTIAL))


def _holds_rows(journal: Path) -> bool:
    """Whether anything was recorded; also where that cannot be told."""
    if journal.stat().st_size == 0:
        return False
    try:
        _, batches = journal_batches(journal)
        return any(batch.num_rows for batch in batches)
    except SessionError:
        return True


def _is_written(events: Path) -> bool:
    """Whether a living process holds the list of events open for writing."""
    with suppress(FileNotFoundError), events.open("rb") as opened:
        try:
            fcntl.flock(opened, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
