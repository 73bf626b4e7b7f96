"""The time of a session: nanoseconds since it began, of this machine or of a simulation.

Arms, sensors and the loop of a run ask it and wait by it; which of the two it is, none of them
knows.
"""

from __future__ import annotations

from typing import Literal

from testbench.clock import Clock
from testbench.frames import NANOSECONDS

CYCLE_NS = NANOSECONDS // 10
"""Where a second takes a second, samples are taken this often [ns]."""
STRETCH_NS = 10 * NANOSECONDS
"""A simulation that goes as fast as it can takes so much at once [ns]."""
HOLD_S = 0.02
"""While virtual time stands still, somebody looks this often whether it may go on [s]."""

Speed = Literal["fast", "realtime"]
"""How virtual time passes: as fast as the machine goes, or a second a second."""


class SessionTime:
    """Real time, the same for all devices of a session.

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

    def next_ns(self, after_ns: int) -> int:
        """Up to when to record after a time [ns]: behind a slow disk in one go what has passed."""
        return max(after_ns + CYCLE_NS, self.now_ns())

    def wait_until(self, host_time_ns: int) -> None:
        """Sleep until a time; returns at once when it has passed."""
        self.clock.sleep((host_time_ns - self.now_ns()) / NANOSECONDS)


class VirtualTime(SessionTime):
    """Time of a simulation: it passes because somebody waits for it, and may be held.

    Args:
        clock: Whose seconds "realtime" keeps to.
        speed: How it passes.
        known_ns: So much is gone through fast at either speed, since a session that is gone on with
            holds it already [ns].
    """

    def __init__(self, clock: Clock, speed: Speed = "fast", known_ns: int = 0):
        super().__init__(clock)
        self.speed: Speed = speed
        self.known_ns = known_ns
        self._now_ns = 0
        self._held_since: int | None = None

    def start(self) -> None:
        if self._origin_ns is None:
            self._origin_ns = self.clock.monotonic_ns() - self.known_ns

    def now_ns(self) -> int:
        return self._now_ns

    def next_ns(self, after_ns: int) -> int:
        if self._held_since is not None:
            return after_ns
        return after_ns + (CYCLE_NS if self.speed == "realtime" else STRETCH_NS)

    def wait_until(self, host_time_ns: int) -> None:
        """Let time pass; while it is held, it does not, and this returns after a moment."""
        if self._held_since is not None:
            self.clock.sleep(HOLD_S)
            return
        if self.speed == "realtime" and host_time_ns > self.known_ns:
            begin = self.clock.monotonic_ns() if self._origin_ns is None else self._origin_ns
            self.clock.sleep((begin + host_time_ns - self.clock.monotonic_ns()) / NANOSECONDS)
        self._now_ns = max(self._now_ns, host_time_ns)

    def hold(self) -> None:
        """Let it stand still; a second call does nothing."""
        if self._held_since is None:
            self._held_since = self.clock.monotonic_ns()

    def go_on(self) -> None:
        """Let it pass again, as if it had never been held."""
        if self._held_since is not None and self._origin_ns is not None:
            self._origin_ns += self.clock.monotonic_ns() - self._held_since
        self._held_since = None
