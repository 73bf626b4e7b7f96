"""Which filters are shown first where there are many: the best and the worst."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from testbench.records.results.evaluation import Evaluation

MOST_SHOWN = 3
"""So many filters are shown at once; of more, the best and the worst, and the others on a click."""


def by_orientation(evaluation: Evaluation, sensor: str) -> list[str]:
    """The filters of a sensor: the best, the worst, then the others, the better ones first."""
    rows = [row for row in evaluation.orientation if row.sensor == sensor]
    return _ends_first((row.filter, row.total_rmse_deg) for row in rows)


def by_flexion(evaluation: Evaluation, joint: str, sequence: str) -> list[str]:
    """The filters of a joint by one of its definitions; see `by_orientation`."""
    rows = [row for row in evaluation.joint_angle if (row.joint, row.sequence) == (joint, sequence)]
    return _ends_first((row.filter, row.flexion_rmse_deg) for row in rows)


def _ends_first(errors: Iterable[tuple[str, float]]) -> list[str]:
    """Names by the root mean square of their errors, the largest put behind the smallest."""
    found: dict[str, list[float]] = {}
    for name, rmse in errors:
        found.setdefault(name, []).append(rmse if np.isfinite(rmse) else np.inf)
    ranked = sorted(found, key=lambda name: float(np.mean(np.square(found[name]))))
    return [*ranked[:1], *ranked[1:][-1:], *ranked[1:-1]]


def visible(filters: Sequence[str]) -> set[str]:
    """Those that are shown at first.

    Args:
        filters: In the order of `by_orientation`.
    """
    return set(filters if len(filters) <= MOST_SHOWN else filters[:2])
