"""The time of a session, the same for its arm and all its sensors."""

from __future__ import annotations

from testbench.clock import Clock
from testbench.frames import NANOSECONDS


class SessionTime:
    """Nanoseconds since the session began, the same for all its devices.

    Args:
        clock: Gives the monotonic time.
    """

    def __init__(self, clock: Clock):
        self.clock = clock
        self._origin_ns: int | None = None

    def start(self) -> None:
        """Time 0 is now; a second call does nothing."""
        if self._origin_ns is None:
            self._origin_ns = self.clock.monotonic_ns()

    def now_ns(self) -> int:
        """Time since the start [ns], 0 before it."""
        return 0 if self._origin_ns is None else self.clock.monotonic_ns() - self._origin_ns

    def wait_until(self, host_time_ns: int) -> None:
        """Sleep until a time; returns at once when it has passed."""
        self.clock.sleep((host_time_ns - self.now_ns()) / NANOSECONDS)
