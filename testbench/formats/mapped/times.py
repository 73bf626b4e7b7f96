"""The clock of the rows of a table, as a mapping and a person state it."""

from __future__ import annotations

from testbench.formats.any_table import Table
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.columns import Placed, columns_of
from testbench.formats.mapped.files import Place
from testbench.formats.mapping import TimeColumn
from testbench.formats.stamps import Asking, Stamps, rate_differs, read_stamps
from testbench.formats.tables.text_table import TextTable
from testbench.formats.tables.timeline import RegularTime
from testbench.records.findings.finding import Finding


def stamps_of(
    place: Place,
    table: Table,
    time: TimeColumn | None,
    rate: float | None,
    counter: str | None,
    asking: Asking,
) -> Stamps:
    """The clock of the rows of a table.

    Args:
        place: Whose key `time` it is, for messages.
        table: Of the samples.
        time: Its column of times, or None.
        rate: Of rows without times [Hz].
        counter: Column of a counter that keeps the place of lost rows without times.
        asking: Whose times they are, and what a person answered.

    Raises:
        InputError: The unit of the times cannot be right.
        FileProblems: There are neither times nor a rate, or the times were rounded away.
    """
    if time is not None and (asking.rate is None or counter is None):
        (column,) = columns_of(place.inside("time", "column"), table, [time.column])
        rounded = None
        if asking.rate is None and isinstance(table, TextTable):
            rounded = table.rounded_times(column)
        if rounded is not None:
            raise rounded
        return read_stamps(table, column, time.unit, asking, time.wraps_bits)
    if rate is None:
        raise place.problem(
            "neither time nor rate_hz is given; state the sampling rate here, or with --rate HZ"
        )
    return Stamps(lambda: RegularTime(rate, counter), [])


def asking_of(build: Build, table: Table, time: TimeColumn | None, rate: float | None) -> Asking:
    """Whose times the columns of a table are.

    Args:
        build: The sensor.
        table: Of its samples.
        time: The column of times, or None.
        rate: That a person states instead [Hz].
    """
    by_clock = time is None or time.unit == "clock"
    answer = None if by_clock else build.options.unit("time", None)
    return Asking(
        f"{table.file}: sensor '{build.name}'",
        None if answer is None else answer.name,
        key="time.unit: UNIT",
        rate=rate,
    )


def rate_findings(build: Build, time: TimeColumn | None, stamps: Stamps) -> list[Finding]:
    """What is said of a rate that is stated beside a column of times.

    Args:
        build: The sensor.
        time: The column.
        stamps: What was read of it.
    """
    whole = build.place.document.value
    if time is None:
        return []
    if build.options.rate is not None:
        return rate_differs(build.options.rate, stamps.rate)
    if whole.rate_hz is None:
        return []
    return rate_differs(whole.rate_hz, stamps.rate, "time.mapping_rate_differs")


def time_place(build: Build, quantity: str, placed: Placed) -> Place:
    """Where the times of a quantity are stated."""
    return build.place.inside(quantity) if placed.part.time else Place(build.place.document, ())
