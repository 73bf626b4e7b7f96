"""What a session answers, in sentences: how large an error is, how sure that is, and whether it is
good enough.

The first screen of a report and the end of a command say them alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt
from statistics import fmean

from testbench.records.results.evaluation import Evaluation, Metric, Outcome
from testbench.records.results.evaluation_rows import MEAN_SQUARE, RankRow
from testbench.records.results.numbers import decimals_by
from testbench.records.results.session_comparison import ComparedMetric

HEADLINE = "flexion_mean_abs_error_deg"
"""The metric of a joint's section that is told where no limit is stated."""
UNSEEN_DEG, UNSEEN_SHARE = 5.0, 0.2
"""An orientation that is wrong by more than the first [deg], and by an angle that shows less than
the second share of it, is wrong in a way that the angle does not see.
"""
MOST_SENSORS = 3
"""Orientations of more sensors are told in one sentence."""
QUANTITIES = {"flexion": "flexion", "total": "orientation"}
MEASURES = {
    "mean_abs_error_deg": "mean error",
    "mean_error_deg": "mean error",
    "median_error_deg": "median error",
    "rmse_deg": "RMS error",
    "iqr_deg": "interquartile range of the error",
    "p95_abs_error_deg": "95th percentile of the error",
    "p95_error_deg": "95th percentile of the error",
    "max_abs_error_deg": "largest error",
    "latency_ms": "delay",
    "convergence_s": "settling time",
}
"""What the end of a metric's name means, in the field's words."""
SIGNED = ("flexion", "heading")
"""Quantities whose mean error has a sign."""


@dataclass(frozen=True)
class Answer:
    """One sentence of what was found.

    Attributes:
        text: The sentence.
        outcome: Of the limit that it tells of; None where it tells of none.
    """

    text: str
    outcome: Outcome | None = None


def answers(evaluation: Evaluation) -> list[Answer]:
    """What a session answers: each limit, what the limits speak of, then what has none.

    Args:
        evaluation: Of the session.
    """
    limited = [metric for metric in evaluation.metrics if metric.outcome is not None]
    told = [Answer(_limit(metric), metric.outcome) for metric in limited]
    if limited:
        told.append(Answer(_scope(evaluation, limited)))
    told += [Answer(text) for text in _chains(evaluation)]
    told += [Answer(text) for text in _unlimited(evaluation, limited)]
    return told + [Answer(text) for text in _unseen(evaluation)]


def known_to(value: float | None, expanded: float | None, unit: str) -> str:
    """A value beside the uncertainty of the truth, to two significant digits of that.

    Args:
        value: In the unit; None where it could not be measured.
        expanded: Its expanded uncertainty (95 %), in the unit; None where it is not known.
        unit: Of both.
    """
    if value is None:
        return "not measured"
    return f"{_rounded(value, expanded)} {unit}, {_sure(expanded, unit)}"


def _rounded(value: float, expanded: float | None) -> str:
    """A value to two digits of its uncertainty, or of itself where that is not known."""
    decimals = decimals_by(expanded)
    if decimals is None:
        decimals = decimals_by(abs(value)) or 0
    return f"{value:.{decimals}f}"


def _sure(expanded: float | None, unit: str) -> str:
    """How well a value is known, in words."""
    if decimals_by(expanded) is None or expanded is None:
        return "its uncertainty is not known"
    return f"known to ± {_rounded(expanded, expanded)} {unit}"


def _limit(metric: Metric) -> str:
    """A metric that has a limit, and whether it keeps it."""
    found = metric.outcome.words if metric.outcome else ""
    value = known_to(metric.value, metric.expanded_uncertainty, metric.unit)
    return f"{subject(metric, metric.filter)} {value}; limit {limits_of(metric)}: {found}."


def limits_of(metric: Metric) -> str:
    """What a metric is held against, in words.

    Args:
        metric: That has a limit.
    """
    bounds = [
        f"{words} {limit:g} {metric.unit}"
        for words, limit in (("at least", metric.lower), ("at most", metric.upper))
        if limit is not None
    ]
    return " and ".join(bounds)


