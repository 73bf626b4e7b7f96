"""One sensor as a mapping describes it: its columns, units, axes and times become samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from testbench.consistency.evidence import Evidence
from testbench.exceptions import InputError
from testbench.formats.any_table import Table
from testbench.formats.axes import IDENTITY, AxisMap, AxisNames, find_axes
from testbench.formats.mapped_files import Files, Meant, Place, file_of
from testbench.formats.mapping import (
    AccColumns,
    DeviceQuaternion,
    GyrColumns,
    QuaternionColumns,
    SensorColumns,
    TimeColumn,
    TruthColumns,
    VectorColumns,
    full_scale_parts,
)
from testbench.formats.options import Options
from testbench.formats.plausibility import decide_unit, gather
from testbench.formats.recording import ImportedSensor
from testbench.formats.stamps import (
    LOWEST_OF_TRUTH_HZ,
    Asking,
    Stamps,
    rate_differs,
    read_stamps,
)
from testbench.formats.tables.clocked_table import ClockedTable, SparseColumns
from testbench.formats.tables.joined_table import Joined, JoinedTable
from testbench.formats.tables.samples_stream import Quantities, SampleStream, measured_rate, stack
from testbench.formats.tables.source import Columns, Kind, Source, first_rows
from testbench.formats.tables.text_table import TextTable
from testbench.formats.tables.timeline import BadRowError, RegularTime, Timeline
from testbench.formats.truth.reference import collect, reference_truth
from testbench.formats.units import find_unit
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM
from testbench.model.kinematics import Pose
from testbench.records.findings.catalogue import finding, noted
from testbench.records.findings.finding import Finding, told_once
from testbench.records.session.samples import Truth

MUCH_FASTER = 1.1
"""The times of the gyroscope are those of the sensor where it is by this factor faster."""
SLOW = 0.8
"""A magnetometer below this part of the sensor's rate is kept at its own instants."""
FULL_SCALE_KEYS = {"acc": "acc_m_s2", "gyr": "gyr_rad_s"}
MAGNETIC = "mag"
QUATERNION = "quaternion"


@dataclass(frozen=True)
class Placed:
    """A quantity, and where its numbers stand.

    Attributes:
        part: Of the mapping.
        table: That holds it.
        titles: Its columns; of a quaternion w, x, y, z.
        time: Column of its times; None where its rows are regular.
    """

    part: VectorColumns | DeviceQuaternion
    table: Table
    titles: list[str]
    time: TimeColumn | None


