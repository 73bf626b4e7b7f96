"""D- or A-optimal designs by greedy choice and exchange, from several starts.

D maximises the determinant of the information, so the volume of the confidence ellipsoid is least;
A minimises the sum of the variances in units of what is known beforehand (Fedorov, Theory of
Optimal Experiments, 1972; Pukelsheim 2006, chapter 6).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Criterion = Literal["D", "A"]
STARTS, MOST_PASSES = 5, 10
LEAST_GAIN = 1e-6


def choose(
    information: np.ndarray,
    count: int,
    size: np.ndarray,
    criterion: Criterion,
    start: np.ndarray | None = None,
    seed: int = 0,
) -> list[int]:
    """Observations to make.

    Args:
        information: Of each candidate, shape (k, p, p).
        count: How many to choose; a candidate may be chosen again.
        size: What is known of each parameter beforehand, a standard deviation, shape (p,).
        criterion: "D" or "A".
        start: Information that is there already, shape (p, p).
        seed: Of the random starts beside the greedy one.

    Returns:
        Indices, ascending.
    """
    scaled = information * np.outer(size, size)
    known = np.eye(len(size)) + (0.0 if start is None else start * np.outer(size, size))
    rng = np.random.default_rng(seed)
    designs = [_greedy(scaled, known, count, criterion)]
    designs += [[int(i) for i in rng.integers(len(scaled), size=count)] for _ in range(STARTS)]
    finished = [_exchange(scaled, known, design, criterion) for design in designs]

    def value(design: list[int]) -> float:
        return merit(known + scaled[np.array(design)].sum(axis=0), criterion)

    best: list[int] = max(finished, key=value)
    return sorted(best)


def merit(information: np.ndarray, criterion: Criterion) -> float:
    """How good a design is; larger is better.

    By D the log of the determinant, by A minus the log of the sum of variances.

    Args:
        information: In units of what is known beforehand, shape (p, p).
        criterion: "D" or "A".
    """
    return float(_merit(information[None], criterion)[0])


def efficiency(
    information: np.ndarray, reference: np.ndarray, size: np.ndarray, criterion: Criterion
) -> float:
    """How many times more a design tells than another, per observation made so often.

    It is the ratio of their variances.

    Args:
        information: Of the design, shape (p, p), of full rank.
        reference: Of the other, shape (p, p), of full rank.
        size: What is known of each parameter beforehand, a standard deviation, shape (p,).
        criterion: "D" or "A".
    """
    scale = np.outer(size, size)
    gain = merit(information * scale, criterion) - merit(reference * scale, criterion)
    return float(np.exp(gain / len(size) if criterion == "D" else gain))


def _greedy(scaled: np.ndarray, known: np.ndarray, count: int, criterion: Criterion) -> list[int]:
    chosen: list[int] = []
    total = known
    for _ in range(count):
        chosen.append(int(np.argmax(_merit(total + scaled, criterion))))
        total = total + scaled[chosen[-1]]
    return chosen


def _exchange(
    scaled: np.ndarray, known: np.ndarray, design: list[int], criterion: Criterion
) -> list[int]:
    """Replace one observation at a time by the best, until none is better (Fedorov's exchange)."""
    chosen = list(design)
    total = known + scaled[chosen].sum(axis=0)
    for _ in range(MOST_PASSES):
        gained = False
        for place, old in enumerate(chosen):
            without = total - scaled[old]
            values = _merit(without + scaled, criterion)
            best = int(np.argmax(values))
            if values[best] > values[old] + LEAST_GAIN:
                chosen[place], total, gained = best, without + scaled[best], True
        if not gained:
            break
    return chosen


def _merit(information: np.ndarray, criterion: Criterion) -> np.ndarray:
    if criterion == "D":
        return np.asarray(np.linalg.slogdet(information)[1])
    return -np.log(np.trace(np.linalg.inv(information), axis1=1, axis2=2))
