"""The quantities of one sensor, whatever files they come from, on one time line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from testbench.formats.any_table import Table
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.columns import MAGNETIC, QUATERNION, Placed
from testbench.formats.mapped.times import asking_of, rate_findings, stamps_of, time_place
from testbench.formats.stamps import Stamps
from testbench.formats.tables.clocked_table import ClockedTable, SparseColumns
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.samples_stream import rate_of_times
from testbench.formats.tables.source import Source, first_rows
from testbench.formats.tables.timeline import BadRowError, Timeline
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, told_once

MUCH_FASTER = 1.1
"""The times of the gyroscope are those of the sensor where it is by this factor faster."""
SLOW = 0.8
"""A magnetometer below this part of the sensor's rate is kept at its own instants."""


@dataclass(frozen=True)
class Together:
    """The rows of a sensor, whatever files they come from.

    Attributes:
        source: With all columns.
        titles: Columns there by quantity.
        stamps: Of its rows.
        main: Table that its rows are those of.
        findings: On their times.
    """

    source: Source
    titles: dict[str, list[str]]
    stamps: Stamps
    main: Table
    findings: list[Finding]


def put_together(build: Build, placed: dict[str, Placed], counter: str | None) -> Together:
    """The quantities of a sensor in one table, at the times of its accelerometer.

    Those of the gyroscope count where that is faster, or alone.

    Args:
        build: The sensor.
        placed: Its quantities.
        counter: Column that keeps the place of lost rows where these have no times.

    Raises:
        FileProblems: The times of a table are missing or malformed.
    """
    whole = build.place.document.value
    rate = build.options.rate_or(whole.rate_hz)
    first, *rest = placed
    kinds = {(p.table.file, p.time.column if p.time else None) for p in placed.values()}
    if len(kinds) == 1:
        p = placed[first]
        asking = asking_of(build, p.table, p.time, build.options.rate)
        stamps = stamps_of(time_place(build, first, p), p.table, p.time, rate, counter, asking)
        titles = {quantity: q.titles for quantity, q in placed.items()}
        noticed = [*stamps.findings, *rate_findings(build, p.time, stamps)]
        if p.time is None and counter is None and rate is not None:
            who = "the mapping" if build.options.rate is None else "--rate"
            noticed.append(finding("time.by_rows", rate_hz=rate, who=who))
        return Together(p.table, titles, stamps, p.table, noticed)
    for quantity, p in placed.items():
        if p.time is None or build.options.rate is not None:
            raise build.place.problem(
                f"its quantities have times of their own: each needs `time` and none a stated rate "
                f"({p.table.file.name} would be put beside the others by nothing)",
                quantity,
            )
    clocks = {
        quantity: stamps_of(
            time_place(build, quantity, p),
            p.table,
            p.time,
            None,
            None,
            asking_of(build, p.table, p.time, None),
        )
        for quantity, p in placed.items()
    }
    firsts = {
        quantity: _first_times(p.table, clocks[quantity].timeline) for quantity, p in placed.items()
    }
    rates = {quantity: _rate(placed[quantity].table, firsts[quantity]) for quantity in placed}
    main = first
    if first == "acc" and "gyr" in rest and rates["gyr"] > MUCH_FASTER * rates["acc"]:
        main = "gyr"
    return _joined(build, placed, clocks, rates, main, int(firsts[main][0]))


def _joined(
    build: Build,
    placed: dict[str, Placed],
    clocks: dict[str, Stamps],
    rates: dict[str, float],
    main: str,
    origin_ns: int,
) -> Together:
    """Quantities of several tables at the times of the main one."""
    base = ClockedTable(placed[main].table, clocks[main].timeline, origin_ns)
    titles: dict[str, list[str]] = {}
    faster: list[Joined] = []
    slower: list[ClockedTable] = []
    for quantity, p in placed.items():
        same_time = p.time is not None and p.time == placed[main].time
        if p.table is placed[main].table and same_time:
            titles[quantity] = p.titles
            continue
        other = ClockedTable(p.table, clocks[quantity].timeline, origin_ns, f"{quantity}: ")
        titles[quantity] = [other.prefix + title for title in p.titles]
        values: dict[str, str | float] = {
            "quantity": quantity,
            "file": p.table.file.name,
            "rate_hz": rates[quantity],
            "main": placed[main].table.file.name,
            "main_rate_hz": rates[main],
        }
        if quantity == MAGNETIC and rates[quantity] < SLOW * rates[main]:
            slower.append(other)
            build.notice("structure.lower_rate", **values)
        else:
            columns = {title: title for title in titles[quantity]}
            faster.append(Joined(other, other.time, columns, turns=quantity == QUATERNION))
            build.notice("structure.interpolated", **values)
    source: Source = JoinedTable(base, base.time, faster) if faster else base
    for other in slower:
        source = SparseColumns(source, base.time, other, titles[MAGNETIC])
    noticed = told_once(found for stamps in clocks.values() for found in stamps.findings)
    return Together(source, titles, clocks[main], placed[main].table, noticed)


def _first_times(table: Table, clock: Callable[[], Timeline]) -> np.ndarray:
    """Times of the first rows of a table on its clock [ns], shape (n,)."""
    timeline = clock()
    columns = first_rows(table, timeline.kinds)
    try:
        return timeline(columns, len(next(iter(columns.values()))))
    except BadRowError as error:
        raise table.problem(str(error), error.row) from None


def _rate(table: Table, times: np.ndarray) -> float:
    """Rows a second without gaps [Hz]."""
    rate = rate_of_times(times)
    if rate is None:
        raise table.problem("its times tell no rate, so that it cannot be put beside other files")
    return rate
