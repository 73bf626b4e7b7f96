"""Whether the raw files of a session are still what was recorded: by the hashes of its manifest.

What was hashed once is remembered in the user's own cache folder, by what the file system says of
the file, and never in the session: that may come from anybody.
"""

from __future__ import annotations

import hashlib
import os
import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from testbench.exceptions import SessionError
from testbench.frames import NANOSECONDS
from testbench.records.disk.json_file import read_json, write_json
from testbench.records.disk.user_folders import user_folder
from testbench.records.session.layout import MANIFEST, is_raw, is_read_raw
from testbench.records.session.session import Session

COARSEST_STAMP_NS = 2 * NANOSECONDS
"""A file that was written to within one tick of its file system's clock after it was hashed has the
same stamps: what is as young as the coarsest tick in use (FAT: 2 s) is not remembered.
"""
MOST_REMEMBERED = 4096
"""Sessions; of more, those that were looked at last."""


@dataclass(frozen=True)
class Checked:
    """What a check of raw files came to.

    Attributes:
        names: Of the files that are what was recorded.
        problems: Of the others, by name: what is wrong with each.
        hashed: Bytes that were read for it; those that are remembered are not.
    """

    names: list[str]
    problems: dict[str, str]
    hashed: int


def open_for_analysis(path: str | Path, verify: bool = True) -> Session:
    """A session whose raw files are what was recorded.

    Args:
        path: Its folder.
        verify: Whether that is looked at.

    Raises:
        SessionError: The folder is no session, or a raw file was changed, removed or added since;
            names each.
    """
    session = Session(path)
    if verify:
        refuse_changed(session, check_raw_files(session, Memory.of(session)))
    return session


def refuse_changed(
    session: Session, checked: Checked, remedy: str = "; --no-verify takes it as it is"
) -> None:
    """Refuse a session whose raw files are not what was recorded.

    Args:
        session: The recording.
        checked: What its check came to.
        remedy: For people.

    Raises:
        SessionError: Names each of them.
    """
    if checked.problems:
        told = "; ".join(f"{name} {what}" for name, what in checked.problems.items())
        raise SessionError(f"{session.path} is not what was recorded: {told}{remedy}")


def check_raw_files(session: Session, memory: Memory | None = None) -> Checked:
    """Compare every raw file with the hash that the manifest states.

    A session that is being recorded or was cut off states none yet.

    Args:
        session: The recording.
        memory: What is known of files that were hashed before; every file is read if None.
    """
    stated = {name: own for name, own in session.manifest.files.items() if is_raw(name)}
    found, problems, hashed = [], {}, 0
    for name in [name for name in session.manifest.files if not _is_name(name)]:
        problems[repr(name)[:100]] = f"is listed in {MANIFEST}, and is no name of a file"
        stated.pop(name, None)
    for name, expected in stated.items():
        try:
            digest, read = _digest(session.path / name, name, memory)
        except OSError as error:
            problems[name] = _missing(error)
            continue
        hashed += read
        if digest == expected:
            found.append(name)
        else:
            problems[name] = "was changed (its SHA-256 differs)"
    if stated:
        present = (path.name for path in session.path.iterdir() if is_read_raw(path.name))
        added = sorted(set(present) - set(stated))
        problems |= dict.fromkeys(added, f"was added ({MANIFEST} does not list it)")
    if memory is not None and hashed:
        memory.keep()
    return Checked(found, problems, hashed)


def _is_name(name: str) -> bool:
    """Whether this is the name of something in the folder itself."""
    return Path(name).name == name and name not in {"", ".", ".."} and "\0" not in name


def _missing(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "is missing"
    return f"cannot be read: {error.strerror or error}"


class Memory:
    """Hashes of a session's files by what the file system says of them.

    Args:
        file: That keeps them.
    """

    def __init__(self, file: Path):
        self._file = file
        self._known: dict[str, str] = {}
        self._now: dict[str, str] = {}
        self._until_ns = 0
        with suppress(OSError, SessionError):
            self._until_ns = file.stat().st_mtime_ns - COARSEST_STAMP_NS
            known = read_json(file)
            if isinstance(known, dict):
                self._known = {str(key): str(value) for key, value in known.items()}

    @staticmethod
    def of(session: Session) -> Memory | None:
        """What the user's cache folder holds of a session; None where there is no such folder."""
        folder = cache_folder()
        if folder is None:
            return None
        own = session.path.stat()
        return Memory(folder / "raw_files" / f"{own.st_dev:x}_{own.st_ino:x}.json")

    def digest(self, found: os.stat_result) -> str | None:
        """The hash of a file that has not been written to since it was taken; None if not known."""
        digest = self._known.get(_key(found))
        if digest is not None:
            self._now[_key(found)] = digest
        return digest if found.st_ctime_ns <= self._until_ns else None

    def note(self, found: os.stat_result, digest: str) -> None:
        """Remember the hash of a file as it is now."""
        self._now[_key(found)] = digest

    def keep(self) -> None:
        """Write it; where that cannot be done, nothing is remembered."""
        with suppress(OSError):
            self._file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_json(self._file, self._now)
            _forget(self._file.parent)


def cache_folder() -> Path | None:
    """The bench's folder in the user's cache folder, None where the user has none."""
    return user_folder("XDG_CACHE_HOME", ".cache")


def _forget(folder: Path) -> None:
    """Remove what was not looked at for long where there is too much: half, to do so seldom."""
    files = list(folder.iterdir())
    if len(files) > MOST_REMEMBERED:
        for path in sorted(files, key=_written_ns)[: len(files) // 2]:
            path.unlink(missing_ok=True)


def _written_ns(path: Path) -> int:
    return path.stat().st_mtime_ns


def _key(found: os.stat_result) -> str:
    """What changes whenever a file is written to, replaced or restored."""
    parts = (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
    return " ".join(map(str, parts))


def _digest(file: Path, name: str, memory: Memory | None) -> tuple[str, int]:
    """SHA-256 of a file, and how many bytes were read for it.

    Raises:
        OSError: It is not there, or no file: a pipe or a device would be read for ever.
    """
    opened = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(opened, "rb") as stream:
        found = os.fstat(opened)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(None, "it is no file", name)
        known = None if memory is None else memory.digest(found)
        if known is not None:
            return known, 0
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        if memory is not None and _key(os.fstat(opened)) == _key(found):
            memory.note(found, digest)
        return digest, found.st_size
