"""What one sensor reported and what it went through, on disk, read as it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from testbench.exceptions import SessionError
from testbench.records.disk.chunks import overlapping
from testbench.records.disk.neighbouring_rows import MOST_THINNED, is_long, read_near
from testbench.records.disk.tables import (
    ROWS_PER_GROUP,
    parquet_shape,
    read_parquet,
    read_parquet_batches,
    read_stacked,
)
from testbench.records.session.samples import TRUTH_Q, TRUTH_RATE, ImuSamples, Truth
from testbench.records.session.sound_tables import (
    RESTARTED_NS,
    Times,
    refuse_no_rotations,
    refuse_other_kinds,
    refuse_times,
)


class _StreamFile:
    """A table of a sensor, which may not fit in memory.

    Args:
        path: Of it.

    Attributes:
        count: Number of rows.
        columns: Names of the columns.

    Raises:
        SessionError: The file is missing or damaged; so do all that read from it.
    """

    def __init__(self, path: Path):
        self._path = path
        self.count, self.columns = parquet_shape(path)
        refuse_other_kinds(path, self.columns)


class SensorFile(_StreamFile):
    """Raw samples of a sensor: what algorithms get of a recording."""

    def __init__(self, path: Path):
        super().__init__(path)
        device = Times(path, "device_time_ns", RESTARTED_NS)
        host = Times(path, "host_time_ns")
        for columns in self.tables(columns=["device_time_ns", "host_time_ns"]):
            device.look(columns["device_time_ns"])
            host.look(columns["host_time_ns"])
        if device.stood:
            raise SessionError(
                f"{path} cannot be analysed: device_time_ns is the same in all of its rows; the "
                "clock of the device stood still"
            )

    def read(self, begin: int = 0, end: int | None = None, every: int = 1) -> ImuSamples:
        """Samples in memory.

        Args:
            begin: First sample.
            end: The one after the last; to the end if None.
            every: Only one sample of so many, the last of them.
        """
        groups = ImuSamples.groups(self.columns)
        return ImuSamples.from_groups(read_stacked(self._path, groups, begin, end, every))

    def batches(self, rows: int = ROWS_PER_GROUP) -> Iterator[ImuSamples]:
        """All samples in pieces of at most so many."""
        return (ImuSamples.from_columns(columns) for columns in self.tables(rows))

    def pieces(self, rows: int, margin: int) -> Iterator[tuple[ImuSamples, slice]]:
        """All samples in pieces with their neighbours, and which of each are the piece itself.

        Args:
            rows: Of a piece, at most.
            margin: Neighbours at either end.
        """
        for columns, own in overlapping(self.tables(rows), rows, margin):
            if len(columns["counter"][own]):
                yield ImuSamples.from_columns(columns), own

    def tables(
        self, rows: int = ROWS_PER_GROUP, columns: Sequence[str] | None = None
    ) -> Iterator[dict[str, np.ndarray]]:
        """Some columns, all if None, in pieces of at most so many samples, shape (n,) each."""
        return read_parquet_batches(self._path, columns, rows)

    def quantities(self, *keys: str, every: int = 1) -> dict[str, np.ndarray]:
        """Some of what the sensor reports, of those that it does.

        Args:
            keys: Attributes of `ImuSamples`.
            every: Only one sample of so many, the last of them.
        """
        groups = ImuSamples.groups(self.columns)
        wanted = {key: groups[key] for key in keys if key in groups}
        return read_stacked(self._path, wanted, every=every) if wanted else {}

    def column(self, name: str, begin: int = 0, end: int | None = None) -> np.ndarray:
        """One column, from sample `begin` to before `end`, shape (n,)."""
        return read_stacked(self._path, {name: name}, begin, end)[name]


class TruthFile(_StreamFile):
    """What a sensor went through."""

    @property
    def is_long(self) -> bool:
        """Whether it is too long to be read as a whole."""
        return is_long(self.count)

    @property
    def has_rates(self) -> bool:
        """Whether its rates were measured, as those of an arm are."""
        return TRUTH_RATE[0] in self.columns

    def read(self) -> Truth:
        """All of it."""
        return self._sound(Truth.from_columns(read_parquet(self._path)))

    def _sound(self, truth: Truth) -> Truth:
        """The same, if it is a truth."""
        if not self.count:
            raise SessionError(f"{self._path} has no rows: nothing is known of what was true")
        refuse_times(self._path, "host_time_ns", truth.host_time_ns, RESTARTED_NS)
        refuse_no_rotations(self._path, "q_world_from_sensor", truth.q_world_from_sensor)
        return truth

    def thinned(self) -> Truth:
        """Evenly spread rows of a long one, for what looks at the whole of it.

        They have rates or, where it has none, orientations; a short one is given as it is.
        """
        if not self.is_long:
            return self.read()
        rates = self.has_rates
        groups: dict[str, str | list[str]] = {"host_time_ns": "host_time_ns"}
        groups |= {"rate": TRUTH_RATE} if rates else {"q": TRUTH_Q}
        table = read_stacked(self._path, groups, every=-(-self.count // MOST_THINNED))
        q = np.broadcast_to(np.nan, (len(table["host_time_ns"]), 4)) if rates else table["q"]
        return self._sound(Truth(table["host_time_ns"], q, table.get("rate")))

    def near(self, instants: np.ndarray, rates: bool = True) -> Truth:
        """The rows around some instants, without the specific force.

        What is interpolated there is not changed by it, and the memory is bounded whatever the
        length. A short one, and one that does not come from an arm, is read as a whole: whether one
        of its orientations has jumped shows beside the others only.

        Args:
            instants: Host times, increasing, shape (n,) [ns].
            rates: Whether its rates are wanted.
        """
        if not self.is_long or not self.has_rates:
            return self.read()
        unread = {"force"} if rates else {"force", "rate"}
        groups = Truth.groups(self.columns).items()
        wanted = {key: group for key, group in groups if key not in unread}
        return self._sound(Truth(**read_near(self._path, wanted, instants)))
