"""A session in short: what it answers, and each limit as a case."""

from __future__ import annotations

from typing import Literal

from testbench.records.results.answer import answers, known_to, limits_of
from testbench.records.results.evaluation import NO_LIMITS, Evaluation, Metric, Outcome
from testbench.records.session.session import Session
from testbench.reporting.summaries.summary import Case, Summary

COLUMNS = ["metric", "filter", "section", "value", "limit", "outcome"]
COUNTED: dict[Outcome, Literal["passed", "failed"]] = {
    Outcome.PASS: "passed",
    Outcome.MARGINAL: "passed",
    Outcome.FAIL: "failed",
    Outcome.NOT_MEASURED: "failed",
}
"""As the exit code has them: a marginal value breaks no limit."""


def session_summary(session: Session, evaluation: Evaluation) -> Summary:
    """A session in short.

    Args:
        session: The recording.
        evaluation: Of it.
    """
    limited = [metric for metric in evaluation.metrics if metric.outcome is not None]
    manifest = session.manifest
    facts = {"session": session.name, "simulated": " and ".join(session.simulated) or "nothing"}
    return Summary(
        title=manifest.protocol.name or session.name,
        verdict=evaluation.verdict,
        sentences=[answer.text for answer in answers(evaluation)],
        columns=COLUMNS,
        rows=[_row(metric) for metric in limited],
        cases=[_case(metric) for metric in limited]
        or [Case("limits", "skipped", f"{NO_LIMITS[:1].upper()}{NO_LIMITS[1:]}.")],
        facts=facts,
        started=manifest.started_utc or "",
        seconds=manifest.duration_s or 0.0,
    )


def _row(metric: Metric) -> list[str]:
    value = known_to(metric.value, metric.expanded_uncertainty, metric.unit)
    found = metric.outcome.words if metric.outcome else ""
    where = [metric.name, metric.filter or "", metric.section or ""]
    return [*where, value, limits_of(metric), found]


def _case(metric: Metric) -> Case:
    place = ", ".join(part for part in (metric.filter, metric.sequence, metric.section) if part)
    *_, value, limit, found = _row(metric)
    message = f"{value}; limit {limit}: {found}"
    return Case(
        f"{metric.name} [{place}]", COUNTED[metric.outcome or Outcome.NOT_MEASURED], message
    )
