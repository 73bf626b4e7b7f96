"""Files that are whole or absent, and nothing overwritten that was not meant to be."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from testbench.exceptions import InputError
from testbench.records.disk.json_file import json_text
from testbench.records.disk.replacing import replaced_file, replaced_folder, stored_where_asked
from testbench.records.session.layout import DERIVED, EVENTS, MANIFEST
from testbench.records.session.session import Session

INDEX = "export.json"
"""File of an exported folder that says what its tables are; a folder without it is never
replaced.
"""


def check_target(path: Path, name: str, suffix: str, session: Session, force: bool) -> None:
    """Refuse a place that an export must not be written to.

    Args:
        path: File or folder to be written.
        name: Of the format.
        suffix: Of the format's files; empty for a folder of tables.
        session: The recording.
        force: Whether an earlier export may be replaced.

    Raises:
        InputError: Says what is in the way.
    """
    if suffix and path.suffix.lower() != suffix:
        raise InputError(
            f"{path} cannot be an export to {name}: the file's name must end in {suffix}"
        )
    if not suffix and path.suffix.lower() in {".csv", ".parquet"}:
        raise InputError(
            f"{path} cannot be an export to {name}: it is a folder of several tables; name a folder"
        )
    _spare_the_recording(path, session)
    if not os.path.lexists(path):
        return
    if path.is_dir() == bool(suffix):
        raise InputError(
            f"{path} is a {'folder' if suffix else 'file'}; an export to {name} cannot take its "
            "place"
        )
    if not force:
        raise InputError(f"{path} exists; --force replaces it")
    if not suffix and not (path / INDEX).is_file() and any(path.iterdir()):
        raise InputError(
            f"{path} is not an earlier export (it has no {INDEX}) and is not replaced; name "
            "another folder"
        )


def _spare_the_recording(path: Path, session: Session) -> None:
    """Refuse the session's folder, one that holds it, and its raw and derived files."""
    folder, wanted = session.path.resolve(), path.resolve()
    own = {MANIFEST, EVENTS, *DERIVED} | set(session.manifest.files)
    if wanted == folder or wanted in folder.parents:
        raise InputError(f"{path} holds the session itself; name another place")
    if folder in wanted.parents and wanted.relative_to(folder).parts[0] in own:
        raise InputError(f"{path} belongs to the recording; name another place")


@contextmanager
def written_whole(path: Path, is_folder: bool) -> Iterator[Path]:
    """A place to write to, beside `path`, that takes its name when everything went well.

    Else it is removed.

    Raises:
        InputError: The place cannot be written to.
        StorageError: The disk is full.
    """
    with stored_where_asked(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced_folder(path) if is_folder else replaced_file(path) as partial:
            yield partial


def write_index(folder: Path, content: dict[str, Any]) -> None:
    """Write the file that says what the tables of an exported folder are."""
    (folder / INDEX).write_text(json_text(content), encoding="utf-8")
