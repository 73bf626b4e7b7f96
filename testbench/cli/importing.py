"""The commands `import` and `formats`: recordings of others."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption, complete_robot
from testbench.cli.output import say, say_findings, say_json, say_table

if TYPE_CHECKING:
    from testbench.records.session.session import Session

TRUTH_PANEL = "Truth from a file of its own"
OPEN_PANEL = "What the files leave open"


class JointUnit(StrEnum):
    """Unit of joint angles."""

    deg = "deg"
    rad = "rad"


def _complete_format(incomplete: str) -> list[str]:
    from testbench.formats import FORMATS

    return [name for name in FORMATS if name.startswith(incomplete)]


# Long by its options, one parameter each, and the request that holds them.
def import_files(
    format_name: Annotated[
        str,
        typer.Argument(
            metavar="FORMAT",
            help="Format of the files; `testbench formats` lists them.",
            autocompletion=_complete_format,
        ),
    ],
    files: Annotated[list[Path] | None, typer.Argument(help="Files to read.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder of the session, to be made.")
    ] = None,
    guess: Annotated[
        bool,
        typer.Option(
            "--guess",
            help="Import nothing: say which formats and columns fit the files (no FORMAT before "
            "them), and write a mapping to begin with (to --out, else here).",
        ),
    ] = False,
    mapping: Annotated[
        str | None,
        typer.Option(
            "--mapping",
            help="Mapping of the generic format: a YAML file, or one that ships.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Sampling rate, where the files do not tell.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            "--unit",
            metavar="WHAT=UNIT",
            help="acc=g, gyr=rad/s, mag=uT, time=ms: how to read it.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(
            "--axes",
            help="Sensor axes: a map that ships, or 'x: -z, y: -y, z: -x'.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    recorded_at: Annotated[
        str | None,
        typer.Option(
            "--recorded-at",
            metavar="ISO-DATE",
            help="When it was recorded, e.g. 2021-08-20T20:21:13+08:00, where the files do not "
            "say.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    encoding: Annotated[
        str | None,
        typer.Option(
            "--encoding",
            metavar="NAME",
            help="Of text files: utf-8, utf-16, utf-16-le, utf-16-be, latin-1, cp1252.",
            rich_help_panel=OPEN_PANEL,
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            help="A robot's joint log or poses, orientations, markers or rigid bodies.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            help="The arm whose log it is.",
            rich_help_panel=TRUTH_PANEL,
            autocompletion=complete_robot,
        ),
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            "--link",
            metavar="[SENSOR=]LINK",
            help="Link of the arm that carries a sensor.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    mounting: Annotated[
        list[str] | None,
        typer.Option(
            "--mounting",
            metavar="[SENSOR=]MAP",
            help="Sensor in the link, e.g. 'rotation_deg: {ZYX: [0, 90, 0]}, position_mm: [0, 0, "
            "25]'.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    dwell: Annotated[
        float | None,
        typer.Option(
            "--dwell",
            metavar="S",
            help="How long each listed pose is held.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    calibration_poses: Annotated[
        int,
        typer.Option(
            "--calibration-poses",
            metavar="N",
            min=0,
            rich_help_panel=TRUTH_PANEL,
            help="The first N listed poses calibrate the sensors and are not judged.",
        ),
    ] = 0,
    move: Annotated[
        float | None,
        typer.Option(
            "--move",
            metavar="S",
            help="How long each move takes; else found in the samples.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    truth_offset: Annotated[
        float | None,
        typer.Option(
            "--truth-offset",
            metavar="S",
            help="Added to the truth's times; else found by the motion.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    truth_rate: Annotated[
        float | None,
        typer.Option(
            "--truth-rate",
            metavar="HZ",
            help="Rate of a log without times.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    truth_time_unit: Annotated[
        str | None,
        typer.Option(
            "--truth-time-unit",
            metavar="UNIT",
            help="Unit of its times: s, ms, us, ns, min, h, day.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    joint_unit: Annotated[
        JointUnit | None,
        typer.Option("--joint-unit", help="Unit of its joint angles.", rich_help_panel=TRUTH_PANEL),
    ] = None,
    truth_cluster: Annotated[
        list[str] | None,
        typer.Option(
            "--truth-cluster",
            metavar="SENSOR=M1,M2,M3",
            help="Markers that carry a sensor, three or more; or SENSOR=BODY, a rigid body.",
            rich_help_panel=TRUTH_PANEL,
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Turn a foreign recording into a session."""
    from testbench.exceptions import InputError
    from testbench.pipeline.bring_in import bring_in
    from testbench.pipeline.request import ImportRequest, TruthRequest

    if guess:
        _guess([Path(format_name), *(files or [])], out, json)
        return
    if not files:
        raise InputError(f"no files were given to read with the format {format_name}")
    if out is None:
        raise InputError("--out SESSION is missing: the folder of the session, to be made")
    described = (robot, link, mounting, dwell, move, truth_rate, joint_unit, calibration_poses)
    if truth is None and any((*described, truth_time_unit, truth_cluster)):
        raise InputError(
            "--robot, --link, --mounting, --dwell, --move, --calibration-poses, --truth-rate, "
            "--truth-time-unit, --truth-cluster and --joint-unit describe the file of --truth"
        )
    angles: Any = None if joint_unit is None else joint_unit.value
    session = bring_in(
        ImportRequest(
            format=format_name,
            files=tuple(map(str, files)),
            out=str(out),
            mapping=mapping,
            rate_hz=rate,
            units=tuple(unit or ()),
            axes=axes,
            recorded_at=recorded_at,
            encoding=encoding,
            truth=None
            if truth is None
            else TruthRequest(
                file=str(truth),
                robot=robot,
                links=tuple(link or ()),
                mountings=tuple(mounting or ()),
                dwell_s=dwell,
                move_s=move,
                offset_s=truth_offset,
                rate_hz=truth_rate,
                joint_unit=angles,
                calibration_poses=calibration_poses,
                time_unit=truth_time_unit,
                clusters=tuple(truth_cluster or ()),
            ),
        )
    )
    _say_imported(session, json)


