"""The wall clock, in one place, so that everything below the command line is given its time instead
of reading it.
"""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """What a run needs of time."""

    def utc(self) -> datetime:
        """The date and time, in UTC."""
        ...

    def monotonic_ns(self) -> int:
        """Nanoseconds of a clock that never goes back."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait."""
        ...


def seconds(clock: Clock) -> float:
    """Seconds of a clock that never goes back."""
    return clock.monotonic_ns() * 1e-9


class SystemClock:
    """The clock of this machine."""

    def utc(self) -> datetime:
        """The date and time, in UTC."""
        return datetime.now(UTC)

    def monotonic_ns(self) -> int:
        """Nanoseconds of the monotonic clock."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(max(seconds, 0.0))
