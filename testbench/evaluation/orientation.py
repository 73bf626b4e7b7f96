"""Errors of each sensor's orientation by each filter."""

from __future__ import annotations

import numpy as np

from testbench.evaluation.judged import rows_by_step
from testbench.evaluation.metrics import orientation_errors, rms
from testbench.model.truth import truth_at
from testbench.records.estimate import SensorEstimate
from testbench.records.evaluation import OrientationRow
from testbench.records.plan import PlannedStep
from testbench.records.samples import Truth

PIECE = 100_000
"""Samples that are compared together; bounds the memory."""


def judged_rows(steps: list[PlannedStep] | None, truth: Truth, time_ns: np.ndarray, static: np.ndarray) -> np.ndarray:
    """Which of a sensor's samples count, shape (n,), bool: by the steps, or by the truth's own marks without a protocol."""
    if steps is not None:
        judged = np.zeros(len(time_ns), dtype=bool)
        for _, rows in rows_by_step(steps, time_ns, static):
            judged[rows] = True
        return judged
    if truth.judged is None:
        return np.ones(len(time_ns), dtype=bool)
    nearest = np.clip(np.searchsorted(truth.host_time_ns, time_ns), 0, len(truth.host_time_ns) - 1)
    return np.asarray(truth.judged[nearest])


def evaluate_sensor(
    name: str, estimate: SensorEstimate, truth: Truth, steps: list[PlannedStep] | None
) -> tuple[list[OrientationRow], dict[str, np.ndarray]]:
    """Rows and error signals of one sensor."""
    time = estimate.host_time_ns
    q_true = truth_at(truth, time)
    judged = judged_rows(steps, truth, time, estimate.static) & np.isfinite(q_true[:, 0]) & ~estimate.flagged
    series = {"host_time_ns": time, "judged": judged}
    rows = []
    for key, q in estimate.orientation.items():
        errors = _errors(q, q_true)
        series |= {f"{key}_{part}_rad": error.astype(np.float32) for part, error in errors.items()}
        if not judged.any():
            continue
        total, heading, inclination = (np.degrees(error[judged]) for error in errors.values())
        rows.append(
            OrientationRow(name, key, int(judged.sum()), rms(total), rms(heading), rms(inclination), float(total.max()))
        )
    return rows, series


def _errors(q: np.ndarray, q_true: np.ndarray) -> dict[str, np.ndarray]:
    """Total, heading and inclination error [rad], shape (n,), computed in pieces, for they may be long."""
    result = {part: np.empty(len(q)) for part in ("total", "heading", "inclination")}
    for begin in range(0, len(q), PIECE):
        piece = slice(begin, begin + PIECE)
        errors = orientation_errors(q[piece], q_true[piece])
        result["total"][piece], result["heading"][piece] = errors.total, errors.heading
        result["inclination"][piece] = errors.inclination
    return result
