"""The command `study`: questions asked of whole runs, beside published tables."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_json, say_table, teller

if TYPE_CHECKING:
    from testbench.records.results.study import StudyRecord, StudyTable
    from testbench.studies import Study
    from testbench.studies.bench import StudyBench


MOST_LISTED = 12
"""More sessions are counted, not listed."""


def _complete_study(incomplete: str) -> list[str]:
    from testbench.studies import STUDIES

    return [name for name in STUDIES if name.startswith(incomplete)]


# Long by its options, one parameter each.
def study(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Name of the study; --list shows them.", autocompletion=_complete_study
        ),
    ] = None,
    logs: Annotated[
        Path, typer.Option("--logs", help="Folder that the sessions and the study are kept in.")
    ] = Path("logs"),
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the first simulated part.")
    ] = 0,
    parts: Annotated[
        int, typer.Option("--parts", min=1, help="How many simulated parts to run.")
    ] = 5,
    protocol: Annotated[
        str | None,
        typer.Option(
            "--protocol",
            help="Another protocol in place of the study's own; reference-4 takes one.",
        ),
    ] = None,
    reproduce: Annotated[
        bool,
        typer.Option(
            "--reproduce",
            help="Run every study of a publication (reference-1, ...) instead, one by one.",
        ),
    ] = False,
    listed: Annotated[bool, typer.Option("--list", help="List the studies instead.")] = False,
    json: JsonOption = False,
) -> None:
    """Run a study and write its tables and report."""
    from testbench.exceptions import InputError
    from testbench.studies import STUDIES, wanted_studies

    if listed:
        return _say_list({study.name: study.description for study in STUDIES.values()}, json)
    if (name is None) != reproduce:
        known = ", ".join(STUDIES)
        raise InputError(
            f"--reproduce takes no name: {name}" if reproduce else f"which study? known: {known}"
        )
    from testbench.clock import SystemClock
    from testbench.pipeline.request import StudyRequest
    from testbench.studies.bench import StudyBench

    asked = StudyRequest(name=name, protocol=protocol, seed=seed, parts=parts, logs=str(logs))
    studies = wanted_studies(asked)
    bench = StudyBench.of(asked, SystemClock(), teller(json))
    if name is None:
        return _reproduce(studies, bench, json)
    kept = studies[0].keep(bench)
    if json:
        files = {"study": str(kept.folder), "report": str(kept.report)}
        say_json({**files, **kept.record.to_dict()})
    else:
        _say_study(kept.record)
        say(f"study:  {kept.folder}")
        say(f"report: {kept.report}")
    return None


def _reproduce(studies: list[Study], bench: StudyBench, json: bool) -> None:
    """Run several, and say what each found and where its report lies."""
    done = []
    for chosen in studies:
        begin = time.perf_counter()
        kept = chosen.keep(bench)
        seconds = time.perf_counter() - begin
        record = kept.record
        done.append(
            {
                "study": str(kept.folder),
                "report": str(kept.report),
                "seconds": seconds,
                "findings": list(record.findings),
            }
        )
        if not json:
            say(f"{chosen.name}: {record.title}, beside {record.source} ({seconds:.0f} s)")
            for finding in record.findings:
                say(f"- {finding}")
            say(f"report: {kept.report}\n")
    if json:
        say_json({"studies": done})


def _say_list(studies: dict[str, str], json: bool) -> None:
    if json:
        say_json(
            {"studies": [{"name": name, "description": text} for name, text in studies.items()]}
        )
    else:
        say_table(
            "Studies", ["name", "description"], [[name, text] for name, text in studies.items()]
        )


def _say_study(record: StudyRecord) -> None:
    say(f"{record.title}, beside {record.source}")
    for table in record.tables:
        _say_study_table(table)
    for finding in record.findings:
        say(f"- {finding}")
    sessions = record.sessions
    if len(sessions) > MOST_LISTED:
        say(
            f"sessions: {len(sessions)}, from {sessions[0]} to {sessions[-1]}; study.json and the "
            "report list them"
        )
        return
    for session in sessions:
        say(f"session: {session}")


def _say_study_table(table: StudyTable) -> None:
    rows: list[list[object]] = []
    for row in table.rows:
        if row.published_alone:
            rows.append([f"{row.label}, published", *row.published])
            continue
        rows.append([row.label, *row.values])
        if row.published:
            rows.append(["  published", *row.published])
    title = f"Table {table.table}: {table.caption}" if table.table else table.caption
    say_table(title, ["", *table.columns], rows)
