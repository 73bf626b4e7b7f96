"""What a process may do that serves one client library alone."""

from __future__ import annotations

import resource
import threading
from collections.abc import Callable

STANDARD_STREAMS = 3


def forbid_connections() -> None:
    """Let this process open nothing more: no file, no socket.

    A client library that loses its connection must not come back by itself, upload its program
    again and take the arm over while somebody else looks after it. ur_rtde (1.6.5) has no switch
    for that; its attempt fails when the system refuses a new descriptor. Those that are open stay
    usable (setrlimit(2): the limit is on the number of the next one). What must be connected to all
    the same, a `Helper` does.
    """
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (STANDARD_STREAMS, most))


def within(call: Callable[[], object], patience_s: float) -> bool:
    """Whether a call came back in time without an exception; it is left alone where it does not.

    Args:
        call: That may hang, with the interpreter's lock let go of.
        patience_s: For it [s].
    """
    done: list[bool] = []

    def run() -> None:
        try:
            call()
        except Exception:
            return
        done.append(True)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(patience_s)
    return bool(done)
