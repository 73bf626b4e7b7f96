"""How well a reading of the gyroscope fits what another triad saw: axes, signs, scale."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from testbench.consistency.angular_rate import (
    BINS,
    IDENTITY,
    MAPS,
    Windows,
    find_windows,
    read_as,
    sums,
)
from testbench.consistency.excerpt import Excerpt
from testbench.consistency.factors import DEG, LIKE, NEAR, best_factors
from testbench.consistency.strides import find_strides

FLOOR = 0.03
"""Scatter that says nothing, of the size of the vector: what biases and scale errors leave."""
SHORTEST = 0.05
"""No mean vector counts as shorter than this part of the usual one."""
LEAST_RATIO = 0.15
"""A reading fits better if it leaves by so much less (mean logarithm of the squares), ..."""
LEAST_SUM = 2.5
"""... in so many windows that this comes to so much, ..."""
LEAST_T = 1.0
"""... and not by one of them alone: mean over its standard error."""
LEAST_WINDOWS = 4
LEAST_EXPLAINED = 0.3
"""Part of the scatter beyond `FLOOR` that a turn must explain to be believed: where accelerations
last as long as the windows do, as of a pendulum, some reading always fits a little better.
"""
WELL_EXPLAINED = 0.8
"""Whose part is so large fits as it is: one that turned k times what it reads would be explained by
1 - (1 - 1/k)^2 of small turns, 0.75 if k is 2 and less beyond, or if it is below 0.69.
"""
LEAST_SCALE_RATIO = 0.4
"""Another scale fits better if it leaves by so much less (mean logarithm of the squares)."""
ONE_AXIS = 0.01
"""Turning about one axis: across it is less than this part of the rates' variance."""
PRIOR_BIAS = np.radians(10.0)
"""What a fitted bias may be, about what it is at rest [rad/s]."""
SAME_SLOPES = np.radians(3.0)
"""Slopes by a bias are kept where it changes by no more turn over a window than this [rad]."""
BIAS_WITHIN, REST_WITHIN = np.radians(30.0), np.radians(3.0)
"""A fitted bias may be so large, or differ by so much from what is read at rest, for slow turning
passes for rest [rad/s].
"""


@dataclass(frozen=True)
class Scatter:
    """Logarithms of the scatter of a vector in a frame that should not turn.

    Attributes:
        logs: By reading and window, shape (r, w).
        length: Of the mean vector by reading and window, shape (r, w).
        independent: How many windows that do not overlap would say as much.
    """

    logs: np.ndarray
    length: np.ndarray
    independent: float

    def better(self, of: int, over: int) -> bool:
        """Whether one reading fits clearly better than another."""
        return is_clear(self.logs[over], self.logs[of], self.independent)

    @property
    def best(self) -> int:
        """The reading that fits best."""
        return int(np.argmin(self.logs.mean(axis=1)))

    @property
    def rivals(self) -> list[int]:
        """Readings that fit no worse than the best to speak of, the best first."""
        order = np.argsort(self.logs.mean(axis=1))
        best = int(order[0])
        return [best] + [int(i) for i in order[1:] if not self.better(best, int(i))]


def is_clear(worse: np.ndarray, better: np.ndarray, independent: float) -> bool:
    """Whether a fit leaves clearly less than another, window by window.

    Args:
        worse: Logarithms of the scatter, shape (w,).
        better: Likewise of the other, shape (w,).
        independent: How many windows that do not overlap would say as much.
    """
    beyond = worse - better
    mean = float(beyond.mean())
    error = float(beyond.std()) / np.sqrt(independent)
    return mean >= LEAST_RATIO and mean * independent >= LEAST_SUM and mean >= LEAST_T * error


