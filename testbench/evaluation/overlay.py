"""Errors over time of both sides of a comparison, for figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.evaluation.paired_errors import ErrorSignal, Judged
from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Metric
from testbench.records.results.session_comparison import Overlay

MOST_METRICS, MOST_SESSIONS = 12, 5
"""More metrics than these are not drawn, nor more sessions of a side."""


def overlays(
    base: Sequence[Judged], new: Sequence[Judged], metrics: Sequence[Metric]
) -> list[Overlay]:
    """The errors of the metrics whose errors over time are kept.

    Args:
        base: Sessions of one side.
        new: Those of the other.
        metrics: In the order of the comparison.
    """
    found = []
    for place, metric in enumerate(metrics):
        errors = {
            side: _errors(sessions[:MOST_SESSIONS], metric)
            for side, sessions in (("base", base), ("new", new))
        }
        if all(errors.values()):
            found.append(Overlay(place, errors))
    return found[:MOST_METRICS]


def _errors(sessions: Sequence[Judged], metric: Metric) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Time [s] and error [deg] of each session, of the section that the metric is of."""
    found = {}
    for judged in sessions:
        signal = ErrorSignal.of(judged, metric)
        if signal is None:
            continue
        kept = np.concatenate([*signal.rows(), np.empty(0, dtype=int)]).astype(int)
        error = np.full(len(signal.error), np.nan)
        error[kept] = signal.error[kept]
        if np.isfinite(error).any():
            inside = np.flatnonzero(np.isfinite(error))
            within = slice(int(inside[0]), int(inside[-1]) + 1)
            time = signal.time_ns[within] / NANOSECONDS
            found[judged.session.name] = (time, error[within])
    return found
