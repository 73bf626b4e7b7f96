"""Why a filter fails the self-test: each usual mistake is undone in turn, until it passes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from testbench.estimation.filters.base import OrientationFilter, UniformSamples
from testbench.estimation.filters.known_motions import (
    BIAS_RAD_S,
    BIASED,
    TURN_LIMIT_DEG,
    TURN_S,
    Check,
    error_deg,
    judge,
    pose,
    recording,
    recordings,
)
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.earths import Q_ENU_FROM

FIXED_S = (0.01, 0.02, 0.005, 1 / 60, 1.0)
"""Intervals that are most likely to be taken for every interval [s]."""
MOST_LATE = 12
TRIADS = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}


@dataclass(frozen=True)
class Mistake:
    """A mistake in words, and what undoes it before and after the filter."""

    words: str
    before: Callable[[UniformSamples], UniformSamples] = lambda samples: samples
    after: Callable[[np.ndarray], np.ndarray] = lambda q: q


def _scaled(quantity: str, factor: float) -> Callable[[UniformSamples], UniformSamples]:
    return lambda samples: replace(samples, **{quantity: factor * getattr(samples, quantity)})


def _mapped(
    quantities: tuple[str, ...], matrix: np.ndarray
) -> Callable[[UniformSamples], UniformSamples]:
    return lambda samples: replace(
        samples, **{key: getattr(samples, key) @ matrix.T for key in quantities}
    )


def _left(q: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda given: rotation.multiply(q, given)


def _single() -> Iterator[Mistake]:
    yield Mistake(
        "rates look like they were taken as deg/s: they come in rad/s", _scaled("gyr", 180 / np.pi)
    )
    yield Mistake(
        "rates look like they were turned into deg/s and then used as rad/s",
        _scaled("gyr", np.pi / 180),
    )
    yield Mistake(
        "it turns against the gyroscope: the sign of the rates is reversed", _scaled("gyr", -1.0)
    )
    yield Mistake(
        "it takes the accelerometer for gravity (at rest it reads upwards), or its earth has z "
        "down",
        _scaled("acc", -1.0),
    )
    yield Mistake(
        "it takes the accelerometer in g: it comes in m/s^2", _scaled("acc", 1 / STANDARD_GRAVITY)
    )
    yield Mistake("the sign of the magnetometer is reversed", _scaled("mag", -1.0))
    yield Mistake(
        "its quaternion is conjugated: it is q_sensor_from_earth, not q_earth_from_sensor",
        after=rotation.conjugate,
    )
    yield Mistake("its quaternion is in the order x, y, z, w: it must be w, x, y, z", after=_rolled)
    for name, words in (("NED", "north, east, down"), ("NWU", "north, west, up")):
        q = np.array(Q_ENU_FROM[name])
        yield Mistake(
            f"its earth frame is {name} ({words}): it must be ENU (east, north, up)", after=_left(q)
        )


def _timing() -> Iterator[Mistake]:
    """Every interval taken for the same, or an output that comes late."""
    words = (
        "it takes every interval for the mean one: where `intervals` are given, each sample "
        "has its own"
    )
    yield Mistake(
        words,
        lambda samples: replace(
            samples, gyr=samples.gyr * (samples.steps() / samples.interval)[:, None]
        ),
    )
    for interval in FIXED_S:
        yield Mistake(
            f"it takes every interval for {1000 * interval:.3g} ms: it comes with the samples",
            lambda samples, interval=interval: replace(
                samples, gyr=samples.gyr * (samples.steps() / interval)[:, None]
            ),  # type: ignore[misc]
        )
    for late in range(1, MOST_LATE + 1):
        words = f"its output comes {late} sample{'s' if late > 1 else ''} late"
        yield Mistake(
            words,
            partial(_followed, count=late),
            partial(_without_first, count=late),
        )


def _without_first(q: np.ndarray, count: int) -> np.ndarray:
    """All but the first samples, shape (n - count, 4)."""
    return q[count:]


def _followed(samples: UniformSamples, count: int) -> UniformSamples:
    """The samples, and the last of them some times more, for a filter that is behind."""
    more: dict[str, Any] = {
        key: np.concatenate([array, np.repeat(array[-1:], count, axis=0)])
        for key in ("gyr", "acc", "mag", "device_q", "intervals")
        if (array := getattr(samples, key)) is not None
    }
    return replace(samples, **more)


def _double() -> Iterator[Mistake]:
    yield Mistake(
        "its quaternion is in the order x, y, z, w, and conjugated",
        after=lambda q: rotation.conjugate(_rolled(q)),
    )
    for name in ("NED", "NWU"):
        left = _left(np.array(Q_ENU_FROM[name]))
        yield Mistake(
            f"its earth frame is {name} and its quaternion conjugated",
            after=lambda q, left=left: left(rotation.conjugate(q)),  # type: ignore[misc]
        )


def _rolled(q: np.ndarray) -> np.ndarray:
    return np.roll(q, 1, axis=-1)


def _axes(needs: tuple[str, ...]) -> Iterator[Mistake]:
    """Every way to permute and reverse the axes of one triad, or of the whole sensor."""
    triads = tuple(key for key in TRIADS if key in needs)
    together = [(triads, "of the sensor")] if triads else []
    for quantities, what in [*(((key,), f"of the {TRIADS[key]}") for key in triads), *together]:
        for matrix, words in _signed_permutations():
            yield Mistake(f"{words} {what}", _mapped(quantities, matrix))


def _signed_permutations() -> list[tuple[np.ndarray, str]]:
    """All 47 besides the identity, with what they do in words; the simplest first."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product([1, -1], repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            reversed_axes = ["xyz"[i] for i in range(3) if signs[i] < 0]
            moved = ["xyz"[i] for i in range(3) if order[i] != i]
            parts = []
            if len(moved) == 2:
                parts.append(f"axes {moved[0]} and {moved[1]} are swapped")
            elif moved:
                parts.append(f"axes are taken as {', '.join('xyz'[k] for k in order)}")
            if len(reversed_axes) == 1:
                parts.append(f"axis {reversed_axes[0]} has the wrong sign")
            elif reversed_axes:
                parts.append(f"axes {' and '.join(reversed_axes)} have the wrong sign")
            if parts:
                found.append((len(moved) + len(reversed_axes), matrix, " and ".join(parts)))
    return [(matrix, words) for _, matrix, words in sorted(found, key=lambda entry: entry[0])]


