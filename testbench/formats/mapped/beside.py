"""What a file beside the samples says of the sign of an accelerometer."""

from __future__ import annotations

import csv
from pathlib import Path

from testbench.formats.mapped.build import Build
from testbench.formats.mapped.files import fitting
from testbench.formats.mapping import AccColumns, SaidBeside


def acc_as_meant(build: Build, part: AccColumns) -> AccColumns:
    """An accelerometer with the sign of the force.

    Args:
        build: The sensor, whose findings say what was found.
        part: Of the mapping.
    """
    asked = part.negated_where
    if asked is None:
        return part
    is_so, file = _said(build, asked)
    if is_so is None:
        if not (build.options.hemisphere or build.place.document.value.hemisphere):
            build.notice("structure.sign_open", file=str(asked.file))
        return part
    if not is_so:
        return part
    build.notice("structure.negated", file=file)
    return part.model_copy(update={"scale": -part.scale})


def _said(build: Build, asked: SaidBeside) -> tuple[bool | None, str]:
    """Whether a file says so, None where none does, and its name."""
    given = build.meant.files
    folder = [*given, *sorted(own for own in given[0].parent.iterdir() if own not in given)]
    for file in fitting(asked.file, folder):
        row = _first_row(file)
        if row.keys() >= asked.where.keys():
            wanted = asked.where.items()
            return all(row[key] in {t.lower() for t in texts} for key, texts in wanted), file.name
    return None, ""


def _first_row(file: Path) -> dict[str, str]:
    """The first row of a table by its titles, in lower case; nothing where it has none."""
    try:
        with file.open(encoding="utf-8-sig", newline="") as lines:
            row = next(csv.DictReader(lines), {})
    except (OSError, UnicodeDecodeError, csv.Error):
        return {}
    return {str(key).strip(): str(value).strip().lower() for key, value in row.items()}
