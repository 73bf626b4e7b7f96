"""Errors with memory whose law is known, laid on the times of a section."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.signal import lfilter

from testbench.evaluation.ranking import SIGNIFICANCE, rank_filters
from testbench.model.statistics.memory import Intervals, Layout, error_series, intervals, layout
from testbench.records.results.evaluation_rows import MEAN_MAGNITUDE, MEAN_SQUARE

RATE = 20.0
"""Samples a second."""
FILTERS = 5
SWEEPS = [4 / hz for _ in range(5) for hz in (0.1, 0.2, 0.3, 0.5, 0.75)]
STEPS = {
    "6 poses": [(2.5 * i, 2.5 * i + 1) for i in range(6)],
    "15 poses": [(4.0 * i, 4.0 * i + 2) for i in range(15)],
    "60 poses": [(4.0 * i, 4.0 * i + 2) for i in range(60)],
    "25 sweeps": [(sum(SWEEPS[:i]) + i, sum(SWEEPS[: i + 1]) + i) for i in range(25)],
    "sweep of 4 s": [(0.0, 4.0)],
    "2 sweeps of 20 s": [(0.0, 20.0), (21.0, 41.0)],
    "record of 300 s": [(0.0, 300.0)],
}
"""Begin and end of what counts in a section [s]."""
FAR = 8.0
"""Errors so many of their standard deviations from zero keep their sign: |e| is as e."""
POSE_SHARE = 0.81
"""Of the variance of errors that go by the pose; the rest is of first order."""


@dataclass(frozen=True)
class Cell:
    """A law of errors on the times of a section.

    Attributes:
        law: Name in `LAWS`.
        steps: Name in `STEPS`.
        tau: Correlation time [s].
    """

    law: str
    steps: str
    tau: float

    def __str__(self) -> str:
        return f"{self.law}, {self.steps}, {self.tau:g} s"

    def memories(self) -> float:
        """Integrals of the autocorrelation that the section holds."""
        steps = STEPS[self.steps]
        duration = steps[-1][1] - steps[0][0]
        if self.law == "random walk":
            return 0.0
        if self.law == "by pose":
            pose = duration / len(steps)
            return duration / (POSE_SHARE * pose + (1 - POSE_SHARE) * 2 * self.tau)
        return duration / (2 * self.tau)


def _first_order(rng: np.random.Generator, cell: Cell, shape: tuple[int, int]) -> np.ndarray:
    keep = np.exp(-1 / (cell.tau * RATE))
    start = keep * rng.standard_normal((shape[0], 1))
    return lfilter(
        [np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(shape), axis=1, zi=start
    )[0]


def _settled(
    numbers: Callable[[tuple[int, int]], np.ndarray],
    cell: Cell,
    shape: tuple[int, int],
    feedback: list[float],
) -> np.ndarray:
    """Of a filter that has run for ten correlation times."""
    before = int(10 * cell.tau * RATE)
    return lfilter([1.0], [1.0, *feedback], numbers((shape[0], shape[1] + before)), axis=1)[
        :, before:
    ]


def _second_order(rng: np.random.Generator, cell: Cell, shape: tuple[int, int]) -> np.ndarray:
    """R(t) = exp(-t / tau) (cos(t / tau) + sin(t / tau)): AR(2), memory 2 tau."""
    step = 1 / (cell.tau * RATE)
    first, second = -2 * np.exp(-step) * np.cos(step), np.exp(-2 * step)
    variance = (1 + second) / ((1 - second) * ((1 + second) ** 2 - first**2))
    return _settled(rng.standard_normal, cell, shape, [first, second]) / np.sqrt(variance)


def _heavy_tailed(rng: np.random.Generator, cell: Cell, shape: tuple[int, int]) -> np.ndarray:
    """Of first order, driven by Student's t with three degrees of freedom, whose variance is 3."""
    keep = np.exp(-1 / (cell.tau * RATE))
    drawn = _settled(lambda size: rng.standard_t(3, size), cell, shape, [-keep])
    return drawn * np.sqrt((1 - keep**2) / 3)


def _random_walk(rng: np.random.Generator, cell: Cell, shape: tuple[int, int]) -> np.ndarray:
    """It begins at zero, its expectation, and ends with a standard deviation of one."""
    return np.cumsum(rng.standard_normal(shape), axis=1) / np.sqrt(shape[1])


