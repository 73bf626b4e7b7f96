"""From a controller's own time to the host's, by the packages that were delayed least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BLOCK_NS = 5_000_000_000
"""The least delayed package is sought in blocks of this length [ns]; that of the last two blocks
counts.
"""
LATELY_NS = 200_000_000
"""The same for what the packages of right now say; at 125 Hz a block holds 25 of them."""
SLEW = 200e-6
"""The estimate follows the clocks' drift by at most this much (relative); quartz clocks differ by
less.
"""
STEP_NS = 10_000_000
"""A difference beyond this is no drift: one of the clocks has made a step, or the packages are
delayed.
"""
ANSWER_NS = 30_000_000
"""Where answers come faster than this the packages themselves are not delayed by more."""
SENT_NS = 500_000
"""A controller is taken to send a report within this time of its stamp [ns]: an assumption; 0.2 ms
were seen of the emulated one.
"""
WITNESSES = 10
"""So many packages of right now must say that the difference of the clocks has grown."""


@dataclass(frozen=True)
class ClockStep:
    """One of the clocks went on by more, or by less, than the other.

    Attributes:
        host_ns: When it was found.
        by_ns: Change of host time less controller time; times before it may be wrong by this.
    """

    host_ns: int
    by_ns: int


class _Least:
    """The smallest difference of the present block and of the one before."""

    def __init__(self, length_ns: int):
        self._length, self._start = length_ns, 0
        self._now = self._before = float("inf")
        self._counts = (0, 0)

    def add(self, difference: float, arrival_ns: int) -> float | None:
        """Take a difference in; that of the block that is over, where one is."""
        passed, over = arrival_ns - self._start, None
        if passed > self._length:
            over = self._now if self._counts[1] else None
            self._before = self._now if passed < 2 * self._length else float("inf")
            self._counts = (self._counts[1] if np.isfinite(self._before) else 0, 0)
            self._now, self._start = difference, arrival_ns
        self._counts = (self._counts[0], self._counts[1] + 1)
        self._now = min(self._now, difference)
        return over

    @property
    def count(self) -> int:
        """How many differences the two blocks hold."""
        return sum(self._counts)

    @property
    def value(self) -> float:
        return min(self._now, self._before)


class ControllerClock:
    """Maps the controller's time stamps to host time.

    A package arrives late by a delay that is never negative, so the smallest difference between
    arrival and stamp is nearest to the offset between the clocks. Once it is in use the mapping
    follows drift slowly, and steps only where there is proof:

    - a package that arrives before the time of its stamp proves that the offset is too large;
    - an effect whose stamp lies before its cause proves that it is too small, and so does a stamp
      that lies before the one before it. Packages that merely come late prove nothing.

    The second needs two witnesses: such a stamp, and all packages of right now.

    Attributes:
        round_trip_ns: The controller answered a question within this time [ns]; no package of the
            same connection that came as fast was under way for longer.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self.round_trip_ns = 0
        self._excess = 0.0
        self._stamp_ns = 0
        self._before: float | None = None
        self._least, self._lately = _Least(BLOCK_NS), _Least(LATELY_NS)
        self._last_ns = 0
        self._slewing = False
        self._steps: list[ClockStep] = []

    @property
    def offset_ns(self) -> float:
        """Host time less controller time [ns]; zero before the first package."""
        return 0.0 if self._offset is None else self._offset

    @property
    def unsure_ns(self) -> float:
        """By how much host times of stamps may be off [ns].

        The least delay of a package is between nothing and the fastest round trip, beside what the
        controller takes to send it. In every block
        it may be larger, by what the least delayed package of the block came later than mapped.
        """
        return self.round_trip_ns + SENT_NS + self._excess

    def begin(self) -> None:
        """Samples are being recorded: let the mapping go on smoothly, unless it is proved wrong."""
        self._slewing = True

    def steps(self) -> list[ClockStep]:
        """The steps since the last call."""
        steps, self._steps = self._steps, []
        return steps

    def at(self, controller_ns: int) -> int:
        """Host time of a stamp by what is known now [ns]."""
        return round(controller_ns + self.offset_ns)

    def host_ns(self, controller_ns: int, arrival_ns: int) -> int:
        """Host time of a stamp, from a package that arrived just now [ns]."""
        difference = float(arrival_ns - controller_ns)
        over = self._least.add(difference, arrival_ns)
        if over is not None and self._slewing and self._offset is not None:
            self._excess = max(self._excess, abs(over - self._offset))
        if controller_ns < self._stamp_ns:
            self._before = self._lately.value
            self._lately = _Least(LATELY_NS)
        self._stamp_ns = controller_ns
        self._lately.add(difference, arrival_ns)
        target = self._least.value
        if self._offset is None or not self._slewing:
            self._offset = target
        elif difference < self._offset - STEP_NS:
            self._step(difference, arrival_ns)
        elif self._before is not None and self._lately.count >= WITNESSES:
            grown, self._before = self._lately.value - self._before, None
            if grown > STEP_NS:  # late packages were as late before
                self._step(self._offset + grown, arrival_ns)
        elif target < self._offset + STEP_NS:  # further off it is no drift
            most = SLEW * max(arrival_ns - self._last_ns, 0)
            self._offset += min(max(target - self._offset, -most), most)
        self._last_ns = arrival_ns
        return self.at(controller_ns)

    def not_before(self, controller_ns: int, cause_ns: int, margin_ns: int = STEP_NS) -> float:
        """Take note of a stamp of something that cannot have happened before its cause.

        Where it seems to, and the packages of right now all say that the clocks' difference has
        grown, the mapping follows at once: to their least difference, or as far as the cause
        demands where that is much less, for then they are delayed too.

        Args:
            controller_ns: A stamp not older than that of the effect.
            cause_ns: Host time of the cause [ns].
            margin_ns: The mapping steps where the effect seems to precede it by more [ns].

        Returns:
            By how much the effect still seems to precede its cause [s]; zero where it does not.
        """
        if self._offset is None:
            return 0.0
        needed = float(cause_ns - controller_ns)
        lately = self._lately.value
        grown = lately > self._offset + STEP_NS and self._lately.count >= WITNESSES
        if self._slewing and needed > self._offset + margin_ns and grown:
            self._step(lately if lately - needed < ANSWER_NS else needed, cause_ns)
        return max(needed - self._offset, 0.0) * 1e-9

    def _step(self, offset: float, now_ns: int) -> None:
        self._steps.append(ClockStep(now_ns, round(offset - self.offset_ns)))
        self._offset = offset
        self._least, self._lately = _Least(BLOCK_NS), _Least(LATELY_NS)
        self._least.add(offset, now_ns)
        self._lately.add(offset, now_ns)
