"""The command `sessions`: what there is, and what is none."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_json, say_table
from testbench.clock import utc_shown

if TYPE_CHECKING:
    from testbench.records.session.session import Session

KEYS = ("session", "kind", "status", "outcome", "duration_s", "started_utc", "resumes")
NO_SESSION = "no session"


def sessions(
    logs: Annotated[Path, typer.Option("--logs", help="Folder that holds the sessions.")] = Path(
        "logs"
    ),
    clean: Annotated[
        bool,
        typer.Option(
            "--clean",
            help="Remove what is no session: what commands left that were cut off before anything "
            "was recorded.",
        ),
    ] = False,
    json: JsonOption = False,
) -> None:
    """List the recorded sessions with their status."""
    from testbench.records.session.leftovers import clean as remove_leftovers
    from testbench.records.session.leftovers import leftovers
    from testbench.records.session.session import damaged_sessions, list_sessions

    gone = remove_leftovers(logs) if clean else []
    damage: dict[str, str] = {}
    rows = [_row(session, json, damage) for session in list_sessions(logs)]
    broken = damaged_sessions(logs)
    damage |= broken
    left = {one.path.name: one.what for one in leftovers(logs)}
    listed = {str(row[0]) for row in rows}
    rows += [[name, None, "damaged", "-", None, None, None] for name in broken]
    rows += [[name, None, NO_SESSION, "-", None, None, None] for name in left if name not in listed]
    if json:
        found = [dict(zip(KEYS, row, strict=True)) for row in rows]
        told = [
            own | {"damage": damage.get(name), "left": left.get(name)}
            for own in found
            for name in [str(own["session"])]
        ]
        say_json({"sessions": told, "removed": [str(path) for path in gone]})
        return
    _say_sessions(logs, rows)
    for name, cause in damage.items():
        say(f"{name} is damaged: {cause}")
    for name, what in left.items():
        say(f"{name} is no session: {what}")
    if left and not clean:
        say(f"`testbench sessions --logs {logs} --clean` removes what is no session")
    for path in gone:
        say(f"removed: {path}")


def _row(session: Session, json: bool, damage: dict[str, str]) -> list[Any]:
    """What is shown of a session; a verdict that cannot be read is noted as damage."""
    from testbench.exceptions import SessionError
    from testbench.records.results.evaluation import stored_verdict

    try:
        verdict = stored_verdict(session.path)
        outcome = "-" if verdict is None else str(verdict[0]) if json else verdict[1]
    except SessionError as error:
        outcome, damage[session.name] = "damaged", str(error)
    manifest = session.manifest
    cut_off = session.status == "running" and not session.is_being_recorded
    return [
        session.name,
        manifest.kind,
        "cut off" if cut_off else str(session.status),
        outcome,
        manifest.duration_s,
        manifest.started_utc,
        None if manifest.resumes is None else manifest.resumes.session,
    ]


def _shown(utc: str) -> str:
    """A stamp of a manifest for people; as it stands where it is none."""
    try:
        return utc_shown(datetime.fromisoformat(utc)).removesuffix(" UTC")
    except ValueError:
        return utc


def _say_sessions(logs: Path, rows: list[list[Any]]) -> None:
    """The sessions of a folder as a table."""
    columns = ["session", "kind", "status", "outcome", "duration [s]", "started (UTC)", "resumes"]
    rows = [[*row[:5], row[5] and _shown(row[5]), row[6]] for row in rows]
    if not any(row[-1] for row in rows):
        columns, rows = columns[:-1], [row[:-1] for row in rows]
    say_table(f"Sessions in {logs}", columns, rows)