@dataclass(frozen=True)
class Pair:
    """A gyroscope and another triad in windows of a recording.

    Attributes:
        gyr: Rates, shape (n, 3) [rad/s].
        vectors: Of the other triad, shape (n, 3).
        windows: To compare them in.
        usual: Usual length of the vector.
    """

    gyr: np.ndarray
    vectors: np.ndarray
    windows: Windows
    usual: float

    @staticmethod
    def of(excerpt: Excerpt, vectors: np.ndarray, seconds: float) -> Pair | None:
        """From an excerpt; None where there are too few windows to say anything.

        Args:
            excerpt: Of the recording.
            vectors: Of the accelerometer or magnetometer, shape (n, 3).
            seconds: Of a step.
        """
        return next(iter(Pair.all_of(excerpt, vectors, seconds)), None)

    @staticmethod
    def all_of(excerpt: Excerpt, vectors: np.ndarray, seconds: float) -> list[Pair]:
        """Likewise in each kind of windows, those in which the maps are furthest apart first.

        Args:
            excerpt: Of the recording.
            vectors: Of the accelerometer or magnetometer, shape (n, 3).
            seconds: Of a step.
        """
        choices = [find_windows(excerpt, vectors, seconds, bins) for bins in BINS]
        if vectors is excerpt.acc:
            choices.append(find_strides(excerpt, seconds))
        found = [Pair._within(excerpt, vectors, windows) for windows in choices]
        pairs = [pair for pair in found if pair is not None]
        if not pairs:
            short = Pair._within(excerpt, vectors, find_windows(excerpt, vectors, seconds, 1))
            return [] if short is None else [short]
        return sorted(pairs, key=Pair.contrast, reverse=True) if len(pairs) > 1 else pairs

    @staticmethod
    def _within(excerpt: Excerpt, vectors: np.ndarray, windows: Windows) -> Pair | None:
        """In some windows; None if there are too few."""
        if len(windows) < LEAST_WINDOWS:
            return None
        length = np.linalg.norm(vectors[windows.covered(len(vectors))], axis=1)
        usual = float(np.median(length))
        return Pair(excerpt.gyr, vectors, windows, usual) if usual > 0 else None

    def contrast(self) -> float:
        """How far apart the fits of the maps are."""
        some = self.few.scatter()
        apart = float(some.logs.mean() - some.logs.mean(axis=1).min())
        return apart * float(np.sqrt(self.windows.independent))

    def blocks(
        self, scale: float = 1.0, bias: np.ndarray | None = None, maps: np.ndarray = MAPS
    ) -> np.ndarray:
        """Mean vectors in a frame that does not turn, shape (r, w, b, 3).

        Args:
            scale: Rates are taken so many times.
            bias: Taken off the rates first, shape (3,) [rad/s].
            maps: True rates are each of these times the rates read, shape (r, 3, 3).
        """
        proper = np.linalg.det(maps) > 0
        read = self.gyr, self.vectors, self.windows
        plain = sums(*read, scale, bias) if proper.any() else None
        other = sums(*read, -scale, bias) if (~proper).any() else None
        one = plain if plain is not None else other
        assert one is not None
        return read_as(one, other if other is not None else one, maps)

    def some(self, most: int) -> Pair:
        """The same in fewer windows."""
        return replace(self, windows=self.windows.some(most))

    @cached_property
    def few(self) -> Pair:
        """The same in `FEW_WINDOWS`."""
        return self.some(FEW_WINDOWS)

    def turning(self, bias: np.ndarray) -> np.ndarray:
        """Angle that the gyroscope goes through in each window, shape (w,) [rad].

        Args:
            bias: Taken off the rates first, shape (3,) [rad/s].
        """
        rates = np.nan_to_num(np.linalg.norm(self.gyr - bias, axis=1))
        angle = np.concatenate([[0.0], np.cumsum(rates)]) * self.windows.seconds
        return np.asarray(angle[self.windows.ends[:, -1]] - angle[self.windows.begins[:, 0]])

    @property
    def about_one_axis(self) -> bool:
        """Whether all turning is about one axis of the sensor."""
        rates = self.gyr[self.windows.covered(len(self.gyr))]
        spread = np.linalg.eigvalsh(np.cov((rates - np.median(rates, axis=0)).T))
        return bool(spread[1] < ONE_AXIS * spread[2])

    def scatter(
        self, scale: float = 1.0, bias: np.ndarray | None = None, maps: np.ndarray = MAPS
    ) -> Scatter:
        """How far the vectors scatter by each reading.

        Args:
            scale: Rates are taken so many times.
            bias: Taken off the rates first, shape (3,) [rad/s].
            maps: True rates are each of these times the rates read, shape (r, 3, 3).
        """
        return self.scatter_of(self.blocks(scale, bias, maps))

    def scatter_of(self, blocks: np.ndarray) -> Scatter:
        """How far means of blocks scatter.

        That is a part of the mean vector, whose length is that of gravity only if nothing smears:
        too fast a turning would else make all means small, and alike.

        Args:
            blocks: As `blocks` gives them, shape (r, w, b, 3).
        """
        # einsum, for NumPy is slow to add up along axes of a few elements
        each = blocks.shape[2]
        mean = np.einsum("rwbi->rwi", blocks) / each
        apart = blocks - mean[:, :, None]
        left = np.einsum("rwbi,rwbi->rw", apart, apart) / each
        length = np.sqrt(np.einsum("rwi,rwi->rw", mean, mean))
        part = left / np.clip(length, SHORTEST * self.usual, self.usual) ** 2
        return Scatter(np.log(part + FLOOR**2), length, self.windows.independent)

    def fitted_bias(self, scale: float, one: np.ndarray, bias: np.ndarray) -> np.ndarray:
        """The bias with which a reading fits best, from the beginning `bias`.

        Args:
            scale: As for `blocks`.
            one: The reading, shape (3, 3).
            bias: To begin with, shape (3,) [rad/s].
        """
        step, turned, slopes = 0.005, np.inf, np.empty(0)
        lasting = float(np.max(self.windows.ends[:, -1] - self.windows.begins[:, 0]))
        for _ in range(2):
            begin = self.deviations(scale, one, bias)
            if turned > SAME_SLOPES:
                moved = [self.deviations(scale, one, bias + step * axis) for axis in np.eye(3)]
                slopes = np.stack([(each - begin) / step for each in moved], axis=-1)
            # windows that something shakes count less
            weight = 1 / (
                np.sum(begin**2, axis=(1, 2)) / begin.shape[1] + (FLOOR * self.usual) ** 2
            )
            left = np.einsum("w,wbik,wbil->kl", weight, slopes, slopes)
            right = np.einsum("w,wbik,wbi->k", weight, slopes, begin)
            prior = np.eye(3) * self.windows.independent / PRIOR_BIAS**2
            change = np.linalg.solve(left + prior, right)
            turned = abs(scale) * float(np.linalg.norm(change)) * lasting * self.windows.seconds
            bias = bias - change
        return bias

    def deviations(self, scale: float, one: np.ndarray, bias: np.ndarray) -> np.ndarray:
        """How far the mean of each block is from that of its window, shape (w, b, 3).

        Args:
            scale: As for `blocks`.
            one: The reading, shape (3, 3).
            bias: Taken off the rates first, shape (3,) [rad/s].
        """
        blocks = self.blocks(scale, bias, one[None])[0]
        return np.asarray(blocks - blocks.mean(axis=1, keepdims=True))


