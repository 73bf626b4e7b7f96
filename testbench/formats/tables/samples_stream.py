"""From the columns of a source to chunks of ImuSamples: the same steps for every format."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from testbench.exceptions import FileProblems
from testbench.formats.tables.broken_lines import left_out
from testbench.formats.tables.mending import Mender
from testbench.formats.tables.order import Order
from testbench.formats.tables.rows import Rows
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.formats.tables.spaced import Spaced
from testbench.formats.tables.timeline import (
    YEAR_NS,
    BadRowError,
    CounterUnwrapper,
    StampedTime,
    Timeline,
)
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples

GRAVITY_UP = np.array([0.0, 0.0, STANDARD_GRAVITY])
LATEST = 1 << 62


@dataclass(frozen=True)
class Quantities:
    """What the columns of a chunk mean, in the units of a session and in the sensor frame.

    Attributes:
        gyr: Angular rate, shape (n, 3) [rad/s], or None where the file has none: NaN then.
        acc: Specific force, shape (n, 3) [m/s^2], or None where the file has none: NaN then.
        mag: Magnetic field, shape (n, 3) [uT], or None.
        device_q: q_earth_from_sensor, shape (n, 4), or None.
        saturated: Shape (n,), bool, or None where the file does not tell.
        temperature: Of the part, shape (n,) [deg C], or None.
    """

    gyr: np.ndarray | None
    acc: np.ndarray | None
    mag: np.ndarray | None = None
    device_q: np.ndarray | None = None
    saturated: np.ndarray | None = None
    temperature: np.ndarray | None = None


Convert = Callable[[Columns], Quantities]


class SampleStream:
    """Chunks of samples; can be gone through more than once.

    Args:
        source: The table.
        kinds: Columns that `convert` needs.
        convert: From columns to quantities.
        timeline: Makes the clock; called for each pass.
        counter: Column of the sample counter, or None to count rows.
        drop: Rows at the beginning to leave out.
        origin_ns: device_time_ns at which host_time_ns is zero; None for the first sample's.
    """

    def __init__(
        self,
        source: Source,
        kinds: Mapping[str, Kind],
        convert: Convert,
        timeline: Callable[[], Timeline],
        counter: str | None = None,
        drop: int = 0,
        origin_ns: int | None = None,
    ):
        self.source, self.drop, self.origin_ns = source, drop, origin_ns
        self._kinds, self._convert, self._timeline, self._counter = (
            dict(kinds),
            convert,
            timeline,
            counter,
        )
        self._like: SampleStream | None = None
        self._findings: list[Finding] = []

    def __iter__(self) -> Iterator[ImuSamples]:
        taken, origin, unwrap = 0, self.origin_ns, CounterUnwrapper()
        for rows in self._rows():
            counter = (
                unwrap(rows.columns[self._counter])
                if self._counter
                else np.arange(taken, taken + len(rows), dtype=np.int64)
            )
            if origin is None:
                origin = int(rows.time[0])
            yield _assemble(rows.time, origin, counter, self._convert(rows.columns))
            taken += len(rows)

    def with_rows_of(self, other: SampleStream | None) -> SampleStream:
        """This stream, with the rows that another stream of the same table has.

        Args:
            other: Whose columns tell which rows repeat others; None for its own.
        """
        self._like = other
        return self

    def findings(self) -> list[Finding]:
        """What was noticed in the last pass that came to an end: of the times, and of lines."""
        return [*self._findings, *left_out(self.source)]

    def first(self) -> ImuSamples:
        """The first chunk.

        Raises:
            FileProblems: There are no samples.
        """
        for chunk in self:
            return chunk
        raise self.problem("there are no samples in the file")

    def first_time_ns(self) -> int:
        """Time of the first sample on the file's own clock [ns], for others on the same clock."""
        for rows in self._rows():
            return int(rows.time[0])
        raise self.problem("there are no samples in the file")

    def goes_on_until(self, time_ns: int) -> int | None:
        """None if there are samples at or after a time on the file's own clock, else the last one.

        Args:
            time_ns: [ns].
        """
        last = None
        for rows in self._rows():
            last = int(rows.time[-1])
            if last >= time_ns:
                return None
        return last

    def problem(self, message: str) -> FileProblems:
        """The error that says `message` of the source."""
        return self.source.problem(message)

    def _rows(self) -> Iterator[Rows]:
        """Rows with their times, mended where they are stamped."""
        timeline = self._timeline()
        needed = self.needed
        if self._like is not None:
            needed = self._like.needed | needed
        kinds = needed | timeline.kinds
        if not kinds:
            raise self.source.problem("no column of the file is used")
        pieces = self._stamped(kinds, timeline, set(needed))
        try:
            if not isinstance(timeline, StampedTime):
                yield from pieces
                return
            order = Order(timeline.counted_ns, timeline.local, timeline.rate is not None)
            mender = Mender(order)
            spaced = None if timeline.rate is None else Spaced(timeline.rate, timeline.column)
            for rows in mender(pieces):
                if spaced is not None:
                    rows.time = spaced(rows.time, mender.habit)
                yield rows
        except BadRowError as error:
            raise self.source.problem(str(error), error.row) from None
        self._findings = mender.findings() + ([] if spaced is None else spaced.findings())

    @property
    def needed(self) -> dict[str, Kind]:
        """The columns by which rows are told apart."""
        return self._kinds | ({self._counter: "integer"} if self._counter else {})

    def _stamped(
        self, kinds: dict[str, Kind], timeline: Timeline, kept: set[str]
    ) -> Iterator[Rows]:
        """Rows as they are in the file."""
        row, latest = 0, -LATEST
        ordered = isinstance(timeline, StampedTime)  # those are put in order later
        for whole in self.source.chunks(kinds):
            count = len(next(iter(whole.values())))
            left_out = min(max(self.drop - row, 0), count)
            columns = (
                {name: values[left_out:] for name, values in whole.items()} if left_out else whole
            )
            row, count = row + left_out, count - left_out
            if not count:
                continue
            try:
                time = timeline(columns, count)
                if not ordered:
                    _check_order(time, latest)
            except BadRowError as error:
                raise self.source.problem(str(error), row + error.row) from None
            own = {name: values for name, values in columns.items() if name in kept}
            yield Rows(time, np.arange(row, row + count), own)
            row, latest = row + count, int(time[-1])


