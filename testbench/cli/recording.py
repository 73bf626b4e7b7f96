"""The command `record`: devices alone."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption, LogsOption
from testbench.cli.output import say, say_findings, say_json, say_table
from testbench.cli.viewing import ViewOption, shown_beside

if TYPE_CHECKING:
    from testbench.execution.run_progress import Progress
    from testbench.records.session.session import Session


# Long by its options, one parameter each.
def record(
    serial: Annotated[
        list[str] | None,
        typer.Option(
            "--serial",
            metavar="[NAME=]PORT:FORMAT",
            help="Board on a serial port, and how it writes: a YAML file or a name.",
        ),
    ] = None,
    dot: Annotated[
        list[str] | None,
        typer.Option(
            "--dot", metavar="[NAME=]ADDRESS", help="Xsens DOT, by address or advertised name."
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            metavar="S",
            help="Length in seconds; without it, Ctrl-C is the normal end.",
        ),
    ] = None,
    logs: LogsOption = Path("logs"),
    name: Annotated[str, typer.Option("--name", help="Name of the recording.")] = "recording",
    dot_payload: Annotated[
        str, typer.Option("--dot-payload", help="Payload mode of the DOTs.")
    ] = "custom_mode_5",
    dot_rate: Annotated[
        int, typer.Option("--dot-rate", metavar="HZ", help="Output rate of the DOTs.")
    ] = 60,
    dot_sync: Annotated[
        bool,
        typer.Option(
            "--dot-sync",
            help="Bring the clocks of the DOTs together first; takes a quarter of a minute.",
        ),
    ] = False,
    scan: Annotated[
        bool, typer.Option("--scan", help="List serial ports and DOTs instead.")
    ] = False,
    view: ViewOption = None,
    json: JsonOption = False,
) -> None:
    """Record IMUs alone, without an arm; Ctrl-C ends it."""
    from testbench.pipeline.record import record as record_devices
    from testbench.pipeline.record import scan_devices
    from testbench.pipeline.request import RecordRequest
    from testbench.pipeline.watcher import Watcher, nothing

    if scan:
        return _say_found(scan_devices(), json)
    asked = RecordRequest(
        serial=tuple(serial or ()),
        dots=tuple(dot or ()),
        duration_s=duration,
        logs=str(logs),
        name=name,
        dot_payload=dot_payload,
        dot_rate_hz=dot_rate,
        dot_sync=dot_sync,
    )
    shown = _say_progress if sys.stderr.isatty() else None
    opened = shown_beside(view, _say_beside) or nothing
    watcher = Watcher(opened=opened)
    if not json:
        watcher = Watcher(notify=say, progress=shown, say=_say_beside, opened=opened)
    return _say_recorded(record_devices(asked, watcher), json)


def _say_progress(progress: Progress) -> None:
    listed = ", ".join(f"{name} {count}" for name, count in progress.samples.items())
    print(f"\r{progress.time:7.1f} s, samples: {listed} ", end="", file=sys.stderr, flush=True)


def _say_beside(line: str) -> None:
    """A line that does not run into the progress."""
    print(f"\n{line}" if sys.stderr.isatty() else line, file=sys.stderr)


def _say_found(found: dict[str, list[Any]], json: bool) -> None:
    if json:
        return say_json(found)
    say_table(
        "Serial ports",
        ["port", "description", "hardware"],
        [list(port.values()) for port in found["serial"]],
    )
    say_table(
        "Xsens DOTs",
        ["address", "name", "RSSI [dBm]"],
        [list(dot.values()) for dot in found["dots"]],
    )
    for note in found["notes"]:
        say(f"note: {note}")
    return None


def _say_recorded(session: Session, json: bool) -> None:
    statistics = {name: sensor.statistics for name, sensor in session.manifest.sensors.items()}
    if json:
        return say_json(
            {
                "session": str(session.path),
                "status": session.status,
                "duration_s": session.manifest.duration_s,
                "findings": session.manifest.findings,
                "notes": session.manifest.notes,
                "sensors": statistics,
            }
        )
    counted = (
        "samples_lost",
        "samples_dropped",
        "malformed_lines",
        "malformed_packets",
        "reconnected",
    )
    rows = [
        [name, s["samples"], s["rate_hz"], *[s.get(key, 0) for key in counted]]
        for name, s in statistics.items()
    ]
    columns = [
        "sensor",
        "samples",
        "rate [Hz]",
        "lost",
        "dropped",
        "malformed lines",
        "malformed packets",
        "reconnects",
    ]
    say_table(f"Recorded, {session.manifest.duration_s or 0.0:.1f} s", columns, rows)
    say_findings(session.manifest.findings)
    return say(f"session: {session.path}")
