"""Any table of samples, by a mapping in YAML: CSV, TSV and other text, and Parquet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.axes import IDENTITY, AxisMap, AxisNames, find_axes
from testbench.formats.common_clock import share_clock
from testbench.formats.mapping import (
    MappingSpec,
    QuaternionColumns,
    SensorColumns,
    TextLayout,
    TimeColumn,
    TruthColumns,
    VectorColumns,
    find_mapping,
)
from testbench.formats.names import sensor_name, stem_without_stamp, unique_names
from testbench.formats.options import Options
from testbench.formats.plausibility import Evidence, decide_unit, gather
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.stamps import (
    LOWEST_OF_TRUTH_HZ,
    Asking,
    Stamps,
    rate_differs,
    read_stamps,
)
from testbench.formats.suitable import suitable_analysis
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.samples_stream import Quantities, SampleStream, measured_rate, stack
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import (
    BLANKS,
    TextTable,
    decimal_of,
    guess_separator,
    head_of,
    split_line,
)
from testbench.formats.tables.timeline import RegularTime
from testbench.formats.truth.reference import collect, reference_truth
from testbench.model import rotation
from testbench.model.kinematics import Pose
from testbench.records.disk.yaml_file import YamlDocument
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import Truth

_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "blanks": BLANKS}
Table = TextTable | ParquetTable


@dataclass(frozen=True)
class Place:
    """A part of the mapping, for messages that name its line.

    Attributes:
        document: The mapping.
        path: Of the part.
    """

    document: YamlDocument[MappingSpec]
    path: tuple[Any, ...]

    def problem(self, message: str, *further: Any) -> FileProblems:
        """The error that says `message` of the part."""
        return self.document.problem(message, *self.path, *further)

    def inside(self, *further: Any) -> Place:
        """A part of the part."""
        return replace(self, path=(*self.path, *further))


def read(files: list[Path], options: Options) -> Recording:
    """Read files as a mapping says.

    Args:
        files: Samples; the first may be the mapping itself.
        options: The mapping, and answers it leaves open.

    Raises:
        InputError: No mapping or no files, or a unit or rate is open.
        FileProblems: The mapping or a file is malformed.
    """
    name = options.mapping_name()
    if name is None and files and files[0].suffix.lower() in {".yaml", ".yml"}:
        name, files = str(files[0]), files[1:]
    if name is None:
        raise InputError(
            "the generic format needs a mapping: --mapping map.yaml, or the name of one that ships "
            "with the bench"
        )
    if not files:
        raise InputError("no file of samples was given beside the mapping")
    document = find_mapping(name)
    spec = document.value
    tables = {file: open_table(file, spec.text) for file in files}
    notes = [f"mapping: {document.file.name}: {spec.description}"]
    sensors = {}
    assigned = _assign(document, files)
    for key, label, file in assigned:
        sensors[label] = _sensor(
            Place(document, ("sensors", key)),
            spec.sensors[key],
            tables[file],
            label,
            options,
            notes,
        )
    heads = [head for head in (sensor.head() for sensor in sensors.values()) if head is not None]
    elsewhere = [
        s
        for s in spec.sensors.values()
        if s.truth is not None and s.truth.file is not None and not s.truth.same_clock
    ]
    analysis = suitable_analysis(
        heads, own_clock=bool(elsewhere), truth=any(s.truth for s in sensors.values())
    )
    if spec.estimate is not None:
        analysis = analysis.model_copy(update={"estimate": spec.estimate})
    findings: list[Finding] = []
    if len({file for _, _, file in assigned}) > 1:
        findings = share_clock(sensors, None, "their times are no Unix times")
    return Recording(
        sensor_name(stem_without_stamp(files[0].stem)),
        spec.description,
        sensors,
        analysis,
        notes,
        findings,
    )


def _assign(document: YamlDocument[MappingSpec], files: list[Path]) -> list[tuple[str, str, Path]]:
    """Key in the mapping, name, and file of each sensor."""
    sensors = document.value.sensors
    if len(sensors) == 1 and len(files) > 1:
        (key, only), *_ = sensors.items()
        chosen = [file for file in files if only.file is None or fnmatch(file.name, only.file)]
        names = unique_names(stem_without_stamp(file.stem) for file in chosen)
        result = [(key, name, file) for name, file in zip(names, chosen, strict=True)]
    else:
        result = []
        for key, sensor in sensors.items():
            fitting = [
                file for file in files if sensor.file is None or fnmatch(file.name, sensor.file)
            ]
            if len(fitting) != 1:
                listing = ", ".join(file.name for file in files)
                raise document.problem(
                    f"{len(fitting)} of the files ({listing}) are meant; `file` must single one "
                    "out",
                    "sensors",
                    key,
                )
            result.append((key, key, fitting[0]))
    unused = set(files) - {file for _, _, file in result}
    if unused:
        raise InputError(
            f"{', '.join(sorted(file.name for file in unused))}: no sensor of the mapping reads it"
        )
    return result


def open_table(file: Path, layout: TextLayout) -> Table:
    """A text or Parquet file as a source.

    Raises:
        FileProblems: It is neither.
    """
    if file.suffix.lower() in {".parquet", ".pq"}:
        if not file.is_file():
            raise FileProblems(file, [Problem("the file does not exist")])
        return ParquetTable(file)
    encoding = None if layout.encoding == "auto" else layout.encoding
    lines = head_of(file, encoding)
    at = layout.skip_lines
    if layout.header:
        while at < len(lines) and (
            not lines[at].strip() or lines[at].strip(' "').lower().startswith("sep=")
        ):
            at += 1
    else:
        at = next((i for i in range(at, len(lines)) if lines[i].strip()), len(lines))
    if at >= len(lines):
        raise FileProblems(
            file, [Problem(f"there is nothing after the {layout.skip_lines} lines to skip")]
        )
    separator = (
        guess_separator(lines[at]) if layout.separator == "auto" else _SEPARATORS[layout.separator]
    )
    titles = split_line(lines[at].lstrip("#% ") if layout.header else lines[at], separator)
    data = at + 1 + layout.lines_below_header if layout.header else at
    first_row = next((line for line in lines[data:] if line.strip()), "")
    decimal = {"point": ".", "comma": ","}.get(layout.decimal) or decimal_of(first_row, separator)
    names = titles if layout.header else [str(i + 1) for i in range(len(titles))]
    return TextTable(file, names, data + 1, separator, decimal, encoding)


def _columns(place: Place, table: Table, wanted: list[str | int]) -> list[str]:
    """Titles of columns given by title or number."""
    result = []
    for i, column in enumerate(wanted):
        if isinstance(column, int):
            if column > len(table.names):
                raise place.problem(
                    f"{table.file.name} has {len(table.names)} columns, not {column}", i
                )
            column = table.names[column - 1]
        if table.names.count(column) != 1:
            listing = ", ".join(name for name in table.names[:40])
            how = "no column" if column not in table.names else "more than one column"
            raise place.problem(f"{table.file.name} has {how} '{column}'; it has {listing}", i)
        result.append(column)
    return result


def _stamps(
    place: Place,
    table: Table,
    time: TimeColumn | None,
    rate: float | None,
    counter: str | None,
    asking: Asking,
) -> Stamps:
    """What makes the times: a counter or the column of times where a person states the rate."""
    if time is not None and (asking.rate is None or counter is None):
        (column,) = _columns(place.inside("time", "column"), table, [time.column])
        return read_stamps(table, column, time.unit, asking, time.wraps_bits)
    if rate is None:
        raise place.problem(
            "neither time nor rate_hz is given; state the sampling rate here, or with --rate HZ"
        )
    return Stamps(lambda: RegularTime(rate, counter), [])


def _rates_differ(whole: MappingSpec, options: Options, stamps: Stamps) -> list[Finding]:
    """What is said of a rate that is stated beside a column of times."""
    if whole.time is None:
        return []
    if options.rate is not None:
        leave = "leave --rate out to believe the stamps"
        return rate_differs(options.rate, "--rate", stamps.rate, False, leave)
    if whole.rate_hz is None:
        return []
    correct = "correct rate_hz or time.unit of the mapping, or state the rate with --rate HZ"
    return rate_differs(whole.rate_hz, "rate_hz of the mapping", stamps.rate, True, correct)


def _decided_units(
    place: Place, quantities: list[str], evidence: Evidence, name: str, notes: list[str]
) -> dict[str, float]:
    """Factors to SI of quantities whose unit nobody stated, by what their values tell."""
    factors = {}
    for quantity in quantities:
        answer = (
            f"the key {'.'.join(map(str, place.path))}.{quantity}.unit of the mapping, or --unit "
            f"{quantity}=UNIT"
        )
        unit = decide_unit(quantity, evidence, name, answer)
        factors[quantity] = unit.factor
        notes.append(
            f"{name}: {quantity} is taken for {unit.name}, by "
            f"{'gravity at rest' if quantity == 'acc' else 'its turns'}"
        )
    return factors


# One piece: columns, units, axes and times of a sensor meet in the function that converts a chunk.
def _sensor(
    place: Place, spec: SensorColumns, table: Table, name: str, options: Options, notes: list[str]
) -> ImportedSensor:
    whole = place.document.value
    counter = (
        _columns(place.inside("counter"), table, [spec.counter])[0]
        if spec.counter is not None
        else None
    )
    stated_rate = options.rate_or(whole.rate_hz)
    use_rate = options.rate is not None or whole.time is None
    by_clock = whole.time is None or whole.time.unit == "clock"
    answer = None if by_clock else options.unit("time", None)
    asking = Asking(
        f"{table.file}: sensor '{name}'",
        None if answer is None else answer.name,
        key="time.unit: UNIT",
        rate=options.rate,
    )
    stamps = _stamps(replace(place, path=()), table, whole.time, stated_rate, counter, asking)
    findings = [*stamps.findings, *_rates_differ(whole, options, stamps)]
    axes = _axes(place, spec.axes)
    vectors: dict[str, tuple[list[str], VectorColumns, AxisMap]] = {}
    for quantity in ("acc", "gyr", "mag"):
        part: VectorColumns | None = getattr(spec, quantity)
        if part is not None:
            own = _own_axes(place.inside(quantity, "axes"), part.axes) if part.axes else axes
            vectors[quantity] = (
                _columns(place.inside(quantity, "columns"), table, part.columns),
                part,
                own,
            )
    q_columns = (
        _columns(place.inside("quaternion", "columns"), table, spec.quaternion.columns)
        if spec.quaternion
        else []
    )
    title = (
        _columns(place.inside("temperature"), table, [spec.temperature])[0]
        if spec.temperature is not None
        else None
    )
    read = (
        [c for columns, _, _ in vectors.values() for c in columns]
        + q_columns
        + ([title] if title else [])
    )
    kinds: dict[str, Kind] = dict.fromkeys(read, "float")
    units = {
        quantity: options.unit(quantity, getattr(part, "unit", None))
        for quantity, (_, part, _) in vectors.items()
    }
    factors = {quantity: 1.0 if unit is None else unit.factor for quantity, unit in units.items()}

    def convert(columns: Columns) -> Quantities:
        values: dict[str, np.ndarray | None] = dict.fromkeys(("acc", "gyr", "mag"))
        for quantity, (titles, part, own) in vectors.items():
            values[quantity] = own.vectors(
                (stack(columns, titles) - part.offset) * (part.scale * factors[quantity])
            )
        q = (
            axes.orientations(_quaternions(columns, q_columns, spec.quaternion))
            if spec.quaternion
            else None
        )
        return Quantities(
            values["gyr"],
            values["acc"],
            values["mag"],
            q,
            temperature=columns[title] if title else None,
        )

    stream = SampleStream(table, kinds, convert, stamps.timeline, counter)
    rate = (stated_rate if use_rate else None) or measured_rate(stream.first()) or stated_rate
    if rate is None:
        raise table.problem(f"the times of sensor '{name}' tell no rate; state it with --rate HZ")
    open_units = [quantity for quantity, unit in units.items() if unit is None]
    if open_units:
        factors |= _decided_units(place, open_units, gather(stream, rate), name, notes)
    truth = (
        _truth(place.inside("truth"), spec.truth, table, stamps, stream, axes, notes)
        if spec.truth
        else None
    )
    scales = {
        q: {"offset": part.offset, "scale": part.scale}
        for q, (_, part, _) in vectors.items()
        if (part.offset, part.scale) != (0.0, 1.0)
    }
    details = (
        {"raw_counts": {"formula": "value in the unit = (counts - offset) * scale"} | scales}
        if scales
        else {}
    )
    return ImportedSensor(
        stream,
        round(rate, 3),
        spec.description or whole.description,
        truth,
        details,
        findings,
        stream.findings,
        stamps.unix,
    )


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


def _quaternions(columns: Columns, titles: list[str], spec: QuaternionColumns) -> np.ndarray:
    """q_earth_from_file, shape (n, 4)."""
    q = stack(columns, titles)
    q = q if spec.order == "wxyz" else np.roll(q, 1, axis=1)
    return q if spec.direction == "earth_from_sensor" else rotation.conjugate(q)


def _truth(
    place: Place,
    spec: TruthColumns,
    table: Table,
    stamps: Stamps,
    stream: SampleStream,
    axes: AxisMap,
    notes: list[str],
) -> Truth:
    source, origin = table, stream.origin_ns
    like: SampleStream | None = stream
    if spec.file is not None:
        source = open_table(table.file.parent / Path(spec.file).name, spec.text)
        key = "truth.time.unit: UNIT in the mapping"
        asking = Asking(f"{source.file}", flag=key, lowest_hz=LOWEST_OF_TRUTH_HZ)
        stamps = _stamps(place, source, spec.time, spec.rate_hz, None, asking)
        like = None
        origin = stream.first_time_ns() if spec.same_clock else None
    titles = _columns(place.inside("columns"), source, spec.columns)
    marks = (
        _columns(place.inside("judged"), source, [spec.judged]) if spec.judged is not None else []
    )

    def convert(columns: Columns) -> Quantities:
        q = _quaternions(columns, titles, spec)
        return Quantities(
            None, None, None, q, np.nan_to_num(columns[marks[0]]) != 0 if marks else None
        )

    kinds: dict[str, Kind] = dict.fromkeys([*titles, *marks], "float")
    made = stamps.timeline
    chunks = list(SampleStream(source, kinds, convert, made, origin_ns=origin).with_rows_of(like))
    time, q = collect(chunks)
    judged = np.concatenate([chunk.saturated for chunk in chunks]) if marks else None
    # without a mounting, the body is the sensor with the axes of the file
    mounting = (
        Pose.from_placement(spec.mounting).quaternion
        if spec.mounting.rotation_deg
        else axes.q_file_from_sensor
    )
    return reference_truth(time, q, mounting, judged, notes)
