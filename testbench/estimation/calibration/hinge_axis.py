"""The axis of a hinge, such as an elbow or a knee, in the axes of a sensor that turns with it."""

from __future__ import annotations

import numpy as np

from testbench.estimation.calibration.triad_model import AXES
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.results.fit import Fit

MOST_WOBBLE = 0.5
"""A turn has no single axis where the RMS rate across it is above this share of the RMS rate along
it.
"""
LEAST_RATE = np.radians(5.0)
"""What turns slower says nothing of an axis [rad/s]."""


def axis_of_turn(rate: np.ndarray, independent: float | None = None) -> Fit:
    """Axis about which a sensor turns, its other segment at rest: main direction of its rates.

    Positive along its largest component. Noise across the axis decides the uncertainty.

    Args:
        rate: Bias taken away, shape (n, 3) [rad/s].
        independent: How many of the samples count as independent; all if None.

    Returns:
        axis_x, axis_y, axis_z, whose covariance lies across the axis.

    Raises:
        PoorExcitation: Nothing turns, or not about one axis.
    """
    names = [f"axis_{i}" for i in AXES]
    _, vectors = np.linalg.eigh(rate.T @ rate)
    axis = vectors[:, -1]
    axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
    along = rate @ axis
    across = rate - along[:, None] * axis
    size, wobble = (
        float(np.sqrt(np.mean(np.sum(v**2, axis=-1)))) for v in (along[:, None], across)
    )
    if size < LEAST_RATE or wobble > MOST_WOBBLE * size:
        raise PoorExcitation(
            names,
            float("inf") if size == 0 else wobble / size,
            f"turns about one axis faster than {np.degrees(LEAST_RATE):.0f} deg/s are needed; "
            "these have "
            f"{np.degrees(size):.1f} deg/s along their main axis and {np.degrees(wobble):.1f} "
            "deg/s across it (RMS)",
        )
    n = len(rate)
    count = float(n if independent is None else min(independent, n))
    variance = float(np.sum(across**2)) / (2 * n - 2) * n / count
    covariance = variance / float(along @ along) * (np.eye(3) - np.outer(axis, axis))
    return Fit(tuple(names), ("1",) * 3, axis, covariance, 2 * count - 2, 1.0, across, "rad/s")