def _by_pose(rng: np.random.Generator, cell: Cell, shape: tuple[int, int]) -> np.ndarray:
    """One number for each step, and errors of first order beside it."""
    result = np.sqrt(1 - POSE_SHARE) * _first_order(rng, cell, shape)
    for begin, end in STEPS[cell.steps]:
        own = np.sqrt(POSE_SHARE) * rng.standard_normal((shape[0], 1))
        result[:, round(begin * RATE) : round(end * RATE)] += own
    return result


LAWS = {
    "first order": _first_order,
    "second order": _second_order,
    "heavy-tailed": _heavy_tailed,
    "random walk": _random_walk,
    "by pose": _by_pose,
}
CELLS = [
    *(Cell("first order", steps, tau) for steps in STEPS for tau in (0.1, 1, 5, 20, 60)),
    *(Cell("second order", steps, tau) for steps in STEPS for tau in (0.1, 1, 5, 20)),
    *(Cell("heavy-tailed", steps, tau) for steps in STEPS for tau in (0.1, 1, 5, 20)),
    *(Cell("random walk", steps, 0.0) for steps in STEPS),
    *(Cell("by pose", steps, 1) for steps in STEPS if "poses" in steps or "25" in steps),
]


@cache
def times(steps: str) -> tuple[Layout, int]:
    """The layout of a section, every step alike, and how many samples it has."""
    n = round(STEPS[steps][-1][1] * RATE)
    rows = [np.arange(round(a * RATE), round(b * RATE)) for a, b in STEPS[steps]]
    found = layout(np.arange(n) / RATE, rows, equally=True)
    assert found is not None
    return found, n


@cache
def known(cell: Cell) -> tuple[float, float, float]:
    """Standard deviation of the mean error, mean magnitude and RMS, from 1,000 draws."""
    own, n = times(cell.steps)
    rng = np.random.default_rng(7)
    mean, magnitude, square = [], [], []
    for _ in range(10):
        drawn = LAWS[cell.law](rng, cell, (100, n))[:, own.rows]
        weight = np.repeat(own.weight / own.sizes, own.sizes)
        mean += (drawn @ weight).tolist()
        magnitude.append(np.mean(np.abs(drawn) @ weight))
        square.append(np.mean(drawn**2 @ weight))
    return float(np.std(mean)), float(np.mean(magnitude)), float(np.sqrt(np.mean(square)))


def trial(cell: Cell, number: int) -> list[Any]:
    """Five filters of one law.

    Returns:
        Whether an interval was given, and whether it missed, for mean, magnitude and RMS of the
        first; width of the first over that of one who knows the law, or None; whether any of five
        equal filters was told apart, by magnitude, square, and far from zero; whether one pair four
        standard errors apart was; whether one of five that is off by six was told from any, and
        from all others.
    """
    own, n = times(cell.steps)
    seed = [number, *str(cell).encode()]
    drawn = LAWS[cell.law](np.random.default_rng(seed), cell, (FILTERS, n))
    deviation, magnitude, rms = known(cell)
    found = intervals(error_series(own, drawn[0]))
    width = None if found.mean is None else (found.mean[1] - found.mean[0]) / (3.92 * deviation)
    apart = np.sqrt(2) * deviation
    near = dict(enumerate(drawn))
    far = {key: FAR + own_errors for key, own_errors in near.items()}
    pair = {0: far[0] + 4 * apart, 1: far[1]}
    told = _told(own, far | {0: far[0] + 6 * apart}, MEAN_MAGNITUDE)
    return [
        *_missed(found, 0.0, magnitude, rms),
        width,
        bool(_told(own, near, MEAN_MAGNITUDE)),
        bool(_told(own, near, MEAN_SQUARE)),
        bool(_told(own, far, MEAN_MAGNITUDE)),
        bool(_told(own, pair, MEAN_MAGNITUDE)),
        any("0" in names for names in told),
        sum("0" in names for names in told) == FILTERS - 1,
    ]


def _missed(found: Intervals, mean: float, magnitude: float, rms: float) -> list[bool]:
    result = []
    for ends, true in ((found.mean, mean), (found.absolute, magnitude), (found.rms, rms)):
        result += [ends is not None, ends is not None and not ends[0] <= true <= ends[1]]
    return result


def _told(own: Layout, errors: dict[int, np.ndarray], criterion: str) -> list[set[str]]:
    """The pairs that a ranking tells apart."""
    series = {str(key): error_series(own, values) for key, values in errors.items()}
    _, compared = rank_filters("joint", "section", None, criterion, series)
    return [{c.first, c.second} for c in compared if c.p_holm < SIGNIFICANCE]
