"""True angles that stand still while the joint turns: a goniometer at its end, a value held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import unwrapped
from testbench.records.results.estimate import JointEstimate
from testbench.records.session.samples import TrueAngles

LEAST_S = 0.1
"""An angle that keeps one value for less is one whose steps are coarse, or that turns back [s]."""
MOVED = np.radians(5.0)
"""By which the estimate must move meanwhile, beside two steps of the truth: an error of a filter
that comes and goes within one rest is smaller [rad].
"""


@dataclass(frozen=True)
class Held:
    """Where one true angle of a joint keeps a value that the joint does not.

    Attributes:
        place: Of the angle among three.
        rows: Instants of the estimate there, shape (n,), bool.
        value: That is kept longest [rad].
        longest_s: How long [s].
        moved: By how much the estimate moves meanwhile, at most [rad].
    """

    place: int
    rows: np.ndarray
    value: float
    longest_s: float
    moved: float


def held_angles(
    true: TrueAngles, joint: JointEstimate, label: str, host_ns: np.ndarray
) -> list[Held]:
    """Where true angles keep a value that the joint does not, whichever filter says so.

    An angle that never moves is one that a model does not have, and says nothing.

    Args:
        true: As recorded.
        joint: The estimate.
        label: Of the joint's own definition.
        host_ns: The estimate's instants on the clock of the truth, shape (n,).
    """
    estimated = [angles for (_, own), angles in joint.angles.items() if own == label]
    found = []
    for place in true.given:
        held = _held(true, place, [angles[:, place] for angles in estimated], host_ns)
        if held is not None:
            found.append(held)
    return found


def _held(
    true: TrueAngles, place: int, estimated: list[np.ndarray], host_ns: np.ndarray
) -> Held | None:
    """The same of one angle; estimates of shape (n,) each [rad]."""
    known = np.flatnonzero(np.isfinite(true.angles[:, place]))
    values, times = true.angles[known, place], true.host_time_ns[known]
    steps = np.abs(np.diff(values))
    if not steps.any():
        return None
    least = MOVED + 2 * float(steps[steps > 0].min())
    borders = np.concatenate([[0], np.flatnonzero(steps) + 1, [len(values)]])
    rows = np.zeros(len(host_ns), dtype=bool)
    longest, moved, value = 0, 0.0, 0.0
    lasting = times[borders[1:] - 1] - times[borders[:-1]]
    for i in np.flatnonzero(lasting >= LEAST_S * NANOSECONDS):
        first, end, lasts = borders[i], borders[i + 1], int(lasting[i])
        within = slice(*np.searchsorted(host_ns, [times[first], times[end - 1] + 1]))
        went = min((_range(own[within]) for own in estimated), default=0.0)
        if went > least:
            rows[within] = True
            moved = max(moved, went)
            if lasts > longest:
                longest, value = lasts, float(values[first])
    return Held(place, rows, value, longest / NANOSECONDS, moved) if rows.any() else None


def _range(angle: np.ndarray) -> float:
    """How far an angle goes, shape (n,) [rad]."""
    known = angle[np.isfinite(angle)]
    return float(np.ptp(unwrapped(known))) if len(known) else 0.0
