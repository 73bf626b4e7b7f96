"""Each command on a disk that is full after every 64 kB, that is read-only, and with files that may
not grow: exit code 3, one sentence, nothing half, and what was recorded kept.
"""

from __future__ import annotations

import ctypes
import os
import random
import resource
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from testbench.execution.recovery import recover
from testbench.records.session.session import RunStatus, Session
from tests.benchmarks.crash_points import FORMATS, Ended, Words, called, place_of, start_in
from tests.benchmarks.points import Found, by, failed, tell_failures, walk
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.processes import NEW_MOUNTS, NO_DISK, PRIVATE

COUNT = 2000
"""More than there are."""
STEP_KB, PAGE_KB = 64, 4
READ_ONLY = 0x21
"""MS_REMOUNT | MS_RDONLY of mount(2)."""
STAGES: dict[str, Words] = {
    "run": ("run", "tiny.yaml", "--logs", "logs2", "--no-report"),
    "import": ("import", "generic", "d.csv", "--mapping", "map.yaml", "--out", "logs/imported"),
    "estimate": ("estimate", "logs/session"),
    "evaluate": ("evaluate", "logs/session", "--filters", "vqf_6d"),
    "report": ("report", "logs/session"),
    "calibrate": ("calibrate", "logs/session", "--out", "calibration.yaml"),
    "noise": ("noise", "logs/session", "--out", "preset.yaml"),
    "tune": ("tune", "logs/session", "--filter", "madgwick_imu", "--parameters", "beta")
    + ("--values", "3", "--no-refinement", "--out", "tuned.json"),
    "view": ("view", "logs/session", "--save", "viewed.rrd"),
    **{
        f"export {kind}": ("export", "logs/session", "--to", kind, "--out", place_of(kind))
        for kind in FORMATS
    },
}
FULL, CLOSED, LIMITED = "full", "read-only", "limited"


def bench_full_disks(count: int = COUNT) -> bool:
    """Print the figures; whether every command ended as it must."""
    found = resumed("full_disks", count, walk(Disks))
    if not found:
        print(NO_DISK)
        return True
    rows: list[list[str | Text]] = []
    for name, own in by(found, "stage").items():
        counts = [str(sum(one["disk"] == kind for one in own)) for kind in (FULL, CLOSED, LIMITED)]
        refused = str(sum(one["code"] == 3 for one in own))
        rows.append([Text(name), *counts, refused, str(failed(own))])
    show("Commands on disks that take no more", ["", FULL, CLOSED, LIMITED, "3", "failed"], rows)
    return tell_failures(found, "{stage}, {disk} at {at_kb} kB")