def subject(metric: Metric | ComparedMetric, by: str | None) -> str:
    """Which angle of what, by which filter and where, and what is told of it.

    Args:
        metric: That is told.
        by: The filter; None where none is named.
    """
    owner, _, name = metric.name.rpartition(".")
    quantity, _, measure = name.partition("_")
    what = QUANTITIES.get(quantity, quantity)
    where = ", ".join(part for part in (metric.sequence, metric.section) if part)
    signed = measure == "mean_error_deg" and quantity in SIGNED
    told = ("signed " if signed else "") + MEASURES.get(measure, measure.replace("_", " "))
    return (
        f"{what[:1].upper()}{what[1:]} of {owner}{f' by {by}' if by else ''}"
        f"{f' ({where})' if where else ''}: {told}"
    )


def _scope(evaluation: Evaluation, limited: Sequence[Metric]) -> str:
    """How many limits are kept, and of how many filters they speak."""
    kept = sum(metric.outcome is Outcome.PASS for metric in limited)
    ran = list(
        dict.fromkeys(
            [row.filter for row in evaluation.orientation]
            + [row.filter for row in evaluation.joint_angle]
        )
    )
    with_limit = [name for name in ran if name in {metric.filter for metric in limited}]
    said = f"{kept} of {len(limited)} {'limit' if len(limited) == 1 else 'limits'} kept"
    if not with_limit:
        return f"{said}."
    without = [name for name in ran if name not in with_limit]
    if not without:
        return f"{said}, of all {len(ran)} filters."
    return (
        f"{said}, of {len(with_limit)} of {len(ran)} filters ({listed(with_limit)}); "
        f"{listed(without)} {'has' if len(without) == 1 else 'have'} none."
    )


def headline_metrics(evaluation: Evaluation) -> list[Metric]:
    """What is told first of a session: the error of each joint's section by each filter, of each
    sensor where there is no joint.

    Args:
        evaluation: Of the session.
    """
    own_sequence = {row.joint: row.sequence for row in reversed(evaluation.joint_angle)}
    return [
        metric
        for metric in evaluation.metrics
        if metric.value is not None and _is_headline(metric, own_sequence)
    ]


def _unlimited(evaluation: Evaluation, limited: Sequence[Metric]) -> list[str]:
    """The errors of each joint's section, and of each sensor where there is no joint."""
    done = {(metric.name, metric.section) for metric in limited}
    metrics = [
        metric
        for metric in headline_metrics(evaluation)
        if (metric.name, metric.section) not in done
    ]
    owners = list(dict.fromkeys(metric.name.rpartition(".")[0] for metric in metrics))
    if not evaluation.joint_angle and len(owners) > MOST_SENSORS:
        return [_of_sensors(metrics, len(owners))]
    groups: dict[tuple[str, str | None], list[Metric]] = {}
    for metric in metrics:
        groups.setdefault((metric.name, metric.section), []).append(metric)
    return [
        _range(evaluation, name.rpartition(".")[0], section, own)
        for (name, section), own in groups.items()
    ]


def _of_sensors(metrics: Sequence[Metric], sensors: int) -> str:
    """The smallest and the largest orientation error of many sensors."""
    by_error = sorted(metrics, key=lambda metric: metric.value or 0.0)
    low, high = (
        f"{known_to(m.value, m.expanded_uncertainty, m.unit)} ({m.name.rpartition('.')[0]} by "
        f"{m.filter})"
        for m in (by_error[0], by_error[-1])
    )
    return f"Orientation of {sensors} sensors: RMS error from {low} to {high}."


def _is_headline(metric: Metric, own_sequence: dict[str, str]) -> bool:
    """Whether it is what is told of a joint, or of a sensor where no joint was evaluated."""
    owner, _, name = metric.name.rpartition(".")
    if own_sequence:
        return name == HEADLINE and metric.sequence == own_sequence.get(owner)
    return name == "total_rmse_deg"


def _range(evaluation: Evaluation, owner: str, section: str | None, own: list[Metric]) -> str:
    """The smallest and the largest error of several filters, and whether they differ."""
    by_error = sorted(own, key=lambda metric: metric.value or 0.0)
    best, worst = by_error[0], by_error[-1]
    known = max((m.expanded_uncertainty or 0.0 for m in own), default=0.0) or None
    if len(own) == 1:
        return f"{subject(best, best.filter)} {known_to(best.value, known, best.unit)}."
    low, high = (_rounded(metric.value or 0.0, known) for metric in (best, worst))
    difference = _difference(evaluation, owner, section, [m.filter or "" for m in by_error])
    return (
        f"{subject(best, None)} {low} {best.unit} ({best.filter}) to {high} {best.unit} "
        f"({worst.filter}), {_sure(known, best.unit)}; {difference}."
    )