def _guess(files: list[Path], out: Path | None, json: bool) -> None:
    """Say what files seem to be."""
    from testbench.pipeline.bring_in import guess_mapping

    found = guess_mapping(map(str, files), None if out is None else str(out))
    names = " ".join(map(str, files))
    if json:
        say_json(
            {
                "formats": found.formats,
                "seen": found.seen,
                "mapping": None if found.mapping is None else str(found.mapping),
            }
        )
        return
    for name, what in found.formats.items():
        say(f"format {name}: {what}")
        say(f"  testbench import {name} {names} --out SESSION")
    for sentence in found.seen:
        say(sentence)
    if found.mapping is not None:
        say(f"mapping: {found.mapping}")
        say(f"  testbench import generic {names} --mapping {found.mapping} --out SESSION")


def _say_imported(session: Session, json: bool) -> None:
    """What an import made."""
    manifest = session.manifest
    if json:
        say_json(
            {
                "session": str(session.path),
                "samples": manifest.samples,
                "rate_hz": {name: sensor.rate_hz for name, sensor in manifest.sensors.items()},
                "duration_s": manifest.duration_s,
                "recorded_utc": manifest.recorded_utc,
                "recorded_by": manifest.recorded_by,
                "findings": manifest.findings,
                "notes": manifest.notes,
            }
        )
        return
    for name, count in manifest.samples.items():
        say(f"{name}: {count} samples at {manifest.sensors[name].rate_hz:g} Hz")
    say_findings(manifest.findings)
    say(f"duration: {manifest.duration_s or 0.0:.1f} s")
    dated = (
        f"{manifest.recorded_utc}, by {manifest.recorded_by}"
        if manifest.recorded_utc
        else "date unknown"
    )
    say(f"recorded: {dated}")
    say(f"session: {session.path}")


def formats(
    json: JsonOption = False,
) -> None:
    """List the file formats that can be imported, the mappings and the axis maps that ship."""
    from testbench.formats import FORMATS, TRUTHS
    from testbench.formats.axes import axis_presets
    from testbench.formats.mapping import find_mapping, list_mappings

    listings = {
        "formats": {name: entry.line for name, entry in FORMATS.items()},
        "truths": TRUTHS,
        "mappings": {name: find_mapping(name).value.description for name in list_mappings()},
        "axes": {
            name: f"x: {a.x}, y: {a.y}, z: {a.z}. {a.description}"
            for name, a in axis_presets().items()
        },
    }
    if json:
        say_json(
            {
                key: [{"name": name, "description": text} for name, text in rows.items()]
                for key, rows in listings.items()
            }
        )
        return
    titles = {
        "formats": "Formats",
        "truths": "Truth from a file of its own (--truth)",
        "mappings": "Mappings of the generic format (--mapping)",
        "axes": "Axis maps (--axes)",
    }
    for key, rows in listings.items():
        say_table(
            titles[key], ["name", "description"], [[name, text] for name, text in rows.items()]
        )