@dataclass(frozen=True)
class Reading:
    """The reading of a gyroscope that fits another triad best, and whether as it is will do.

    Attributes:
        pair: That was compared.
        scatter: By the 48 maps, at the scale and the bias.
        scale: By which rates fit best, of those tried.
        bias: Shape (3,) [rad/s].
        turns: Whether any reading fits clearly better than that nothing turns.
        turning: Angle that the gyroscope goes through in each window, shape (w,) [rad].
        one_axis: Whether all turning is about one axis. Accelerations of a pendulum go with it, and
            a reading that puts that axis along gravity fits them as well as the right one.
        explained: Part of the scatter that turning explains.
        scale_open: Whether half or twice the scale fits hardly worse.
    """

    pair: Pair
    scatter: Scatter
    scale: float
    bias: np.ndarray
    turns: bool
    turning: np.ndarray
    one_axis: bool
    explained: float
    scale_open: bool

    @property
    def fits_as_is(self) -> bool:
        """Whether no other map fits clearly better than the axes as they are."""
        return not self.scatter.better(self.scatter.best, IDENTITY)


FEW_WINDOWS = 60
"""Windows in which scales are first tried."""
FEWER_WINDOWS = 20
"""And all factors."""
NEIGHBOURS = (0.5, 2.0)
"""Scales of neighbouring range settings, and of a sampling rate told wrongly."""
SCALES = (*NEIGHBOURS, DEG, 1 / DEG, DEG / 1000, 1000 / DEG, 1e-3, 1e3, 0.01, 0.1, 10.0, 100.0)
"""Those of units of the rate, and of time."""


