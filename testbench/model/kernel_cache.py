"""Compiled kernels on disk: when the program was replaced in place, and by several processes.

Numba keeps an index beside each module with kernels. The types that they were compiled for are
pickled in it, named tuples by module and name of their class; the stamp of the index, date and size
of that one module, is looked at only after it is unpickled. A class that a newer version has moved
is then not found, and the kernel cannot be called (numba 0.68.1, `numba.core.caching`). Here an
entry that cannot be read is no entry: the kernel is compiled again.

Processes that start together want the same kernels, and would each compile all of them. Here the
first one compiles a kernel, while the others wait for it and read it.

The first commands in a new environment compile some, which takes a while: who looks at a terminal
is told once.
"""

from __future__ import annotations

import fcntl
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pickle import UnpicklingError
from typing import Any

from numba.core import caching, event
from numba.core.dispatcher import Dispatcher

UNREADABLE = (AttributeError, ImportError, EOFError, IndexError, UnpicklingError)
"""What unpickling raises on what another version has written, or half of it (docs of `pickle`)."""


def _forgiving(read: Callable[..., Any], nothing: Callable[[], Any]) -> Callable[..., Any]:
    """A method that reads of the cache, and finds nothing where it cannot."""

    @wraps(read)
    def tried(*arguments: Any) -> Any:
        try:
            return read(*arguments)
        except UNREADABLE:
            return nothing()

    return tried


def forgive() -> None:
    """Let every kernel of this process be compiled anew where what is kept of it is unreadable."""
    file = caching.IndexDataCacheFile
    for name, nothing in (("_load_index", dict), ("_load_data", type(None))):
        read = getattr(file, name, None)
        if read is not None and not hasattr(read, "__wrapped__"):
            setattr(file, name, _forgiving(read, nothing))


LOGGER = "testbench.model.kernel_cache"
COMPILES = (
    "compiling what computes fast: once in a new environment or for a new version, about 15 s of a "
    "processor"
)


class Announcement(event.Listener):
    """Logs, at the first kernel that is in no cache, that kernels are being compiled."""

    def __init__(self) -> None:
        self.told = False

    def on_start(self, event: Any) -> None:
        """A kernel was in no cache."""
        if not self.told:
            logging.getLogger(LOGGER).info(COMPILES)
        self.told = True

    def on_end(self, event: Any) -> None:
        """It is compiled, and the next ones are not told of."""


def announce() -> None:
    """Have it logged that this process compiles; the command line shows that on a terminal."""
    event.register("numba:compile", Announcement())


LONGEST_WAIT_S, ASKED_EVERY_S = 60.0, 0.02
"""A process that takes longer over a kernel may have been stopped: nobody waits on [s]."""


@contextmanager
def _turn(path: str) -> Iterator[None]:
    """The turn of this process at a file; without one where the disk has no room for such files."""
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError:
        yield
        return
    try:
        end = time.monotonic() + LONGEST_WAIT_S
        while time.monotonic() < end:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError:
                time.sleep(ASKED_EVERY_S)
        yield
    finally:
        os.close(file)  # which gives the lock back


def take_turns() -> None:
    """Let every kernel be compiled by one process at a time.

    A kernel that calls another one waits for that with its own lock in hand; kernels do not call
    one another in circles, so that no two processes wait for each other.
    """
    plain = Dispatcher.compile
    if hasattr(plain, "__wrapped__"):
        return

    @wraps(plain)
    def in_turn(dispatcher: Any, signature: Any) -> Any:
        file = getattr(dispatcher._cache, "_cache_file", None)
        if file is None:
            return plain(dispatcher, signature)
        with _turn(f"{file._index_path}.lock"):
            return plain(dispatcher, signature)

    setattr(Dispatcher, "compile", in_turn)  # noqa: B010  (a method that is replaced on purpose)
