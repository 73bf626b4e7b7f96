"""Ctrl-C that ends a recording between two chunks of time, so that nothing is torn."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def on_interrupt(ask_to_stop: Callable[[], None]) -> Iterator[None]:
    """Call `ask_to_stop` on SIGINT and SIGTERM instead of raising in the middle; only the main
    thread gets signals.

    Args:
        ask_to_stop: Must return at once; the recording looks for it between two chunks.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def handle(signum: int, frame: object) -> None:
        ask_to_stop()

    previous = {number: signal.signal(number, handle) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
