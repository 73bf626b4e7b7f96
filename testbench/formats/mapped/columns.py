"""The columns that a mapping names: what they are called, and which quantity is where."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbench.formats.any_table import Table
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.files import Place, file_of
from testbench.formats.mapping import DeviceQuaternion, TimeColumn, VectorColumns
from testbench.formats.tables.text_table import TextTable

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


def titles_of(
    place: Place, table: Table, columns: list[Any] | None, array: str | None
) -> list[str]:
    """The columns of a quantity, given as such or as an array.

    Args:
        place: Of the quantity in the mapping.
        table: That they are looked for in.
        columns: Titles, or numbers from 1.
        array: Name of the array, where no columns are given.

    Raises:
        FileProblems: There is no such column or array, more than one, or one of another width.
    """
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


def own_column(build: Build, key: str, table: Table) -> str | None:
    """A column that stands beside the samples: counter or temperature."""
    stated: str | int | None = getattr(build.spec, key)
    if stated is None:
        return None
    (title,) = columns_of(build.place.inside(key), table, [stated])
    return title


def place_quantities(build: Build) -> dict[str, Placed]:
    """Where each quantity of a sensor stands.

    Args:
        build: The sensor.

    Raises:
        FileProblems: A file or column is not there, or no quantity of motion is.
    """
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
        titles = titles_of(place, table, part.columns, part.array)
        if isinstance(part, DeviceQuaternion) and part.order == "xyzw":
            titles = [titles[3], *titles[:3]]
        placed[quantity] = Placed(part, table, titles, part.time or whole.time)
    if not placed.keys() & {"acc", "gyr", QUATERNION}:
        raise build.place.problem("of its acc, gyr and quaternion no file was given")
    return placed


def check_used_once(build: Build, placed: dict[str, Placed], truth: list[str]) -> None:
    """Refuse a column that is taken for two things.

    Args:
        build: The sensor.
        placed: Its quantities.
        truth: Columns of a truth in the rows of the samples.

    Raises:
        FileProblems: One is.
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
