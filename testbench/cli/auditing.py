"""The command `audit`: what a recording says of its sensors by themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbench.cli.options import JsonOption, NoVerifyOption, SensorOption, session_of
from testbench.cli.output import say, say_json, say_table

if TYPE_CHECKING:
    from testbench.pipeline.audit import SensorAudit
    from testbench.records.results.estimate import SensorEstimate


def audit(
    session: Annotated[Path, typer.Argument(help="Folder of a session.")],
    sensor: SensorOption = None,
    faces: Annotated[
        str | None,
        typer.Option(
            "--faces",
            help="Which axis of the part pointed up in each rest, in their order, such as "
            "'+z -z +x -x +y -y': the axes of a recording without a truth.",
        ),
    ] = None,
    rest: Annotated[
        float,
        typer.Option("--rest", min=0.1, help="Shortest rest on a face that counts, in seconds."),
    ] = 1.0,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Sampling, clocks between the triads, axes, and the scatter of roll and pitch at rest."""
    from testbench.pipeline.audit import audit_sensors
    from testbench.pipeline.request import AuditRequest

    opened = session_of(session, no_verify)
    named = tuple((faces or "").replace(",", " ").split())
    found = audit_sensors(opened, AuditRequest(sensor=sensor, faces=named, least_rest_s=rest))
    if json:
        told = {name: asdict(own) for name, own in found.items()}
        say_json({"session": str(opened.path), "simulated": opened.simulated, "sensors": told})
        return
    say_timing(found)
    say_axes(found)
    _say_faces(found)
    _say_inclination(found)
    if opened.simulated:
        say(f"simulated: {' and '.join(opened.simulated)}")


def say_timing(found: Mapping[str, SensorAudit] | Mapping[str, SensorEstimate]) -> None:
    """Show how each sensor was sampled.

    Args:
        found: By sensor, with its timing.
    """
    rows: list[list[Any]] = []
    for name, own in found.items():
        t = own.timing
        rows.append(
            [
                name,
                t.samples,
                t.nominal_rate_hz,
                t.sampling_rate_hz,
                t.jitter_ms,
                t.repeated_stamps + t.backward_stamps,
                t.gaps,
                t.lost_percent,
                t.acc_after_gyr_ms,
                2 * t.acc_after_gyr_sd_ms,
            ]
        )
    titles = ["sensor", "samples", "nominal [Hz]", "sampling [Hz]", "jitter [ms]", "bad stamps"]
    titles += ["gaps", "lost [%]", "acc. after gyr. [ms]", "U [ms]"]
    say_table("Timing, by each sensor's own clock", titles, rows)


def say_axes(found: Mapping[str, SensorAudit] | Mapping[str, SensorEstimate]) -> None:
    """Show which axis is which, where the motion and a truth tell.

    Args:
        found: By sensor, with its axes.
    """
    hands = {True: "right", False: "left", None: ""}
    rows: list[list[Any]] = [
        [name, triad, own.axes or "", hands[own.right_handed], own.gain, own.crooked_deg]
        for name, sensor in found.items()
        for triad, own in sensor.axes.items()
    ]
    if rows:
        titles = ["sensor", "triad", "axes", "hand", "reading over truth", "crooked [deg]"]
        say_table("Axes against the truth", titles, rows)


def _say_faces(found: dict[str, SensorAudit]) -> None:
    rows: list[list[Any]] = []
    for name, sensor in found.items():
        own = sensor.faces
        if own is None:
            continue
        rows.append([name, "acc", own.acc or "not every axis was up", own.gain, own.crooked_deg])
        rows.append([name, "gyr", own.gyr or "the turns do not tell", None, own.missed_deg])
    if rows:
        titles = ["sensor", "triad", "axes", "reading over gravity", "left [deg]"]
        say_table("Axes by rests on the faces", titles, rows)


def _say_inclination(found: dict[str, SensorAudit]) -> None:
    rows: list[list[Any]] = [
        [name, own.inclination.roll_sd_rad, own.inclination.pitch_sd_rad, own.inclination.rest_s]
        for name, own in found.items()
        if own.inclination is not None
    ]
    if rows:
        titles = ["sensor", "sd of roll [rad]", "sd of pitch [rad]", "rest [s]"]
        say_table("Inclination at rest by the accelerometer (R of an Euler filter)", titles, rows)
