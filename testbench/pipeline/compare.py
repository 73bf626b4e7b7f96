"""Compare sessions: whether errors became larger from one side to the other, and what differs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.evaluation import evaluate
from testbench.evaluation.comparable import differing
from testbench.evaluation.overlay import overlays
from testbench.evaluation.paired_errors import Judged
from testbench.evaluation.repeatability import content_of, key_of
from testbench.evaluation.session_differences import Side, compare_metrics, value_of
from testbench.evaluation.verdict import has_sign
from testbench.exceptions import InputError, NotFoundError
from testbench.pipeline.kept_estimate import estimate_of
from testbench.pipeline.loaded_analysis import LoadedAnalysis, load_analysis
from testbench.pipeline.request import AnalysisRequest, CompareRequest
from testbench.pipeline.sides import sides_of
from testbench.pipeline.summaries import refuse_no_folder, write_summaries
from testbench.records.findings.finding import Finding
from testbench.records.results.answer import headline_metrics
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Metric
from testbench.records.results.session_comparison import ComparedSession, SessionComparison
from testbench.records.session.parts import part_of
from testbench.records.session.session import Session

ONE_A_SIDE = (
    "One session a side: what another power-up, mounting or alignment changes is not in the "
    "intervals; several sessions a side would show it."
)
SAME_SAMPLES = "Both sides hold the same samples: what differs is how they were analysed."
STATED = "the same, as was stated"
"""The part of every session where that is known, whatever their manifests tell."""
NO_DIRECTION = "covered_percent"
"""A metric that ends so is neither better nor worse where it is larger."""


@dataclass(frozen=True)
class Compared:
    """What a comparison came to, and where it is written.

    Attributes:
        comparison: The result.
        report: The page; None where none was asked for.
        files: Summaries that were asked for.
    """

    comparison: SessionComparison
    report: Path | None
    files: list[Path] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        written = {"report": str(self.report) if self.report else None}
        return self.comparison.to_dict() | written | {"files": [str(own) for own in self.files]}


def compare(
    base: str | Path,
    *new: str | Path,
    metrics: Iterable[str] = (),
    filters: Iterable[str] = (),
    margin: float = 0.0,
    same_part: bool = False,
) -> SessionComparison:
    """Whether errors became larger from one side of sessions to the other; nothing is written.

    Args:
        base: A session, or a folder of sessions, that is compared with.
        *new: Sessions or folders of sessions, which are the other side together.
        metrics: As `evaluate` spells them, or without the joint or sensor.
        filters: Whose errors are compared; those of all if none.
        margin: A larger difference counts, in the unit of each metric.
        same_part: Whether all sessions have the same sensors, though no manifest tells it.

    Raises:
        InputError: Sessions that were named cannot be compared; says why.
    """
    asked = CompareRequest(
        base=str(base),
        new=tuple(map(str, new)),
        metrics=tuple(metrics),
        filters=tuple(filters),
        margin=margin,
        same_part=same_part,
        write_report=False,
    )
    return compare_sessions(asked).comparison


def compare_sessions(asked: CompareRequest) -> Compared:
    """Carry out a request for a comparison.

    Nothing is written into the sessions.

    Raises:
        InputError: Sessions that were named cannot be compared, a folder holds none that can, or
            nothing was measured on both sides; says why.
        NotFoundError: No such metric or filter.
        SessionError: What was named is no session, or not what was recorded.
    """
    if not asked.margin >= 0:
        raise InputError(f"--margin {asked.margin:g} is no margin: it must be 0 or more")
    report = _report_of(asked)
    refuse_no_folder(report, asked.markdown, asked.junit)
    loaded = load_analysis(AnalysisRequest(calibrations=asked.calibrations))
    base, new, left_out = sides_of(asked)
    judged = [_judged(side, loaded) for side in (base, new)]
    comparison = _compared(asked, judged, left_out)
    page = None
    if report is not None:
        from testbench.reporting.comparison_report import comparison_report

        page = comparison_report(comparison, report)
    return Compared(comparison, page, write_summaries(comparison, asked.markdown, asked.junit))


def _report_of(asked: CompareRequest) -> Path | None:
    """Where the page is written: as asked for, or beside the first new session."""
    if not asked.write_report:
        return None
    if asked.report is not None:
        return Path(asked.report)
    base, first = (Path(name).resolve() for name in (asked.base, asked.new[0]))
    return first.parent / f"{first.name}_against_{base.name}.html"


def _judged(side: Sequence[Session], loaded: LoadedAnalysis) -> list[tuple[Judged, Estimate]]:
    """Sessions of a side, estimated and evaluated.

    Raises:
        InputError: Of one nothing can be estimated.
    """
    found = []
    for session in side:
        estimated = estimate_of(session, loaded)
        if estimated is None:
            raise InputError(f"{session.path} cannot be compared: nothing can be estimated of it")
        evaluated = evaluate(session, estimated, loaded.settings(session))
        found.append((Judged(session, evaluated), estimated))
    return found


def _compared(
    asked: CompareRequest, judged: Sequence[list[tuple[Judged, Estimate]]], left_out: list[str]
) -> SessionComparison:
    """The comparison of two sides that are judged."""
    first, other = (side[0][0].session for side in judged)
    alone = len(judged[0]) == len(judged[1]) == 1
    alike = alone and content_of(first) == content_of(other)
    stated = STATED if asked.same_part or alike else None
    base, new = (
        Side([one for one, _ in side], [stated or part_of(one.session) for one, _ in side])
        for side in judged
    )
    wanted, missing = _metrics(asked, base, new)
    other_truth = first.has_protocol and len(_arms(base) | _arms(new)) > 1
    notes = [SAME_SAMPLES if alike else ONE_A_SIDE] if alone else []
    rows = compare_metrics(base, new, wanted, asked.margin, other_truth)
    return SessionComparison(
        _described(base),
        _described(new),
        asked.margin,
        rows,
        differing(*judged),
        [*left_out, *missing],
        notes,
        first.simulated,
        overlays(base.judged, new.judged, wanted),
    )


def _arms(side: Side) -> set[str | None]:
    return {one.session.manifest.robot.name for one in side.judged}


def _described(side: Side) -> list[ComparedSession]:
    return [
        ComparedSession(
            one.session.name,
            str(one.session.path),
            part,
            one.session.manifest.recorded_utc or one.session.manifest.started_utc,
        )
        for one, part in zip(side.judged, side.parts, strict=True)
    ]


def _metrics(asked: CompareRequest, base: Side, new: Side) -> tuple[list[Metric], list[str]]:
    """The metrics that are compared, and of which of them not, in sentences.

    Raises:
        NotFoundError: No such metric or filter.
        InputError: Nothing was measured on both sides.
    """
    chosen = _chosen(asked, base.judged[0])
    found, missing = [], []
    every = [*base.judged, *new.judged]
    for metric in chosen:
        key = key_of(metric)
        lacking = [one for one in every if value_of(one, key) is None]
        if lacking:
            missing.append(_missing(metric, lacking))
        else:
            found.append(metric)
    if not found:
        told = " ".join(missing or [_nothing(one) for one in every])
        raise InputError(f"nothing was measured on both sides: {told}")
    return found, missing


def _missing(metric: Metric, lacking: Sequence[Judged]) -> str:
    """That a metric is left out, and why its filter was not judged where that was noticed."""
    place = ", ".join(own for own in (metric.filter, metric.sequence, metric.section) if own)
    names = ", ".join(one.session.name for one in lacking)
    noticed = [
        str(own)
        for own in lacking[0].evaluation.findings
        if own.code.startswith("judged.") and metric.filter in _filters_of(own)
    ]
    why = f": {noticed[0].rstrip('.')}" if noticed else ""
    return f"{metric.name} ({place}) is left out: it is not in {names}{why}."


def _filters_of(found: Finding) -> list[str]:
    """The filters that a finding is of."""
    named = found.values.get("filters", found.values.get("filter"))
    return named if isinstance(named, list) else [str(named)]


def _nothing(judged: Judged) -> str:
    """Why a session has no metric to compare, by what was noticed."""
    notes = judged.evaluation.notes[:2]
    return f"{judged.session.name}: {' '.join(notes) or 'it has no error'}"


def _chosen(asked: CompareRequest, judged: Judged) -> list[Metric]:
    """The metrics of a session that are asked for."""
    evaluation = judged.evaluation
    own = {name: joint.label for name, joint in judged.session.analysis.joints.items()}
    comparable = [
        metric
        for metric in evaluation.metrics
        if metric.value is not None
        and not has_sign(_kind(metric))
        and not metric.name.endswith(NO_DIRECTION)
        and metric.sequence in (None, own.get(metric.name.partition(".")[0]))
    ]
    if asked.metrics:
        known = {name for metric in comparable for name in (metric.name, _kind(metric))}
        for name in asked.metrics:
            if name not in known:
                raise NotFoundError("metric", name, sorted(known))
        comparable = [m for m in comparable if {m.name, _kind(m)} & set(asked.metrics)]
    else:
        first = {key_of(metric) for metric in headline_metrics(evaluation)}
        comparable = [metric for metric in comparable if key_of(metric) in first]
    filters = {metric.filter for metric in comparable}
    for name in asked.filters:
        if name not in filters:
            raise NotFoundError("filter", name, sorted(filter(None, filters)))
    return [m for m in comparable if not asked.filters or m.filter in asked.filters]


def _kind(metric: Metric) -> str:
    return metric.name.rpartition(".")[2]