def diagnose(kind: OrientationFilter, checks: list[Check]) -> str:
    """The mistake whose undoing lets a failing filter pass, in words; else what it fails at."""
    needs = kind.needs
    groups = recordings(needs)
    failed = [check for check in checks if not check.passed]
    if [check.name for check in failed] == [BIASED]:
        return _of_bias(failed[0])
    screen = [
        recording("tilted", pose(60, -35, 25), np.array([0.6, -0.48, 0.64])),
        recording("elsewhere", pose(-100, 20, -140), np.array([-0.64, 0.6, 0.48])),
        *(
            case
            for check in failed
            for case in groups[check.name]
            if check.name != BIASED and case.name == check.where
        ),
    ]
    if "device_q" not in needs:
        screen = [replace(case, samples=replace(case.samples, device_q=None)) for case in screen]
    for mistake in itertools.chain(_timing(), _single(), _axes(needs), _double()):
        run = _undone(kind, mistake)
        if all(
            error_deg(case, run(case.samples), needs) < TURN_LIMIT_DEG for case in screen
        ) and all(check.passed for check in judge(run, needs, groups)):
            return mistake.words
    if {check.name for check in failed} <= {
        "rest in 24 poses",
        "start in any pose",
        "known heading",
    }:
        return (
            "it does not find its start within 6 s: it should take it from the first sample, "
            "and from any pose"
        )
    return (
        f"it is {failed[0].worst_deg:.1f} deg off at '{failed[0].name}', {failed[0].where}; "
        "the cause cannot be told"
    )


def _of_bias(check: Check) -> str:
    """The gyroscope alone is off by what its bias amounts to, and twice that says that it was added
    once more.
    """
    alone = float(np.degrees(BIAS_RAD_S)) * TURN_S
    off = (
        f"{check.worst_deg:.1f} deg off after {TURN_S:g} s with a bias of 1 deg/s, the "
        f"gyroscope alone {alone:.1f} deg"
    )
    if check.worst_deg is not None and 1.5 * alone < check.worst_deg < 2.5 * alone:
        return f"it adds the bias of the gyroscope instead of taking it away: it is {off}"
    return f"it makes more of the bias of the gyroscope than there is: it is {off}"


def _undone(kind: OrientationFilter, mistake: Mistake) -> Callable[[UniformSamples], np.ndarray]:
    return lambda samples: mistake.after(kind.run(mistake.before(samples)))
