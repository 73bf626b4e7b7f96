"""The study `reference-1`: sensors at rest, calibration, and the elbow's flexion, beside
Castellanos Alonso 2023.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from testbench.estimation.filters import get_filter
from testbench.pipeline.analyse import Result, examine
from testbench.pipeline.request import AnalysisRequest
from testbench.records.results.study import StudyRecord, StudyTable
from testbench.records.specs.published import (
    PublishedResults,
    load_published,
    load_published_tables,
)
from testbench.studies.bench import StudyBench
from testbench.studies.elbow.calibration import (
    Calibrated,
    calibrated,
    calibration_table,
    example_table,
    matrix_table,
    one_pose,
    orthogonality_table,
)
from testbench.studies.elbow.conclusions import Evidence, conclusions_table
from testbench.studies.elbow.distribution import (
    distribution_curves,
    distribution_table,
    pooled_errors,
)
from testbench.studies.elbow.evidence import (
    OF_FIELD,
    carried_table,
    field_reasons,
    field_table,
    rate_table,
)
from testbench.studies.elbow.flexion import (
    TUNED,
    flexion_curves,
    flexion_table,
    growth_table,
    noise_table,
    rest_table,
    steadiness_table,
)
from testbench.studies.elbow.misalignment import misalignment_study
from testbench.studies.elbow.models import heading_table, tilt_table
from testbench.studies.elbow.own import WANTED, own_study
from testbench.studies.elbow.signals import angle_curves, calibration_curves, rest_curves
from testbench.studies.parts import number_with, over_parts
from testbench.studies.result import StudyResult

QUESTION = (
    "How well do two kinds of inertial sensors measure an elbow's flexion that a robot arm plays, "
    "calibrated and not, by several filters and Euler sequences, and what does misalignment do to "
    "it?"
)
TITLE = "An elbow played by a robot arm"
REST, TABLES, CHECK, ELBOW = "static_noise", "elbow_tables", "calibration_check", "elbow_flexion"
DISTURBED, RATES, TURNS = "elbow_disturbed", "elbow_rates", "orthogonality"
PROTOCOLS = {
    REST: None,
    TABLES: ("device", TUNED, "ecompass", "triad"),
    CHECK: None,
    ELBOW: ("device", "vqf_6d", "triad"),
    DISTURBED: OF_FIELD,
    RATES: None,
    TURNS: None,
}
"""Each with the filters that it runs; its own if None."""
GROWN_DEG = 20.0
"""Misalignment at which the growth with flexion is shown: the largest of the protocol."""


@dataclass(frozen=True)
class Runs:
    """What every part went through.

    Attributes:
        of: By protocol, one result a part.
        untuned: Of elbow_tables once more, imufilter with MATLAB's defaults.
    """

    of: dict[str, list[Result]]
    untuned: list[Result]

    def each(self, protocol: str, make: Callable[[Result], StudyTable]) -> StudyTable:
        """A table of every part of one protocol, as one."""
        return over_parts([make(result) for result in self.of[protocol]])


def run(bench: StudyBench) -> StudyRecord:
    """Run the protocols and compute the tables, or ask the user's recording or protocol."""
    started = bench.now()
    if bench.own:
        return _own(bench, started)
    of = bench.results_of(PROTOCOLS)
    bench.say("calibrations, theory and tables")
    runs = Runs(of, [_untuned(result) for result in of[TABLES]])
    result = compare(runs)
    sessions = [str(each.session.path) for several in of.values() for each in several]
    settings = {"protocols": ", ".join(PROTOCOLS), "seed": bench.seed, "parts": bench.parts}
    trace = "; ".join(
        f"{name}: {', '.join(each.session.name for each in several)}"
        for name, several in of.items()
    )
    return result.record(
        "reference-1", TITLE, QUESTION, started, settings, sessions, f"Of {trace}."
    )


def _own(bench: StudyBench, started: str) -> StudyRecord:
    """The same questions of the user's data, as far as they can be asked."""
    results = bench.results(TABLES)
    found = own_study(results, load_published().source)
    bench.refuse_without("the study", () if found.tables else WANTED)
    sessions = [str(result.session.path) for result in results]
    settings = bench.settings(TABLES)
    return found.record("reference-1", TITLE, QUESTION, started, settings, sessions)


def _untuned(result: Result) -> Result:
    """The same session with imufilter as MATLAB has it."""
    asked = AnalysisRequest(
        filters=(TUNED,), parameters={TUNED: dict(get_filter(TUNED).parameters)}
    )
    return examine(result.session, asked)


