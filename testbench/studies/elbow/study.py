"""The study `reference-1`: sensors at rest, calibration, and the elbow's flexion, beside
Castellanos Alonso 2023.
"""

from __future__ import annotations

from testbench.pipeline.analyse import Result
from testbench.records.results.study import StudyRecord, StudyTable
from testbench.records.specs.published import load_published, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.elbow.calibration import calibration_table, example_table
from testbench.studies.elbow.flexion import (
    flexion_curves,
    flexion_table,
    growth_table,
    heading_fit,
    heading_table,
    noise_table,
    rest_table,
)
from testbench.studies.elbow.misalignment import FILTERS, misalignment_study
from testbench.studies.result import StudyResult

QUESTION = (
    "How well do two kinds of inertial sensors measure an elbow's flexion that a robot arm plays, "
    "calibrated and not, by several filters and Euler sequences, and what does misalignment do to "
    "it?"
)
REST, TABLES, CHECK, ELBOW = "static_noise", "elbow_tables", "calibration_check", "elbow_flexion"
TABLE_FILTERS = ("device", "imufilter", "ecompass", "triad")
GROWN_DEG = 20.0
"""Misalignment at which the growth with flexion is shown: the largest of the protocol."""


def run(bench: StudyBench) -> StudyRecord:
    """Run the four protocols and compute the tables."""
    started = bench.now()
    rest, tables, check = bench.run(REST), bench.run(TABLES, TABLE_FILTERS), bench.run(CHECK)
    elbow = bench.run(ELBOW, FILTERS)
    bench.say("calibrations, theory and tables")
    ours = {
        "rest": rest.session.name,
        "tables 5.4 and 5.5": f"{tables.session.name}, evaluated by {check.session.name}",
        "tables 5.6 to 5.10": tables.session.name,
        "misalignment": elbow.session.name,
    }
    result = compare(rest, tables, check, elbow)
    sessions = [str(each.session.path) for each in (rest, tables, check, elbow)]
    settings = {
        "protocols": ", ".join((REST, TABLES, CHECK, ELBOW)),
        "seed": bench.seed,
        "parts": 1,
    }
    trace = "; ".join(f"{what}: {session}" for what, session in ours.items())
    title = "An elbow played by a robot arm"
    return result.record(
        "reference-1", title, QUESTION, started, settings, sessions, f"Of {trace}."
    )


def compare(rest: Result, tables: Result, check: Result, elbow: Result) -> StudyResult:
    """All tables, from runs of the four protocols with the same seed.

    Args:
        rest: Of static_noise.
        tables: Of elbow_tables.
        check: Of calibration_check.
        elbow: Of elbow_flexion.
    """
    published, static = load_published(), load_published_tables("reference_1_static")
    theory = misalignment_study(session=elbow.session, evaluation=elbow.evaluation)
    growth = growth_table(elbow, GROWN_DEG)
    flexion = flexion_table(tables.evaluation, published)
    calibration = calibration_table(tables.session, check.session, published)
    first = (
        noise_table(rest.evaluation, static),
        rest_table(rest.session, rest.evaluation, static),
        calibration,
        example_table(static),
        flexion,
        heading_table(published),
        growth,
    )
    curves = (flexion_curves(tables.evaluation, published), *theory.curves)
    return StudyResult(
        published.source,
        _findings(calibration, flexion, growth, theory),
        (*first, *theory.tables),
        curves,
        theory.surfaces,
    )


# One piece: five sentences and the numbers in them.
def _findings(
    calibration: StudyTable, flexion: StudyTable, growth: StudyTable, theory: StudyResult
) -> tuple[str, ...]:
    def worst(published_method: bool) -> float:
        return max(
            float(row.values[-1] or 0.0)
            for row in calibration.rows
            if bool(row.published) == published_method
        )

    means = [float(row.values[-1] or 0.0) for row in flexion.rows]
    last = {row.label: f"{float(row.values[-2] or 0.0):.2f}" for row in growth.rows}
    theirs = [float(row.published[-1] or 0.0) for row in flexion.rows if row.published]

    def at_the_end(sequence: str) -> str:
        measured = {
            label.partition(", ")[2]: value
            for label, value in last.items()
            if label.startswith(sequence)
        }
        return ", ".join(
            f"{value} deg by {name}" for name, value in measured.items() if name != "theory"
        )

    theirs_mg = max(float(row.published[-1] or 0.0) for row in calibration.rows if row.published)
    model = heading_fit(load_published())
    fit = next(row for row in theory.table("fits").rows if row.label == "70 deg")
    calibrated = (
        "Calibrated by the published map R = A' pinv(B'), an accelerometer is off by up to "
        f"{worst(True):.1f} mg in poses that it has not seen (published: {theirs_mg:g} mg); with a "
        f"bias in the model by up to {worst(False):.2f} mg in the axes it covers."
    )
    aligned = (
        f"Aligned in a reference pose, the mean |error| of the flexion is {min(means):.2f} to "
        f"{max(means):.2f} deg, by filter and sequence; the published means reach from "
        f"{min(theirs):.2f} to {max(theirs):.2f} deg."
    )
    modelled = (
        "The published growth by YXZ (table 5.7) is consistent with two sensors "
        f"{model.heading_deg:.1f} deg apart in heading on an elbow that starts at "
        f"{model.offset_deg:.1f} deg: these two, fitted to its fifteen values, leave "
        f"{model.rms_deg:.2f} deg RMS and {model.largest_deg:.2f} deg at most."
    )
    grown = (
        f"Misaligned by {GROWN_DEG:g} deg and flexed by 70 deg, YXZ is wrong by "
        f"{last['YXZ, theory']} deg in theory, {at_the_end('YXZ')}; ZXZ is wrong by "
        f"{at_the_end('ZXZ')}."
    )
    fitted = (
        f"Theory at 70 deg: a = {fit.values[0]:.5f} and c = {fit.values[4]:.4f}, published "
        f"{fit.published[0]} and {fit.published[4]}."
    )
    return calibrated, aligned, modelled, grown, fitted
