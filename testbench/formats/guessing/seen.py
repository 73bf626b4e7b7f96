"""What a file holds by its titles: columns of numbers, and quantities by sensor."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems
from testbench.formats.any_table import Table, kind_of, open_table
from testbench.formats.guessing.text_layout import find_layout, numeric_columns
from testbench.formats.guessing.titles import in_order, read_title
from testbench.formats.mapping import TextLayout
from testbench.formats.tables.array_table import ArrayTable
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.parquet_table import ParquetTable
from testbench.formats.tables.source import first_rows
from testbench.formats.tables.text_table import TextTable, head_of

KINDS = {"acc": 3, "gyr": 3, "mag": 3, "quaternion": 4, "truth": 4}
"""Quantities of a sensor in a mapping, and how many columns each has."""
ROWS_LOOKED_AT = 100_000


@dataclass
class Quantity:
    """Columns of one quantity.

    Attributes:
        columns: Titles, or places from 1 where there are none.
        array: Or the array that holds them all.
        names: As the table calls them.
        unit: As their titles write it.
    """

    columns: list[str | int]
    names: list[str]
    unit: str = ""
    array: str | None = None


@dataclass
class Seen:
    """A file that was looked into.

    Attributes:
        table: Of it.
        layout: Of its text.
        values: First rows of its columns of numbers.
        clocks: Columns of times of day.
        sensors: Quantities by sensor, as titles tell them; empty where they tell none.
        second: Titles of a second line, by column; joined to those of the first where these alone
            tell no quantity, or stand more than once.
        free: Columns of acceleration without gravity, which no sensor here takes.
    """

    table: Table
    layout: TextLayout
    values: dict[str, np.ndarray]
    clocks: list[str]
    sensors: dict[str, dict[str, Quantity]] = field(default_factory=dict)
    second: dict[str, str] = field(default_factory=dict)
    free: list[str] = field(default_factory=list)


def look(file: Path) -> Seen:
    """Look into a file.

    Args:
        file: To look into.

    Raises:
        FileProblems: It is not there, or holds no table.
    """
    layout = TextLayout()
    clocks: list[str] = []
    if kind_of(file) is None:
        layout, rows = find_layout(file)
        table = open_table(file, layout)
        numbers, clocks = numeric_columns(table.names, rows)
    else:
        table = open_table(file, layout)
        numbers = [name for name in table.names if _is_number(table, name)]
    values: dict[str, np.ndarray] = {}
    for group in _together(table, numbers):
        rows_read = first_rows(table, dict.fromkeys(group, "float"))
        values |= {name: column[:ROWS_LOOKED_AT] for name, column in rows_read.items()}
    seen = Seen(table, layout, values, clocks)
    if not layout.header:
        return seen
    if isinstance(table, TextTable) and layout.lines_below_header:
        second = _second_titles(table, layout)
        seen.second = second if table.twice else {}
        seen.sensors = _by_title(seen)
        if not seen.sensors and second and not seen.second:
            seen.second = second
            seen.sensors = _by_title(seen)
        return seen
    seen.sensors = _by_title(seen)
    return seen


def _second_titles(table: TextTable, layout: TextLayout) -> dict[str, str]:
    """The line below the titles by column; nothing where it has another number of fields."""
    line = head_of(table.file, table.encoding)[table.first_line - 1 - layout.lines_below_header]
    fields = split_line(line, table.separator)
    return dict(zip(table.names, fields, strict=True)) if len(fields) == len(table.names) else {}


def _is_number(table: Table, name: str) -> bool:
    if not isinstance(table, ParquetTable):
        return True
    try:
        first_rows(table, {name: "float"})
    except FileProblems:
        return False
    return True


def _together(table: Table, names: list[str]) -> list[list[str]]:
    """Columns that can be read together: of arrays, those of one."""
    if isinstance(table, TextTable):
        return [names] if names else []
    inside = {column: array for array, columns in table.arrays.items() for column in columns}
    return [list(group) for _, group in itertools.groupby(names, lambda n: inside.get(n, n))]


def path_of(seen: Seen, name: str) -> tuple[str, str]:
    """Group and own name of an array; a column of another table is in no group.

    Where there are two lines of titles its own name is both.
    """
    table = seen.table
    if name in seen.second:
        first = re.sub(r" \(column \d+\)$", "", name)
        return "", f"{first} {seen.second[name]}"
    if not isinstance(table, ArrayTable):
        return "", name
    folder, _, last = name.rpartition("/")
    return folder, last


def _by_title(seen: Seen) -> dict[str, dict[str, Quantity]]:
    """Quantities by sensor, as titles and names of arrays tell them."""
    sensors: dict[str, dict[str, Quantity]] = {}
    parts: dict[tuple[str, str], dict[str, str]] = {}
    units: dict[tuple[str, str], str] = {}
    inside = {column for columns in seen.table.arrays.values() for column in columns}
    stem = read_title(seen.table.file.stem).kind
    for name in seen.values:
        if name in inside:
            continue
        folder, last = path_of(seen, name)
        title = read_title(last)
        kind = title.kind or (stem if title.part else None)
        if kind == "free":
            seen.free.append(name)
        if kind in KINDS and title.part:
            key = (folder or title.owner, kind)
            parts.setdefault(key, {}).setdefault(title.part, name)
            units.setdefault(key, title.unit)
    for (owner, kind), of in parts.items():
        ordered = in_order(of, kind)
        if ordered is not None:
            columns = [column_of(seen, name) for name in ordered]
            sensors.setdefault(owner, {})[kind] = Quantity(columns, ordered, units[owner, kind])
    for array, columns_of in seen.table.arrays.items():
        folder, last = path_of(seen, array)
        title = read_title(last)
        kind = title.kind
        width = KINDS.get(kind or "")
        if kind is not None and len(columns_of) == width:
            found = Quantity([*columns_of], columns_of, title.unit, array)
            sensors.setdefault(folder, {}).setdefault(kind, found)
    return _of_one_owner(sensors)


def _of_one_owner(sensors: dict[str, dict[str, Quantity]]) -> dict[str, dict[str, Quantity]]:
    """The same, with quantities put together that stand under different names but once each.

    `device_q_w` beside `acc_x` and `gyr_x` is of the same sensor; two accelerometers are two.
    """
    kinds = [kind for of in sensors.values() for kind in of]
    if len(sensors) > 1 and len(set(kinds)) == len(kinds):
        return {"": {kind: q for of in sensors.values() for kind, q in of.items()}}
    return {owner: of for owner, of in sensors.items() if of.keys() - {"mag", "truth"}} or sensors


def column_of(seen: Seen, name: str) -> str | int:
    """A column as a mapping names it."""
    if seen.second:
        return seen.table.names.index(name) + 1
    return name if seen.layout.header else int(name)


def name_of(seen: Seen, column: str | int) -> str:
    """A column as its table calls it."""
    return column if isinstance(column, str) else seen.table.names[column - 1]