def _check_order(time: np.ndarray, latest: int) -> None:
    steps = np.diff(time, prepend=latest)
    if np.any(steps < 0):
        row = int(np.argmax(steps < 0))
        before, after = (time[row] - steps[row]) / NANOSECONDS, time[row] / NANOSECONDS
        raise BadRowError(
            f"time goes back from {before:.6f} s to {after:.6f} s; samples must stand in the "
            "order of time",
            row,
        )


def _assemble(time: np.ndarray, origin: int, counter: np.ndarray, q: Quantities) -> ImuSamples:
    count = len(time)
    calendar = (
        abs(origin) > YEAR_NS
    )  # a date, not a clock that began at power-up: only the time since the start is kept
    return ImuSamples(
        time - origin if calendar else time,
        time - origin,
        np.full((count, 3), np.nan) if q.gyr is None else q.gyr,
        np.full((count, 3), np.nan) if q.acc is None else q.acc,
        q.mag,
        q.device_q,
        counter,
        np.zeros(count, dtype=bool) if q.saturated is None else q.saturated,
        q.temperature,
    )


def stack(
    columns: Columns, names: list[str], factor: float = 1.0, offset: float = 0.0
) -> np.ndarray:
    """Columns side by side, less an offset and then times a factor.

    Args:
        columns: By name, each of shape (n,).
        names: Those wanted, k of them.
        factor: Of every number.
        offset: Taken off every number first.

    Returns:
        Shape (n, k), each column in one piece: checks and disk take them one by one.
    """
    result = np.empty((len(names), len(columns[names[0]])))
    with np.errstate(over="ignore"):  # infinite: not finite is what is said of it later
        for name, row in zip(names, result, strict=True):
            if offset:
                np.subtract(columns[name], offset, out=row)
                row *= factor
            else:
                np.multiply(columns[name], factor, out=row)
    return result.T


def specific_force(q_earth_from_sensor: np.ndarray, free_acceleration: np.ndarray) -> np.ndarray:
    """Specific force in the sensor from the vendor's acceleration in the earth without gravity.

    Vendors write quaternions to a few digits; they are brought to unit length first.

    Args:
        q_earth_from_sensor: As the vendor has it, shape (n, 4).
        free_acceleration: In the earth, shape (n, 3) [m/s^2].

    Returns:
        Shape (n, 3) [m/s^2]; NaN where there is no orientation.
    """
    return rotation.rotate(
        rotation.conjugate(_unit(q_earth_from_sensor)), free_acceleration + GRAVITY_UP
    )


def increment_rate(dq: np.ndarray, rate: float) -> np.ndarray:
    """Angular rate of orientation increments.

    Args:
        dq: Over one output interval each, shape (n, 4).
        rate: Of the output [Hz].

    Returns:
        Shape (n, 3) [rad/s].
    """
    q = _unit(dq)
    known = np.isfinite(q).all(axis=1)
    result = np.full((len(q), 3), np.nan)
    result[known] = rotation.to_rotation_vector(q[known]) * rate
    return result


def _unit(q: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(q, axis=1, keepdims=True)
        return np.asarray(q / np.where((norm > 0) & np.isfinite(norm), norm, np.nan))


def measured_rate(samples: ImuSamples) -> float | None:
    """Mean rate without gaps [Hz], or None where it cannot be told.

    Stamps may be coarse, even repeat.
    """
    return rate_of_times(samples.device_time_ns) if len(samples) > 2 else None


def rate_of_times(time_ns: np.ndarray) -> float | None:
    """Mean rate of instants without gaps [Hz], or None where none comes after another.

    Args:
        time_ns: Shape (n,) [ns].
    """
    steps = np.diff(time_ns)
    if not np.any(steps > 0):
        return None
    usual = steps[steps <= 5 * np.median(steps[steps > 0])]
    return float(NANOSECONDS / usual.mean())
