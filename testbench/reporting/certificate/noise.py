"""The certificate of a sensor's noise at rest: a data sheet by axis, and the Allan deviation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from testbench.exceptions import InputError
from testbench.records.results.certificate import (
    Figure,
    FigureCurve,
    ResultRow,
    ResultTable,
)
from testbench.records.results.evaluation import Evaluation, NoiseRow
from testbench.records.results.quantity import Quantity
from testbench.records.session.layout import allan_table
from testbench.records.session.session import Session
from testbench.reporting.certificate import words
from testbench.reporting.certificate.parts import Parts, shortened
from testbench.reporting.certificate.statements import weighty
from testbench.reporting.page.tables import unit_words

K = 1.96
"""Coverage factor of a normal distribution for 95 % (JCGM 100:2008, table G.1)."""
TRIADS = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
AXES = ("x", "y", "z")
INTEGRATED = {"acc": "Velocity random walk", "gyr": "Angle random walk"}
OF_FILTERS = {"filter", "filters"}
"""Values of findings that speak of orientations, which noise has none of."""
NOT_SHOWN = "not shown by this rest"
HIDDEN = "lost among the other noises"
UNSTATED = "no uncertainty is stated"


@dataclass(frozen=True)
class _Line:
    """A line of the data sheet: its title, and where value, uncertainty and unit stand."""

    title: str
    value: str
    sd: str
    unit: str
    lacking: str


LINES = (
    _Line(
        "White noise, one-sided density",
        "noise_density",
        "noise_density_sd",
        "noise_density_unit",
        HIDDEN,
    ),
    _Line("", "random_walk", "", "random_walk_unit", HIDDEN),
    _Line(
        "Bias instability",
        "bias_instability",
        "bias_instability_sd",
        "bias_instability_unit",
        NOT_SHOWN,
    ),
    _Line(
        "Rate random walk",
        "rate_random_walk",
        "rate_random_walk_sd",
        "rate_random_walk_unit",
        NOT_SHOWN,
    ),
)


def noise_parts(session: Session, sensor: str, evaluation: Evaluation) -> Parts:
    """What a certificate of noise says of a sensor.

    Args:
        session: The recording.
        sensor: Its name.
        evaluation: Of the session.

    Raises:
        InputError: No noise of it was measured.
    """
    rows = [row for row in evaluation.noise if row.sensor == sensor]
    if not rows:
        raise InputError(
            f"{session.path}: there is no noise of sensor {sensor} to certify; `testbench noise` "
            "says why"
        )
    by_triad = {
        quantity: {row.axis: row for row in rows if row.quantity == quantity} for quantity in TRIADS
    }
    tables = [_table(quantity, own) for quantity, own in by_triad.items() if own]
    span, count = max(row.span_s for row in rows), max(row.samples for row in rows)
    found = [*session.manifest.findings, *evaluation.findings]
    others = [*(name for name in session.sensor_names if name != sensor), *session.analysis.joints]
    return Parts(
        title=words.NOISE_TITLE,
        summary=_summary(sensor, by_triad, span),
        procedure=[words.REST_TAKEN.format(count=count, span=span), words.ALLAN],
        results=tables,
        figures=_figures(sensor, evaluation, by_triad),
        findings=weighty([own for own in found if not OF_FILTERS & own.values.keys()], others),
        uncertainty=[words.NOISE_UNCERTAINTY],
        references=[words.OWN_UNITS],
        not_claimed=_not_claimed(by_triad, span),
        untraceable=words.NO_REFERENCE,
    )


def _table(quantity: str, own: Mapping[str, NoiseRow]) -> ResultTable:
    """The data sheet of a triad."""
    rows = [row for line in LINES if (row := _row(quantity, line, own)) is not None]
    first = next(iter(own.values()))
    bandwidths = {axis: row.noise_bandwidth_hz for axis, row in own.items()}
    if any(value is not None for value in bandwidths.values()):
        quantities = [
            Quantity.of(bandwidths.get(axis), None, None, UNSTATED if axis in own else NOT_SHOWN)
            for axis in AXES
        ]
        rows.append(
            ResultRow(
                of=["Bandwidth of the low pass"],
                key="noise_bandwidth_hz",
                unit="Hz",
                quantities=quantities,
            )
        )
    return ResultTable(
        title=f"{TRIADS[quantity].capitalize()}, over {first.span_s:.0f} s at rest",
        of=["quantity"],
        columns=[f"{axis} (value ± U)" for axis in AXES],
        rows=rows,
        notes=["k = 1.96. A dash: not observed, as said under “Not stated”."],
    )


def _row(quantity: str, line: _Line, own: Mapping[str, NoiseRow]) -> ResultRow | None:
    """A line of the data sheet; None of a unit that the triad has not."""
    title = line.title or INTEGRATED.get(quantity, "")
    unit = unit_words(getattr(next(iter(own.values())), line.unit))
    if not title or not unit:
        return None
    quantities = [_quantity(line, own.get(axis)) for axis in AXES]
    return ResultRow(of=[title], key=line.value, unit=unit, quantities=quantities)


def _quantity(line: _Line, row: NoiseRow | None) -> Quantity:
    """What one axis has of a line."""
    value = None if row is None else getattr(row, line.value)
    if row is None or value is None:
        return Quantity.of(None, None, None, line.lacking)
    if line.sd:
        sd = getattr(row, line.sd)
    elif row.noise_density and row.noise_density_sd is not None:
        sd = row.noise_density_sd * value / row.noise_density  # the same noise in another unit
    else:
        sd = None
    return Quantity.of(value, None if sd is None else K * sd, K, "" if sd else UNSTATED)


def _summary(sensor: str, by_triad: Mapping[str, Mapping[str, NoiseRow]], span: float) -> list[str]:
    """The white noise of each triad in a sentence."""
    told = []
    for quantity, own in by_triad.items():
        known = [row for row in own.values() if row.noise_density is not None]
        if known:
            worst = max(known, key=lambda row: row.noise_density or 0.0)
            told.append(
                words.WHITE_NOISE.format(
                    triad=TRIADS[quantity].capitalize(),
                    sensor=sensor,
                    shown=_quantity(LINES[0], worst).shown,
                    unit=unit_words(worst.noise_density_unit),
                    axis=worst.axis,
                    span=span,
                )
            )
    return told or [words.NO_WHITE_NOISE.format(sensor=sensor, span=span)]


def _not_claimed(by_triad: Mapping[str, Mapping[str, NoiseRow]], span: float) -> list[str]:
    """What was not observed, and what no rest can show."""
    told = [
        words.TRIAD_NOT_OBSERVED.format(triad=TRIADS[quantity].capitalize())
        for quantity, own in by_triad.items()
        if not own
    ]
    for line in LINES:
        where = []
        for quantity, own in by_triad.items():
            axes = [axis for axis in AXES if axis in own and getattr(own[axis], line.value) is None]
            where += [f"{TRIADS[quantity]} ({', '.join(axes)})"] if axes else []
        if where and line.title:
            told.append(f"{line.title} of the {', '.join(where)}: {line.lacking}.")
    return [*told, words.NO_REST_SHOWS, words.TOO_SLOW.format(half=span / 2)]


def _figures(
    sensor: str, evaluation: Evaluation, by_triad: Mapping[str, Mapping[str, NoiseRow]]
) -> list[Figure]:
    """The Allan deviation of each triad."""
    series = evaluation.series.get(allan_table(sensor), {})
    figures = []
    for quantity, own in by_triad.items():
        curves = [
            FigureCurve(
                name=axis,
                x=shortened(series["tau_s"]),
                y=shortened(series[f"{quantity}_{axis}"]),
                lower=shortened(series[f"{quantity}_{axis}_lower"]),
                upper=shortened(series[f"{quantity}_{axis}_upper"]),
            )
            for axis in AXES
            if f"{quantity}_{axis}" in series
        ]
        curves += _parts_found(series, quantity)
        if own and curves:
            unit = unit_words(next(iter(own.values())).bias_instability_unit)
            figures.append(
                Figure(
                    title=f"Allan deviation of the {TRIADS[quantity]}; bands: 68 % confidence",
                    kind="log_log",
                    x_title="averaging time [s]",
                    y_title=f"Allan deviation [{unit}]",
                    curves=curves,
                )
            )
    return figures


GUIDES = {"white": "white noise", "flicker": "bias instability", "walk": "rate random walk"}


def _parts_found(series: Mapping[str, np.ndarray], quantity: str) -> list[FigureCurve]:
    """Straight lines of the parts that the fit found, RMS of the axes that show them."""
    curves = []
    for part, name in GUIDES.items():
        lines = [series[key] for a in AXES if (key := f"{quantity}_{a}_{part}") in series]
        found = [line for line in lines if np.isfinite(line).all()]
        if found:
            rms = np.sqrt(np.mean(np.square(found), axis=0))
            curves.append(FigureCurve(name=name, x=shortened(series["tau_s"]), y=shortened(rms)))
    return curves
