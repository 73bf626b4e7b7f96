"""Derived results that are replaced as a whole: what is found under their names was written
together.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from errno import ENOSPC
from pathlib import Path

from testbench.exceptions import StorageError
from testbench.records.storage import replace_synced


@contextmanager
def replaced_folder(folder: Path, summary: Path | None = None) -> Iterator[Path]:
    """A new folder to fill, which takes the place of another one once it is full.

    Whatever ends this early, a full disk or a kill, leaves the old folder with its summary, or
    neither of them: tables of one result never stand beside the summary of another. What was
    written so far is removed, at the latest by the next attempt.

    Args:
        folder: To be replaced, or made.
        summary: A file outside of the folder without which it is not read; it is removed before the
            folders change places, and for the caller to write afterwards.

    Yields:
        The folder to write to.

    Raises:
        StorageError: The disk does not take it.
    """
    new, old = folder.with_name(f"{folder.name}.new"), folder.with_name(f"{folder.name}.old")
    with stored(folder):
        for left in (new, old):
            if left.is_dir():
                shutil.rmtree(left)
        try:
            new.mkdir()
            yield new
        except BaseException:
            shutil.rmtree(new, ignore_errors=True)
            raise
        if summary is not None:
            summary.unlink(missing_ok=True)
        if folder.is_dir():
            folder.rename(old)
        new.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def write_page(path: Path, text: str) -> None:
    """Write a text in one step, in place of an earlier one.

    Raises:
        StorageError: The disk does not take it; the earlier one is as it was.
    """
    partial = path.with_suffix(".partial")
    with stored(path):
        try:
            partial.write_text(text, encoding="utf-8")
            replace_synced(partial, path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise


@contextmanager
def stored(path: Path, comfort: str = "the recording is as it was") -> Iterator[None]:
    """Say in one sentence what could not be written, and what has become of the rest or is to be
    done.

    Raises:
        StorageError: The disk does not take it.
    """
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {disk_reason(error)}; {comfort}") from None


def disk_reason(error: OSError) -> str:
    """Why something cannot be written, in words."""
    return (
        "there is no room left on the disk"
        if error.errno == ENOSPC
        else error.strerror or str(error)
    )
