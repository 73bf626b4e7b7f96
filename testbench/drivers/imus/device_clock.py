"""A device's own clock: counters that wrap, boards that restart, samples that were lost."""

from __future__ import annotations

from testbench.frames import NANOSECONDS

LONGEST_BACKLOG_NS = 30 * NANOSECONDS
"""Samples may reach the host this late without the device's clock being doubted [ns]; a Bluetooth
link stalls for seconds.
"""
AFTER_RECONNECT_NS = 2 * NANOSECONDS
"""The same for the first sample of a new connection, behind which nothing can have piled up
[ns].
"""


class DeviceClock:
    """Turns wrapping time stamps into times that only grow, with the host's clock as witness.

    A stamp is known modulo `wrap_ns`. Which turn it belongs to, the host says: the last accepted
    sample's time plus what has passed on the host since. So wraps are resolved across gaps of any
    length, and a device that started anew is noticed.

    Args:
        wrap_ns: Period of the stamp [ns], None if it does not wrap.
    """

    def __init__(self, wrap_ns: int | None):
        self.wrap_ns = wrap_ns
        self.last_ns: int | None = None
        self._last_host_ns = 0
        self._offset_ns = 0
        self._fresh = False

    def reconnected(self) -> None:
        """The next stamp comes over a new connection: nothing is queued behind it, and the device
        may have restarted.
        """
        self._fresh = True

    def unwrap(self, stamp_ns: int, host_ns: int) -> int | None:
        """The time of a stamp, on the scale of the first one [ns]; None if it contradicts the
        host's clock.
        """
        if self.last_ns is None:
            return stamp_ns
        predicted, time = self._predicted(host_ns), stamp_ns + self._offset_ns
        tolerance = AFTER_RECONNECT_NS if self._fresh else LONGEST_BACKLOG_NS
        if self.wrap_ns is not None:
            time += round((predicted - time) / self.wrap_ns) * self.wrap_ns
            tolerance = min(tolerance, self.wrap_ns // 4)
        if abs(time - predicted) > tolerance or (self._fresh and time <= self.last_ns):
            return None
        return time

    def accept(self, time_ns: int, host_ns: int) -> None:
        """Take a time for granted; later ones are compared with it."""
        if self.last_ns is None or time_ns > self.last_ns:
            self.last_ns, self._last_host_ns = time_ns, host_ns
        self._fresh = False

    def restart(self, stamp_ns: int, host_ns: int) -> int:
        """The device counts from anew: carry its time on by the host's clock, and return that of
        the stamp [ns].
        """
        time = self._predicted(host_ns)
        self._offset_ns = time - stamp_ns
        self.accept(time, host_ns)
        return time

    def _predicted(self, host_ns: int) -> int:
        return (self.last_ns or 0) + max(host_ns - self._last_host_ns, 1)


class SampleCounter:
    """A running number for each sample; a step of more than one is a loss.

    Args:
        rate: Nominal [Hz]; losses are told from steps of time where the device sends no counter.
        wrap: The device's counter runs from 0 to wrap - 1, None if it does not wrap.
    """

    def __init__(self, rate: float, wrap: int | None = None):
        self._period_ns, self._wrap = NANOSECONDS / rate, wrap
        self._value = -1
        self._time_ns: int | None = None
        self._own: int | None = None

    def step(self, time_ns: int | None, own: int | None = None, restarted: bool = False) -> int:
        """How many periods this sample lies after the last one; 0 for one that was sent twice.

        Args:
            time_ns: Of the sample, by the device; None where only the order is known.
            own: The device's counter, if it sends one.
            restarted: The device began to count anew.
        """
        previous_time, previous_own = self._time_ns, self._own
        self._time_ns, self._own = time_ns, own
        if previous_time is None and previous_own is None:
            return 1
        if own is not None and previous_own is not None and not restarted:
            step = own - previous_own if self._wrap is None else (own - previous_own) % self._wrap
            if step >= 0 and self._credible(step, time_ns, previous_time):
                return step
        if time_ns is None or previous_time is None:
            return 1
        return max(1, round((time_ns - previous_time) / self._period_ns))

    def advance(self, step: int) -> int:
        """The number of a sample that lies `step` after the last one."""
        self._value += step
        return self._value

    def _credible(self, step: int, time_ns: int | None, previous_ns: int | None) -> bool:
        """Whether the clock does not contradict a counter's step, as it does where a digit was lost
        on the line.
        """
        if time_ns is None or previous_ns is None:
            return True
        return step * self._period_ns <= 2 * max(time_ns - previous_ns, 0) + NANOSECONDS
