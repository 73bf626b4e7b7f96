"""The study `reference-5` of the user's own protocol or recording: each joint by each state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.model.statistics.spread import Change
from testbench.pipeline.analyse import Result
from testbench.records.results.study import (
    StudyCurve,
    StudyCurves,
    StudyRecord,
    StudyRow,
    StudyTable,
)
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published_chain import load_published_chain
from testbench.studies.bench import StudyBench
from testbench.studies.chain import words
from testbench.studies.chain.comparison import FOURIER, KINEMATIC

PROTOCOL = "gait"
SHOWN_SAMPLES = 400
"""Of a curve over time, about."""
LISTED = 8
"""Joints that are drawn."""


def own_study(bench: StudyBench) -> StudyRecord:
    """Ask the user's protocol or recording what it says of each joint.

    Args:
        bench: With the user's data.

    Raises:
        InputError: The data ask for no joints of a chain, or these cannot be estimated; says why.
    """
    started = bench.now()
    results = bench.results(PROTOCOL)
    first = results[0]
    missing = []
    if not first.estimate.chain:
        told = [found.sentence for found in first.estimate.findings if "chain" in found.where]
        missing = told or ["estimate.chain: the joints of a model and the sensors on its links"]
    bench.refuse_without("the chain", missing)
    judged = bool(first.evaluation.chain)
    tables = [errors_table(results)] if judged else [angles_table(results)]
    if judged and len(results) > 1 and _both(results):
        tables.append(states_of(results))
    return StudyRecord(
        "reference-5",
        "A Kalman filter over a kinematic chain",
        words.QUESTION,
        load_published_chain().source,
        started,
        bench.settings(PROTOCOL),
        tuple(str(result.session.path) for result in results),
        _said(results, judged),
        tuple(tables),
        (),
        software_versions(),
        tuple(_curves(first)),
    )


def _both(results: Sequence[Result]) -> bool:
    states = {one.state for one in results[0].estimate.chain}
    return {KINEMATIC, FOURIER} <= states


def errors_table(results: Sequence[Result]) -> StudyTable:
    """Errors of each joint by each state, over the parts.

    Args:
        results: One a part, with a truth.
    """
    rows = []
    for row in results[0].evaluation.chain:
        own = [
            other
            for result in results
            for other in result.evaluation.chain
            if (other.section, other.joint, other.state) == (row.section, row.joint, row.state)
        ]
        cells = [
            [getattr(other, kind) for other in own]
            for kind in ("mean_error_deg", "rmse_deg", "uncertainty_deg", "covered_percent")
        ]
        spread = tuple(float(np.std(c, ddof=1)) if len(c) > 1 else None for c in cells)
        label = f"{row.section}, {row.joint}, {row.state}"
        values = tuple(float(np.mean(cell)) for cell in cells)
        rows.append(StudyRow(label, values, spread=spread))
    return StudyTable(
        "joints",
        "Errors of each joint by each state of the filter",
        ("signed mean [deg]", "RMS [deg]", "stated uncertainty [deg]", "covered [%]"),
        tuple(rows),
        "How to read: against the truth of the recording; covered are the errors within 1.96 of "
        "the uncertainty that the filter states, 95 is honest.",
        decimals=(3, 3, 3, 0),
        short="Joints",
        spread=words.OVER_PARTS if len(results) > 1 else "",
    )


def angles_table(results: Sequence[Result]) -> StudyTable:
    """Range of each joint by each state where there is no truth.

    Args:
        results: One a part.
    """
    rows = []
    for one in results[0].estimate.chain:
        degrees, sd = np.degrees(one.mean[:, 0]), np.degrees(one.sd[:, 0])
        for i, joint in enumerate(one.joints):
            low, high = np.percentile(degrees[:, i], [2.5, 97.5])
            known = float(np.sqrt(np.mean(sd[:, i] ** 2)))
            label = f"{one.section}, {joint}, {one.state}"
            rows.append(StudyRow(label, (float(low), float(high), known)))
    return StudyTable(
        "joints",
        "Range of each joint by each state of the filter; there is no truth",
        ("2.5 % [deg]", "97.5 % [deg]", "stated uncertainty [deg]"),
        tuple(rows),
        "How to read: nothing judges these angles; the uncertainty is the filter's own.",
        decimals=(1, 1, 2),
        short="Joints",
    )


def states_of(results: Sequence[Result]) -> StudyTable:
    """The two states side by side over the parts.

    Args:
        results: One a part, with a truth and both states.
    """
    rows = []
    for row in results[0].evaluation.chain:
        if row.state != FOURIER:
            continue
        pair = [
            [
                other.rmse_deg
                for result in results
                for other in result.evaluation.chain
                if (other.section, other.joint, other.state) == (row.section, row.joint, state)
            ]
            for state in (FOURIER, KINEMATIC)
        ]
        change = Change.of(*pair)
        low, high = change.interval or (None, None)
        values = (change.percent, low, high, change.verdict)
        rows.append(StudyRow(f"{row.section}, {row.joint}", values))
    return StudyTable(
        "states",
        words.STATES_CAPTION.replace(", motion by motion", ""),
        ("change [%]", "from [%]", "to [%]", "shown"),
        tuple(rows),
        words.STATES_HOW,
        decimals=(1, 1, 1, 0),
        short="Fourier or kinematic",
        spread=words.INTERVAL,
    )


def _said(results: Sequence[Result], judged: bool) -> tuple[str, ...]:
    said = []
    for one in results[0].estimate.chain:
        if judged:
            rows = [row for row in results[0].evaluation.chain if row.state == one.state]
            values = [row.rmse_deg for row in rows]
            said.append(
                f"{one.section}, {one.state} state: RMS of {min(values):.2f} to "
                f"{max(values):.2f} deg over {len(values)} joints."
            )
        if one.facts.get("lost", False):
            said.append(f"{one.section}, {one.state} state: the filter says that it is lost.")
    if not judged:
        said.append("There is no truth: no angle is judged.")
    return tuple(said)


def _curves(result: Result) -> list[StudyCurves]:
    """The joints that move most, by each state."""
    found = []
    chain = result.estimate.chain
    order = np.argsort(-np.ptp(chain[0].mean[:, 0], axis=0))[:LISTED]
    for i in order:
        joint, curves = chain[0].joints[i], []
        for one in chain:
            if one.section != chain[0].section or joint not in one.joints:
                continue
            rows = np.arange(0, len(one.mean), max(len(one.mean) // SHOWN_SAMPLES, 1))
            seconds = (one.host_time_ns[rows] - one.host_time_ns[0]) / 1e9
            angle = np.degrees(one.mean[rows, 0, one.joints.index(joint)])
            curves.append(StudyCurve(one.state, seconds, angle, "line"))
        found.append(StudyCurves(joint, "time [s]", "angle [deg]", tuple(curves), words.ANGLES_HOW))
    return found
