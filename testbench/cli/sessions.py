"""The command `sessions`: what there is, and what is none."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_json, say_table
from testbench.clock import utc_shown

if TYPE_CHECKING:
    from testbench.records.session.session import Session

KEYS = (
    *("session", "kind", "status", "outcome", "duration_s", "started_utc", "resumes"),
    *("protocol", "sensors", "tags", "headline"),
)
NO_SESSION = "no session"


# Long by its options, one parameter each.
def sessions(
    logs: Annotated[Path, typer.Option("--logs", help="Folder that holds the sessions.")] = Path(
        "logs"
    ),
    since: Annotated[
        str | None,
        typer.Option("--since", metavar="DATE", help="Begun on this day or later, as 2026-11-30."),
    ] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="DATE", help="Begun on this day or earlier.")
    ] = None,
    protocol: Annotated[
        str | None, typer.Option("--protocol", help="Of the protocol or recording of this name.")
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option("--sensor", help="With a sensor of this name, or of this preset."),
    ] = None,
    tag: Annotated[
        str | None,
        typer.Option("--tag", help="With a device of this tag, as its manifest states it."),
    ] = None,
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
    """List the recorded sessions with their status, verdict and what they answer."""
    from testbench.records.session.leftovers import clean as remove_leftovers
    from testbench.records.session.leftovers import leftovers
    from testbench.records.session.session import damaged_sessions, list_sessions

    wanted = Wanted.of(since, until, protocol, sensor, tag)
    gone = remove_leftovers(logs) if clean else []
    damage: dict[str, str] = {}
    rows = [_row(own, json, damage) for own in list_sessions(logs) if wanted.takes(own)]
    broken = {} if wanted.chooses else damaged_sessions(logs)
    damage |= broken
    left = {} if wanted.chooses else {one.path.name: one.what for one in leftovers(logs)}
    listed = {str(row[0]) for row in rows}
    rows += [_blank(name, "damaged") for name in broken]
    rows += [_blank(name, NO_SESSION) for name in left if name not in listed]
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


@dataclass(frozen=True)
class Wanted:
    """Which sessions are listed; all where nothing is said.

    Attributes:
        since: First day.
        until: Last day.
        protocol: Name of the protocol or recording.
        sensor: Name or preset of a sensor.
        tag: Of a device.
    """

    since: date | None
    until: date | None
    protocol: str | None
    sensor: str | None
    tag: str | None

    @staticmethod
    def of(
        since: str | None,
        until: str | None,
        protocol: str | None,
        sensor: str | None,
        tag: str | None,
    ) -> Wanted:
        """As it was typed.

        Raises:
            InputError: A date is none.
        """
        return Wanted(_day("--since", since), _day("--until", until), protocol, sensor, tag)

    @property
    def chooses(self) -> bool:
        """Whether not all are listed."""
        return any(value is not None for value in vars(self).values())

    def takes(self, session: Session) -> bool:
        """Whether a session is listed."""
        manifest = session.manifest
        own = manifest.sensors
        known = {*own, *(record.preset for record in own.values())}
        return (
            self._on_time(manifest.recorded_utc or manifest.started_utc)
            and self.protocol in (None, manifest.protocol.name)
            and (self.sensor is None or self.sensor in known)
            and (self.tag is None or self.tag in {record.device_tag for record in own.values()})
        )

    def _on_time(self, utc: str | None) -> bool:
        if self.since is None and self.until is None:
            return True
        try:
            day = datetime.fromisoformat(utc or "").date()
        except ValueError:  # nobody knows when it was
            return False
        return (self.since or day) <= day <= (self.until or day)


def _day(option: str, text: str | None) -> date | None:
    from testbench.exceptions import InputError

    try:
        return None if text is None else date.fromisoformat(text)
    except ValueError:
        raise InputError(f"{option} {text}: write a day as 2026-11-30") from None


def _blank(name: str, status: str) -> list[Any]:
    """What is shown of a folder that holds no session that can be read."""
    row: dict[str, Any] = dict.fromkeys(KEYS) | {
        "session": name,
        "status": status,
        "outcome": "-",
        "sensors": [],
        "tags": [],
    }
    return list(row.values())


def _row(session: Session, json: bool, damage: dict[str, str]) -> list[Any]:
    """What is shown of a session; a verdict that cannot be read is noted as damage."""
    from testbench.exceptions import SessionError
    from testbench.records.results.evaluation import stored_verdict

    headline = ""
    try:
        verdict = stored_verdict(session.path)
        outcome = "-" if verdict is None else str(verdict.outcome) if json else verdict.words
        headline = "" if verdict is None else verdict.headline
    except SessionError as error:
        outcome, damage[session.name] = "damaged", str(error)
    manifest = session.manifest
    cut_off = session.status == "running" and not session.is_being_recorded
    tags = {record.device_tag for record in manifest.sensors.values()}
    return [
        session.name,
        manifest.kind,
        "cut off" if cut_off else str(session.status),
        outcome,
        manifest.duration_s,
        manifest.started_utc,
        None if manifest.resumes is None else manifest.resumes.session,
        manifest.protocol.name,
        list(manifest.sensors),
        sorted(tag for tag in tags if tag),
        headline,
    ]


def _shown(utc: str) -> str:
    """A stamp of a manifest for people; as it stands where it is none."""
    try:
        return utc_shown(datetime.fromisoformat(utc)).removesuffix(" UTC")
    except ValueError:
        return utc


def _say_sessions(logs: Path, rows: list[list[Any]]) -> None:
    """The sessions of a folder as a table, and below it what each answers."""
    columns = ["session", "kind", "status", "outcome", "duration [s]", "started (UTC)", "resumes"]
    shown = [[*row[:5], row[5] and _shown(row[5]), row[6]] for row in rows]
    if not any(row[-1] for row in shown):
        columns, shown = columns[:-1], [row[:-1] for row in shown]
    say_table(f"Sessions in {logs}", columns, shown)
    for row in rows:
        if row[-1]:
            say(f"{row[0]}: {row[-1]}")
