"""A clock on which several threads take turns: one runs at a time, and time passes only while all
of them sleep.
"""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime

STUCK_S = 120.0
"""A thread that gets no turn for so long never will [s of the machine]."""


class Killed(BaseException):
    """Ends a thread that was killed."""


@dataclass(order=True)
class _Sleeper:
    wake_ns: int
    number: int
    turn: threading.Event = field(default_factory=threading.Event, compare=False)


class Task:
    """A thread that takes its turns on the clock.

    Attributes:
        at_death: Done in the place of the operating system when the thread is killed.
    """

    def __init__(self, clock: LockStep, work: Callable[[], object]):
        self.clock, self.ended, self.killed, self.dying = clock, False, False, False
        self.at_death: list[Callable[[], None]] = []
        self.failure: BaseException | None = None
        self._work = work
        self._sleeper = clock._expect(0.0)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self._sleeper.turn.wait()
        self.clock._tasks[threading.get_ident()] = self
        try:
            with suppress(Killed):
                self._work()
        except BaseException as failure:
            self.failure = failure
        finally:
            self.ended = True
            self.clock._hand_over(None)

    def kill(self) -> None:
        """End it at once, as SIGKILL does a process."""
        self.killed = True

    def wait(self, timeout: float = 60.0) -> bool:
        """Whether it ended within some time of the clock [s]."""
        end_ns = self.clock.now_ns + round(1e9 * timeout)
        while not self.ended and self.clock.now_ns < end_ns:
            self.clock.sleep(0.01)
        return self.ended


class LockStep:
    """The clock.

    Attributes:
        now_ns: Monotonic time [ns].
        due_ns: When something else than a thread must be done next.
        do: Does it; the clock stands at `due_ns` meanwhile.
    """

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000
        self.due_ns: Callable[[], int | None] = lambda: None
        self.do: Callable[[], None] = lambda: None
        self._asleep: list[_Sleeper] = []
        self._number = itertools.count()
        self._tasks: dict[int, Task] = {}
        self._started: list[Task] = []
        self._failure: BaseException | None = None

    def utc(self) -> datetime:
        return datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        """Let the others have their turns; one that sleeps for nothing goes to the end of the
        queue.
        """
        self._hand_over(self._expect(seconds))
        task = self._tasks.get(threading.get_ident())
        if task is None and self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure
        if task is not None and task.killed and not task.dying:
            task.dying = True
            for action in task.at_death:
                action()
            raise Killed

    def start(self, work: Callable[[], object]) -> Task:
        """Let a thread of its own do something from now on."""
        self._started.append(Task(self, work))
        return self._started[-1]

    @property
    def task(self) -> Task | None:
        """Whose turn it is; None for the test's own thread."""
        return self._tasks.get(threading.get_ident())

    def close(self) -> None:
        """Kill what still runs, and raise what went wrong in a thread that nobody asked."""
        for task in self._started:
            task.kill()
        assert all(task.wait() for task in self._started), "a thread does not end"
        for task in self._started:
            if task.failure is not None:
                raise task.failure

    def _expect(self, seconds: float) -> _Sleeper:
        wake_ns = self.now_ns + max(round(1e9 * seconds), 0)
        sleeper = _Sleeper(wake_ns, next(self._number))
        heapq.heappush(self._asleep, sleeper)
        return sleeper

    def _hand_over(self, sleeper: _Sleeper | None) -> None:
        """Wake whoever wakes first, and wait for the turn of `sleeper`."""
        if not self._asleep:
            return
        first = heapq.heappop(self._asleep)
        try:
            self._go_to(first.wake_ns)
        except BaseException as failure:  # of an emulator: the test must hear of it
            self._failure = failure
        if first is sleeper:
            return
        first.turn.set()
        if sleeper is not None:
            assert sleeper.turn.wait(STUCK_S), "whose turn it is does not go on"

    def _go_to(self, time_ns: int) -> None:
        while (due := self.due_ns()) is not None and due <= time_ns:
            self.now_ns = max(due, self.now_ns)
            self.do()
        self.now_ns = max(time_ns, self.now_ns)
