"""The driving process's end of its connection to the bench: what it says never makes it wait."""

from __future__ import annotations

import threading
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any


class Outbox:
    """Sends in a thread of its own.

    A bench that is held up does not read. Who sends to it would wait once the line between them is
    full, after two to three seconds of samples, and the controller's watchdog would end the program
    for it.

    Args:
        connection: To the bench.
    """

    def __init__(self, connection: Connection):
        self._connection = connection
        self._waiting: SimpleQueue[Any] = SimpleQueue()
        self._sent = threading.Semaphore(0)
        self._asked, self._broken = 0, False
        threading.Thread(target=self._run, name="outbox", daemon=True).start()

    def send(self, message: Any) -> None:
        """Let a message go as soon as the bench takes it; it must not be changed any more.

        Raises:
            BrokenPipeError: The bench is gone.
        """
        if self._broken:
            raise BrokenPipeError("the bench is gone")
        self._asked += 1
        self._waiting.put(message)

    def flush(self, patience_s: float) -> None:
        """Wait until all is sent, for so long at most [s]."""
        while self._asked and not self._broken and self._sent.acquire(timeout=patience_s):
            self._asked -= 1

    def poll(self, timeout: float = 0.0) -> bool:
        """Whether the bench has said something, or is gone, within a time [s]."""
        return self._connection.poll(timeout)

    def recv(self) -> Any:
        """What the bench has said.

        Raises:
            EOFError: It is gone.
        """
        return self._connection.recv()

    def _run(self) -> None:
        while not self._broken:
            message = self._waiting.get()
            try:
                self._connection.send(message)
            except OSError:
                self._broken = True
            self._sent.release()
