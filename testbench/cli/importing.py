"""The commands `import` and `formats`: recordings of others."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.import_options import (
    AxesOption,
    CalibrationPosesOption,
    DwellOption,
    EncodingOption,
    ForwardOption,
    HemisphereOption,
    JointOption,
    JointUnitOption,
    LinkOption,
    MappingOption,
    MountingOption,
    MoveOption,
    PlaceByOption,
    RateOption,
    RecordedAtOption,
    RobotOption,
    SegmentOption,
    SequenceOption,
    SimulatedOption,
    StandingOption,
    TruthAngleOption,
    TruthClusterOption,
    TruthOffsetOption,
    TruthOption,
    TruthRateOption,
    TruthSdOption,
    TruthTimeUnitOption,
    UnitOption,
)
from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_findings, say_json, say_table

if TYPE_CHECKING:
    from testbench.records.session.session import Session


OF_NEARLY_ALL = ("date.unknown", "structure.mapping", "consistency.unchecked")
"""Findings of nearly every recording, which a few words say or nobody needs to be told; the report
and --json hold them whole.
"""


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
    mapping: MappingOption = None,
    rate: RateOption = None,
    unit: UnitOption = None,
    axes: AxesOption = None,
    recorded_at: RecordedAtOption = None,
    encoding: EncodingOption = None,
    hemisphere: HemisphereOption = None,
    simulated: SimulatedOption = False,
    truth: TruthOption = None,
    robot: RobotOption = None,
    link: LinkOption = None,
    mounting: MountingOption = None,
    dwell: DwellOption = None,
    calibration_poses: CalibrationPosesOption = 0,
    move: MoveOption = None,
    truth_offset: TruthOffsetOption = None,
    truth_rate: TruthRateOption = None,
    truth_sd: TruthSdOption = None,
    truth_time_unit: TruthTimeUnitOption = None,
    joint_unit: JointUnitOption = None,
    truth_cluster: TruthClusterOption = None,
    truth_angle: TruthAngleOption = None,
    joint: JointOption = None,
    sequence: SequenceOption = None,
    place_by: PlaceByOption = None,
    standing: StandingOption = None,
    forward: ForwardOption = None,
    segment: SegmentOption = None,
    json: JsonOption = False,
) -> None:
    """Turn a foreign recording into a session."""
    from testbench.exceptions import InputError
    from testbench.pipeline.bring_in import bring_in
    from testbench.pipeline.request import BodyRequest, ImportRequest, TruthRequest

    of_body = any((joint, sequence, place_by, standing, forward, segment))
    if guess:
        further = (mapping, axes, recorded_at, encoding, hemisphere, truth)
        if of_body or simulated or any(option is not None for option in further):
            raise InputError(
                "--guess looks at the files by themselves: beside them it takes --out, --rate and "
                "--unit; give the other options to the import that it names"
            )
        _guess([Path(format_name), *(files or [])], out, rate, unit or [], json)
        return
    if not files:
        raise InputError(f"no files were given to read with the format {format_name}")
    if out is None:
        raise InputError("--out SESSION is missing: the folder of the session, to be made")
    described = (robot, link, mounting, dwell, move, truth_rate, joint_unit, calibration_poses)
    if truth is None and any((*described, truth_sd, truth_time_unit, truth_cluster, truth_angle)):
        raise InputError(
            "--robot, --link, --mounting, --dwell, --move, --calibration-poses, --truth-rate, "
            "--truth-sd, --truth-time-unit, --truth-cluster, --truth-angle and --joint-unit "
            "describe the file of --truth"
        )
    angles: Any = None if joint_unit is None else joint_unit.value
    where: Any = None if hemisphere is None else hemisphere.value
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
            hemisphere=where,
            simulated=simulated,
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
                sd_deg=truth_sd,
                joint_unit=angles,
                calibration_poses=calibration_poses,
                time_unit=truth_time_unit,
                clusters=tuple(truth_cluster or ()),
                angles=tuple(truth_angle or ()),
            ),
            body=None
            if not of_body
            else BodyRequest(
                joints=tuple(joint or ()),
                sequences=tuple(sequence or ()),
                segments=tuple(segment or ()),
                place_by=None if place_by is None else place_by.value,
                standing=standing,
                forward=tuple(forward or ()),
            ),
        )
    )
    _say_imported(session, json)


def _guess(
    files: list[Path], out: Path | None, rate: float | None, units: list[str], json: bool
) -> None:
    """Say what files seem to be."""
    from testbench.pipeline.bring_in import guess_mapping

    found = guess_mapping(map(str, files), None if out is None else str(out), rate, units)
    names = shlex.join(map(str, files))
    if json:
        say_json(
            {
                "formats": found.formats,
                "mappings": found.shipped,
                "seen": found.seen,
                "mapping": None if found.mapping is None else str(found.mapping),
            }
        )
        return

    def answered(name: str) -> str:
        return "".join(f" {option}" for option in found.answers.get(name, ()))

    for name, what in found.formats.items():
        say(f"format {name}: {what}")
        asked = re.search(r"--unit \w+=\w+|--rate HZ", what)
        options = f" {asked[0]}" if asked and what.startswith("it asks") else ""
        say(f"  testbench import {name} {names}{answered(name)}{options} --out SESSION")
    for name, what in found.shipped.items():
        say(f"mapping {name}, which ships: {what}")
        say(f"  testbench import generic {names} --mapping {name}{answered(name)} --out SESSION")
    for sentence in found.seen:
        say(sentence)
    if found.mapping is not None:
        say(f"mapping: {found.mapping}")
        options = answered("") + "".join(f" {option}" for option in found.open_options)
        mapping = shlex.quote(str(found.mapping))
        say(f"  testbench import generic {names} --mapping {mapping}{options} --out SESSION")


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
    say_findings(one for one in manifest.findings if one.code not in OF_NEARLY_ALL)
    unshown: dict[str, list[str]] = {}
    for one in manifest.findings:
        if one.code == "consistency.unchecked":
            unshown.setdefault(str(one.values["in_short"]), []).append(one.where)
    for what, sensors in unshown.items():
        say(f"unchecked, for the motion does not show it: {', '.join(sensors)}: {what}")
    say(f"duration: {manifest.duration_s or 0.0:.1f} s")
    dated = (
        f"{manifest.recorded_utc}, by {manifest.recorded_by}"
        if manifest.recorded_utc
        else "date unknown; --recorded-at 2021-08-20 states it, by which the nearest of several "
        "stored calibrations is chosen"
    )
    say(f"recorded: {dated}")
    if manifest.simulated_sensors:
        say("simulated: the samples come from a model")
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
