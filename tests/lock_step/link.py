"""The process that drives an arm, as a thread on the lock-step clock."""

from __future__ import annotations

import pickle
import subprocess
from collections import deque
from typing import Any

from testbench.drivers.arms.link import Link
from testbench.drivers.arms.worker import serve
from tests.lock_step.clock import LockStep, Task

LOOK_S = 0.001
"""One who waits for a message looks so often [s]."""


class PipeEnd:
    """What bench and driving process use of `multiprocessing.connection.Connection`."""

    peer: PipeEnd

    def __init__(self, clock: LockStep):
        self.clock, self.closed = clock, False
        self.inbox: deque[bytes] = deque()

    def send(self, message: Any) -> None:
        if self.closed or self.peer.closed:
            raise BrokenPipeError("the other end is closed")
        self.peer.inbox.append(pickle.dumps(message))

    def poll(self, timeout: float = 0.0) -> bool:
        end_ns = self.clock.now_ns + round(1e9 * timeout)
        while not self.inbox and not self.peer.closed and self.clock.now_ns < end_ns:
            self.clock.sleep(LOOK_S)
        return bool(self.inbox) or self.peer.closed

    def recv(self) -> Any:
        while not self.poll(LOOK_S):
            pass
        if not self.inbox:
            raise EOFError
        return pickle.loads(self.inbox.popleft())

    def close(self) -> None:
        self.closed = True


class Process:
    """What the bench uses of `subprocess.Popen`."""

    def __init__(self, task: Task):
        self._task = task

    def kill(self) -> None:
        self._task.kill()

    def wait(self, timeout: float | None = None) -> int:
        if not self._task.wait(60.0 if timeout is None else timeout):
            raise subprocess.TimeoutExpired("the driving process", timeout or 60.0)
        return -9 if self._task.killed else 0


class LockStepLink(Link):
    """The bench's end."""

    time: LockStep

    def _start(self) -> Any:
        ours, theirs = PipeEnd(self.time), PipeEnd(self.time)
        ours.peer, theirs.peer = theirs, ours
        task = self.time.start(lambda: _serve(theirs))
        task.at_death.append(theirs.close)
        return ours, Process(task)


def _serve(end: PipeEnd) -> None:
    try:
        serve(end, end.clock)  # type: ignore[arg-type]
    finally:
        end.close()
