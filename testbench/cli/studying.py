"""The command `study`: questions asked of whole runs, beside published tables."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.output import say, say_json, say_table

if TYPE_CHECKING:
    from testbench.records.study import StudyRecord, StudyTable


def _complete_study(incomplete: str) -> list[str]:
    from testbench.studies import STUDIES

    return [name for name in STUDIES if name.startswith(incomplete)]


def study(
    name: Annotated[
        str | None, typer.Argument(help="Name of the study; --list shows them.", autocompletion=_complete_study)
    ] = None,
    logs: Annotated[Path, typer.Option("--logs", help="Folder that the sessions and the study are kept in.")] = Path("logs"),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the first simulated part.")] = 0,
    parts: Annotated[int, typer.Option("--parts", min=1, help="How many simulated parts to run.")] = 5,
    listed: Annotated[bool, typer.Option("--list", help="List the studies instead.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of tables.")] = False,
) -> None:
    """Run a study and write its tables and report."""
    from testbench.exceptions import InputError
    from testbench.studies import STUDIES, get_study

    if listed:
        return _say_list({study.name: study.description for study in STUDIES.values()}, json)
    if name is None:
        raise InputError(f"which study? known: {', '.join(STUDIES)}")
    from testbench.clock import SystemClock
    from testbench.reporting.study_report import study_report
    from testbench.studies.bench import StudyBench
    from testbench.studies.folder import new_folder

    clock = SystemClock()
    chosen = get_study(name)
    record = chosen.run(StudyBench(logs, clock, seed, parts, _tell if not json and sys.stderr.isatty() else _keep_quiet))
    folder = new_folder(logs, name, clock)
    record.save(folder)
    report = study_report(record, folder)
    if json:
        say_json({"study": str(folder), "report": str(report), **record.to_dict()})
    else:
        _say_study(record)
        say(f"study:  {folder}")
        say(f"report: {report}")
    return None


def _tell(text: str) -> None:
    print(text, file=sys.stderr)


def _keep_quiet(text: str) -> None:
    """Say nothing."""


def _say_list(studies: dict[str, str], json: bool) -> None:
    if json:
        say_json({"studies": [{"name": name, "description": text} for name, text in studies.items()]})
    else:
        say_table("Studies", ["name", "description"], [[name, text] for name, text in studies.items()])


def _say_study(record: StudyRecord) -> None:
    say(f"{record.title}, beside {record.source}")
    for table in record.tables:
        _say_study_table(table)
    for finding in record.findings:
        say(f"- {finding}")
    for session in record.sessions:
        say(f"session: {session}")


def _say_study_table(table: StudyTable) -> None:
    rows: list[list[object]] = []
    for row in table.rows:
        rows.append([row.label, *row.values])
        if row.published:
            rows.append(["  published", *row.published])
    title = f"Table {table.table}: {table.caption}" if table.table else table.caption
    say_table(title, ["", *table.columns], rows)
