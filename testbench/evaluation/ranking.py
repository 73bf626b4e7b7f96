"""Which filter is better, and where no difference is shown."""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr

from testbench.model.statistics.memory import (
    FEWEST_MEMORIES,
    ErrorSeries,
    fewest_memories,
    means,
)
from testbench.records.results.evaluation_rows import Comparison, RankRow

SIGNIFICANCE = 0.05
MEAN_MAGNITUDE, MEAN_SQUARE = "mean |flexion error|", "RMS total error"
LEAST_RELEVANT = 0.01
"""A difference is shown only where it exceeds this, the last digit that the tables give [deg]."""


# One piece: the comparisons decide what is kept, tested, lettered and ranked, in this order.
def rank_filters(
    owner: str,
    section: str | None,
    sequence: str | None,
    criterion: str,
    series: dict[str, ErrorSeries],
) -> tuple[list[RankRow], list[Comparison]]:
    """Rank filters that were judged on the same blocks.

    Each pair is compared by the mean difference of the criterion, against its standard error that
    respects the memory of the errors, by Student's t; what is tested is whether it exceeds 0.01
    deg (a minimum-effect test: Murphy & Myors 1999), since with samples enough any two filters
    differ. The family of all pairs keeps a level of 5 % (Holm 1979); pairs of filters that are left
    out stay in it, since the errors themselves chose which those are.

    Args:
        owner: Joint or sensor.
        section: Of the protocol, for a joint; None for a sensor.
        sequence: Of the joint's angles; None for a sensor.
        criterion: `MEAN_MAGNITUDE` compares |e|, `MEAN_SQUARE` e².
        series: By filter; errors in degrees, of the same layout.

    Returns:
        Rows, best first, and the comparisons behind them. Filters whose errors last too long for
        the section are left out of both; where fewer than two are left, both are empty.
    """
    measured = {
        name: own.absolute if criterion == MEAN_MAGNITUDE else own.square
        for name, own in series.items()
    }
    values = {name: float(measured[name] @ own.layout.weight) for name, own in series.items()}
    order = sorted(series, key=lambda name: values[name])
    held = dict(zip(series, fewest_memories(list(series.values())), strict=True))
    order = [name for name in order if held[name] >= FEWEST_MEMORIES]
    if len(order) < 2:
        return [], []
    found = _differences(order, measured, series, held)
    pairs = list(found)
    sizes = {
        name: 1.0 if criterion == MEAN_MAGNITUDE else float(np.sqrt(values[name])) for name in order
    }
    relevant = {
        (a, b): LEAST_RELEVANT * (1.0 if criterion == MEAN_MAGNITUDE else sizes[a] + sizes[b])
        for a, b in pairs
    }
    tests = [_exceeds(found[pair], relevant[pair]) for pair in pairs]
    left_out = [1.0] * (math.comb(len(series), 2) - len(pairs))
    comparisons = [
        Comparison(
            owner,
            section,
            sequence,
            criterion,
            *pair,
            found[pair].mean,
            p,
            p_holm,
            int(min(found[pair].memories, len(series[pair[0]].layout.rows))),
        )
        for pair, p, p_holm in zip(pairs, tests, holm(tests + left_out)[: len(pairs)], strict=True)
    ]
    apart = {frozenset((c.first, c.second)) for c in comparisons if c.p_holm < SIGNIFICANCE}
    letters = group_letters(order, apart)
    rows = []
    for place, name in enumerate(order):
        differs = [frozenset((name, other)) in apart for other in order]
        value = values[name] if criterion == MEAN_MAGNITUDE else float(np.sqrt(values[name]))
        alike = [
            other for other, far in zip(order, differs, strict=True) if other != name and not far
        ]
        rows.append(
            RankRow(
                owner,
                section,
                sequence,
                criterion,
                name,
                value,
                sum(differs[:place]) + 1,
                len(order) - sum(differs[place + 1 :]),
                letters[name],
                alike,
            )
        )
    return rows, comparisons


class _Difference(NamedTuple):
    """Mean difference of a pair of filters.

    Attributes:
        mean: Of the criterion.
        error: Its standard error.
        freedom: Degrees of freedom of that.
        memories: The fewest that the section holds, of either filter's errors or the difference.
    """

    mean: float
    error: float
    freedom: int
    memories: float


def _differences(
    order: list[str],
    measured: dict[str, np.ndarray],
    series: dict[str, ErrorSeries],
    held: dict[str, float],
) -> dict[tuple[str, str], _Difference]:
    """Of every pair, by the names in their order.

    Args:
        order: The filters that are compared, two at least.
        measured: The criterion of each piece, by filter, shape (m,) each.
        series: Errors, by filter.
        held: Memories that the section holds of these.
    """
    pairs = list(combinations(order, 2))
    apart = means(series[order[0]].layout, np.array([measured[a] - measured[b] for a, b in pairs]))
    return {
        (a, b): _Difference(
            float(apart.mean[i]),
            float(apart.error[i]),
            int(apart.freedom[i]),
            min(float(apart.memories[i]), held[a], held[b]),
        )
        for i, (a, b) in enumerate(pairs)
    }


def _exceeds(found: _Difference, relevant: float) -> float:
    """The two-sided p of a mean difference being larger than what is relevant.

    It is 1 for a difference that lasts too long to tell.

    Args:
        found: The difference.
        relevant: The least difference that counts.
    """
    excess = abs(found.mean) - relevant
    if excess <= 0 or found.memories < FEWEST_MEMORIES:
        return 1.0
    return float(2 * stdtr(found.freedom, -excess / max(found.error, 1e-12)))


def holm(p: list[float]) -> list[float]:
    """Adjusted p values of a family of tests.

    Holm (1979), A simple sequentially rejective multiple test procedure.
    """
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    largest = 0.0
    for place, index in enumerate(order):
        largest = max(largest, min((len(p) - place) * p[index], 1.0))
        adjusted[index] = largest
    return [float(value) for value in adjusted]


def group_letters(order: list[str], apart: set[frozenset[str]]) -> dict[str, str]:
    """Letters by name: two names share one exactly where they are not apart.

    Insert and absorb (Piepho 2004).

    Args:
        order: Names, best first; so the first letter belongs to the best.
        apart: Pairs that differ.
    """
    columns: list[set[str]] = [set(order)]
    for pair in sorted(apart, key=lambda item: sorted(order.index(name) for name in item)):
        first, second = pair
        split: list[set[str]] = []
        for column in columns:
            split += [column - {first}, column - {second}] if pair <= column else [column]
        columns = []
        for i, column in enumerate(split):  # absorb those that others contain
            inside = any(
                column < other or (column == other and j < i)
                for j, other in enumerate(split)
                if j != i
            )
            if not inside:
                columns.append(column)
    columns.sort(key=lambda column: sorted(order.index(name) for name in column))
    return {
        name: "".join(_letter(i) for i, column in enumerate(columns) if name in column)
        for name in order
    }


def _letter(index: int) -> str:
    return chr(ord("a") + index) if index < 26 else f"({index + 1})"
