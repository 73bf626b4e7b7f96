"""The one way to write a file or folder: beside its place, synced, renamed once it is whole.

What is found under a name was written whole and by one writer. Nothing is written through a
symbolic link: a link under the final name is replaced, not followed, and the name that is written
to cannot be guessed.
"""

from __future__ import annotations

import fcntl
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EACCES, EDQUOT, EFBIG, EINVAL, EIO, ENOSPC, EPERM, EROFS
from pathlib import Path

from testbench.clock import Clock, utc_name
from testbench.exceptions import InputError, StorageError

PARTIAL = ".partial"
"""How names of what is not whole yet end."""
REASONS = {
    ENOSPC: "there is no room left on the disk",
    EDQUOT: "the quota of this disk is used up",
    EFBIG: "it would be larger than a file may be here",
    EROFS: "the disk is read-only",
    EACCES: "the folder may not be written to",
    EPERM: "the folder may not be written to",
}
"""Why a disk takes nothing, in words."""
LONGEST_NAME = 120
"""Bytes of a name that its partial file repeats: file systems take 255 with all that is added."""


@contextmanager
def replaced_file(path: Path, anew: bool = False, mode: int = 0o666) -> Iterator[Path]:
    """A file to write, which takes the name `path` once it is whole, in place of an earlier one.

    A power cut leaves the old file or the new one, whole. What was written so far is removed if
    this ends early; after a kill, by the next writer of the same file.

    Args:
        path: The final name.
        anew: Refuse an earlier file instead of replacing it.
        mode: Who may read and write it, from its first byte on, less what the user's mask takes.

    Yields:
        The empty file to write to, by its path.

    Raises:
        InputError: There is an earlier file, though `anew` is asked for.
        OSError: The disk does not take it; the earlier file is as it was.
    """
    if anew and os.path.lexists(path):
        raise _taken(path)
    _clear(path)
    partial, held = _claimed_file(path, mode)
    try:
        yield partial
        _sync(partial)
        if anew:
            _link(partial, path)
        else:
            partial.replace(path)
        _sync(path.parent)
    finally:
        try:
            partial.unlink(missing_ok=True)
        finally:
            os.close(held)


def write_text(path: Path, text: str, anew: bool = False) -> None:
    """Write a text in UTF-8 in one step; see `replaced_file`."""
    with replaced_file(path, anew) as partial:
        partial.write_text(text, encoding="utf-8")


@contextmanager
def replaced_folder(
    folder: Path, summary: Path | None = None, anew: bool = False
) -> Iterator[Path]:
    """A new folder to fill, which takes the place of another one once it is full.

    Whatever ends this early, a full disk or a kill, leaves the old folder with its summary, or
    neither of them: tables of one result never stand beside the summary of another. What was
    written so far is removed, after a kill by the next attempt.

    Args:
        folder: To be replaced, or made.
        summary: A file beside the folder without which it is not read. The caller writes it into
            the new folder; the old one is removed before the folders change places, and the new one
            is moved out of the folder last.
        anew: Refuse an earlier folder instead of replacing it.

    Yields:
        The folder to write to.

    Raises:
        InputError: There is an earlier one, though `anew` is asked for.
        OSError: The disk does not take it.
    """
    if anew and os.path.lexists(folder):
        raise _taken(folder)
    _clear(folder)
    new, held = _claimed_folder(folder)
    try:
        yield new
        for path in new.rglob("*"):
            _sync(path)
        _sync(new)
        if summary is not None:
            summary.unlink(missing_ok=True)
        old = _partial_of(folder)
        if anew and os.path.lexists(folder):
            raise _taken(folder)
        with suppress(FileNotFoundError):
            folder.rename(old)
        new.rename(folder)
        if summary is not None:
            (folder / summary.name).replace(summary)
        _sync(folder.parent)
        remove(old)
    finally:
        try:
            remove(new)
        finally:
            os.close(held)


@contextmanager
def stored(path: Path, comfort: str = "the recording is as it was") -> Iterator[None]:
    """Say in one sentence what could not be written, and what has become of the rest.

    Raises:
        StorageError: The disk does not take it.
    """
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {disk_reason(error)}; {comfort}") from None


