"""Write a session: journals while it runs, Parquet once it is closed, and a manifest."""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from errno import ELOOP
from importlib.metadata import PackageNotFoundError, distribution
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from testbench.clock import utc_text
from testbench.exceptions import SessionError, StorageError
from testbench.records.disk.journal import Journal, compact
from testbench.records.disk.json_file import plain_values
from testbench.records.disk.replacing import REASONS, disk_reason, write_text
from testbench.records.disk.tables import Columns, write_parquet
from testbench.records.session.layout import (
    EVENTS,
    MANIFEST,
    is_raw,
    journal_file,
    table_file,
)
from testbench.records.session.manifest import SCHEMA_VERSION, Manifest, RunStatus
from testbench.records.session.session import Event, Session
from testbench.records.specs.protocol import Analysis
from testbench.records.specs.shipped import PACKAGE

DECIDING_PACKAGES = ("imu-testbench", "pin", "ruckig", "numpy", "scipy", "numba")
"""They computed the plan and the raw files: a run is gone on with by the same ones only."""
RECORDED_PACKAGES = (*DECIDING_PACKAGES, "vqf", "pyarrow")


class FolderTaken(SessionError):
    """Somebody else made the folder first."""


class SessionWriter:
    """A session being written.

    Args:
        path: Folder to create.
        analysis: What estimate and evaluate will need.
        sensors: Description of each sensor.
        started: Date and time of the start.
        details: Further entries of the manifest.
        announced: Whether to write the manifest at once, with which the folder becomes a session;
            else `announce` does.
        folder: Empty folder to write to, which takes the name `path` once it is whole; `path`
            itself is made if None.

    Raises:
        SessionError: The folder exists or cannot be made.
        StorageError: The disk does not take it.
    """

    def __init__(
        self,
        path: Path,
        analysis: Analysis,
        sensors: Mapping[str, Any],
        started: datetime,
        details: Mapping[str, Any] | None = None,
        announced: bool = True,
        folder: Path | None = None,
    ):
        self.path, self._shown = folder or path, path
        if folder is None:
            make_folder(path)
        content = {
            "schema_version": SCHEMA_VERSION,
            "session": path.name,
            "status": RunStatus.RUNNING,
            "started_utc": utc_text(started),
            "clocks": {
                "host_time_ns": "nanoseconds since the start of the session, host clock",
                "device_time_ns": "nanoseconds of the sensor's own clock",
            },
            "software": software_versions(),
            "sensors": dict(sensors),
            "analysis": analysis.model_dump(mode="json"),
            **(details or {}),
        }
        self.manifest = Manifest.of(plain_values(content), path / MANIFEST)
        self._journals: dict[str, Journal] = {}
        self._events = (self.path / EVENTS).open("w", encoding="utf-8")
        fcntl.flock(
            self._events, fcntl.LOCK_EX
        )  # held while this process lives: nobody recovers a running session
        if announced:
            self._write_manifest()

    @classmethod
    def reopen(
        cls, path: Path, resumed: Mapping[str, Any], details: Mapping[str, Any] | None = None
    ) -> SessionWriter:
        """Go on with a session that was closed or recovered.

        Args:
            path: Its folder.
            resumed: What the manifest should say of the resumption.
            details: Entries of the manifest that are others from now on.

        Raises:
            SessionError: The session cannot be read, or is being recorded.
        """
        writer = cls.__new__(cls)
        writer.path, writer._shown, writer._journals = path, path, {}
        manifest = Manifest.read(path)
        writer._events = _appended(path / EVENTS)
        try:
            fcntl.flock(writer._events, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SessionError(f"{path} is still being recorded") from None
        writer.manifest = manifest.changed(
            without=("message", "duration_s", "files"),
            status=RunStatus.RUNNING,
            resumed=[*manifest.resumed, dict(resumed)],
            **(details or {}),
        )
        writer._write_manifest()
        return writer

    def announce(self) -> None:
        """Write the manifest: from now on the folder is a session."""
        self._write_manifest()

    def add_text(self, name: str, text: str) -> None:
        """Keep a file verbatim."""
        write_text(self.path / name, text)

    def add_table(
        self, name: str, columns: Columns, notes: Mapping[str, str] | None = None
    ) -> None:
        """Write a whole table at once, as `<name>.parquet`.

        Args:
            name: Of the table.
            columns: By name, each of shape (n,).
            notes: What the table is, by key; kept in the schema's metadata.
        """
        write_parquet(self.path / table_file(name), columns, notes)

    def open_journal(
        self, name: str, columns: Mapping[str, Any], notes: Mapping[str, str] | None = None
    ) -> None:
        """Begin a stream that becomes `<name>.parquet` on closing, or go on with one that did."""
        table = self.path / table_file(name)
        if table.is_file():
            self._journals[name] = Journal.continued(
                self.path / journal_file(name), columns, table, notes
            )
        else:
            self._journals[name] = Journal(self.path / journal_file(name), columns, notes)

    def rows(self, name: str) -> int:
        """How many samples a stream holds."""
        return self._journals[name].rows

    def append(self, name: str, columns: Columns) -> None:
        """Append samples to a stream.

        Args:
            name: Of the stream.
            columns: By name, each of shape (n,).

        Raises:
            StorageError: They cannot be written; so do `event`, `flush`, `sync` and `close`.
        """
        with self._writing():
            self._journals[name].append(columns)

    def event(self, event: Event) -> None:
        """Append an event, and hand it to the operating system: what happened before the first
        sample outlives a kill too.
        """
        with self._writing():
            self._events.write(event.to_json() + "\n")
            self._events.flush()

    def flush(self) -> None:
        """Hand everything written so far to the operating system."""
        with self._writing():
            self._events.flush()

    def sync(self) -> None:
        """Force everything written so far onto the disk."""
        with self._writing():
            self._events.flush()
            os.fsync(self._events.fileno())
            for journal in self._journals.values():
                journal.sync()

    def compact(self) -> None:
        """End the streams and turn each into verified Parquet."""
        for name, journal in self._journals.items():
            journal.close()
            if journal.path.exists():
                compact(journal.path, self.path / table_file(name))

    def close(self, status: RunStatus, **details: Any) -> None:
        """Finish the session: compact, hash the files, write the final manifest."""
        with self._writing():
            self.compact()
            self.sync_events()
            self.manifest = self.manifest.changed(
                status=status, **details, files=file_hashes(self.path)
            )
            self._write_manifest()

    def abandon(self) -> None:
        """Let go of every file as it is; the session can be recovered once there is room."""
        for journal in self._journals.values():
            journal.abandon()
        with suppress(OSError, ValueError):
            self._events.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise StorageError(f"{self._shown} cannot be written: {disk_reason(error)}") from None

    def sync_events(self) -> None:
        """Close the list of events."""
        if not self._events.closed:
            self._events.flush()
            os.fsync(self._events.fileno())
            self._events.close()

    def _write_manifest(self) -> None:
        self.manifest.write(self.path)


def make_folder(path: Path) -> None:
    """Make the folder of a session.

    Raises:
        FolderTaken: It exists.
        SessionError: There is no such place.
        StorageError: The disk does not take it.
    """
    try:
        path.mkdir(parents=True)
    except FileExistsError as error:
        raise FolderTaken(
            f"the session folder {path} cannot be made: {disk_reason(error)}"
        ) from None
    except OSError as error:
        refused = StorageError if error.errno in REASONS else SessionError
        raise refused(f"the session folder {path} cannot be made: {disk_reason(error)}") from None


def note_end(session: Session, event: Event) -> None:
    """Append the last event of a session that was cut off, once.

    Its recovery may have been cut off after it had said so.
    """
    if session.events[-1:] != [event]:
        with _appended(session.path / EVENTS) as events:
            events.write("\n" + event.to_json() + "\n")


def _appended(events: Path) -> TextIOWrapper:
    """A list of events, to go on with.

    Raises:
        SessionError: It is a symbolic link: what that leads to is no part of the session.
    """
    try:
        opened = os.open(events, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    except OSError as error:
        if error.errno != ELOOP:
            raise
        raise SessionError(f"{events} is a symbolic link, and is not written to") from None
    return os.fdopen(opened, "a", encoding="utf-8")


def file_hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every raw file of a session."""
    hashes = {}
    for path in sorted(path for path in folder.iterdir() if path.is_file() and is_raw(path.name)):
        with path.open("rb") as file:  # in pieces: a long recording does not fit in memory
            hashes[path.name] = hashlib.file_digest(file, "sha256").hexdigest()
    return hashes


def software_versions() -> dict[str, str]:
    """Versions of what computed the session."""
    versions = {"python": platform.python_version()}
    for name in RECORDED_PACKAGES:
        try:
            versions[name] = _version(name)
        except PackageNotFoundError:
            continue
    commit = source_commit()
    return versions | ({"git_commit": commit} if commit else {})


def _version(name: str) -> str:
    """Version of a package by the line of its metadata that states it: to parse the whole, as
    `importlib.metadata.version` does, takes ten times as long, 50 ms for all.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    own = distribution(name)
    stated = re.search(r"^Version:\s*(\S+)", own.read_text("METADATA") or "", re.MULTILINE)
    return own.version if stated is None else stated[1]


def deciding_versions(software: Mapping[str, str]) -> dict[str, str]:
    """Of the versions that a manifest states, those that a run can only be gone on with."""
    wanted = ("python", "git_commit", *DECIDING_PACKAGES)
    return {name: software[name] for name in wanted if name in software}


def source_commit() -> str | None:
    """The git commit of the source tree, or None for an installed package."""
    git = PACKAGE.parent / ".git"
    try:
        head = (git / "HEAD").read_text(encoding="utf-8").strip()
        reference = head.removeprefix("ref: ")
        if reference == head:
            return head
        loose = git / reference
        if loose.is_file():
            return loose.read_text(encoding="utf-8").strip()
        packed = (git / "packed-refs").read_text(encoding="utf-8").splitlines()
        return next((line.split()[0] for line in packed if line.endswith(f" {reference}")), None)
    except OSError:
        return None
