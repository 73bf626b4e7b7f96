"""Noise at rest: what a sensor reads when nothing happens, in the words of its data sheet."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

import numpy as np

from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model.allan import (
    FLICKER,
    AllanCurve,
    Coefficient,
    NoiseCoefficients,
    allan_deviation,
    fit_noise,
)
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.evaluation import NoiseRow
from testbench.records.session.samples import ACC, AXES, GYR, MAG
from testbench.records.session.session import Session

SHORTEST_S = 10.0
"""Rests shorter than this say little of noise [s]."""
LONGEST_GAP_NS, LONGEST_GAP = 100_000_000, 2.5
"""An interval is a gap beyond this, and beyond so many usual intervals: at 5 Hz all are 0.2 s."""
_G, _DEG = STANDARD_GRAVITY, np.pi / 180

UNITS: dict[str, tuple[str, float, str, float, str, float, str, float]] = {
    # mean and sd, white noise, bias instability, rate random walk: unit and its size in SI
    "acc": ("mg", 1e-3 * _G, "ug/sqrt(Hz)", 1e-6 * _G, "mg", 1e-3 * _G, "mg/sqrt(s)", 1e-3 * _G),
    "gyr": (
        "deg/s",
        _DEG,
        "deg/s/sqrt(Hz)",
        _DEG,
        "deg/h",
        _DEG / 3600,
        "deg/h/sqrt(s)",
        _DEG / 3600,
    ),
    "mag": ("uT", 1.0, "uT/sqrt(Hz)", 1.0, "uT", 1.0, "uT/sqrt(s)", 1.0),
}
RANDOM_WALK = {"acc": ("m/s/sqrt(h)", 60.0), "gyr": ("deg/sqrt(h)", 60.0 / _DEG), "mag": ("", 0.0)}
"""Unit of the random walk that white noise integrates to, and its size per SI unit."""
_NOTHING = Coefficient(0.0, 0.0)
SILENT = NoiseCoefficients(_NOTHING, _NOTHING, _NOTHING)
"""Of an axis whose reading never changes."""


def longest_rest(time_ns: np.ndarray, still: np.ndarray) -> slice | None:
    """The longest run of samples at rest without a gap.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        still: Where the sensor is at rest, shape (n,), bool.

    Returns:
        None where it is shorter than `SHORTEST_S`.
    """
    rest = _longest_run(time_ns, still)
    return rest if rest is not None and _span_s(time_ns, rest) >= SHORTEST_S else None


def longest_rest_s(estimate: SensorEstimate) -> float:
    """How long a sensor rested without a gap, at the longest [s]; also where that is too short."""
    rest = _longest_run(estimate.host_time_ns, estimate.static & ~estimate.flagged)
    return 0.0 if rest is None else _span_s(estimate.host_time_ns, rest)


def _span_s(time_ns: np.ndarray, rest: slice) -> float:
    return float(time_ns[rest.stop - 1] - time_ns[rest.start]) / NANOSECONDS


def _longest_run(time_ns: np.ndarray, still: np.ndarray) -> slice | None:
    """The longest run of at least three samples at rest without a gap."""
    return max(runs_at_rest(time_ns, still), key=lambda run: run.stop - run.start, default=None)


def runs_at_rest(time_ns: np.ndarray, still: np.ndarray) -> list[slice]:
    """Runs of at least three samples at rest without a gap, in their order.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        still: Where the sensor is at rest, shape (n,), bool.
    """
    steps = np.diff(time_ns)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = steps > max(LONGEST_GAP_NS, LONGEST_GAP * usual)
    broken = np.concatenate([[True], ~still[1:] | ~still[:-1] | gaps, [True]])
    edges = np.flatnonzero(broken)
    long = np.flatnonzero(np.diff(edges) >= 3)
    return [slice(int(edges[i]), int(edges[i + 1])) for i in long]


@dataclass(frozen=True)
class LongRest:
    """Every reading over a rest, one column at a time: a night at 1 kHz has 0.2 GB an axis.

    Attributes:
        count: Samples.
        span: From the first to the last [s].
        columns: Names of those there are.
        read: Gives a column, (count,).
    """

    count: int
    span: float
    columns: Collection[str]
    read: Callable[[str], np.ndarray]

    @staticmethod
    def longest(session: Session, name: str, estimate: SensorEstimate) -> LongRest | None:
        """The longest rest of a sensor, or None where it is shorter than `SHORTEST_S`."""
        rows = longest_rest(estimate.host_time_ns, estimate.static & ~estimate.flagged)
        if rows is None:
            return None
        begin, end = (
            rows.start * estimate.every,
            rows.stop * estimate.every,
        )  # each row stands for so many samples
        interval = (
            float(estimate.host_time_ns[rows.stop - 1] - estimate.host_time_ns[rows.start])
            / NANOSECONDS
        )
        interval /= (rows.stop - rows.start - 1) * estimate.every
        columns = session.imu_columns(name)
        return LongRest(
            end - begin,
            interval * (end - begin - 1),
            columns,
            lambda key: session.imu_column(name, key, begin, end),
        )

    def varies(self, columns: Iterable[str]) -> bool:
        """Whether all of these are known throughout, and not all the same."""
        lowest, highest = np.inf, -np.inf
        for column in columns:
            signal = self.read(column) if column in self.columns else np.full(1, np.nan)
            if not np.isfinite(signal).all():
                return False
            lowest, highest = min(lowest, float(signal.min())), max(highest, float(signal.max()))
        return highest > lowest


@dataclass(frozen=True)
class NoiseFound:
    """The noise of a sensor over a rest.

    Attributes:
        rows: Mean, standard deviation and Allan coefficients of each axis.
        curves: Averaging times, and of each axis that is not silent its Allan deviation with the
            ends of its 68.3 % interval, and the straight lines of the parts that the fit found, NaN
            where it found none: in the unit of the bias instability, shape (k,) each.
    """

    rows: list[NoiseRow] = field(default_factory=list)
    curves: dict[str, np.ndarray] = field(default_factory=dict)


def noise_of(sensor: str, rest: LongRest | None) -> NoiseFound:
    """What a sensor reads over a rest; nothing without one."""
    found = NoiseFound()
    if rest is None:
        return found
    rate = (rest.count - 1) / rest.span
    for quantity, columns in (("acc", ACC), ("gyr", GYR), ("mag", MAG)):
        if not rest.varies(columns):
            continue
        for axis, column in zip(AXES, columns, strict=True):
            signal, coefficients = rest.read(column), SILENT
            if signal.min() < signal.max():
                curve = allan_deviation(signal, rate)
                coefficients = fit_noise(curve)
                found.curves.update(_columns(f"{quantity}_{axis}", curve, coefficients))
            found.rows.append(_row(sensor, f"{quantity}_{axis}", rest.span, signal, coefficients))
    return found


def _row(
    sensor: str, name: str, span: float, signal: np.ndarray, coefficients: NoiseCoefficients
) -> NoiseRow:
    """What the readings of an axis, `gyr_x`, come to, in the units of data sheets."""
    quantity, _, axis = name.partition("_")
    unit, size, white_unit, white_size, bias_unit, bias_size, walk_unit, walk_size = UNITS[quantity]
    walk_name, walk_factor = RANDOM_WALK[quantity]
    walks = coefficients.white.found and walk_factor
    return NoiseRow(
        sensor,
        quantity,
        axis,
        len(signal),
        span,
        float(signal.mean() / size),
        float(signal.std(ddof=1) / size),
        unit,
        *_found(coefficients.white, white_size / np.sqrt(2)),  # one-sided
        white_unit,
        coefficients.white.value * walk_factor if walks else None,
        walk_name,
        *_found(coefficients.bias_instability, bias_size),
        bias_unit,
        *_found(coefficients.rate_random_walk, walk_size),
        walk_unit,
        coefficients.bandwidth_hz,
    )


def _columns(name: str, curve: AllanCurve, fit: NoiseCoefficients) -> dict[str, np.ndarray]:
    """An Allan curve of an axis, `gyr_x`, and the parts of its fit, as columns (IEEE Std 952-1997,
    annex C).
    """
    tau, size = curve.tau, UNITS[name.partition("_")[0]][5]
    lines = {
        "white": (fit.white, 1 / np.sqrt(tau)),
        "flicker": (fit.bias_instability, np.full(len(tau), np.sqrt(FLICKER))),
        "walk": (fit.rate_random_walk, np.sqrt(tau / 3)),
    }
    columns = {"": curve.deviation, "_lower": curve.lower, "_upper": curve.upper}
    columns |= {
        f"_{part}": (own.value if own.found else np.nan) * line
        for part, (own, line) in lines.items()
    }
    return {"tau_s": tau} | {name + end: values / size for end, values in columns.items()}


def norm_error_percent(rest: LongRest | None) -> float | None:
    """Error of the mean norm of the specific force at rest against standard gravity [%].

    None without a rest.
    """
    if rest is None:
        return None
    mean = np.array([rest.read(column).mean() for column in ACC])
    if not np.isfinite(mean).all():
        return None
    return float(100 * (np.linalg.norm(mean) / STANDARD_GRAVITY - 1))


def _found(coefficient: Coefficient, size: float) -> tuple[float | None, float | None]:
    """Value and standard uncertainty in the data sheet's unit.

    None where it is lost among the others.
    """
    return (coefficient.value / size, coefficient.sd / size) if coefficient.found else (None, None)
