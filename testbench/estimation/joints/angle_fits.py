"""How fast a joint turns, by its estimate and by a truth of its angles, and where both fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from testbench.estimation.signals.rates import LOST_S, WIDEST, RateMagnitude, angle_rate
from testbench.estimation.signals.recording import JointTruth
from testbench.estimation.signals.time_alignment import fit_anywhere
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import gradient, median_interval
from testbench.records.results.estimate import ClockFit, JointEstimate

LEAST_ROWS = 10
"""Rates that both must have."""
UNFITTED = ClockFit(method="arrival")
"""The clock as the times are read."""


def angle_fits(
    found: JointEstimate,
    own: list[np.ndarray],
    truth: JointTruth,
    places: list[int],
    true_places: list[int],
    factor: float = 1.0,
) -> Iterator[ClockFit]:
    """The fit to the angles of each filter, up to the first that holds.

    Args:
        found: The joint.
        own: Angles by each filter, shape (n, 3) [rad].
        truth: Its true angles.
        places: Of the angles that are looked at.
        true_places: Of those of the truth.
        factor: That the true angles are multiplied by [1].
    """
    true = true_rate(truth, true_places, factor)
    for angles in own:
        measured = estimated_rate(found.host_time_ns, angles[:, places])
        if len(true.time) < LEAST_ROWS or len(measured.time) < LEAST_ROWS:
            yield replace(UNFITTED, refused="unknown")
            continue
        fit = fit_anywhere(measured, true, UNFITTED, 0.0, truth.near)
        yield fit
        if fit.method == "angular_rate":
            return


def true_rate(truth: JointTruth, places: list[int], factor: float = 1.0) -> RateMagnitude:
    """Length of the rates of true angles.

    Args:
        truth: Of a joint.
        places: Of the angles that are looked at.
        factor: That they are multiplied by [1].
    """
    return angle_rate(truth.angles.host_time_ns, factor * truth.angles.angles[:, places])


def estimated_rate(time_ns: np.ndarray, angles: np.ndarray) -> RateMagnitude:
    """Length of the rates of estimated angles at their own instants.

    Args:
        time_ns: Shape (n,).
        angles: Shape (n, k) [rad].
    """
    rows = np.isfinite(angles).all(axis=1) & (np.diff(time_ns, prepend=time_ns[:1] - 1) > 0)
    time = time_ns[rows] / NANOSECONDS
    if len(time) < LEAST_ROWS:
        return RateMagnitude(np.zeros(0), np.zeros(0), 0.0, 0.0)
    rates = gradient(np.unwrap(angles[rows], axis=0), time)
    gap = max(LOST_S, WIDEST * median_interval(time))
    return RateMagnitude(time, rotation.lengths(rates), 0.0, gap)
