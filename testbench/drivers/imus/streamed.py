"""What every live sensor shares: a bounded queue of samples, and notices of faults.

A live sensor has a thread of its own that reads the device and puts samples into the queue; the
recorder takes them out.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbench.drivers.imus.base import Imu
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Event

QUEUE_S = 10.0
"""The queue holds this much of a device's output [s]: longer than any disk takes to sync."""
TALLY_NS = NANOSECONDS
"""Faults of one kind within this time of the first become one event [ns]."""


@dataclass
class _Tally:
    first_ns: int
    count: int = 0
    details: dict[str, Any] = field(default_factory=dict)


class Notices:
    """What happened to a device, as events, and how often in all; may be used from several threads.

    Args:
        time: Of the session.
    """

    def __init__(self, time: SessionTime):
        self._time, self._lock = time, threading.Lock()
        self._events: list[Event] = []
        self._tallies: dict[str, _Tally] = {}
        self.totals: dict[str, int] = {}

    def add(self, event: str, host_time_ns: int | None = None, **details: Any) -> None:
        """Note something that is worth an event of its own."""
        with self._lock:
            self.totals[event] = self.totals.get(event, 0) + 1
            self._events.append(
                Event(self._time.now_ns() if host_time_ns is None else host_time_ns, event, details)
            )

    def tally(self, event: str, count: int = 1, **details: Any) -> None:
        """Note something that may come in swarms.

        The event holds the count of a second and the details of its first.
        """
        with self._lock:
            self.totals[event] = self.totals.get(event, 0) + count
            tally = self._tallies.setdefault(event, _Tally(self._time.now_ns(), 0, details))
            tally.count += count

    def take(self, everything: bool = False) -> list[Event]:
        """Events since the last call.

        Tallies come only once their second is over, unless `everything` is asked for.
        """
        now = self._time.now_ns()
        with self._lock:
            taken, self._events = self._events, []
            for event, tally in list(self._tallies.items()):
                if everything or now - tally.first_ns >= TALLY_NS:
                    taken.append(
                        Event(tally.first_ns, event, {"count": tally.count, **tally.details})
                    )
                    del self._tallies[event]
        return sorted(taken, key=lambda event: event.host_time_ns)


Row = tuple[int, int, int, bool, tuple[float, ...]]
"""device_time_ns, host_time_ns, counter, saturated; angular rate [rad/s], specific force [m/s^2],
field [uT], quaternion.
"""


class SampleQueue:
    """A bounded queue of samples; what does not fit is dropped and counted.

    The device's reader never waits for it.

    Args:
        capacity: Samples it holds.
        magnetometer: Whether each row holds the magnetic field.
        orientation: Whether each row ends with a quaternion.
        notices: Told of drops.
    """

    def __init__(self, capacity: int, magnetometer: bool, orientation: bool, notices: Notices):
        self.capacity, self.magnetometer, self.orientation, self._notices = (
            capacity,
            magnetometer,
            orientation,
            notices,
        )
        self._rows: deque[Row] = deque()
        self.received = 0

    def put(self, row: Row) -> None:
        """Append a sample, or drop it if nobody takes any out."""
        if len(self._rows) >= self.capacity:
            self._notices.tally(
                "samples_dropped", why=f"the queue of {self.capacity} samples was full"
            )
            return
        self._rows.append(row)
        self.received += 1

    def take(self, until_ns: int) -> ImuSamples:
        """Everything that arrived up to a host time."""
        rows: list[Row] = []
        while self._rows and self._rows[0][1] <= until_ns:
            rows.append(self._rows.popleft())
        width = 6 + 3 * self.magnetometer + 4 * self.orientation
        device, host, counter, saturated, values = (
            zip(*rows, strict=True) if rows else ((), (), (), (), ())
        )
        table = np.array(values, dtype=float).reshape(-1, width)
        return ImuSamples(
            np.array(device, dtype=np.int64),
            np.array(host, dtype=np.int64),
            table[:, :3],
            table[:, 3:6],
            table[:, 6:9] if self.magnetometer else None,
            table[:, -4:] if self.orientation else None,
            np.array(counter, dtype=np.int64),
            np.array(saturated, dtype=bool),
        )


class StreamedImu(Imu):
    """A live sensor whose reader puts samples into a queue.

    Args:
        time: Of the session.
        rate: Nominal [Hz].
        magnetometer: Whether its samples hold the magnetic field.
        orientation: Whether its samples hold orientations of the device's own.
        queue_s: Length of the queue [s].
    """

    def __init__(
        self,
        time: SessionTime,
        rate: float,
        magnetometer: bool,
        orientation: bool,
        queue_s: float = QUEUE_S,
    ):
        self.rate, self.has_magnetometer, self.has_orientation = rate, magnetometer, orientation
        self.time = time
        self.notices = Notices(time)
        self.queue = SampleQueue(
            max(round(queue_s * rate), 1), magnetometer, orientation, self.notices
        )
        self._failure: BaseException | None = None
        self._stopped = False

    def read(self, until_ns: int) -> ImuSamples:
        """Wait for a host time, then hand over what has arrived up to it.

        Raises:
            DriverError: The reader failed in a way that reconnecting cannot mend.
        """
        self.time.wait_until(until_ns)
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise DriverError(
                f"the reader of {self} failed: {type(failure).__name__}: {failure}"
            ) from failure
        return self.queue.take(until_ns)

    def events(self) -> list[Event]:
        """What happened since the last call; the same fault many times in a second is one event."""
        return self.notices.take(everything=self._stopped)

    def statistics(self) -> dict[str, int]:
        """How many samples were kept, and how often each kind of event happened so far."""
        return {"samples": self.queue.received, **self.notices.totals}