@contextmanager
def stored_where_asked(path: Path) -> Iterator[None]:
    """The same of a file whose place a person has named, and may have named wrongly.

    Raises:
        InputError: There is no such place.
        StorageError: The disk takes nothing: it is full, read-only, or broken.
    """
    try:
        yield
    except OSError as error:
        by_disk = error.errno is None or error.errno in {*REASONS, EIO}
        refused = StorageError if by_disk else InputError
        raise refused(f"{path} cannot be written: {disk_reason(error)}") from None


def disk_reason(error: OSError) -> str:
    """Why something cannot be written, in words."""
    return REASONS.get(error.errno or 0) or error.strerror or str(error)


def clear_partials(folder: Path) -> list[Path]:
    """Remove what writers that were killed have left in a folder.

    Args:
        folder: To look in.

    Returns:
        What is gone.
    """
    found = list(folder.glob(f"*{PARTIAL}"))
    for left in found:
        _remove_unless_held(left)
    return [path for path in found if not os.path.lexists(path)]


def _partial_of(path: Path) -> Path:
    """A name beside `path` that nobody can have taken or guessed."""
    name = path.name.encode()[:LONGEST_NAME].decode(errors="ignore")
    return path.with_name(f".{name}.{secrets.token_hex(8)}{PARTIAL}")


def _claimed_file(path: Path, mode: int) -> tuple[Path, int]:
    """An empty file to write to, and its open descriptor: its lock says that somebody writes it."""
    while True:
        partial = _partial_of(path)
        held = os.open(partial, os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_RDWR, mode)
        if _hold(held, partial):
            return partial, held


def _claimed_folder(path: Path) -> tuple[Path, int]:
    """An empty folder to fill, and its open descriptor, with a lock as above."""
    while True:
        partial = _partial_of(path)
        partial.mkdir()
        with suppress(FileNotFoundError):
            held = os.open(partial, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            if _hold(held, partial):
                return partial, held


def _hold(held: int, partial: Path) -> bool:
    """Lock what was just made.

    False where another writer took it for left over and removed it before.
    """
    with suppress(OSError):  # a file system without locks: what a kill leaves there stays
        fcntl.flock(held, fcntl.LOCK_EX)
    if os.path.lexists(partial):
        return True
    os.close(held)
    return False


def _clear(path: Path) -> None:
    """Remove what killed writers of the same file or folder have left."""
    start = _partial_of(path).name.removesuffix(PARTIAL)[:-16]
    with suppress(FileNotFoundError):
        for left in path.parent.iterdir():
            if left.name.startswith(start) and left.name.endswith(PARTIAL):
                _remove_unless_held(left)


def _remove_unless_held(path: Path) -> None:
    with suppress(OSError):
        if path.is_symlink():
            path.unlink()
            return
        found = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            fcntl.flock(found, fcntl.LOCK_EX | fcntl.LOCK_NB)
            remove(path)
        finally:
            os.close(found)


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _link(partial: Path, path: Path) -> None:
    """Give a whole file its name, unless somebody else has taken it meanwhile."""
    try:
        path.hardlink_to(partial)
    except OSError:
        if os.path.lexists(path):
            raise _taken(path) from None
        partial.rename(path)  # on a file system without links


def _taken(path: Path) -> InputError:
    return InputError(f"{path} exists already; it is kept, not replaced")


def _sync(path: Path) -> None:
    """Force a file or the entries of a folder onto the disk."""
    if path.is_symlink():
        return
    opened = os.open(path, os.O_RDONLY)
    try:
        os.fsync(opened)
    except OSError as error:
        if error.errno != EINVAL:  # file systems of other machines may not sync folders
            raise
    finally:
        os.close(opened)


def free_folder(logs: Path, name: str) -> Path:
    """A folder that does not exist yet: the name, or the name with a number."""
    folder, count = logs / name, 1
    while folder.exists():
        count += 1
        folder = logs / f"{name}_{count}"
    return folder


def dated_folder(logs: Path, name: str, clock: Clock) -> Path:
    """A folder for what begins now: `<logs>/<date>_<name>`, with a number where that exists."""
    return free_folder(logs, f"{utc_name(clock.utc())}_{name}")