# One piece: the tables in their order.
def compare(runs: Runs) -> StudyResult:
    """All tables."""
    published, static = load_published(), load_published_tables("reference_1_static")
    found = [
        calibrated(tables.session, check.session)
        for tables, check in zip(runs.of[TABLES], runs.of[CHECK], strict=True)
    ]
    elbow = runs.of[ELBOW][0]
    theory = misalignment_study(session=elbow.session, evaluation=elbow.evaluation)
    both = list(zip(runs.of[TABLES], runs.untuned, strict=True))
    flexion = over_parts(
        [flexion_table(own.evaluation, other.evaluation, published) for own, other in both]
    )
    field = over_parts(
        [
            field_table(calm, disturbed)
            for calm, disturbed in zip(runs.of[TABLES], runs.of[DISTURBED], strict=True)
        ]
    )
    field = replace(field, reasons=field_reasons(field))
    growth = runs.each(ELBOW, lambda result: growth_table(result, GROWN_DEG))
    conclusions = conclusions_table(Evidence(runs.of[TABLES], runs.untuned, found))
    errors = pooled_errors(runs.of[TABLES], "elbow")
    tables = (
        conclusions,
        runs.each(REST, lambda result: noise_table(result.evaluation, static)),
        runs.each(REST, lambda result: rest_table(result.session, result.evaluation, static)),
        over_parts([calibration_table(each, published) for each in found]),
        matrix_table(found[0], static),
        example_table(static),
        runs.each(TURNS, lambda result: orthogonality_table(result.session, static)),
        flexion,
        over_parts([steadiness_table(own.evaluation, other.evaluation) for own, other in both]),
        heading_table(published),
        tilt_table(published),
        field,
        growth,
        runs.each(ELBOW, carried_table),
        distribution_table(errors, "elbow"),
        runs.each(RATES, rate_table),
    )
    curves = (
        flexion_curves(flexion, published),
        *distribution_curves(errors, "elbow"),
        *rest_curves(runs.of[REST][0]),
        *calibration_curves(found[0]),
        *angle_curves(elbow),
        *theory.curves,
    )
    return StudyResult(
        published.source,
        _findings(found, published, conclusions, growth, theory),
        (*tables, *theory.tables),
        curves,
        theory.surfaces,
    )


# One piece: the sentences and the numbers in them.
def _findings(
    found: Sequence[list[Calibrated]],
    published: PublishedResults,
    conclusions: StudyTable,
    growth: StudyTable,
    theory: StudyResult,
) -> tuple[str, ...]:
    by_verdict: dict[str, list[str]] = {}
    for row in conclusions.rows:
        by_verdict.setdefault(str(row.values[0]), []).append(row.label)
    counted = ", ".join(f"{len(names)} {verdict}" for verdict, names in by_verdict.items())
    said = [f"Of {len(conclusions.rows)} conclusions of the source {counted}; the first table."]
    worst = {
        each.label: number_with([float(one_pose(part[i])[6] or 0.0) for part in found])
        for i, each in enumerate(found[0])
        if each.settings == "published" and each.dimension == "3D"
    }
    theirs = {
        row.sensor: max(row.bias_mg)
        for row in published.calibration_bias
        if row.method.startswith("3D")
    }
    said.append(
        "By the source's own definition, one pose with the main axis up, the worst bias left by R "
        "= A' pinv(B') in 3D is "
        + " and ".join(
            f"{value} mg ({label.split(', ')[1]}, published {theirs[label.split(', ')[1]]:g} mg)"
            for label, value in worst.items()
        )
        + "."
    )
    last = {
        row.title: number_with([float(row.values[-2] or 0.0)])
        for row in growth.rows
        if "theory" not in row.label
    }
    said.append(
        f"Misaligned by {GROWN_DEG:g} deg and flexed by 70 deg: "
        + ", ".join(f"{label} {value} deg" for label, value in last.items())
        + "; YXZ by theory "
        f"{float(growth.rows[0].values[-2] or 0.0):.2f} deg, ZXZ none."
    )
    fit = next(row for row in theory.table("fits").rows if row.label == "70 deg")
    said.append(
        f"Theory at 70 deg: a = {fit.values[0]:.5f} and c = {fit.values[6]:.4f}, published "
        f"{fit.published[0]} and {fit.published[6]}."
    )
    return tuple(said)
