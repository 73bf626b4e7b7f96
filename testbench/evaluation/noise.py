"""Noise at rest: what a sensor reads when nothing happens, in the words of its data sheet."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model.allan import Coefficient, allan_deviation, fit_noise
from testbench.records.evaluation import NoiseRow
from testbench.records.samples import AXES, ImuSamples

SHORTEST_S = 10.0
"""Rests shorter than this say little of noise [s]."""
LONGEST_GAP_NS = 100_000_000
_G, _DEG = STANDARD_GRAVITY, np.pi / 180

UNITS: dict[str, tuple[str, float, str, float, str, float, str, float]] = {
    # mean and sd, white noise, bias instability, rate random walk: unit and its size in SI
    "acc": ("mg", 1e-3 * _G, "ug/sqrt(Hz)", 1e-6 * _G, "mg", 1e-3 * _G, "mg/sqrt(s)", 1e-3 * _G),
    "gyr": ("deg/s", _DEG, "deg/s/sqrt(Hz)", _DEG, "deg/h", _DEG / 3600, "deg/h/sqrt(s)", _DEG / 3600),
    "mag": ("uT", 1.0, "uT/sqrt(Hz)", 1.0, "uT", 1.0, "uT/sqrt(s)", 1.0),
}
RANDOM_WALK = {"acc": ("m/s/sqrt(h)", 60.0), "gyr": ("deg/sqrt(h)", 60.0 / _DEG), "mag": ("", 0.0)}
"""Unit of the random walk that white noise integrates to, and its size per SI unit."""


def longest_rest(time_ns: np.ndarray, still: np.ndarray) -> slice | None:
    """The longest run of samples at rest without a gap, or None where it is shorter than `SHORTEST_S`."""
    broken = np.concatenate([[True], ~still[1:] | ~still[:-1] | (np.diff(time_ns) > LONGEST_GAP_NS), [True]])
    edges = np.flatnonzero(broken)
    if len(edges) < 2:
        return None
    longest = int(np.argmax(np.diff(edges)))
    rest = slice(int(edges[longest]), int(edges[longest + 1]))
    if rest.stop - rest.start < 3 or (time_ns[rest.stop - 1] - time_ns[rest.start]) < SHORTEST_S * NANOSECONDS:
        return None
    return rest


def noise_rows(sensor: str, samples: ImuSamples, time_ns: np.ndarray, still: np.ndarray) -> list[NoiseRow]:
    """Mean, standard deviation and Allan coefficients of each axis over the longest rest.

    Args:
        sensor: Its name. samples: Raw. time_ns: Host times, shape (n,). still: At rest and not flagged, shape (n,).
    """
    rest = longest_rest(time_ns, still)
    if rest is None:
        return []
    span = (time_ns[rest.stop - 1] - time_ns[rest.start]) / NANOSECONDS
    count = rest.stop - rest.start
    rate = (count - 1) / span
    rows = []
    for quantity, array in (("acc", samples.acc), ("gyr", samples.gyr), ("mag", samples.mag)):
        if array is None or not np.isfinite(array[rest]).all() or array[rest].std() == 0:
            continue
        unit, size, white_unit, white_size, bias_unit, bias_size, walk_unit, walk_size = UNITS[quantity]
        for i, axis in enumerate(AXES):
            signal = array[rest, i]
            coefficients = fit_noise(allan_deviation(signal, rate))
            density = _found(coefficients.white, white_size / np.sqrt(2))  # one-sided
            walk_name, walk_factor = RANDOM_WALK[quantity]
            random_walk = coefficients.white.value * walk_factor if coefficients.white.found and walk_factor else None
            bias, walk = _found(coefficients.bias_instability, bias_size), _found(coefficients.rate_random_walk, walk_size)
            rows.append(
                NoiseRow(
                    sensor, quantity, axis, count, span, float(signal.mean() / size), float(signal.std(ddof=1) / size), unit,
                    *density, white_unit, random_walk, walk_name, *bias, bias_unit, *walk, walk_unit,
                )
            )  # fmt: skip
    return rows


def norm_error_percent(samples: ImuSamples, time_ns: np.ndarray, still: np.ndarray) -> float | None:
    """Error of the mean norm of the specific force at rest against standard gravity [%]; None without a rest."""
    rest = longest_rest(time_ns, still)
    if rest is None or not np.isfinite(samples.acc[rest]).all():
        return None
    return float(100 * (np.linalg.norm(samples.acc[rest].mean(axis=0)) / STANDARD_GRAVITY - 1))


def _found(coefficient: Coefficient, size: float) -> tuple[float | None, float | None]:
    """Value and standard uncertainty in the data sheet's unit; None where it is lost among the others."""
    return (coefficient.value / size, coefficient.sd / size) if coefficient.found else (None, None)
