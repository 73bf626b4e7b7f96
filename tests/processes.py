"""The command line in processes of their own, forked from one that has imported the bench already:
a process for a test, without the seconds that its imports take.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

# Imported here for the process that all others are forked from.
import testbench.pipeline
import testbench.reporting.report  # noqa: F401
from testbench.cli import main
from testbench.clock import SystemClock
from tests.patience import PATIENCE_S

FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload([__name__])

NO_DISK = "this machine does not let tests mount a file system"
NEW_MOUNTS, PRIVATE = 0x20000, 0x44000
"""CLONE_NEWNS of unshare(2), MS_REC | MS_PRIVATE of mount(2)."""


def forked(target: Callable[..., object], *arguments: Any) -> BaseProcess:
    """Start a function of a module in a process of its own."""
    process = FORKS.Process(target=target, args=arguments, daemon=True)
    process.start()
    return process


def bench(
    *words: object,
    cwd: Path | None = None,
    around: Callable[[], AbstractContextManager[object]] = nullcontext,
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, inside of what `around` gives: exit code, and what it printed."""
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / "stdout", Path(name) / "stderr"]
        process = forked(_called, ["testbench", *map(str, words)], files, cwd, around)
        process.join(PATIENCE_S)
        out, err = (file.read_text(encoding="utf-8") for file in files)
        if process.exitcode is None:
            process.kill()
            raise subprocess.TimeoutExpired(words, PATIENCE_S, out, err)
        return subprocess.CompletedProcess(words, process.exitcode, out, err)


def _called(
    words: list[str],
    files: list[Path],
    cwd: Path | None,
    around: Callable[[], AbstractContextManager[object]],
) -> None:
    for number, file in enumerate(files, 1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
    if cwd is not None:
        os.chdir(cwd)
    sys.argv = words
    with around():
        main()


@contextmanager
def virtual_time(struck_s: float | None = None, signal: int = 0) -> Iterator[None]:
    """A machine on which time passes when somebody sleeps, and only then; once this process has
    slept so long, it gets a signal.
    """
    passed_ns = 0

    def sleep(self: SystemClock, seconds: float) -> None:
        nonlocal passed_ns, struck_s
        passed_ns += round(max(seconds, 0.0) * 1e9)
        if struck_s is not None and passed_ns > struck_s * 1e9:
            struck_s = None
            os.kill(os.getpid(), signal)

    SystemClock.sleep = sleep  # type: ignore[method-assign]
    SystemClock.monotonic_ns = lambda self: passed_ns  # type: ignore[method-assign]
    yield


@contextmanager
def small_disk(folder: Path, size_kb: int, session: Path | None = None) -> Iterator[None]:
    """A file system of this process's own in a folder: of some size, or full with the copy of a
    session. What is in it at the end is kept beside it in `<folder>_kept`.
    """
    folder.mkdir()
    libc = ctypes.CDLL(None)
    options = f"size={size_kb}k".encode()
    if (
        libc.unshare(NEW_MOUNTS)
        or libc.mount(None, b"/", None, PRIVATE, None)
        or libc.mount(b"tmpfs", bytes(folder), b"tmpfs", 0, options)
    ):
        sys.exit(NO_DISK)
    if session is not None:
        shutil.copytree(session, folder / session.name)
        fill(folder / "filler")
    try:
        yield
    finally:
        shutil.copytree(folder, folder.with_name(f"{folder.name}_kept"))


def fill(file: Path) -> None:
    """Write zeros until there is no room."""
    with file.open("wb", buffering=0) as stream:
        for size in (4096, 1):
            try:
                while True:
                    stream.write(bytes(size))
            except OSError:
                continue
