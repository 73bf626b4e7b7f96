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


def utc_text(moment: datetime) -> str:
    """A moment as records keep it: ISO 8601, UTC, to the second."""
    return _in_utc(moment).isoformat(timespec="seconds")


def utc_name(moment: datetime) -> str:
    """A moment as names of files and folders begin with it: 20261121T223000Z."""
    return f"{_in_utc(moment):%Y%m%dT%H%M%SZ}"


def utc_shown(moment: datetime) -> str:
    """A moment for people."""
    return f"{_in_utc(moment):%Y-%m-%d %H:%M:%S} UTC"


def utc_day(text: str) -> str:
    """The date, for people, of a moment as records keep it."""
    return f"{_in_utc(datetime.fromisoformat(text)):%Y-%m-%d}"


def _in_utc(moment: datetime) -> datetime:
    """A moment without a zone is taken for UTC."""
    return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)


def real_time_ns() -> int:
    """This machine's real time, as the kernel stamps what arrives [ns since 1970]."""
    return time.time_ns()


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
