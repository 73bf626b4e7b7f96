"""The mounting of a sensor by its rates while it moves and by gravity while it rests."""

from __future__ import annotations

import numpy as np

from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.alignment.vector_mounting import VectorMounting, mounting_from_vectors
from testbench.estimation.signals.recording import RunFacts
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.reference_step import before_judging
from testbench.model.statistics.intervals import median_interval
from testbench.records.session.samples import Truth

FEWEST_ROWS = 10
"""Samples of motion and rest that a mounting is asked of."""


def mounting_by_rates(
    run: RunFacts,
    read: tuple[np.ndarray, np.ndarray],
    time_ns: np.ndarray,
    static: np.ndarray,
    truth: Truth,
    q_true: np.ndarray,
) -> VectorMounting | None:
    """The mounting over what comes before the first judged step; None where that is too little.

    Args:
        run: What is known of the recording.
        read: Calibrated angular rates [rad/s] and specific forces [m/s^2], shape (n, 3) each.
        time_ns: Their instants on the host's clock, shape (n,) [ns].
        static: Sound samples at rest, shape (n,), bool.
        truth: What the sensor went through.
        q_true: q_world_from_sensor at the samples, NaN where unknown, shape (n, 4).
    """
    usable = before_judging(run.steps, time_ns)
    gyr, acc = read
    rate, sound = true_rates(truth, time_ns)
    moving = usable & sound & ~static & np.isfinite(gyr).all(axis=1)
    rest = usable & static & np.isfinite(q_true[:, 0]) & np.isfinite(acc).all(axis=1)
    if moving.sum() + rest.sum() < FEWEST_ROWS:
        return None
    # what no calibration has taken away
    bias = gyr[rest].mean(axis=0) if rest.any() else np.zeros(3)
    seconds = median_interval(time_ns) / NANOSECONDS
    force = rotation.rotate(rotation.conjugate(q_true[rest]), -run.gravity)
    return mounting_from_vectors(
        [  # a pair a second counts as independent
            (rate[moving], gyr[moving] - bias, max(moving.sum() * seconds, 1.0)),
            (force, acc[rest], max(rest.sum() * seconds, 1.0)),
        ]
    )
