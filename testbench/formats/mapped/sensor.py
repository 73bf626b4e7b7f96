"""One sensor as a mapping describes it: its quantities become samples."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from testbench.consistency.evidence import Evidence
from testbench.formats.any_table import Table
from testbench.formats.mapped.build import Build
from testbench.formats.mapped.columns import (
    Placed,
    check_used_once,
    own_column,
    place_quantities,
)
from testbench.formats.mapped.conversion import Conversion, conversion_of
from testbench.formats.mapped.together import Together, put_together
from testbench.formats.mapped.truth import mapped_truth, truth_in_rows
from testbench.formats.mapping import AccColumns, GyrColumns, full_scale_parts
from testbench.formats.plausibility import gather, told_unit
from testbench.formats.recording import ImportedSensor
from testbench.formats.tables.samples_stream import SampleStream, measured_rate
from testbench.formats.tables.source import Kind, first_rows
from testbench.formats.tables.units import find_unit

FULL_SCALE_KEYS = {"acc": "acc_m_s2", "gyr": "gyr_rad_s"}


@dataclass(frozen=True)
class Mapped:
    """A sensor that was built, and which columns it reads.

    Attributes:
        sensor: Of the recording.
        read: File and title of each column.
    """

    sensor: ImportedSensor
    read: set[tuple[Path, str]]


def mapped_sensor(build: Build) -> Mapped:
    """Build a sensor.

    Args:
        build: What it is built from.

    Raises:
        InputError: A unit or rate is open; says how to state it.
        FileProblems: The mapping does not fit the files, or a file is malformed.
    """
    spec = build.spec
    placed = place_quantities(build)
    together = put_together(build, placed, None)
    counter = own_column(build, "counter", together.main)
    if counter is not None and isinstance(together.source, Table):
        together = put_together(build, placed, counter)
    temperature = own_column(build, "temperature", together.main)
    truth_titles = truth_in_rows(build, together.main)
    check_used_once(build, placed, truth_titles)
    convert = conversion_of(build, placed, together.titles, temperature)
    build.findings += together.findings
    stream = SampleStream(
        together.source, convert.kinds, convert, together.stamps.timeline, counter
    )
    _notice_empty(build, placed, together, convert.kinds)
    rate = _rate(build, placed, together, stream)
    if convert.open_units:
        convert.factors.update(_decided_units(build, convert.open_units, gather(stream)))
    truth = None
    if spec.truth is not None:
        truth = mapped_truth(build, together, stream, convert.axes, truth_titles)
    sensor = ImportedSensor(
        stream,
        round(rate, 3),
        spec.description or build.place.document.value.description,
        truth,
        _details(build, convert, rate),
        build.findings,
        stream.findings,
        together.stamps.unix,
    )
    columns_read = {(p.table.file, column) for p in placed.values() for column in p.titles}
    return Mapped(sensor, columns_read)


def _rate(
    build: Build, placed: dict[str, Placed], together: Together, stream: SampleStream
) -> float:
    """The rate of a sensor [Hz]: that of its times where it has some, else the one stated."""
    stated = build.options.rate_or(build.place.document.value.rate_hz)
    timed = next(iter(placed.values())).time is not None and build.options.rate is None
    rate = (None if timed else stated) or measured_rate(stream.first()) or stated
    if rate is None:
        raise together.main.problem(
            f"the times of sensor '{build.name}' tell no rate; state it with --rate HZ"
        )
    return rate


def _notice_empty(
    build: Build, placed: dict[str, Placed], together: Together, kinds: dict[str, Kind]
) -> None:
    """Say which columns hold nothing at all."""
    head = first_rows(together.source, kinds)
    for quantity, p in placed.items():
        empty = [
            own
            for own, title in zip(p.titles, together.titles[quantity], strict=True)
            if not np.isfinite(head[title]).any()
        ]
        if empty:
            build.notice(
                "structure.empty_columns",
                columns=", ".join(empty),
                file=p.table.file.name,
                rows=len(head[together.titles[quantity][0]]),
                quantity=quantity,
            )


def _decided_units(build: Build, quantities: list[str], evidence: Evidence) -> dict[str, float]:
    """Factors to SI of quantities whose unit nobody stated, by what their values tell."""
    factors = {}
    for quantity in quantities:
        key = f"{'.'.join(map(str, build.place.path))}.{quantity}.unit"
        answer = f"the key {key} of the mapping, or --unit {quantity}=UNIT"
        unit, said = told_unit(quantity, evidence, build.name, answer)
        factors[quantity] = unit.factor
        build.findings.append(said)
    return factors


def _details(build: Build, convert: Conversion, rate: float) -> dict[str, Any]:
    """What the manifest says further of a sensor."""
    scales = {
        quantity: {"offset": vector.part.offset, "scale": vector.part.scale}
        for quantity, vector in convert.vectors.items()
        if (vector.part.offset, vector.part.scale) != (0.0, 1.0)
    }
    details: dict[str, Any] = {} if build.spec.device is None else {"device_tag": build.spec.device}
    if scales:
        details["raw_counts"] = {
            "formula": "value in the unit = (counts - offset) * scale"
        } | scales
    full_scale = {}
    for quantity, vector in convert.vectors.items():
        part = vector.part
        if isinstance(part, AccColumns | GyrColumns) and part.full_scale is not None:
            size, unit = full_scale_parts(quantity, part.full_scale)
            factor = convert.factors[quantity] if unit is None else find_unit(quantity, unit).factor
            full_scale[FULL_SCALE_KEYS[quantity]] = size * factor
    if full_scale:
        details["full_scale"] = full_scale
    if build.spec.sampling == "integrated":
        details |= {"sampling": "integrated", "rate_delay_s": 0.5 / rate}
    elif "sampling" in build.spec.model_fields_set:  # said, and not merely the default
        details["sampling"] = build.spec.sampling
    if build.spec.gyr_delay_ms is not None:
        details["rate_delay_s"] = 1e-3 * build.spec.gyr_delay_ms
    if build.spec.truth is not None and build.spec.truth.world != "z_up":
        details["truth_world"] = build.spec.truth.world
    if build.spec.truth is not None and build.spec.truth.sd_deg is not None:
        details |= {"truth_sd_deg": build.spec.truth.sd_deg, "truth_sd_from": "as was stated"}
    return details
