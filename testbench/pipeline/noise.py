"""What a sensor reads at rest, and how that is kept as a sensor that can be simulated."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from testbench.evaluation import evaluate
from testbench.evaluation.noise import SHORTEST_S, longest_rest_s
from testbench.exceptions import InputError, NotFoundError
from testbench.pipeline.calibrate import only_sensor
from testbench.pipeline.kept_estimate import load_or_estimate
from testbench.pipeline.noise_preset import measured_sensor
from testbench.pipeline.request import NoiseRequest
from testbench.records.disk.yaml_file import load_yaml
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import NoiseRow
from testbench.records.session.session import Session
from testbench.records.specs.sensor import PRESET_SUFFIXES, ImuParameters, load_preset, save_sensor


@dataclass(frozen=True)
class MeasuredNoise:
    """The noise of a session's sensors.

    Attributes:
        rows: By sensor, quantity and axis; none where nothing rested for ten seconds.
        file: The preset that was written; None where none was asked for.
        notes: On what of it was not measured, and why, in sentences.
    """

    rows: list[NoiseRow]
    file: Path | None
    notes: list[str]


def measure_noise(session: Session, asked: NoiseRequest | None = None) -> MeasuredNoise:
    """Noise at rest, and a preset with it where one is asked for.

    Args:
        session: The recording.
        asked: Of which sensor, and where the preset goes; of all of them, and no preset, if None.

    Raises:
        NotFoundError: No such sensor, or no such preset.
        InputError: A preset is of one sensor, was not measured, or nothing is known of its range.
    """
    asked = asked or NoiseRequest()
    estimated = load_or_estimate(session)
    if asked.sensor is not None and asked.sensor not in session.sensor_names:
        raise NotFoundError("sensor", asked.sensor, session.sensor_names)
    rows = [row for row in evaluate(session, estimated).noise if asked.sensor in (None, row.sensor)]
    notes = _too_short(session, estimated, asked.sensor, rows)
    if asked.out is None:
        return MeasuredNoise(rows, None, notes)
    name = only_sensor(session, asked.sensor)
    own = [row for row in rows if row.sensor == name]
    file = Path(asked.out)
    rate = estimated.sensors[name].timing.sampling_rate_hz
    parameters, on_preset = _preset(session, name, own, rate, asked.like)
    save_sensor(file, parameters)
    return MeasuredNoise(rows, file, [*notes, *on_preset])


def _too_short(
    session: Session, estimated: Estimate, wanted: str | None, rows: list[NoiseRow]
) -> list[str]:
    """Why there is no noise of a sensor, in a sentence each."""
    measured = {row.sensor for row in rows}
    names = [name for name in session.sensor_names if wanted in (None, name)]
    return [
        f"sensor {name}: no noise was measured, for that takes a rest of {SHORTEST_S:g} s; its "
        f"longest lasts {longest_rest_s(estimated.sensors[name]):.1f} s"
        for name in names
        if name not in measured and name in estimated.sensors
    ]


def _preset(
    session: Session, name: str, rows: list[NoiseRow], rate: float | None, like: str | None
) -> tuple[ImuParameters, list[str]]:
    """The preset of the sensor that the rows are of; sentences on what was not measured."""
    span = max((row.span_s for row in rows), default=0.0)
    model = "simulated " if session.manifest.sensors[name].simulated else ""
    origin = f"{model}sensor {name} of session {session.name}, {span:.0f} s at rest"
    base, base_name = _base(session, name, like)
    parameters, notes = measured_sensor(rows, base, origin, rate, base_name)
    copied = (
        "all that is not noise, such as ranges, bandwidths and turn-on biases, is copied from "
        f"{base_name}"
    )
    return parameters, [*notes, copied]


def _base(session: Session, name: str, like: str | None) -> tuple[ImuParameters, str]:
    """The data sheet to start from, and what it is, a phrase."""
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