def read_against(
    excerpt: Excerpt,
    vectors: np.ndarray,
    seconds: float,
    rest_bias: np.ndarray | None,
    scales: tuple[float, ...] = (),
    scale_known: bool = False,
) -> Reading | None:
    """The reading of a gyroscope by the first kind of windows that shows one; None without windows.

    Args:
        excerpt: Of the recording.
        vectors: Of the accelerometer or magnetometer, shape (n, 3).
        seconds: Of a step.
        rest_bias: What the gyroscope reads at rest, shape (3,) [rad/s]; None if it never rests.
        scales: Only windows in which one of these shows turning, in `FEW_WINDOWS`; any if empty.
        scale_known: Whether the scale of the gyroscope is known to be right, and no other tried.
    """
    first = None
    for pair in Pair.all_of(excerpt, vectors, seconds):
        if scales:
            pair = pair.few
            if not _may_turn(pair, rest_bias, scales):
                continue
        reading = read_gyroscope(pair, rest_bias, scale_known)
        if reading.turns:
            return reading
        first = reading if first is None else first
    return first


def _may_turn(pair: Pair, rest_bias: np.ndarray | None, scales: tuple[float, ...]) -> bool:
    """Whether any map fits at one of these scales better than that nothing turns."""
    nothing = pair.scatter(0.0, maps=MAPS[:1]).logs[0].mean()
    for scale in scales:
        bias = rest_bias
        if bias is None:
            bias = pair.fitted_bias(scale, MAPS[IDENTITY], np.zeros(3))
        if _least(pair.scatter(scale, bias)) < nothing - LEAST_RATIO:
            return True
    return False


def read_gyroscope(pair: Pair, rest_bias: np.ndarray | None, scale_known: bool = False) -> Reading:
    """Find the reading of a gyroscope that fits another triad best.

    Args:
        pair: The two of them.
        rest_bias: What the gyroscope reads at rest, shape (3,) [rad/s]; None if it never rests.
        scale_known: Whether its scale is known to be right, and no other tried.
    """
    nothing = pair.scatter(0.0, maps=MAPS[:1]).logs[0]
    bias = np.zeros(3) if rest_bias is None else rest_bias
    within = BIAS_WITHIN if rest_bias is None else REST_WITHIN
    found = _with_bias(pair, 1.0, bias, within)
    sure = found.best == IDENTITY and is_clear(nothing, found.logs[IDENTITY], found.independent)
    sure = scale_known or (sure and _is_right_scale(pair, bias, rest_bias is None))
    tried = [(1.0, found)]
    if not sure:
        some = pair.few
        scales = [*SCALES, *_other_factors(some, bias)]
        likely = [scale for scale in scales if _least(some.scatter(scale, bias)) < _least(found)]
        tried += [(scale, _with_bias(pair, scale, bias, within)) for scale in likely]
    scale, scatter = min(
        (one for one in tried if one[0] == 1.0 or _is_another_scale(found, one[1])),
        key=lambda one: _least(one[1]),
    )
    best = scatter.logs[scatter.best]
    turns = is_clear(nothing, best, scatter.independent)
    turns = turns and explained(nothing, best) >= LEAST_EXPLAINED
    turning = pair.turning(bias) * (scale if turns else 1.0)
    part, is_open = explained(nothing, best), _is_open(pair, scale, bias)
    one_axis = pair.about_one_axis
    return Reading(pair, scatter, scale, bias, turns, turning, one_axis, part, is_open)


