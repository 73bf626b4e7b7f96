"""Turn a foreign recording into a session, by what a person says of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from testbench.clock import Clock, SystemClock
from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.guessing.written import mapping_yaml
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.pipeline.body_request import body_of
from testbench.pipeline.request import ImportRequest, TruthRequest
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.disk.yaml_file import parse_yaml, validation_problems
from testbench.records.session.session import Session
from testbench.records.specs.strict import Placement

Value = TypeVar("Value")


def bring_in(asked: ImportRequest, clock: Clock | None = None) -> Session:
    """Turn foreign files into a session.

    Args:
        asked: The files, and what they leave open.
        clock: For the date of the import; the machine's if None.

    Raises:
        NotFoundError: No such format; lists those that exist.
        InputError: Something is open or contradicts itself; says how to settle it. Nothing is
            written then.
        FileProblems: A file is not of this format; nothing is written then.
    """
    units = _once("--unit", (_pair("--unit", text) for text in asked.units))
    options = Options(
        asked.mapping,
        asked.rate_hz,
        units,
        asked.axes,
        asked.recorded_at,
        asked.encoding,
        asked.hemisphere,
        asked.simulated,
    )
    truth = None if asked.truth is None else _truth(asked.truth)
    body = None if asked.body is None else body_of(asked.body)
    files = [Path(file) for file in asked.files]
    return import_recording(
        asked.format, files, Path(asked.out), clock or SystemClock(), options, truth, body
    )


def guess_mapping(
    files: Iterable[str],
    out: str | None = None,
    rate_hz: float | None = None,
    units: Iterable[str] = (),
) -> Guessed:
    """Look into foreign files, and write a mapping of them to begin with.

    Args:
        files: Of one recording.
        out: File for the mapping; None for one called after the first of them, where the process
            works.
        rate_hz: Sampling rate, where a person states it [Hz].
        units: Units that a person states, each `WHAT=UNIT`.

    Raises:
        InputError: Nothing fits, says what was seen; or the file for the mapping is there already.
        FileProblems: A file is not there.
    """
    from testbench.formats.guessing.guess import default_name, guess
    from testbench.formats.mapped.files import inside

    paths = [own for file in files for own in inside(Path(file))]
    stated = _once("--unit", (_pair("--unit", text) for text in units))
    found = guess(paths, Options(rate=rate_hz, units=stated))
    if found.mapping is None:
        return Guessed(found.formats, found.shipped, found.seen, None, (), found.answers)
    path = Path(out) if out is not None else Path(default_name(paths))
    with stored_where_asked(path):
        write_text(path, mapping_yaml(found.mapping, found.seen), anew=True)
    still = tuple(found.open_options)
    return Guessed(found.formats, found.shipped, found.seen, path, still, found.answers)


@dataclass(frozen=True)
class Guessed:
    """What files seem to be.

    Attributes:
        formats: Those that read them, each with what it finds or asks.
        shipped: Mappings that ship with the bench and read them.
        seen: What the mapping rests on.
        mapping: Where that was written; None where no columns were recognised.
        open_options: Options that the import by it asks for.
        answers: Options, of those that a person gave, that the import by each format or mapping
            takes, by its name; "" is the mapping that was written.
    """

    formats: dict[str, str]
    shipped: dict[str, str]
    seen: list[str]
    mapping: Path | None
    open_options: tuple[str, ...] = ()
    answers: Mapping[str, Sequence[str]] = field(default_factory=dict)


def _truth(asked: TruthRequest) -> TruthOptions:
    links = (_pair("--link", text) if "=" in text else ("", text) for text in asked.links)
    return TruthOptions(
        Path(asked.file),
        asked.robot,
        _once("--link", links),
        _once("--mounting", map(_placement, asked.mountings)),
        asked.dwell_s,
        asked.move_s,
        asked.offset_s,
        asked.rate_hz,
        asked.joint_unit,
        asked.calibration_poses,
        asked.time_unit,
        _once("--truth-cluster", map(_cluster, asked.clusters)),
        _once("--truth-angle", map(_angle, asked.angles)),
        asked.sd_deg,
    )


def _once(option: str, pairs: Iterable[tuple[str, Value]]) -> dict[str, Value]:
    """What an option says of each name, of which it may speak once."""
    found: dict[str, Value] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"{option} is given twice for {name or 'the sensor'}; say which holds")
        found[name] = value
    return found


def _pair(option: str, text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key.strip() or not value.strip():
        raise InputError(
            f"{option} {text}: write it as "
            f"{'WHAT=UNIT, e.g. acc=g or time=ms' if option == '--unit' else 'SENSOR=...'}"
        )
    return key.strip(), value.strip()


def _cluster(text: str) -> tuple[str, list[str]]:
    """Sensor and names, from `SENSOR=M1,M2,M3`."""
    sensor, names = _pair("--truth-cluster", text)
    return sensor, [name.strip() for name in names.split(",") if name.strip()]


def _angle(text: str) -> tuple[str, str]:
    """Joint and angle, and the column, from `JOINT.ANGLE=COLUMN`."""
    joint, equals, column = (part.strip() for part in text.partition("="))
    if not equals or not joint or not column.removeprefix("-").strip():
        raise InputError(
            f"--truth-angle {text}: write it as JOINT.ANGLE=COLUMN, such as "
            "knee.flexion=knee_angle_r"
        )
    return joint, column


def _placement(text: str) -> tuple[str, Placement]:
    """Sensor ("" for all) and mounting, from `[SENSOR=]rotation_deg: {...}, position_mm: [...]`."""
    sensor, equals, rest = text.partition("=")
    sensor, rest = (sensor.strip(), rest) if equals else ("", text)
    place = Path("--mounting")
    data, places = parse_yaml(rest if rest.strip().startswith("{") else f"{{{rest}}}", place)
    try:
        return sensor, Placement.model_validate(data)
    except ValidationError as error:
        raise InputError(str(FileProblems(place, validation_problems(error, places)))) from None