class Disks:
    """Small disks on which commands run.

    Args:
        folder: To work in.
        only: Names of the stages that are tried.

    Attributes:
        points: Stages, kinds of disks and room on them [kB], in an order by chance, the same every
            time; none where nothing can be mounted.
    """

    def __init__(self, folder: Path, only: Sequence[str] = tuple(STAGES)):
        self.folder = folder
        self.start = start_in(folder)
        self.used_kb = _used_kb(self.start)
        self.points: list[tuple[Any, ...]] = []
        self.before = _contents(self.start)
        for name in only:
            ended, kept = self._ended(name, FULL, 100_000)
            if NO_DISK in ended.told:
                return
            assert ended.code in {0, 2} and ended.code == (name == "noise") * 2, ended.told
            points = range(0, self._written_kb(kept), STEP_KB)
            self.points += [(name, FULL, at) for at in points]
            self.points += [(name, LIMITED, at) for at in points[:: max(len(points) // 3, 1)]]
            self.points.append((name, CLOSED, 0))
            shutil.rmtree(kept)
        random.Random(0).shuffle(self.points)

    def _written_kb(self, kept: Path) -> int:
        """Of what is new, and of what takes the place of other files, which lies beside them."""
        after = _contents(kept)
        sizes = [len(own) for path, own in after.items() if self.before.get(path) != own]
        return sum(-(-size // (PAGE_KB * 1024)) * PAGE_KB for size in sizes)

    def trial(self, name: str, disk: str, at_kb: int) -> Found:
        """What is wrong with how a command ended, and with what it left."""
        ended, kept = self._ended(name, disk, at_kb)
        failure = self._wrong(name, ended, kept)
        shutil.rmtree(kept)
        return {
            "stage": name,
            "disk": disk,
            "at_kb": at_kb,
            "code": ended.code,
            "failure": failure,
        }

    def _ended(self, name: str, disk: str, at_kb: int) -> tuple[Ended, Path]:
        place, kept = self.folder / "disk", self.folder / "kept"
        place.mkdir()
        size_kb = 1_000_000 if disk == LIMITED else self.used_kb + at_kb
        limit = at_kb * 1024 + 1 if disk == LIMITED else None
        around = partial(_mounted, self.start, place, kept, size_kb, disk == CLOSED, limit)
        ended = called(place, *STAGES[name], around=around)
        place.rmdir()
        return ended, kept

    def _wrong(self, name: str, ended: Ended, kept: Path) -> str:
        lines = [line for line in ended.told.splitlines() if line.startswith("error: ")]
        if ended.code not in {0, 3} and not (name == "noise" and ended.code == 2):
            return f"exit code {ended.code}: {ended.told[-300:]}"
        if "Traceback" in ended.told or (ended.code == 3 and len(lines) != 1):
            return f"said: {ended.told[-300:]}"
        left = [path.name for path in kept.rglob("*.partial")]
        if left:
            return f"{left} were left"
        after = _contents(kept)
        changed = [path for path, own in self.before.items() if _raw(path) and after[path] != own]
        if changed:
            return f"{changed} were changed"
        if ended.code == 0:
            return ""
        new = sorted(set(after) - set(self.before))
        if name == "run":
            return self._wrong_run(ended, kept)
        made = [path for path in new if not path.startswith("logs/session/")]
        if name == "calibrate":
            made = [path for path in made if path != "calibration.yaml"]  # whole before its report
        return f"{made} were left" if made else ""

    def _wrong_run(self, ended: Ended, kept: Path) -> str:
        """What was recorded can be recovered where there is room."""
        said = ("make room", "cannot be made", "the recording is whole; judge it again")
        if not any(words in ended.told for words in said):
            return f"it was not said what to do: {ended.told}"
        for manifest in kept.glob("logs2/*/manifest.json"):
            session = recover(Session(manifest.parent))
            if session.status is RunStatus.RUNNING:
                return "what was recorded could not be recovered"
        return ""


@contextmanager
def _mounted(
    start: Path, place: Path, kept: Path, size_kb: int, closed: bool, limit: int | None
) -> Iterator[None]:
    """A file system of this process's own in a folder, with a copy of another one.

    Args:
        start: What is copied into it.
        place: Where it is.
        kept: Where its content is copied to at the end.
        size_kb: Of it.
        closed: Whether it is read-only then.
        limit: Largest size of a file [bytes]; any if None.
    """
    libc = ctypes.CDLL(None)
    options = f"size={size_kb}k".encode()
    if (
        libc.unshare(NEW_MOUNTS)
        or libc.mount(None, b"/", None, PRIVATE, None)
        or libc.mount(b"tmpfs", bytes(place), b"tmpfs", 0, options)
    ):
        kept.mkdir()
        sys.exit(NO_DISK)
    shutil.copytree(start, place, dirs_exist_ok=True)
    if closed and libc.mount(None, bytes(place), None, READ_ONLY, None):
        sys.exit(NO_DISK)
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, unlimited[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
        shutil.copytree(place, kept)


def _used_kb(folder: Path) -> int:
    """Of all pages of all files."""
    sizes = (path.stat().st_size for path in folder.rglob("*") if path.is_file())
    return sum(-(-size // (PAGE_KB * 1024)) for size in sizes) * PAGE_KB


def _contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {os.fspath(path.relative_to(folder)): path.read_bytes() for path in files}


def _raw(path: str) -> bool:
    """Whether a file is neither derived nor of the command."""
    derived = ("logs/session/e", "logs/session/report")
    return path.startswith("logs/session/events") or not path.startswith(derived)


if __name__ == "__main__":
    sys.exit(not bench_full_disks(count_of(COUNT, __doc__)))
