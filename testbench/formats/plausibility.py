"""Whether the numbers can be what their units say.

Gravity at rest tells it, and rotation as the accelerometer sees it.

At rest an accelerometer reads 9.81 m/s^2, and nothing else: that tells g, mg and m/s^2 apart. While
a sensor turns, the specific force turns in its frame as da/dt = -omega x a, whatever the unit of a;
the slope of one against the other tells rad/s from deg/s. Between two rests the rates, integrated,
must turn gravity from where it was to where it is: that tells a gyroscope at half or twice its
scale, whatever the accelerations on the way.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.options import Options
from testbench.formats.units import Unit, find_unit, unit_names
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation
from testbench.records.session.samples import ImuSamples

REST_WINDOW_S = 0.5
REST_SPREAD = 0.03
"""A window counts as rest if no axis varies by more than this part of the norm (standard
deviation).
"""
STATED_WITHIN = 0.35
"""|acc| at rest may differ from gravity by so much where the unit is stated: sensors without
calibration are wrong by 10 %.
"""
UNSTATED_WITHIN = 0.2
TURN_BLOCK_S = 0.2
"""Long enough for vibration to average out, short enough for the chord to be the arc."""
SLOPE_WITHIN = 2.0
"""The slope may be wrong by this factor: scale errors, and linear acceleration, disturb it."""
LEAST_EXPLAINED = 0.5
"""Turning must explain this part of the changes of the specific force (R^2); linear acceleration
does the rest.
"""
ABSURD = 1e9
"""A number beyond this is no reading in any unit."""
MOST_CHUNKS = 20
FACTORS = (1.0, 2.0, 0.5)
"""Of the scale, as it is and at the wrong one of two neighbouring range settings."""
REST_RATE_SPREAD = 0.05
"""At rest no axis of a gyroscope varies by more than this (standard deviation) [rad/s]."""
LONGEST_TURN_S = 20.0
"""From rest to rest: over longer ones the error of a bias adds up."""
LEAST_TILT = np.radians(30)
"""By which a turn must tilt gravity to count."""
FEWEST_TURNS = 3
MISSED, HIT = np.radians(15), 1 / 3
"""A scale is asked about if turns miss gravity by so much, and another one misses it by this part
of that.
"""


@dataclass(frozen=True)
class Evidence:
    """What the numbers say of their units.

    Attributes:
        rest_norm: |acc| at rest in the unit of the numbers, None if never at rest.
        slope: Of da/dt against -omega x a, None where the sensor hardly turns; 1 if omega is in
            rad/s.
    """

    rest_norm: float | None
    slope: float | None


def gather(chunks: Iterable[ImuSamples], rate: float, most_chunks: int = MOST_CHUNKS) -> Evidence:
    """Look at samples until both questions are answered.

    Args:
        chunks: Samples in any units.
        rate: Samples a second [Hz].
        most_chunks: Give up after so many.
    """
    norms: list[np.ndarray] = []
    sums = np.zeros(4)
    slope: float | None = None
    for i, chunk in enumerate(map(_readable, chunks)):
        norms.append(_rest_norms(chunk.acc, rate))
        sums += _turning(chunk, rate)
        slope = _slope(sums)
        if i + 1 >= most_chunks or (slope is not None and any(len(n) for n in norms)):
            break
    rest = np.concatenate(norms) if norms else np.zeros(0)
    return Evidence(float(np.median(rest)) if len(rest) else None, slope)


def _readable(samples: ImuSamples) -> ImuSamples:
    """Samples whose infinite and absurd numbers are NaN: their squares are no numbers."""
    readings = {"acc": samples.acc, "gyr": samples.gyr}
    changed = {}
    for key, array in readings.items():
        absurd = ~(np.abs(array) < ABSURD)
        if absurd.any():
            changed[key] = np.where(absurd, np.nan, array)
    return replace(samples, **changed) if changed else samples


def _rest_norms(acc: np.ndarray, rate: float) -> np.ndarray:
    """|mean acc| of each window at rest."""
    size = max(round(REST_WINDOW_S * rate), 4)
    count = len(acc) // size
    windows = acc[: count * size].reshape(count, size, 3)
    windows = windows[np.isfinite(windows).all(axis=(1, 2))]
    norms = np.linalg.norm(windows.mean(axis=1), axis=1)
    return norms[(windows.std(axis=1).max(axis=1) <= REST_SPREAD * norms) & (norms > 0)]


def _turning(chunk: ImuSamples, rate: float) -> np.ndarray:
    """X x, x y, y y and the number of rows of a regression through the origin.

    In it y is the step of acc and x is -omega x acc dt.
    """
    size = max(round(TURN_BLOCK_S * rate), 1)
    count = len(chunk) // size
    if count < 3:
        return np.zeros(4)
    acc = chunk.acc[: count * size].reshape(count, size, 3).mean(axis=1)
    gyr = chunk.gyr[: count * size].reshape(count, size, 3).mean(axis=1)
    y = np.diff(acc, axis=0)
    middle = (acc[1:] + acc[:-1]) / 2
    x = -np.cross((gyr[1:] + gyr[:-1]) / 2, middle) * (size / rate)
    # shocks say nothing of turning
    calm = np.linalg.norm(y, axis=1) < 0.5 * np.linalg.norm(middle, axis=1)
    known = calm & np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
    x, y = x[known], y[known]
    return np.array([np.sum(x * x), np.sum(x * y), np.sum(y * y), 3 * len(x)])


def missed_by_factor(samples: ImuSamples, rate: float) -> tuple[np.ndarray, int]:
    """How far rotations between rests miss the direction of gravity after them.

    The gyroscope is taken so many times.

    Args:
        samples: In the units of a session.
        rate: Samples a second [Hz].

    Returns:
        Median angle by each of `FACTORS`, shape (3,) [rad], and the number of rotations that tilt
        gravity enough to tell.
    """
    samples = _readable(samples)
    size = max(round(REST_WINDOW_S * rate), 4)
    count = len(samples) // size
    acc, gyr = (a[: count * size].reshape(count, size, 3) for a in (samples.acc, samples.gyr))
    if count < 2 or not np.isfinite(gyr).any():
        return np.full(len(FACTORS), np.nan), 0
    mean = acc.mean(axis=1)
    norm = np.linalg.norm(mean, axis=1)
    still = (
        (acc.std(axis=1).max(axis=1) <= REST_SPREAD * norm)
        & (gyr.std(axis=1).max(axis=1) <= REST_RATE_SPREAD)
        & (norm > 0)
    )
    rests = np.flatnonzero(still)
    missed = []
    for before, after in itertools.pairwise(rests):
        if after == before + 1 or (after - before) * size > LONGEST_TURN_S * rate:
            continue
        up, wanted = mean[before] / norm[before], mean[after] / norm[after]
        turn = (
            samples.gyr[before * size : (after + 1) * size]
            - (gyr[before].mean(axis=0) + gyr[after].mean(axis=0)) / 2
        )
        if np.arccos(np.clip(up @ wanted, -1, 1)) < LEAST_TILT or not np.isfinite(turn).all():
            continue
        ends = [
            rotation.rotate(rotation.conjugate(_whole(turn * (factor / rate))), up)
            for factor in FACTORS
        ]
        missed.append([np.arccos(np.clip(end @ wanted, -1, 1)) for end in ends])
    return (
        (np.median(missed, axis=0), len(missed)) if missed else (np.full(len(FACTORS), np.nan), 0)
    )


def _whole(steps: np.ndarray) -> np.ndarray:
    """The rotation that rotation vectors one after another come to, shape (n, 3) [rad] to (4,)."""
    q = rotation.from_rotation_vector(steps)
    while len(q) > 1:
        even = rotation.multiply(q[: len(q) // 2 * 2 : 2], q[1::2])
        q = np.concatenate([even, q[-1:]]) if len(q) % 2 else even
    return np.asarray(q[0])


def _slope(sums: np.ndarray) -> float | None:
    xx, xy, yy, count = sums
    if xx <= 0 or yy <= 0 or count < 45 or xy * xy < LEAST_EXPLAINED * xx * yy:
        return None
    return float(xy / xx)


def units_that_fit(quantity: str, evidence: Evidence) -> list[Unit]:
    """The units in which the numbers make sense; none where nothing can be told."""
    units = [find_unit(quantity, name) for name in unit_names(quantity)]
    if quantity == "acc":
        norm = evidence.rest_norm
        return (
            []
            if norm is None
            else [u for u in units if abs(norm * u.factor / STANDARD_GRAVITY - 1) < UNSTATED_WITHIN]
        )
    slope = evidence.slope
    return (
        []
        if slope is None or slope <= 0
        else [u for u in units if 1 / SLOPE_WITHIN < slope / u.factor < SLOPE_WITHIN]
    )


def decide_unit(quantity: str, evidence: Evidence, sensor: str, answer: str) -> Unit:
    """The unit of numbers whose file states none.

    Args:
        quantity: "acc" or "gyr".
        evidence: Of the numbers as they are.
        sensor: Its name.
        answer: How a person states the unit.

    Raises:
        InputError: It cannot be told; asks the person, and says how to answer.
    """
    fitting = units_that_fit(quantity, evidence)
    if len(fitting) == 1:
        return fitting[0]
    word = "accelerometer" if quantity == "acc" else "gyroscope"
    if quantity == "acc":
        seen = (
            "it is never at rest"
            if evidence.rest_norm is None
            else f"|acc| at rest is {evidence.rest_norm:.4g}, which is no gravity"
        )
    elif evidence.slope is None:
        seen = "it hardly turns, so that the accelerometer cannot tell"
    else:
        seen = (
            f"a turn by the accelerometer is {evidence.slope:.3g} times that by the gyroscope, "
            "which fits no unit"
        )
    choices = ", ".join(unit_names(quantity))
    raise InputError(
        f"sensor '{sensor}': in which unit is the {word}? The file does not say, and {seen}. "
        f"Answer with {answer} ({choices})."
    )


def check_units(samples: ImuSamples, rate: float, sensor: str, options: Options) -> list[str]:
    """Refuse samples that cannot be in the units they were taken for.

    Args:
        samples: In the units of a session.
        rate: [Hz].
        sensor: Its name.
        options: Which units the person answered for.

    Returns:
        Notes on what could not be checked.

    Raises:
        InputError: Asks which unit it is, and says how to answer.
    """
    notes = []
    evidence = gather([samples], rate)
    if not options.answered("acc") and np.isfinite(samples.acc).any():
        if evidence.rest_norm is None:
            early = f"in its first {len(samples)} samples"
            notes.append(
                f"sensor '{sensor}' is not at rest {early}: the unit of its accelerometer is "
                "unchecked"
            )
        elif abs(evidence.rest_norm / STANDARD_GRAVITY - 1) > STATED_WITHIN:
            raise InputError(_acc_question(sensor, evidence))
    slope = evidence.slope
    if not options.answered("gyr") and slope is not None and slope > 0:
        fitting = [unit.name for unit in units_that_fit("gyr", evidence)]
        if (fitting and "rad/s" not in fitting) or slope > 180 / np.pi / SLOPE_WITHIN:
            wrong = "deg/s taken for rad/s" if slope < 1 else "rad/s taken for deg/s"
            told = (
                f"sensor '{sensor}': the accelerometer turns {slope:.3g} times as far as the "
                "gyroscope says"
            )
            raise InputError(f"{told}; it looks like {wrong}. {_answer('gyr')}")
    if not options.answered("gyr"):
        _check_scale(samples, rate, sensor)
    return notes


def _check_scale(samples: ImuSamples, rate: float, sensor: str) -> None:
    """Refuse a gyroscope at half or twice its scale."""
    missed, turns = missed_by_factor(samples, rate)
    best = int(np.argmin(missed)) if turns >= FEWEST_TURNS else 0
    if best == 0 or missed[0] < MISSED or missed[best] > HIT * missed[0]:
        return
    as_is, other = np.degrees(missed[[0, best]])
    raise InputError(
        f"sensor '{sensor}': its gyroscope's turns from rest to rest miss the direction of gravity "
        f"after them by {as_is:.0f} deg (median of {turns}), and by {other:.0f} deg if it turned "
        f"{FACTORS[best]:g} times as far as it says: it looks like the scale of another range "
        f"setting. Correct the scale in the file or the mapping (scale: {FACTORS[best]:g}), or: "
        f"{_answer('gyr')}"
    )


def _acc_question(sensor: str, evidence: Evidence) -> str:
    others = [unit.name for unit in units_that_fit("acc", evidence) if unit.name != "m/s^2"]
    norm = evidence.rest_norm or 0.0
    hint = ""
    if others:
        hint = f" It looks like {others[0]} taken for m/s^2."
    elif norm < 0.1 * STANDARD_GRAVITY:
        hint = (
            " Gravity seems to have been removed; the bench needs the specific force, with gravity."
        )
    return (
        f"sensor '{sensor}': |acc| at rest is {norm:.4g} m/s^2, where gravity is 9.81.{hint} "
        f"{_answer('acc')}"
    )


def _answer(quantity: str) -> str:
    choices = ", ".join(unit_names(quantity))
    return (
        f"In which unit is it? Answer with --unit {quantity}=UNIT ({choices}); the unit it was "
        "read in confirms it as it is."
    )
