"""The command `study`: questions asked of whole runs, beside published tables."""

from __future__ import annotations

import time
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.options import JsonOption, NoVerifyOption
from testbench.cli.output import say, say_json, say_table, teller

if TYPE_CHECKING:
    from testbench.records.results.study import StudyRecord, StudyTable, Value
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
            help="Another protocol in place of the study's own; the published column is left out.",
        ),
    ] = None,
    session: Annotated[
        Path | None,
        typer.Option(
            "--session",
            help="Recording to ask instead of running anything; the published column is left out.",
        ),
    ] = None,
    no_verify: NoVerifyOption = False,
    option: Annotated[
        list[str] | None,
        typer.Option(
            "--option",
            metavar="NAME=VALUE",
            help="Option of the study, such as every=2; --list names them.",
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
        return _say_list(list(STUDIES.values()), json)
    if (name is None) != reproduce:
        known = ", ".join(STUDIES)
        raise InputError(
            f"--reproduce takes no name: {name}" if reproduce else f"which study? known: {known}"
        )
    from testbench.clock import SystemClock
    from testbench.pipeline.request import StudyRequest
    from testbench.studies.bench import StudyBench

    asked = StudyRequest(
        name=name,
        protocol=protocol,
        session=None if session is None else str(session),
        verify=not no_verify,
        seed=seed,
        parts=parts,
        logs=str(logs),
        options=_options(option or []),
    )
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


def _options(given: list[str]) -> dict[str, str]:
    """Options by name, as `--option` gives them.

    Raises:
        InputError: One is no NAME=VALUE, or is given twice.
    """
    from testbench.exceptions import InputError

    options: dict[str, str] = {}
    for each in given:
        name, sign, value = (part.strip() for part in each.partition("="))
        if not (name and sign and value) or name in options:
            raise InputError(f"--option {each}: write it once, as NAME=VALUE, e.g. every=2")
        options[name] = value
    return options


def _say_list(studies: list[Study], json: bool) -> None:
    if json:
        entries = [
            {
                "name": study.name,
                "description": study.description,
                "options": dict(study.options),
            }
            for study in studies
        ]
        return say_json({"studies": entries})
    rows: list[list[object]] = [[study.name, study.description] for study in studies]
    say_table("Studies", ["name", "description"], rows)
    for study in studies:
        for option, meaning in study.options.items():
            say(f"{study.name} --option {option}=...: {meaning}")
    return None


def _say_study(record: StudyRecord) -> None:
    say(f"{record.title}, {'beside' if record.beside_published else 'after'} {record.source}")
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
        printed = [
            _with_spread(value, sd)
            for value, sd in zip_longest(row.published, row.published_spread)
        ]
        if row.published_alone:
            rows.append([f"{row.label}, {row.published_title}", *printed])
            continue
        ours = [_with_spread(value, sd) for value, sd in zip_longest(row.values, row.spread)]
        rows.append([row.title, *ours])
        if row.published:
            rows.append([f"  {row.published_title}", *printed])
    title = f"Table {table.table}: {table.caption}" if table.table else table.caption
    if table.spread:
        title += f" (± {table.spread})"
    say_table(title, ["", *table.columns], rows)
    for reason in table.reasons:
        say(f"{reason.verdict}: {reason.claim}")


def _with_spread(value: Value, sd: Value) -> Value:
    """A value as it is, or with its spread and no finer than that."""
    if not isinstance(value, int | float) or not isinstance(sd, int | float):
        return value
    from testbench.records.results.numbers import decimals_by

    decimals = decimals_by(sd)
    if decimals is None:
        return value
    return f"{value:.{decimals}f} ± {sd:.{decimals}f}"
