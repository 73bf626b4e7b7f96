"""One process at a time works on what is derived from a session.

Estimate, evaluation, report and exports that lie together are of one another.
"""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
LOOK_S = 0.05


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
    without locks nothing is kept away; a folder that does not exist needs no lock.

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
    if not held.thread.acquire(timeout=max(until - time.monotonic(), 0.0)):
        raise _busy(folder)
    if held.depth == 0:
        try:
            _take_from_processes(opened, folder, until)
        except BaseException:
            held.thread.release()
            raise
    held.depth += 1


def _take_from_processes(opened: int, folder: Path, until: float) -> None:
    while True:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() >= until:
                raise _busy(folder) from None
            time.sleep(LOOK_S)
        except OSError:  # a file system without locks
            return


def _release(held: _Held) -> None:
    held.depth -= 1
    held.thread.release()


def _busy(folder: Path) -> SessionError:
    return SessionError(
        f"{folder} is being worked on by another process (an evaluation, a report, an export or a "
        "recovery); try again once that has ended"
    )
