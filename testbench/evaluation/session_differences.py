"""Whether errors of one side of sessions are larger than those of the other, metric by metric.

One session a side of the same part is compared in pairs of errors. Several sessions a side are
compared by their scatter, part by part. One session a side of two parts is compared, and told to be
of these two parts: how far parts scatter is not seen in it (docs/decisions/0062).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtr, stdtrit

from testbench.evaluation.paired_errors import BY_ERRORS, Judged, paired_difference
from testbench.evaluation.ranking import SIGNIFICANCE, Difference, holm
from testbench.evaluation.repeatability import Key, key_of
from testbench.model.statistics.memory import CONFIDENCE
from testbench.records.results.evaluation import Metric
from testbench.records.results.session_comparison import ComparedMetric, Told

LEAST_FREEDOM = 2
"""Degrees of freedom: of two sides of two sessions, or of three sessions and one."""
SMALLEST = 1e-12
"""A smaller standard error is none, in the unit of the metric."""
TWO_PARTS = (
    "the difference is of these two parts: how far parts of one kind scatter is not known from one "
    "session a side; compare several sessions of several parts"
)
UNTOLD_PARTS = (
    "nothing tells whether both sessions have the same part, and two parts may differ by as much; "
    "--same-part states that they have"
)
FEW = (
    "sessions of {base} and {new} parts do not show how far parts scatter: compare several parts a "
    "side, or the same one"
)


@dataclass(frozen=True)
class Side:
    """One side of a comparison.

    Attributes:
        judged: Its sessions, one at least.
        parts: Of each, what tells its part from others; None where nothing does.
    """

    judged: Sequence[Judged]
    parts: Sequence[str | None]

    def metrics(self, key: Key) -> dict[str, list[float]]:
        """Values of a metric by part; sessions whose part nobody tells are parts of their own."""
        found: dict[str, list[float]] = {}
        for one, part in zip(self.judged, self.parts, strict=True):
            value = value_of(one, key)
            if value is not None:
                found.setdefault(part or str(one.session.path), []).append(value)
        return found


def value_of(judged: Judged, key: Key) -> float | None:
    """A metric of a session; None where it was not measured."""
    found = (m.value for m in judged.evaluation.metrics if key_of(m) == key)
    value = next(found, None)
    return value if value is not None and math.isfinite(value) else None


@dataclass(frozen=True)
class Shown:
    """What was found of a metric, before all of them are looked at together.

    Attributes:
        base: Value of one side.
        new: Value of the other.
        difference: New less base; None where it is not known.
        ci95: Of that, or None.
        error: Standard error of that, or None.
        freedom: Of the error.
        p: Of no difference showing as much, and of one of the margin; None where it cannot be
            tested.
        paired_by: What was paired.
        why: Why nothing is told.
    """

    base: float
    new: float
    difference: float | None = None
    ci95: tuple[float, float] | None = None
    error: float | None = None
    freedom: int = 0
    p: tuple[float, float] | None = None
    paired_by: str = "nothing"
    why: str | None = None


def compare_metrics(
    base: Side, new: Side, metrics: Sequence[Metric], margin: float, other_truth: bool
) -> list[ComparedMetric]:
    """What may be said of each metric.

    That there is a difference at all is tested of all metrics together at a level of 5 % (Holm
    1979), that one is beyond the margin of each by itself; told is what passes both. Metrics that
    cannot be told are no part of the family: whether they can is seen in how errors scatter, which
    says nothing of their mean.

    Args:
        base: The side that is compared with.
        new: The other.
        metrics: Of the first session of `base`, each measured on both sides.
        margin: A larger difference counts, in the unit of each metric.
        other_truth: The truths of both sides are not the same arm's, so that how far each may be
            off counts.
    """
    found = [_shown(base, new, metric, margin, other_truth) for metric in metrics]
    adjusted = iter(holm([own.p[0] for own in found if own.p is not None]))
    return [
        _row(metric, own, None if own.p is None else max(next(adjusted), own.p[1]))
        for metric, own in zip(metrics, found, strict=True)
    ]


def _row(metric: Metric, found: Shown, p_holm: float | None) -> ComparedMetric:
    told = Told.NOT_KNOWN
    if p_holm is not None and found.difference is not None:
        apart = Told.WORSE if found.difference > 0 else Told.BETTER
        told = apart if p_holm < SIGNIFICANCE else Told.NOT_SHOWN
    return ComparedMetric(
        metric.name,
        metric.filter,
        metric.sequence,
        metric.section,
        metric.unit,
        found.base,
        found.new,
        found.difference,
        None if found.ci95 is None else list(found.ci95),
        found.error,
        found.freedom,
        None if found.p is None else max(found.p),
        p_holm,
        found.paired_by,
        told,
        found.why,
    )


def _shown(base: Side, new: Side, metric: Metric, margin: float, other_truth: bool) -> Shown:
    """Of one metric."""
    if len(base.judged) == len(new.judged) == 1:
        return _of_two(base, new, metric, margin, other_truth)
    one, other = base.metrics(key_of(metric)), new.metrics(key_of(metric))
    found = _of_several(one, other, margin)
    return _with_truth(found, base, new, metric, margin) if other_truth else found


def _of_two(base: Side, new: Side, metric: Metric, margin: float, other_truth: bool) -> Shown:
    """Of one session a side."""
    key = key_of(metric)
    before, after = (value_of(side.judged[0], key) or 0.0 for side in (base, new))
    found, by = paired_difference(base.judged[0], new.judged[0], metric)
    other_parts = _other_parts(base.parts[0], new.parts[0])
    if isinstance(found, str):
        return Shown(before, after, after - before, paired_by=by, why=other_parts or found)
    shown = _tested(Shown(before, after, paired_by=by), found, margin)
    if other_truth:
        shown = _with_truth(shown, base, new, metric, margin)
    return shown if other_parts is None else replace(shown, p=None, why=other_parts)


def _other_parts(base: str | None, new: str | None) -> str | None:
    """Why a difference may be that of two parts; None where both sessions have the same."""
    if base is None or new is None:
        return UNTOLD_PARTS
    return None if base == new else TWO_PARTS


def _tested(shown: Shown, found: Difference, margin: float) -> Shown:
    """With a difference and its interval, and how likely one within the margin shows as much."""
    half = float(stdtrit(found.freedom, (1 + CONFIDENCE) / 2)) * found.error
    return replace(
        shown,
        difference=found.mean,
        ci95=(found.mean - half, found.mean + half),
        error=found.error,
        freedom=found.freedom,
        p=p_values(found.mean, found.error, found.freedom, (margin, margin)),
    )


def p_values(
    difference: float, error: float, freedom: int, margins: tuple[float, float]
) -> tuple[float, float]:
    """How likely no difference shows as much as was found, and how likely one of the margin does.

    Student's t of two sides, and a minimum-effect test (Murphy & Myors 1999) at the margin that is
    nearer to what was found; both are the same without margins.

    Args:
        difference: That was found.
        error: Its standard error.
        freedom: Degrees of freedom of that.
        margins: What counts above zero, and below it, both positive.
    """
    beyond, behind = margins if difference >= 0 else margins[::-1]
    size, scale = abs(difference), max(error, SMALLEST)
    tails = stdtr(freedom, np.array([-size, beyond - size, -(size + behind)]) / scale)
    none, near, far = tails.tolist()
    return float(2 * none), float(near + far) if size > beyond else 1.0


def _of_several(base: dict[str, list[float]], new: dict[str, list[float]], margin: float) -> Shown:
    """Of several sessions on one side at least.

    The same parts on both sides are compared part by part, by Student's t of the differences of
    their means. One part that is the same on both sides, and other parts, are compared by two
    samples: of its sessions, or of the means of the parts. All by the logarithm where all values
    are positive, for magnitudes are skewed.

    Args:
        base: Values by part.
        new: Those of the other side.
        margin: A larger difference counts.
    """
    logarithmic = min(min(map(min, base.values())), min(map(min, new.values()))) > 0
    scaled = [
        {part: np.log(own) if logarithmic else np.array(own) for part, own in side.items()}
        for side in (base, new)
    ]
    one, other = ({part: float(own.mean()) for part, own in side.items()} for side in scaled)
    same_part = len(one) == 1 and set(one) == set(other)
    pairs = set(one) == set(other) and len(one) > LEAST_FREEDOM
    if pairs:
        apart = np.array([other[part] - one[part] for part in one])
        sides = [np.array(list(one.values())), np.array(list(other.values()))]
        n, freedom = len(apart), len(apart) - 1
        error = float(apart.std(ddof=1)) / math.sqrt(n)
    else:
        samples = (
            [next(iter(side.values())) for side in scaled]
            if same_part
            else [np.array(list(side.values())) for side in (one, other)]
        )
        sides = samples
        freedom = sum(len(own) for own in sides) - 2
        error = _two_samples(sides)
    middles = [float(own.mean()) for own in sides]
    before, after = (math.exp(middle) if logarithmic else middle for middle in middles)
    shown = Shown(before, after, paired_by="part" if pairs else "nothing")
    if freedom < LEAST_FREEDOM:
        why = FEW.format(base=len(one), new=len(other))
        if same_part:
            why = f"{freedom + 2} sessions are too few to show how far sessions scatter"
        return replace(shown, difference=after - before, why=why)
    found = Difference(middles[1] - middles[0], error, freedom, math.inf, freedom + 1)
    return _back(shown, found, margin) if logarithmic else _tested(shown, found, margin)


def _two_samples(sides: Sequence[np.ndarray]) -> float:
    """Standard error of the difference of two means, both sides scattering alike."""
    squares = sum(float(np.sum((own - own.mean()) ** 2)) for own in sides)
    freedom = max(sum(len(own) for own in sides) - 2, 1)
    return math.sqrt(squares / freedom * sum(1 / len(own) for own in sides))


def _back(shown: Shown, found: Difference, margin: float) -> Shown:
    """A difference of logarithms in the unit of the metric, from the geometric mean of the base."""
    half = float(stdtrit(found.freedom, (1 + CONFIDENCE) / 2)) * found.error
    ends = [shown.base * math.expm1(found.mean + sign * half) for sign in (-1, 1)]
    share = margin / shown.base
    margins = math.log1p(share), -math.log1p(-share) if share < 1 else math.inf
    return replace(
        shown,
        difference=shown.new - shown.base,
        ci95=(ends[0], ends[1]),
        error=shown.new * found.error,
        freedom=found.freedom,
        p=p_values(found.mean, found.error, found.freedom, margins),
    )


def _with_truth(shown: Shown, base: Side, new: Side, metric: Metric, margin: float) -> Shown:
    """With how far the truths of two arms may be off, which no scatter of errors shows."""
    if shown.difference is None or shown.error is None:
        return shown
    stated = [_expanded(side, key_of(metric)) for side in (base, new)]
    if None in stated:
        why = "how far the truths of both arms may be off is not known"
        return replace(shown, p=None, why=why)
    own = math.hypot(*(value / 2 for value in stated if value is not None))
    error = math.hypot(shown.error, own)
    found = Difference(shown.difference, error, shown.freedom, math.inf, shown.freedom)
    return _tested(shown, found, margin)


def _expanded(side: Side, key: Key) -> float | None:
    """The largest expanded uncertainty of the truth that a side's sessions state of a metric."""
    known = [
        m.expanded_uncertainty
        for one in side.judged
        for m in one.evaluation.metrics
        if key_of(m) == key
    ]
    values = [value for value in known if value is not None]
    return max(values) if values and len(values) == len(known) else None


def by_errors(metric: Metric) -> bool:
    """Whether one session a side shows the difference of a metric."""
    return metric.name.rpartition(".")[2] in BY_ERRORS
