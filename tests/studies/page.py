"""The numbers of docs/studies.md, taken from studies that were run.

`studies.md.j2` beside this module is the page with places for numbers of ours; `page_values.json`
holds what stands there. After `make reproduce`

    .venv/bin/python -m tests.studies.page logs

writes both anew from the newest study of each publication in `logs`.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

from jinja2 import Environment, StrictUndefined

from testbench.records.results.numbers import decimals_by
from testbench.records.results.study import FILE, StudyRecord

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "studies.md"
TEMPLATE, VALUES = (
    Path(__file__).with_name(name) for name in ("studies.md.j2", "page_values.json")
)
STUDIES = tuple(f"reference-{i}" for i in range(1, 6))
WIDTH = 130
"""Of a sentence that a study says."""
Look = Callable[[str], list[Any]]


def rendered(look: Look) -> str:
    """The page.

    Args:
        look: Gives what stands at an address: study, table, row and column, with a bar between
            them. See `looked_up`.
    """

    def cell(*address: str, decimals: int | None = None) -> str:
        """A value with its spread, no finer than that; or with stated decimals."""
        value, sd = look("|".join(address))
        if not isinstance(value, int | float):
            return str(value)
        if decimals is None:
            decimals = decimals_by(sd)
        if decimals is None:
            raise ValueError(f"{'|'.join(address)} has no spread: say how many decimals")
        return f"{value:.{decimals}f}" + (f" ± {sd:.{decimals}f}" if sd else "")

    def number(*address: str) -> float:
        """A bare value, for what a filter shows."""
        return float(look("|".join(address))[0])

    def title(study: str, table: str, row: str) -> str:
        """The whole title of a row that is named by its beginning."""
        return str(look(f"{study}|{table}|{row}|")[0])

    def ends(study: str, table: str, column: str, decimals: int = 2) -> str:
        """The least and the largest of a column."""
        low, high = (f"{end:.{decimals}f}" for end in look(f"{study}|{table}|*|{column}"))
        return low if low == high else f"{low} to {high}"

    def reasons(study: str, *tables: str) -> list[tuple[str, str]]:
        """Verdict and claim of each reason of some tables."""
        return [tuple(own) for table in tables for own in look(f"{study}|{table}|reasons|")]

    def findings(study: str) -> list[str]:
        """The answer in sentences."""
        return list(look(f"{study}|findings||"))

    made = Environment(undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True)
    made.filters["fixed"] = lambda value, decimals: f"{value:.{decimals}f}"
    made.filters["times"] = lambda factor, value: factor * value
    made.filters["lines"] = lambda text: fill(text, WIDTH, subsequent_indent="  ")
    made.filters["digits"] = lambda value, count: f"{value:.{count}g}"
    asked = {"cell": cell, "number": number, "title": title, "ends": ends}
    asked |= {"reasons": reasons, "findings": findings}
    page = made.from_string(TEMPLATE.read_text(encoding="utf-8")).render(asked)
    return re.sub(r"\n{3,}", "\n\n", page)


def newest(logs: Path) -> dict[str, StudyRecord]:
    """The newest study of each publication.

    Args:
        logs: Where `make reproduce` keeps them.
    """
    found = {}
    for name in STUDIES:
        folders = sorted(path.parent for path in logs.glob(f"*_study_{name}*/{FILE}"))
        if not folders:
            raise SystemExit(f"no study {name} in {logs}: make reproduce runs it")
        found[name] = StudyRecord.load(folders[-1])
    return found


def looked_up(records: Mapping[str, StudyRecord], address: str) -> list[Any]:
    """What stands at an address.

    Of a cell its value and spread; of the row `*` the least and the largest of the column; of the
    row `reasons` verdict and claim of each; of the table `findings` these; without a column the
    title of the row. Rows and columns are named by the whole title or by what it alone begins with.

    Args:
        records: By name.
        address: Study, table, row and column, with a bar between them.
    """
    study, key, row_name, column_name = address.split("|")
    if key == "findings":
        return list(records[study].findings)
    table = records[study].table(key)
    if row_name == "reasons":
        return [[reason.verdict, reason.claim] for reason in table.reasons]
    if column_name == "":
        return [_one([row.title for row in table.rows], row_name, address)]
    column = table.columns.index(_one(list(table.columns), column_name, address))
    if row_name == "*":
        known = [row.values[column] for row in table.rows]
        numbers = [float(value) for value in known if isinstance(value, int | float)]
        return [min(numbers), max(numbers)]
    row = {row.title: row for row in table.rows}[
        _one([row.title for row in table.rows], row_name, address)
    ]
    return [row.values[column], row.spread[column] if row.spread else None]


def _one(names: list[str], wanted: str, address: str) -> str:
    if wanted in names:
        return wanted
    own = [name for name in names if name.startswith(wanted)]
    if len(own) != 1:
        raise SystemExit(f"{address}: {len(own)} of these begin so: {'; '.join(names)}")
    return own[0]


def kept() -> dict[str, list[Any]]:
    """What stands on the page, by address."""
    return dict(json.loads(VALUES.read_text(encoding="utf-8"))["cells"])


def main(logs: Path) -> None:
    """Write page and values anew.

    Args:
        logs: Where `make reproduce` keeps its studies.
    """
    records = newest(logs)
    seen: dict[str, list[Any]] = {}

    def look(address: str) -> list[Any]:
        if address not in seen:
            seen[address] = looked_up(records, address)
        return seen[address]

    page = rendered(look)
    runs = {
        name: {"started_utc": record.started_utc, "settings": record.settings}
        for name, record in records.items()
    }
    content = {"runs": runs, "cells": dict(sorted(seen.items()))}
    VALUES.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "logs"))
