"""What several sessions of one protocol say together: how far another one may lie from this.

An interval within a session speaks of that session repeated on the same part. Sessions with other
parts, mountings and power-ups scatter by more; their scatter is what a reader must expect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from testbench.evaluation.ranking import LEAST_RELEVANT, Difference, ranked
from testbench.evaluation.repeatability import key_of
from testbench.evaluation.verdict import has_sign
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.results.evaluation_rows import (
    MEAN_MAGNITUDE,
    MEAN_SQUARE,
    RANKED_METRICS,
    Comparison,
    Interval,
    RankRow,
    RepeatedMetric,
    RepeatedSession,
)

RANKED = dict(zip(RANKED_METRICS, (MEAN_MAGNITUDE, MEAN_SQUARE), strict=True))
"""Metrics by which filters are compared over sessions, as they are within one."""
FEWEST = 2
"""Sessions that have a scatter."""


def with_repeats(
    evaluation: Evaluation, others: Sequence[Evaluation], sessions: list[RepeatedSession]
) -> Evaluation:
    """An evaluation with what further sessions of the same protocol say beside it.

    Args:
        evaluation: Of this session.
        others: Of the further sessions, one at least.
        sessions: All of them, this one first.
    """
    every = [{key_of(m): _known(m.value) for m in one.metrics} for one in (evaluation, *others)]
    rows = []
    for metric in evaluation.metrics:
        values = [one.get(key_of(metric)) for one in every]
        if values[0] is not None and len(values) - values.count(None) >= FEWEST:
            rows.append(_row(metric, values))
    ranking, comparisons = _ranking([evaluation, *others])
    return replace(
        evaluation,
        repeated_sessions=sessions,
        repeats=rows,
        repeat_ranking=ranking,
        repeat_comparisons=comparisons,
    )


def _known(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def _row(metric: Metric, values: list[float | None]) -> RepeatedMetric:
    known = np.array([value for value in values if value is not None])
    mean, sd = float(known.mean()), float(known.std(ddof=1))
    ends = intervals(known, logarithmic=not has_sign(metric.name.partition(".")[2]))
    return RepeatedMetric(*key_of(metric), metric.unit, values, mean, sd, *ends)


def intervals(values: np.ndarray, logarithmic: bool) -> tuple[Interval, Interval]:
    """Where the mean over all sessions lies, and where that of one more session does, 95 % each.

    Student's t with n - 1 degrees of freedom: m +- t s / sqrt(n), and m +- t s sqrt(1 + 1 / n), the
    prediction interval (Hahn & Meeker, Statistical intervals, 1991, sections 4.2 and 4.8). Both
    hold where sessions were drawn as the ones to come will be.

    Args:
        values: One a session, shape (n,), n of 2 at least.
        logarithmic: Magnitudes: symmetric in the logarithm, for they are skewed and end at zero.

    Returns:
        Of the mean, and of another session.
    """
    n = len(values)
    t = float(stdtrit(n - 1, 0.975))
    mean, sd = float(values.mean()), float(values.std(ddof=1))
    near, far = t * sd / np.sqrt(n), t * np.sqrt(1 + 1 / n)
    if logarithmic and (values > 0).all():
        logs = np.log(values)
        middle, spread = float(logs.mean()), float(logs.std(ddof=1))
        of_mean = mean * np.exp([-near / mean, near / mean])
        another = np.exp([middle - far * spread, middle + far * spread])
    else:
        of_mean = np.array([mean - near, mean + near])
        another = np.array([mean - far * sd, mean + far * sd])
    if logarithmic:
        of_mean, another = np.maximum(of_mean, 0.0), np.maximum(another, 0.0)
    return of_mean.tolist(), another.tolist()


def _ranking(evaluations: list[Evaluation]) -> tuple[list[RankRow], list[Comparison]]:
    """Filters compared in pairs, session by session, of those that ran in all of them."""
    values: dict[tuple[str, str | None, str | None, str], dict[str, list[float]]] = {}
    for one in evaluations:
        for metric in one.metrics:
            owner, _, kind = metric.name.partition(".")
            if kind in RANKED and metric.filter and metric.value is not None:
                place = owner, metric.section, metric.sequence, RANKED[kind]
                of_filter = values.setdefault(place, {}).setdefault(metric.filter, [])
                of_filter.append(metric.value)
    rows, comparisons = [], []
    for place, known in values.items():
        whole = {name: np.array(own) for name, own in known.items() if len(own) == len(evaluations)}
        if len(whole) < 2:
            continue
        found = _differences(whole)
        order = {name: float(own.mean()) for name, own in whole.items()}
        shown = dict(sorted(order.items(), key=lambda item: item[1]))
        placed, compared = ranked(place, shown, found, dict.fromkeys(found, LEAST_RELEVANT))
        rows += placed
        comparisons += compared
    return rows, comparisons


def _differences(values: dict[str, np.ndarray]) -> dict[tuple[str, str], Difference]:
    """Of each pair, over sessions; the filters of a session judged the same samples."""
    found = {}
    for a, b in combinations(sorted(values, key=lambda name: float(values[name].mean())), 2):
        apart = values[a] - values[b]
        n = len(apart)
        error = float(apart.std(ddof=1)) / np.sqrt(n)
        found[a, b] = Difference(float(apart.mean()), float(error), n - 1, np.inf, n)
    return found
