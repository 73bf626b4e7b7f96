"""Whether two sensors see the centre of the joint between them move alike.

They do if they sit on the two segments of one joint, on one clock. What no heading and no levers
explain of the accelerations shows that they do not, and a shift of their times that explains it
shows by how much their clocks differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.joints.joint_centre import (
    LEAST_CONTRAST,
    LEAST_MOTION,
    CentreCost,
    centre_terms,
)
from testbench.estimation.joints.limb import Limb

FEIGNED = 0.5
"""RMS that the inclination of filters can feign [m/s^2]: that of 3 deg feigns 0.51."""
DOUBTFUL = 0.1
"""Part of the less moved sensor's level variance that sensors of one joint leave at most, to be
beyond doubt [1].
"""
APART = 0.7
"""Part of the less moved sensor's whole variance that sensors of other segments leave at least [1].
Simulated walkers with sensors on skin leave 0.02, three Xsens DOTs on a person who squats slowly
0.5; a knee between two legs leaves 2.1, an ankle 1.0, a segment passed over 1.5 to 9, by the DOTs
6. The hip of the other side leaves 0.1, and is not seen: one pelvis carries both.
"""
WIDEST_S, STEP_S = 2.0, 0.04
"""Shifts that are tried, in recordings of four times as long, and how far apart [s]."""
SHORTEST_S = 4.0
"""Less says nothing [s]."""
HEADINGS = np.arange(30) * 2 * np.pi / 30
MOST = 3000
"""Instants that are looked at: a minute at the rate of a limb."""


@dataclass(frozen=True)
class CentreApart:
    """Sensors that do not see their joint's centre move alike.

    Attributes:
        shift_s: What is to be added to the times of the second one, so that they do [s]; None
            where no shift of the times makes them.
    """

    shift_s: float | None


def centre_apart(limb: Limb, first: str, second: str) -> CentreApart | None:
    """Whether two sensors contradict each other; None where they do not, or hardly move.

    Args:
        limb: Both sensors.
        first: Name of one.
        second: Name of the other.
    """
    a, A = (own[:MOST] for own in centre_terms(limb, first))
    b, B = (own[:MOST] for own in centre_terms(limb, second))
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    if known.sum() * limb.interval < SHORTEST_S:
        return None
    most = min(round(WIDEST_S / limb.interval), int(known.sum()) // 4)
    a, b = np.where(known[:, None], a, 0.0), np.where(known[:, None], b, 0.0)
    A, B = (np.where(known[:, None, None], own, 0.0) for own in (A, B))
    moved = min(float(np.mean(np.sum(own[:, :2] ** 2, axis=1))) for own in (a, b))
    if moved < LEAST_MOTION**2:
        return None

    def left(shift: int) -> float:
        """What is left where the second sensor is later by so many instants."""
        early, late = (
            slice(max(shift, 0), len(a) + min(shift, 0)),
            slice(max(-shift, 0), len(a) - max(shift, 0)),
        )
        cost = CentreCost(a[early], A[early], b[late], B[late])
        return min(cost(heading) for heading in HEADINGS)

    as_read = left(0)
    if as_read < max(FEIGNED**2, DOUBTFUL * moved):
        return None
    step = max(round(STEP_S / limb.interval), 1)
    coarse = min(range(-most, most + 1, step), key=left)
    best = min(range(coarse - step + 1, coarse + step), key=left)
    least = left(best)
    if least < min(DOUBTFUL * moved, as_read / LEAST_CONTRAST):
        return CentreApart(best * limb.interval)
    whole = min(float(np.mean(np.sum(own**2, axis=1))) for own in (a, b))
    return CentreApart(None) if as_read > APART * whole else None