def _difference(
    evaluation: Evaluation, owner: str, section: str | None, filters: Sequence[str]
) -> str:
    """Whether filters were shown to differ, by all of their error."""
    ranked = [
        row
        for row in evaluation.ranking
        if (row.owner, row.section, row.sequence, row.criterion)
        == (owner, section, None, MEAN_SQUARE)
        and row.filter in filters
    ]
    if len(ranked) < 2:
        return f"too little was evaluated to rank the {len(filters)} filters"
    first = min(ranked, key=lambda row: row.value)
    alike: list[RankRow] = [
        row for row in ranked if row is first or row.filter in first.no_difference
    ]
    best = listed(row.filter for row in alike)
    if len(alike) == 1:
        said = f"by all of the error ({MEAN_SQUARE}) {best} is best"
    elif len(alike) == len(ranked):
        said = f"by all of the error ({MEAN_SQUARE}) no difference was shown between {best}"
    else:
        said = f"by all of the error ({MEAN_SQUARE}) {best} are best, and not told apart"
    left_out = [name for name in filters if name not in {row.filter for row in ranked}]
    return said + (f"; not ranked: {listed(left_out)}" if left_out else "")


def _chains(evaluation: Evaluation) -> list[str]:
    """The state of each section of a chain filter with the smallest error, RMS over all joints, and
    its worst joint; states are not ranked.
    """
    told = []
    for section in dict.fromkeys(row.section for row in evaluation.chain):
        rows = [row for row in evaluation.chain if row.section == section]
        rms = {
            state: sqrt(fmean(row.rmse_deg**2 for row in rows if row.state == state))
            for state in dict.fromkeys(row.state for row in rows)
        }
        best, other = min(rms, key=rms.__getitem__), max(rms, key=rms.__getitem__)
        own = [row for row in rows if row.state == best]
        worst = max(own, key=lambda row: row.rmse_deg)
        known = (
            max((row.expanded_uncertainty_magnitude_deg or 0.0 for row in own), default=0.0) or None
        )
        of = "one joint angle" if len(own) == 1 else f"{len(own)} joint angles"
        said = f"Chain filter in {section} ({best} state): RMS error of {of} "
        said += known_to(rms[best], known, "deg")
        if len(own) > 1:
            said += f"; the worst is {worst.joint} with {_rounded(worst.rmse_deg, known)} deg"
        if other != best:
            said += f"; the {other} state has {_rounded(rms[other], known)} deg, "
            said += "which was not tested against it"
        told.append(f"{said}.")
    return told


def _unseen(evaluation: Evaluation) -> list[str]:
    """Filters whose orientation is wrong in a way that a joint's angle does not see."""
    told = []
    for joint in dict.fromkeys(row.joint for row in evaluation.joint_angle):
        own = [row for row in evaluation.joint_angle if row.joint == joint]
        flexion: dict[str, float] = {}
        for row in own:
            if row.sequence == own[0].sequence:
                flexion[row.filter] = max(flexion.get(row.filter, 0.0), row.flexion_rmse_deg)
        total: dict[str, float] = {}
        for ranked in evaluation.ranking:
            if (ranked.owner, ranked.sequence, ranked.criterion) == (joint, None, MEAN_SQUARE):
                total[ranked.filter] = max(total.get(ranked.filter, 0.0), ranked.value)
        hidden = [
            name
            for name, error in total.items()
            if error > UNSEEN_DEG and flexion.get(name, error) < UNSEEN_SHARE * error
        ]
        if hidden:
            worst = max(total[name] for name in hidden)
            told.append(
                f"The flexion of {joint} does not see all: as an orientation, {listed(hidden)} "
                f"{'is' if len(hidden) == 1 else 'are'} wrong by up to {worst:.0f} deg (RMS)."
            )
    return told


def listed(names: Iterable[str]) -> str:
    """Names as a sentence has them: a, b and c."""
    names = list(names)
    return ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + "".join(names[-1:])
