"""What a limit makes of a value: guard bands, and how often an equal session would come out
otherwise.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from testbench.records.results.evaluation import Outcome
from testbench.records.results.uncertainty import LEVEL
from testbench.records.specs.protocol import AcceptanceLimit

FEWEST_SESSIONS = 3
"""Of fewer equal sessions no scatter is stated."""
_QUANTILES = (np.arange(400) + 0.5) / 400


def outcome_of(
    value: float | None, limit: AcceptanceLimit, expanded: float | None = None
) -> Outcome:
    """Fail beyond a limit by more than the expanded uncertainty; marginal near it; else pass.

    Near is within the expanded uncertainty on either side, so that no verdict is given which the
    truth may overturn (guard bands w = U: ILAC-G8:09/2019, 4.2; JCGM 106:2012, 8.3); and on the
    safe side also within `marginal_percent`. What is uncertain by nobody knows how much passes
    nothing, and breaks a limit that it is beyond.

    Args:
        value: Of the metric.
        limit: What it must keep.
        expanded: Expanded uncertainty of the value, for 95 %; None counts as 0.
    """
    if value is None or not np.isfinite(value):
        return Outcome.NOT_MEASURED
    beyond = [value - limit.max] if limit.max is not None else []
    beyond += [limit.min - value] if limit.min is not None else []
    if expanded is not None and not expanded >= 0:  # NaN, or no uncertainty at all
        return Outcome.FAIL if max(beyond) > 0 else Outcome.MARGINAL
    guard, part = expanded or 0.0, limit.marginal_percent / 100
    if max(beyond) > guard:
        return Outcome.FAIL
    near_max = limit.max is not None and value > limit.max - max(part * abs(limit.max), guard)
    near_min = limit.min is not None and value < limit.min + max(part * abs(limit.min), guard)
    return Outcome.MARGINAL if near_max or near_min else Outcome.PASS


def guard_band(expanded: float | None, values: list[float]) -> float | None:
    """Half of the guard band of a value that equal sessions scatter about.

    The expanded uncertainty of the truth and that of one session among equal ones, by Student's t,
    add as squares (JCGM 100:2008, 5.1.2).

    Args:
        expanded: Of the truth, for 95 %; None counts as 0.
        values: Of the equal sessions, at least `FEWEST_SESSIONS`.
    """
    k = float(stdtrit(len(values) - 1, (1 + LEVEL) / 2))
    return float(np.hypot(expanded or 0.0, k * np.std(values, ddof=1)))


def otherwise_percent(
    outcome: Outcome, limit: AcceptanceLimit, guard: float | None, values: list[float]
) -> float:
    """How often a further session of the same kind would come out otherwise [%].

    Its value is predicted by those of the others: their mean, with a Student's t of
    s sqrt(1 + 1/n) (the prediction interval of a normal distribution).

    Args:
        outcome: Of this session.
        limit: What the value must keep.
        guard: Half of the guard band.
        values: Of the equal sessions, at least `FEWEST_SESSIONS`.
    """
    count = len(values)
    spread = np.std(values, ddof=1) * np.sqrt(1 + 1 / count)
    predicted = np.mean(values) + spread * stdtrit(count - 1, _QUANTILES)
    return 100 * float(np.mean([outcome_of(x, limit, guard) is not outcome for x in predicted]))
