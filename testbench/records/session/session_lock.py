"""One process at a time works on what is derived from a session.

So estimate, evaluation, report and exports that lie together are of one another.
"""

from __future__ import annotations

import fcntl
import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from testbench.exceptions import SessionError
from testbench.records.session.session import Session

Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")

WAIT_S = 60.0
"""How long the later process waits."""
TELL_S = 1.0
"""After so long it says for whom."""
LOOK_S = 0.05
LONGEST_COMMAND = 80
"""Characters of another process's command line that are shown."""
OTHER_PROCESS = "another process"
OTHER_THREAD = "another thread of this process"
LOG = logging.getLogger(__name__)


@dataclass
class _Held:
    """A lock of this process: the thread that has it may take it again."""

    thread: Any = field(default_factory=threading.RLock)
    depth: int = 0


_HELD: dict[tuple[int, int], _Held] = {}
_REGISTRY = threading.Lock()


@contextmanager
def session_lock(folder: Path, wait_s: float | None = None) -> Iterator[None]:
    """Keep other processes and threads from the derived files of a session.

    The lock is one of the operating system on the session's folder: it leaves no file behind and
    ends with the process, however that ends. Whoever has it may take it again. On a file system
    without locks nothing is kept away; a folder that does not exist needs no lock. Whoever waits
    for longer than `TELL_S` is told for whom, once, by a warning of the logger of this module: on
    stderr if nobody has set up another way.

    Args:
        folder: Of the session.
        wait_s: How long to wait for another [s]; `WAIT_S` if None.

    Raises:
        SessionError: Another one works on it for longer than that.
    """
    try:
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:  # what reads or writes there says why
        yield
        return
    stat = os.fstat(opened)
    with _REGISTRY:
        held = _HELD.setdefault((stat.st_dev, stat.st_ino), _Held())
    until = time.monotonic() + (WAIT_S if wait_s is None else wait_s)
    try:
        _take(held, opened, folder, until)
        try:
            yield
        finally:
            _release(held)
    finally:
        os.close(opened)


def session_locked(
    function: Callable[Concatenate[Session, Parameters], Returned],
) -> Callable[Concatenate[Session, Parameters], Returned]:
    """Let a function have a session to itself, from what it reads to what it writes."""

    @wraps(function)
    def locked(session: Session, *args: Parameters.args, **options: Parameters.kwargs) -> Returned:
        with session_lock(session.path):
            return function(session, *args, **options)

    return locked


def _take(held: _Held, opened: int, folder: Path, until: float) -> None:
    if not held.thread.acquire(timeout=_at_most(TELL_S, until)):
        _tell(folder, OTHER_THREAD)
        if not held.thread.acquire(timeout=_at_most(WAIT_S, until)):
            raise _busy(folder, OTHER_THREAD)
    if held.depth == 0:
        try:
            _take_from_processes(opened, folder, until)
        except BaseException:
            held.thread.release()
            raise
    held.depth += 1


def _take_from_processes(opened: int, folder: Path, until: float) -> None:
    tell_at: float | None = time.monotonic() + TELL_S
    while True:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            now = time.monotonic()
            if now >= until:
                raise _busy(folder, _holder(opened)) from None
            if tell_at is not None and now >= tell_at:
                _tell(folder, _holder(opened))
                tell_at = None
            time.sleep(LOOK_S)
        except OSError:  # a file system without locks
            return


def _at_most(seconds: float, until: float) -> float:
    """So long, but not longer than until a time of the monotonic clock [s]."""
    return max(min(seconds, until - time.monotonic()), 0.0)


def _tell(folder: Path, who: str) -> None:
    LOG.warning("waiting for %s, which %s is working on", folder, who)


def _holder(opened: int) -> str:
    """Which process has the lock of an open folder; only that there is one, where the system does
    not say (proc_locks(5)).
    """
    stat = os.fstat(opened)
    place = f"{os.major(stat.st_dev):02x}:{os.minor(stat.st_dev):02x}:{stat.st_ino}"
    with suppress(OSError, ValueError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            words = line.split()
            if words[1:2] == ["FLOCK"] and place in words:
                process = int(words[4])
                command = Path(f"/proc/{process}/cmdline").read_bytes().rstrip(b"\0")
                return f"{OTHER_PROCESS}, {process} ({_shown(command)}),"
    return OTHER_PROCESS


def _shown(command: bytes) -> str:
    """A command line in few words, its program without the folder."""
    program, *words = command.decode(errors="replace").split("\0")
    text = " ".join(" ".join([Path(program).name, *words]).split())
    return text if len(text) <= LONGEST_COMMAND else f"{text[:LONGEST_COMMAND]}..."


def _release(held: _Held) -> None:
    held.depth -= 1
    held.thread.release()


def _busy(folder: Path, who: str) -> SessionError:
    return SessionError(
        f"{folder} is being worked on by {who} with an evaluation, a report, an export or a "
        "recovery; try again once that has ended"
    )
