"""Tables as Parquet, with units and conventions in the schema."""

from __future__ import annotations

import json
from pathlib import Path

from testbench.formats.exporters.settings import settings_of
from testbench.formats.exporters.source import ExportSource
from testbench.formats.exporters.tables import all_tables, conventions, description, unit_of
from testbench.formats.exporters.writing import write_index
from testbench.records.disk.tables import write_parquet
from testbench.records.session.layout import table_file


def write(source: ExportSource, folder: Path) -> list[str]:
    """Write one Parquet file for each table, and export.json."""
    tables = all_tables(source)
    for name, columns in tables.items():
        units = {column: unit_of(column) for column in columns}
        notes = {
            "session": source.session.name,
            "parameters": json.dumps(settings_of(source, source.filters)),
            "units": json.dumps(units),
            "conventions": json.dumps(conventions()),
        }
        write_parquet(folder / table_file(name), columns, notes)
    write_index(folder, description(source, tables))
    return []