def _other_factors(pair: Pair, bias: np.ndarray) -> list[float]:
    """Factors that fit, the axes as they are, and are not near one of `SCALES`, nor near 1, where
    the scale of a neighbouring range is looked for.

    Args:
        pair: In few windows.
        bias: Taken off the rates first, shape (3,) [rad/s].
    """
    angle = float(np.quantile(pair.turning(bias), 0.9))
    coarse, fine = (
        lambda scale, one=one: one.scatter(scale, bias, MAPS[:1]).logs[0]
        for one in (pair.some(FEWER_WINDOWS), pair)
    )
    found = best_factors(coarse, fine, angle)
    return [
        one
        for one in found
        if not NEAR[0] < one < NEAR[1] and all(abs(np.log(one / scale)) > LIKE for scale in SCALES)
    ]


def _least(scatter: Scatter) -> float:
    return float(scatter.logs.mean(axis=1).min())


def _is_another_scale(found: Scatter, other: Scatter) -> bool:
    """Whether another scale fits clearly better, with the axes as they are: whatever the scale, an
    axis that is put along gravity turns nothing.
    """
    if other.better(other.best, IDENTITY):
        return False
    own, best = found.logs[found.best], other.logs[other.best]
    gain = float((own - best).mean())
    return gain >= LEAST_SCALE_RATIO and is_clear(own, best, found.independent)


def explained(nothing: np.ndarray, best: np.ndarray) -> float:
    """The part that turning explains of what would scatter if nothing turned.

    Args:
        nothing: Logarithms of the scatter, shape (w,).
        best: Likewise of the best reading, shape (w,).
    """
    beyond = np.exp([float(nothing.mean()), float(best.mean())]) - FLOOR**2
    return float(1 - beyond[1] / beyond[0]) if beyond[0] > 0 else 0.0


def _is_open(pair: Pair, scale: float, bias: np.ndarray) -> bool:
    """Whether half or twice a scale fits hardly worse, with the axes as they are."""
    some = pair.few
    own, *others = (
        some.scatter(scale * factor, bias, MAPS[:1]).logs[0] for factor in (1.0, *NEIGHBOURS)
    )
    return not all(is_clear(other, own, some.windows.independent) for other in others)


def _is_right_scale(pair: Pair, bias: np.ndarray, unknown: bool) -> bool:
    """Whether the axes as they are fit at no other scale clearly better."""
    some = pair.few
    if unknown:
        bias = some.fitted_bias(1.0, MAPS[IDENTITY], bias)
    nothing, own = (some.scatter(scale, bias, MAPS[:1]).logs[0] for scale in (0.0, 1.0))
    others = () if explained(nothing, own) >= WELL_EXPLAINED else _other_factors(some, bias)
    return not any(
        is_clear(own, some.scatter(scale, bias, MAPS[:1]).logs[0], some.windows.independent)
        for scale in (*SCALES, *others)
    )


def _with_bias(pair: Pair, scale: float, bias: np.ndarray, within: float) -> Scatter:
    """By all maps, the likely ones each with the bias that suits it."""
    scatter = pair.scatter(scale, bias)
    if not 0.1 < scale < 10:
        return scatter
    logs, length = scatter.logs.copy(), scatter.length.copy()
    for one in dict.fromkeys([IDENTITY, *scatter.rivals[:3]]):
        own = pair.few.fitted_bias(scale, MAPS[one], bias)
        if np.linalg.norm(own - bias) < within:
            fitted = pair.scatter(scale, own, MAPS[one : one + 1])
            if fitted.logs[0].mean() < logs[one].mean():
                logs[one], length[one] = fitted.logs[0], fitted.length[0]
    return Scatter(logs, length, scatter.independent)
