"""A second process beside the one that lives with a client library: it may open connections."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

PATIENCE_S = 6.0
"""An answer takes no longer [s]: stopping an arm from outside and looking at it is bounded."""


class Helper:
    """Does things in a process of its own, which ends with this one.

    It is forked before there are threads, client libraries and limits.

    Args:
        not_its_own: Descriptors that it must not keep open.
    """

    def __init__(self, not_its_own: Iterable[int] = ()):
        ours, theirs = socket.socketpair()
        if os.fork() == 0:
            ours.close()
            for descriptor in not_its_own:
                os.close(descriptor)
            _serve(Connection(theirs.detach()))
            os._exit(0)
        theirs.close()
        self._connection = Connection(ours.detach())

    def ask(self, function: Callable[..., Any], *arguments: Any) -> Any | None:
        """What a function returns there; None where nothing came back in time.

        Args:
            function: Of a module, by which it is found.
            arguments: Of it.
        """
        with suppress(OSError, EOFError):
            self._connection.send((function, arguments))
            if self._connection.poll(PATIENCE_S):
                return self._connection.recv()
        return None


def _serve(connection: Connection) -> None:
    with suppress(OSError, EOFError):
        while True:
            function, arguments = connection.recv()
            try:
                answer = function(*arguments)
            except Exception:  # nothing may come of it: who asked is told that nothing came back
                answer = None
            connection.send(answer)
