"""A lock by which only one bench on this machine drives a controller at a time."""

from __future__ import annotations

import fcntl
import os
import re
import socket
import tempfile
from contextlib import suppress
from pathlib import Path

USED_BY_ANOTHER_RUN = (
    "another run of the bench on this machine drives it; wait for its end, or stop it"
)


class ControllerLock:
    """The right to drive the controller at an address, until let go or the process ends.

    Args:
        host: Name or address of the controller; names of one address share one lock.
    """

    def __init__(self, host: str):
        address = host
        with suppress(OSError, UnicodeError):
            address = socket.gethostbyname(host)
        self.path = (
            Path(tempfile.gettempdir())
            / f"testbench-arm-{re.sub('[^A-Za-z0-9.-]', '_', address)}.lock"
        )
        self._file: int | None = None

    def take(self) -> bool:
        """Whether nobody else holds it; where the file cannot be made nobody is kept out."""
        try:
            self._file = self._open()
        except OSError:
            return True
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            return False
        return True

    def _open(self) -> int:
        """Reading is enough for a lock, and a file of another user can be read."""
        with suppress(FileNotFoundError):
            return os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        return os.open(self.path, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)

    def release(self) -> None:
        """Let go; a second call does nothing.

        The file stays, so that two processes never hold two files of one name.
        """
        if self._file is not None:
            os.close(self._file)
            self._file = None
