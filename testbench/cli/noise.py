"""The command `noise`: what a sensor reads at rest, to be kept as a sensor that can be
simulated.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.output import say, say_json, say_noise

if TYPE_CHECKING:
    from testbench.records.sensor import ImuParameters
    from testbench.records.session import Session


def noise(
    session: Annotated[
        Path, typer.Argument(help="Folder of a session with a rest of ten seconds or more.")
    ],
    sensor: Annotated[
        str | None,
        typer.Option("--sensor", help="Which sensor; needed where the session has several."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Write the sensor as a preset for protocols.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            "--like",
            help="Preset (a name or a .yaml file) that gives what a rest cannot show, such as "
            "ranges.",
        ),
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of tables.")
    ] = False,
) -> None:
    """Noise at rest in data-sheet units; --out keeps it as a sensor preset."""
    from testbench.evaluation import evaluate
    from testbench.exceptions import InputError, NotFoundError
    from testbench.pipeline.analyse import load_or_estimate
    from testbench.pipeline.noise_preset import measured_sensor
    from testbench.records.sensor import save_sensor
    from testbench.records.session import Session

    opened = Session(session)
    estimated = load_or_estimate(opened)
    names = opened.sensor_names
    if sensor is not None and sensor not in names:
        raise NotFoundError("sensor", sensor, names)
    rows = [row for row in evaluate(opened, estimated).noise if sensor in (None, row.sensor)]
    notes: list[str] = []
    if out is not None:
        name = sensor or (names[0] if len(names) == 1 else None)
        if name is None:
            raise InputError(
                f"the session has several sensors ({', '.join(names)}); say which with --sensor"
            )
        own = [row for row in rows if row.sensor == name]
        span = max((row.span_s for row in own), default=0.0)
        origin = f"sensor {name} of session {opened.name}, {span:.0f} s at rest"
        rate = estimated.sensors[name].timing.sampling_rate_hz
        base, base_name = _base(opened, name, like)
        parameters, notes = measured_sensor(own, base, origin, rate, base_name)
        save_sensor(out, parameters)
        notes.append(
            "all that is not noise, such as ranges, bandwidths and turn-on biases, is copied from "
            f"{base_name}"
        )
    if json:
        say_json(
            {
                "session": str(opened.path),
                "noise": [vars(row) for row in rows],
                "file": str(out) if out else None,
                "notes": notes,
            }
        )
        return
    if not rows:
        say("the recording holds no rest of 10 s or more, so no noise was measured")
    say_noise(rows)
    for note in notes:
        say(f"note: {note}")
    if out is not None:
        say(f"written: {out}; name it in a protocol beside it as preset: {out.name}")


def _base(session: Session, name: str, like: str | None) -> tuple[ImuParameters, str]:
    """The data sheet to start from, and what it is, a phrase."""
    from testbench.exceptions import InputError
    from testbench.records.sensor import PRESET_SUFFIXES, ImuParameters, load_preset
    from testbench.records.yaml_file import load_yaml

    if like is not None and like.endswith(PRESET_SUFFIXES):
        return load_yaml(Path(like), ImuParameters).value, f"the preset file {Path(like).name}"
    if like is not None:
        return load_preset(like), f"the preset {like}"
    described = session.analysis.sensors.get(name)
    if described is None:
        raise InputError(
            f"nothing is known of the range of sensor '{name}'; name a preset that resembles it "
            "with --like"
        )
    changed = " as changed in" if described.parameters else " named by"
    kind = f"the preset {described.preset}{changed}" if described.preset else "the parameters in"
    return described.imu(), f"{kind} the session's protocol"
