"""Tables as comma-separated text, which every program reads."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
from pyarrow import csv

from testbench.formats.exporters.source import ExportSource
from testbench.formats.exporters.tables import all_tables, description
from testbench.formats.exporters.writing import write_index


def write(source: ExportSource, folder: Path) -> list[str]:
    """Write one CSV file for each table, and export.json.

    Numbers are in full precision; a cell is empty where there is none.
    """
    tables = all_tables(source)
    options = csv.WriteOptions(include_header=True, quoting_style="needed")
    for name, columns in tables.items():
        arrays = {
            key: pa.array(values, from_pandas=True) for key, values in columns.items()
        }  # NaN becomes an empty cell
        csv.write_csv(pa.table(arrays), folder / f"{name}.csv", options)
    write_index(folder, description(source, tables))
    return []
