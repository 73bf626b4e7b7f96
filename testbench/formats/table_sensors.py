"""Sensors out of a table whose columns were recognised.

Units are stated or decided; time comes by stamps, a counter or a rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.formats.assumed import assumed_units
from testbench.formats.options import Options
from testbench.formats.plausibility import gather, told_unit
from testbench.formats.recording import ImportedSensor
from testbench.formats.stamps import Asking, Stamps, rate_differs, read_stamps
from testbench.formats.tables.recognise import Found
from testbench.formats.tables.samples_stream import Quantities, SampleStream, measured_rate, stack
from testbench.formats.tables.source import Columns, Kind, Source
from testbench.formats.tables.timeline import RegularTime
from testbench.formats.tables.units import QUANTITIES, TimeUnit, Unit, known_unit
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding


@dataclass(frozen=True)
class Layout:
    """What a format knows of its tables beyond the titles of their columns.

    Attributes:
        description: Of the sensor.
        units: By quantity, where the titles state none but the format does.
        time: Column of stamps, None for none.
        time_unit: Unit of the stamps; None where nothing states it.
        conjugate: The file's quaternion is q_sensor_from_earth.
        earth: What its earth's axes point to.
        rate: That the file states for samples without stamps [Hz], None for none.
    """

    description: str
    units: dict[str, str]
    time: str | None = None
    time_unit: TimeUnit | None = "s"
    conjugate: bool = False
    earth: str = "ENU"
    rate: float | None = None


# One piece: units, conversion and times of a table depend on one another.
def table_sensor(
    source: Source,
    found: Found,
    layout: Layout,
    name: str,
    options: Options,
    findings: list[Finding],
) -> ImportedSensor:
    """A sensor of a table.

    Args:
        source: The table.
        found: The sensor's columns.
        layout: What the format knows.
        name: Of the sensor.
        options: Answers.
        findings: What was noticed; is added to.

    Raises:
        InputError: A unit or the rate cannot be told; asks for it.
    """
    kinds: dict[str, Kind] = {
        column: "float" for columns in found.columns.values() for column in columns
    }
    stated: dict[str, str | None] = {
        quantity: _stated(quantity, found, layout)
        for quantity in QUANTITIES
        if quantity in found.columns
    }
    units = {quantity: options.unit(quantity, unit) for quantity, unit in stated.items()}
    factors: dict[str, float] = {
        quantity: 1.0 if unit is None else unit.factor for quantity, unit in units.items()
    }

    def convert(columns: Columns) -> Quantities:
        gyr, acc, mag = (
            stack(columns, found.columns[quantity], factors[quantity])
            if quantity in found.columns
            else None
            for quantity in ("gyr", "acc", "mag")
        )
        q = None
        if "quaternion" in found.columns:
            q = stack(columns, found.columns["quaternion"])
            q = rotation.conjugate(q) if layout.conjugate else q
            q = (
                q
                if layout.earth == "ENU"
                else rotation.multiply(np.array(Q_ENU_FROM[layout.earth]), q)
            )
        return Quantities(gyr, acc, mag, q)

    stamps = _stamps(source, layout, name, options)
    stream = SampleStream(source, kinds, convert, stamps.timeline)
    rate = options.rate_or(layout.rate) or measured_rate(stream.first())
    if rate is None:
        raise source.problem(
            f"the samples of sensor '{name}' have no usable times; state the rate with --rate HZ"
        )
    findings += _decide(stream, stated, units, factors, name)
    findings += _assumed(found, layout, units, name, options)
    return ImportedSensor(
        stream,
        round(rate, 3),
        layout.description,
        findings=stamps.findings,
        told=stream.findings,
        unix=stamps.unix,
    )


def _stated(quantity: str, found: Found, layout: Layout) -> str | None:
    return _by_file(quantity, found) or layout.units.get(quantity)


def _by_file(quantity: str, found: Found) -> str | None:
    """The unit that the title of a quantity states."""
    unit = found.units.get(quantity)
    return unit if unit and known_unit(quantity, unit) else None


def _stamps(source: Source, layout: Layout, name: str, options: Options) -> Stamps:
    rate = options.rate_or(layout.rate)
    if layout.time is not None:
        return asked_stamps(source, layout.time, layout.time_unit, name, options)
    if rate is None:
        raise source.problem(
            f"sensor '{name}' has no column of times; state its sampling rate with --rate HZ"
        )
    by_hand = options.rate is not None
    said = [finding("time.by_rows", rate_hz=rate, who="--rate")] if by_hand else []
    return Stamps(lambda: RegularTime(rate), said)


def asked_stamps(
    source: Source, column: str, stated: TimeUnit | None, name: str, options: Options
) -> Stamps:
    """How a column of times is to be read, by what a person says with --unit and --rate.

    Args:
        source: The table.
        column: Of times.
        stated: Unit by the format or the title, None where none states it.
        name: Of the sensor.
        options: Answers.

    Raises:
        InputError: The unit cannot be right.
    """
    unit = None if stated == "clock" else options.unit("time", None)
    rate = options.rate_or(None)
    answered = None if unit is None else unit.name
    asking = Asking(f"{file_of(source)}sensor '{name}'", answered, rate=rate)
    stamps = read_stamps(source, column, stated, asking)
    if rate is not None:
        stamps.findings.extend(rate_differs(rate, stamps.rate))
    return stamps


def file_of(source: Source) -> str:
    """The file of a table before a message, where it has one of its own."""
    file = getattr(getattr(source, "main", source), "file", None)
    return f"{file}: " if file is not None else ""


def _decide(
    stream: SampleStream,
    stated: dict[str, str | None],
    units: dict[str, Unit | None],
    factors: dict[str, float],
    name: str,
) -> list[Finding]:
    """Fill in the factors of units that nobody stated; the stream sees them at its next pass."""
    open_ones = [
        quantity for quantity in ("acc", "gyr") if quantity in stated and units[quantity] is None
    ]
    if not open_ones:
        return []
    evidence, findings = gather(stream), []
    for quantity in open_ones:
        unit, said = told_unit(quantity, evidence, name, f"--unit {quantity}=UNIT")
        factors[quantity] = unit.factor
        findings.append(said)
    return findings


def _assumed(
    found: Found, layout: Layout, units: dict[str, Unit | None], name: str, options: Options
) -> list[Finding]:
    """What is taken for granted where the file does not say it."""
    findings = []
    if "mag" in units and units["mag"] is None:
        findings.append(finding("unit.field_unstated", name))
    taken = {
        quantity: unit.name
        for quantity, unit in units.items()
        if unit is not None
        and (unit.name == "au" or (quantity in layout.units and not _by_file(quantity, found)))
    }
    findings += assumed_units(name, taken, options)
    if "quaternion" in found.columns and layout.conjugate:
        findings.append(finding("orientation.inverse", name, earth=layout.earth))
    return findings
