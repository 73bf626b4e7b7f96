"""How the errors of the flexion are distributed: histogram, fitted densities, quantiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from testbench.evaluation.flexion import joint_errors
from testbench.pipeline.analyse import Result
from testbench.records.results.study import StudyCurve, StudyCurves, StudyRow, StudyTable
from testbench.records.session.plan import judged_steps

QUANTILES = (2.5, 25.0, 50.0, 75.0, 97.5)
BINS = 40
SHOWN = 0.995
"""Share of the errors that the histogram spans; those beyond would flatten it."""
FEWEST = 50


def pooled_errors(results: Sequence[Result], joint: str) -> dict[str, np.ndarray]:
    """Signed errors of a joint's flexion, all samples of judged steps of all parts together, by
    filter, shape (n,) [deg].

    Args:
        results: Of one protocol or one recording.
        joint: Of its analysis.
    """
    found: dict[str, list[np.ndarray]] = {}
    for result in results:
        errors = joint_errors(
            result.session, joint, result.estimate, judged_steps(result.session.steps)
        )
        if errors is None or not errors.steps:
            continue
        rows = np.concatenate([own for _, own in errors.steps])
        for (name, sequence), error in errors.error.items():
            if sequence == errors.joint.label:
                degrees = np.degrees(error[rows])
                found.setdefault(name, []).append(degrees[np.isfinite(degrees)])
    together = {name: np.concatenate(parts) for name, parts in found.items()}
    return {name: values for name, values in together.items() if len(values) >= FEWEST}


def distribution_table(errors: dict[str, np.ndarray], joint: str) -> StudyTable:
    """Moments, quantiles, and how far each fitted density is from the errors.

    Args:
        errors: By filter, shape (n,) [deg].
        joint: Its name.
    """
    rows = []
    for name, values in errors.items():
        normal, t = _fits(values)
        rows.append(
            StudyRow(
                name,
                (
                    len(values),
                    float(values.mean()),
                    float(values.std(ddof=1)),
                    *map(float, np.percentile(values, QUANTILES)),
                    float(stats.skew(values)),
                    float(stats.kurtosis(values)),
                    float(stats.kstest(values, normal.cdf).statistic),
                    float(stats.kstest(values, t.cdf).statistic),
                ),
            )
        )
    return StudyTable(
        "distribution",
        f"Distribution of the flexion's errors, {joint}",
        (
            "samples",
            "mean [deg]",
            "sd [deg]",
            *(f"{q:g} % [deg]" for q in QUANTILES),
            "skewness",
            "excess kurtosis",
            "farthest from normal",
            "farthest from t",
        ),
        tuple(rows),
        "How to read: signed errors in poses and sweeps that are evaluated, all parts together. "
        "The last two are the largest distance between the share of errors below a value and "
        "that of the fitted distribution (0 is alike); neighbouring samples hang together, so that "
        "no test of significance is drawn from it.",
        "The source's aim names the distribution of errors and shows none.",
        decimals=(0, 3, 3, *(3,) * len(QUANTILES), 2, 2, 3, 3),
        short="Distribution",
    )


def distribution_curves(errors: dict[str, np.ndarray], joint: str) -> tuple[StudyCurves, ...]:
    """A histogram with both fitted densities for each filter.

    Args:
        errors: By filter, shape (n,) [deg].
        joint: Its name.
    """
    figures = []
    for name, values in errors.items():
        tail = 50 * (1 - SHOWN)
        low, high = np.percentile(values, [tail, 100 - tail])
        edges = np.linspace(low, high, BINS + 1)
        share, _ = np.histogram(values, edges)
        density = share / (len(values) * np.diff(edges))
        x, y = np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(density, 2), [0.0]])
        fine = np.linspace(low, high, 201)
        normal, t = _fits(values)
        figures.append(
            StudyCurves(
                f"Distribution of the flexion's errors, {joint}, {name}",
                "error [deg]",
                "density [1/deg]",
                (
                    StudyCurve("errors", x, y, "line"),
                    StudyCurve("normal distribution", fine, normal.pdf(fine), "fit"),
                    StudyCurve("Student's t distribution", fine, t.pdf(fine), "fit"),
                ),
                "How to read: steps are the histogram, dotted lines densities of the same moments.",
            )
        )
    return tuple(figures)


def _fits(values: np.ndarray) -> tuple[Any, Any]:
    """A normal and a t distribution of the same moments.

    The degrees of freedom n of the latter follow from the excess kurtosis, 6 / (n - 4); where
    that is not above zero it is a normal one in all but name.
    """
    mean, sd = float(values.mean()), max(float(values.std()), 1e-12)
    freedom = 4 + 6 / max(float(stats.kurtosis(values)), 0.06)
    width = sd * np.sqrt((freedom - 2) / freedom)
    return stats.norm(mean, sd), stats.t(freedom, float(np.median(values)), width)