@dataclass
class Build:
    """What the steps of building one sensor share.

    Attributes:
        place: Of the sensor in the mapping.
        spec: The sensor there.
        meant: Its name and files.
        files: Of the whole recording.
        options: Answers of a person.
        findings: What was noticed so far; is added to.
    """

    place: Place
    spec: SensorColumns
    meant: Meant
    files: Files
    options: Options
    findings: list[Finding] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Of the sensor."""
        return self.meant.name

    def notice(self, code: str, **values: str | float) -> None:
        """Add a finding on this sensor."""
        self.findings.append(finding(code, self.name, **values))


@dataclass(frozen=True)
class Mapped:
    """A sensor that was built, and which columns it reads.

    Attributes:
        sensor: Of the recording.
        read: File and title of each column.
    """

    sensor: ImportedSensor
    read: set[tuple[Path, str]]


def columns_of(place: Place, table: Table, wanted: list[str | int]) -> list[str]:
    """Titles of columns given by title or number.

    Args:
        place: Of the list in the mapping.
        table: That they are looked for in.
        wanted: Titles, or numbers from 1.

    Raises:
        FileProblems: There is no such column, or more than one.
    """
    result = []
    twice: dict[str, list[int]] = table.twice if isinstance(table, TextTable) else {}
    for i, column in enumerate(wanted):
        if isinstance(column, int):
            if column > len(table.names):
                raise place.problem(
                    f"{table.file.name} has {len(table.names)} columns, not {column}", i
                )
            column = table.names[column - 1]
        if column in twice:
            places = " and ".join(map(str, twice[column]))
            raise place.problem(
                f"{table.file.name} has more than one column '{column}' (its columns {places}): "
                "say by its number which is meant",
                i,
            )
        if table.names.count(column) != 1:
            raise place.problem(f"{_lacks(table, column)}{_listing(table)}", i)
        result.append(column)
    return result


def _lacks(table: Table, column: str) -> str:
    how = "no column" if column not in table.names else "more than one column"
    return f"{table.file.name} has {how} '{column}'; it has "


def _listing(table: Table) -> str:
    """What a table has, arrays as wholes, and what in it nobody but MATLAB opens."""
    parts = {column for columns in table.arrays.values() for column in columns}
    alone = [name for name in table.names if name not in parts]
    wide = [f"{name} (an array of {len(of)})" for name, of in table.arrays.items()]
    listing = ", ".join([*wide, *alone][:40]) or "nothing"
    closed = getattr(table, "closed", ())
    return listing + (f"; {', '.join(closed)} only MATLAB opens" if closed else "")


def _titles(place: Place, table: Table, columns: list[Any] | None, array: str | None) -> list[str]:
    """The columns of a quantity, given as such or as an array."""
    if columns is not None:
        return columns_of(place.inside("columns"), table, columns)
    assert array is not None
    width = 3 if not place.path or place.path[-1] not in (QUATERNION, "truth") else 4
    found = table.arrays.get(array)
    if found is None:
        how = "is one column" if array in table.names else "is not there"
        raise place.problem(
            f"the array '{array}' {how}; {table.file.name} has {_listing(table)}", "array"
        )
    if len(found) != width:
        raise place.problem(
            f"the array '{array}' has {len(found)} columns, where {width} are needed; name them "
            f"(columns: ['{array}[1]', ...])",
            "array",
        )
    return found


def _place_quantities(build: Build) -> dict[str, Placed]:
    """Where each quantity of a sensor stands."""
    whole = build.place.document.value
    placed: dict[str, Placed] = {}
    for quantity in ("acc", "gyr", MAGNETIC, QUATERNION):
        part: VectorColumns | DeviceQuaternion | None = getattr(build.spec, quantity)
        if part is None:
            continue
        place = build.place.inside(quantity)
        file = file_of(place, part, build.meant)
        if file is None:
            build.notice("structure.no_file", quantity=quantity)
            continue
        table = build.files.table(file)
        titles = _titles(place, table, part.columns, part.array)
        if isinstance(part, DeviceQuaternion) and part.order == "xyzw":
            titles = [titles[3], *titles[:3]]
        placed[quantity] = Placed(part, table, titles, part.time or whole.time)
    if not placed.keys() & {"acc", "gyr", QUATERNION}:
        raise build.place.problem("of its acc, gyr and quaternion no file was given")
    return placed


def _check_used_once(build: Build, placed: dict[str, Placed], truth: list[str]) -> None:
    """Refuse a column that is taken for two things.

    Args:
        build: The sensor.
        placed: Its quantities.
        truth: Columns of a truth in the rows of the samples.
    """
    used: dict[tuple[Path, str], str] = {}
    parts = [(quantity, p.table.file, p.titles) for quantity, p in placed.items()]
    parts += [("truth", next(iter(placed.values())).table.file, truth)] if truth else []
    for quantity, file, titles in parts:
        again = sorted({used[file, title] for title in titles if (file, title) in used})
        if again:
            raise build.place.problem(
                f"{again[0]} and {quantity} are both read from {', '.join(titles)} of {file.name}, "
                "which cannot be both: name the columns of each, or, where each has a file of its "
                "own, its `file` (mappings of phones: sensor_logger, phyphox)",
                quantity,
            )
        twice = [title for title, count in Counter(titles).items() if count > 1]
        if twice:
            raise build.place.problem(f"the column {twice[0]} stands twice", quantity)
        used |= {(file, title): quantity for title in titles}
    for quantity, p in placed.items():
        if p.time is not None and p.time.column in p.titles:
            raise build.place.problem(f"{p.time.column} is both its time and its value", quantity)


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


def _asking(build: Build, table: Table, time: TimeColumn | None, rate: float | None) -> Asking:
    """Whose times the columns of a table are."""
    by_clock = time is None or time.unit == "clock"
    answer = None if by_clock else build.options.unit("time", None)
    return Asking(
        f"{table.file}: sensor '{build.name}'",
        None if answer is None else answer.name,
        key="time.unit: UNIT",
        rate=rate,
    )


def _rates_differ(build: Build, time: TimeColumn | None, stamps: Stamps) -> list[Finding]:
    """What is said of a rate that is stated beside a column of times."""
    whole = build.place.document.value
    if time is None:
        return []
    if build.options.rate is not None:
        leave = "leave --rate out to believe the stamps"
        return rate_differs(build.options.rate, "--rate", stamps.rate, False, leave)
    if whole.rate_hz is None:
        return []
    correct = "correct rate_hz or time.unit of the mapping, or state the rate with --rate HZ"
    return rate_differs(whole.rate_hz, "rate_hz of the mapping", stamps.rate, True, correct)


def _time_place(build: Build, quantity: str, placed: Placed) -> Place:
    """Where the times of a quantity are stated."""
    return build.place.inside(quantity) if placed.part.time else Place(build.place.document, ())


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


def _put_together(build: Build, placed: dict[str, Placed], counter: str | None) -> Together:
    """The quantities of a sensor in one table, at the times of its accelerometer.

    Those of the gyroscope count where that is faster, or alone.
    """
    whole = build.place.document.value
    rate = build.options.rate_or(whole.rate_hz)
    first, *rest = placed
    kinds = {(p.table.file, p.time.column if p.time else None) for p in placed.values()}
    if len(kinds) == 1:
        p = placed[first]
        asking = _asking(build, p.table, p.time, build.options.rate)
        stamps = stamps_of(_time_place(build, first, p), p.table, p.time, rate, counter, asking)
        titles = {quantity: q.titles for quantity, q in placed.items()}
        noticed = [*stamps.findings, *_rates_differ(build, p.time, stamps)]
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
            _time_place(build, quantity, p),
            p.table,
            p.time,
            None,
            None,
            _asking(build, p.table, p.time, None),
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
    steps = np.diff(times)
    if not np.any(steps > 0):
        raise table.problem("its times tell no rate, so that it cannot be put beside other files")
    return float(NANOSECONDS / steps[steps <= 5 * np.median(steps[steps > 0])].mean())


# One piece: columns, units, axes and times of a sensor meet in the function that converts a chunk.
def mapped_sensor(build: Build) -> Mapped:
    """Build a sensor.

    Args:
        build: What it is built from.

    Raises:
        InputError: A unit or rate is open; says how to state it.
        FileProblems: The mapping does not fit the files, or a file is malformed.
    """
    place, spec, options = build.place, build.spec, build.options
    whole = place.document.value
    placed = _place_quantities(build)
    together = _put_together(build, placed, None)
    counter = _own_column(build, "counter", together.main)
    if counter is not None and isinstance(together.source, Table):
        together = _put_together(build, placed, counter)
    title = _own_column(build, "temperature", together.main)
    truth_titles = _truth_in_rows(build, together.main)
    _check_used_once(build, placed, truth_titles)
    axes = _axes(place, spec.axes)
    vectors: dict[str, tuple[list[str], VectorColumns, AxisMap]] = {}
    for quantity in ("acc", "gyr", MAGNETIC):
        if quantity in placed:
            part = placed[quantity].part
            assert isinstance(part, VectorColumns)
            own = _own_axes(place.inside(quantity, "axes"), part.axes) if part.axes else axes
            vectors[quantity] = (together.titles[quantity], part, own)
    q_columns = together.titles.get(QUATERNION, [])
    read = [column for columns in together.titles.values() for column in columns]
    kinds: dict[str, Kind] = dict.fromkeys(read + ([title] if title else []), "float")
    units = {
        quantity: options.unit(quantity, getattr(part, "unit", None))
        for quantity, (_, part, _) in vectors.items()
    }
    factors = {quantity: 1.0 if unit is None else unit.factor for quantity, unit in units.items()}

    def convert(columns: Columns) -> Quantities:
        values: dict[str, np.ndarray | None] = dict.fromkeys(("acc", "gyr", MAGNETIC))
        for quantity, (titles, part, own) in vectors.items():
            values[quantity] = own.vectors(
                (stack(columns, titles) - part.offset) * (part.scale * factors[quantity])
            )
        q = None
        if q_columns and spec.quaternion is not None:
            q = axes.orientations(_orientations(columns, q_columns, spec.quaternion))
        return Quantities(
            values["gyr"],
            values["acc"],
            values[MAGNETIC],
            q,
            temperature=columns[title] if title else None,
        )

    build.findings += together.findings
    stream = SampleStream(together.source, kinds, convert, together.stamps.timeline, counter)
    _notice_empty(build, placed, together, kinds)
    stated_rate = options.rate_or(whole.rate_hz)
    timed = next(iter(placed.values())).time is not None and options.rate is None
    rate = (None if timed else stated_rate) or measured_rate(stream.first()) or stated_rate
    if rate is None:
        raise together.main.problem(
            f"the times of sensor '{build.name}' tell no rate; state it with --rate HZ"
        )
    open_units = [quantity for quantity, unit in units.items() if unit is None]
    if open_units:
        factors |= _decided_units(build, open_units, gather(stream))
    truth = _truth(build, together, stream, axes, truth_titles) if spec.truth else None
    description = spec.description or whole.description
    sensor = ImportedSensor(
        stream,
        round(rate, 3),
        description,
        truth,
        _details(build, vectors, factors, rate),
        build.findings,
        stream.findings,
        together.stamps.unix,
    )
    columns_read = {(p.table.file, column) for p in placed.values() for column in p.titles}
    return Mapped(sensor, columns_read)


def _own_column(build: Build, key: str, table: Table) -> str | None:
    """A column that stands beside the samples: counter or temperature."""
    stated: str | int | None = getattr(build.spec, key)
    if stated is None:
        return None
    (title,) = columns_of(build.place.inside(key), table, [stated])
    return title


def _notice_empty(
    build: Build, placed: dict[str, Placed], together: Together, kinds: dict[str, Kind]
) -> None:
    """Say which columns hold nothing at all."""
    head = first_rows(together.source, kinds)
    for quantity, p in placed.items():
        empty = [
            own
            for own, title in zip(p.titles, together.titles[quantity], strict=True)
            if not np.isfinite(head[title]).any()
        ]
        if empty:
            build.notice(
                "structure.empty_columns",
                columns=", ".join(empty),
                file=p.table.file.name,
                rows=len(head[together.titles[quantity][0]]),
                quantity=quantity,
            )


def _decided_units(build: Build, quantities: list[str], evidence: Evidence) -> dict[str, float]:
    """Factors to SI of quantities whose unit nobody stated, by what their values tell."""
    factors = {}
    for quantity in quantities:
        key = f"{'.'.join(map(str, build.place.path))}.{quantity}.unit"
        answer = f"the key {key} of the mapping, or --unit {quantity}=UNIT"
        unit = decide_unit(quantity, evidence, build.name, answer)
        factors[quantity] = unit.factor
        told = "gravity at rest" if quantity == "acc" else "its turns"
        build.notice(
            "structure.unit_told", quantity=quantity, unit=unit.name, evidence=told, answer=answer
        )
    return factors


def _details(
    build: Build,
    vectors: dict[str, tuple[list[str], VectorColumns, AxisMap]],
    factors: dict[str, float],
    rate: float,
) -> dict[str, Any]:
    """What the manifest says further of a sensor."""
    scales = {
        quantity: {"offset": part.offset, "scale": part.scale}
        for quantity, (_, part, _) in vectors.items()
        if (part.offset, part.scale) != (0.0, 1.0)
    }
    details: dict[str, Any] = {}
    if scales:
        details["raw_counts"] = {
            "formula": "value in the unit = (counts - offset) * scale"
        } | scales
    full_scale = {}
    for quantity, (_, part, _) in vectors.items():
        if isinstance(part, AccColumns | GyrColumns) and part.full_scale is not None:
            size, unit = full_scale_parts(quantity, part.full_scale)
            factor = factors[quantity] if unit is None else find_unit(quantity, unit).factor
            full_scale[FULL_SCALE_KEYS[quantity]] = size * factor
    if full_scale:
        details["full_scale"] = full_scale
    if build.spec.sampling == "integrated":
        details |= {"sampling": "integrated", "rate_delay_s": 0.5 / rate}
    if build.spec.truth is not None and build.spec.truth.world != "z_up":
        details["truth_world"] = build.spec.truth.world
    return details


def _axes(place: Place, axes: str | AxisNames | None) -> AxisMap:
    if axes is None:
        return IDENTITY
    if isinstance(axes, str):
        try:
            return find_axes(axes)
        except InputError as error:
            raise place.problem(str(error), "axes") from None
    result = _own_axes(place.inside("axes"), axes)
    if not result.is_rotation:
        raise place.problem(
            "turns right-handed axes into left-handed ones; if the file's are, give acc, gyr and "
            "mag axes of their own",
            "axes",
        )
    return result


def _own_axes(place: Place, axes: AxisNames) -> AxisMap:
    try:
        return AxisMap.from_names(axes)
    except InputError as error:
        raise place.problem(str(error)) from None


def _orientations(columns: Columns, titles: list[str], spec: QuaternionColumns) -> np.ndarray:
    """q_enu_from_file of columns w, x, y, z, shape (n, 4)."""
    q = stack(columns, titles)
    q = q if spec.direction == "earth_from_sensor" else rotation.conjugate(q)
    return q if spec.earth == "ENU" else rotation.multiply(np.array(Q_ENU_FROM[spec.earth]), q)


def _truth_titles(place: Place, spec: TruthColumns, table: Table) -> list[str]:
    """The columns of a truth as w, x, y, z."""
    titles = _titles(place, table, spec.columns, spec.array)
    return titles if spec.order == "wxyz" else [titles[3], *titles[:3]]


def _truth_in_rows(build: Build, main: Table) -> list[str]:
    """The columns of a truth that stands in the rows of the samples."""
    spec = build.spec.truth
    if spec is None or spec.file is not None:
        return []
    return _truth_titles(build.place.inside("truth"), spec, main)


def _truth(
    build: Build, together: Together, stream: SampleStream, axes: AxisMap, in_rows: list[str]
) -> Truth:
    spec, place = build.spec.truth, build.place.inside("truth")
    assert spec is not None
    table, stamps, origin = together.main, together.stamps, stream.origin_ns
    titles = in_rows
    like: SampleStream | None = stream if together.source is table else None
    if spec.file is not None:
        file = together.main.file.parent / Path(spec.file).name
        given = [own for own in build.files.given if own.name == file.name]
        table = build.files.table(given[0] if given else file, spec.text)
        key = "truth.time.unit: UNIT in the mapping"
        asking = Asking(f"{table.file}", flag=key, lowest_hz=LOWEST_OF_TRUTH_HZ)
        stamps = stamps_of(place, table, spec.time, spec.rate_hz, None, asking)
        like = None
        settings = place.document.value.estimate
        # who wants no clock fitted says that the times are on one clock
        same_clock = spec.same_clock or (settings is not None and not settings.align_clock)
        origin = stream.first_time_ns() if same_clock else None
        titles = _truth_titles(place, spec, table)
    else:
        build.notice("structure.truth_in_rows")
    judged = [] if spec.judged is None else [spec.judged]
    marks = columns_of(place.inside("judged"), table, judged) if judged else []

    def convert(columns: Columns) -> Quantities:
        q = _orientations(columns, titles, spec)
        return Quantities(
            None, None, None, q, np.nan_to_num(columns[marks[0]]) != 0 if marks else None
        )

    kinds: dict[str, Kind] = dict.fromkeys([*titles, *marks], "float")
    own = SampleStream(table, kinds, convert, stamps.timeline, origin_ns=origin)
    chunks = list(own.with_rows_of(like))
    time, q = collect(chunks)
    counted = np.concatenate([chunk.saturated for chunk in chunks]) if marks else None
    # without a mounting, the body is the sensor with the axes of the file
    mounting = (
        Pose.from_placement(spec.mounting).quaternion
        if spec.mounting.rotation_deg
        else axes.q_file_from_sensor
    )
    notes: list[str] = []
    truth = reference_truth(time, q, mounting, counted, notes)
    build.findings += [noted(note, build.name) for note in notes]
    return truth
