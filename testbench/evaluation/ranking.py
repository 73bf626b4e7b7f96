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
from testbench.records.results.evaluation_rows import (
    MEAN_MAGNITUDE,
    MEAN_SQUARE,
    Comparison,
    RankRow,
)

SIGNIFICANCE = 0.05
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
    square = criterion == MEAN_SQUARE
    sizes = {name: float(np.sqrt(values[name])) if square else 1.0 for name in order}
    relevant = {(a, b): LEAST_RELEVANT * (sizes[a] + sizes[b] if square else 1.0) for a, b in found}
    shown = {name: sizes[name] if square else values[name] for name in order}
    left_out = math.comb(len(series), 2) - len(found)
    return ranked((owner, section, sequence, criterion), shown, found, relevant, left_out)


def ranked(
    place: tuple[str, str | None, str | None, str],
    shown: dict[str, float],
    found: dict[tuple[str, str], Difference],
    relevant: dict[tuple[str, str], float],
    left_out: int = 0,
) -> tuple[list[RankRow], list[Comparison]]:
    """Places and comparisons of filters from the differences of all pairs.

    Args:
        place: Owner, section, sequence and criterion.
        shown: Value of each filter, best first.
        found: Difference of each pair.
        relevant: The least difference of each pair that counts.
        left_out: Pairs that are not told, and count in the family nevertheless.
    """
    order = list(shown)
    tests = [_exceeds(found[pair], relevant[pair]) for pair in found]
    adjusted = holm(tests + [1.0] * left_out)[: len(tests)]
    comparisons = [
        Comparison(*place, *pair, found[pair].mean, p, p_holm, found[pair].blocks)
        for pair, p, p_holm in zip(found, tests, adjusted, strict=True)
    ]
    apart = {frozenset((c.first, c.second)) for c in comparisons if c.p_holm < SIGNIFICANCE}
    letters = group_letters(order, apart)
    rows = []
    for at, name in enumerate(order):
        differs = [frozenset((name, other)) in apart for other in order]
        alike = [
            other for other, far in zip(order, differs, strict=True) if other != name and not far
        ]
        best, worst = sum(differs[:at]) + 1, len(order) - sum(differs[at + 1 :])
        rows.append(RankRow(*place, name, shown[name], best, worst, letters[name], alike))
    return rows, comparisons


class Difference(NamedTuple):
    """Mean difference of a pair of filters.

    Attributes:
        mean: Of the criterion.
        error: Its standard error.
        freedom: Degrees of freedom of that.
        memories: The fewest that the section holds, of either filter's errors or the difference.
        blocks: Independent ones, at most.
    """

    mean: float
    error: float
    freedom: int
    memories: float
    blocks: int


def _differences(
    order: list[str],
    measured: dict[str, np.ndarray],
    series: dict[str, ErrorSeries],
    held: dict[str, float],
) -> dict[tuple[str, str], Difference]:
    """Of every pair, by the names in their order.

    Args:
        order: The filters that are compared, two at least.
        measured: The criterion of each piece, by filter, shape (m,) each.
        series: Errors, by filter.
        held: Memories that the section holds of these.
    """
    pairs = list(combinations(order, 2))
    layout = series[order[0]].layout
    apart = means(layout, np.array([measured[a] - measured[b] for a, b in pairs]))
    memories = [
        min(float(own), held[a], held[b]) for own, (a, b) in zip(apart.memories, pairs, strict=True)
    ]
    return {
        pair: Difference(
            float(apart.mean[i]),
            float(apart.error[i]),
            int(apart.freedom[i]),
            memories[i],
            int(min(memories[i], len(layout.rows))),
        )
        for i, pair in enumerate(pairs)
    }


def _exceeds(found: Difference, relevant: float) -> float:
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
