"""The axis of a hinge, such as an elbow, in the sensors beside it, from their motion alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.calibration.triad_model import AXES
from testbench.model.statistics.least_squares import (
    FitParameter,
    PoorExcitation,
    covariance_of,
    solve,
)
from testbench.records.results.fit import Fit

VAGUE = np.radians(10.0)
"""An axis that is known no better than this is refused [rad]; by eye it is known as well."""
MOST_WOBBLE = 0.5
"""A turn has no single axis where the RMS rate across it is above this share of the RMS rate along
it.
"""
LEAST_RATE = np.radians(5.0)
"""Samples at which neither sensor turns faster say nothing of an axis [rad/s]; Olsson et al. 2020
leave them out too.
"""
STARTS = 60
"""Directions over half a sphere from which the search begins; neighbours are about 20 deg apart."""
COARSE = 400
"""Samples that the search for a start looks at."""
ADVICE = (
    "both segments must turn, one of them about two axes; with one segment at rest use "
    "axis_of_turn on the other"
)


@dataclass(frozen=True)
class HingeAxes:
    """One hinge in the axes of two sensors.

    Attributes:
        first: Unit vector in the first sensor, shape (3,).
        second: Unit vector in the second sensor, shape (3,).
        fit: Both, first_x to second_z, with covariance (each lies across its vector).
        signs_agree: Whether accelerometers told that both point the same way; rates alone do not.
    """

    first: np.ndarray
    second: np.ndarray
    fit: Fit
    signs_agree: bool


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


def hinge_axes(
    first_rate: np.ndarray,
    second_rate: np.ndarray,
    first_force: np.ndarray | None = None,
    second_force: np.ndarray | None = None,
    force_weight: float = 0.02,
    independent: float | None = None,
) -> HingeAxes:
    """Axis of a hinge while both segments move.

    Across the axis both segments turn alike: |w1 x j1| = |w2 x j2| (Seel, Schauer & Raisch, Joint
    axis and position estimation from inertial measurement data by exploiting kinematic constraints,
    CCA 2012). Where both sensors feel the same force along the axis, j1 . a1 = j2 . a2 as well,
    which also tells the signs (Olsson, Kok, Seel & Halvorsen, Robust plug-and-play joint axis
    estimation using inertial sensors, Sensors 20(12), 2020). Gauss-Newton on the two spheres, from
    the best of a grid.

    Args:
        first_rate: Of the first sensor, bias taken away, shape (n, 3) [rad/s].
        second_rate: Of the second sensor, at the same instants, shape (n, 3) [rad/s].
        first_force: Specific force of the first sensor, shape (n, 3) [m/s^2]; both or none.
        second_force: Specific force of the second sensor, shape (n, 3) [m/s^2].
        force_weight: Of the second constraint against the first [rad/s per m/s^2]: standard
            deviation of the difference of rates over that of forces. The default takes 0.01 rad/s
            and 0.5 m/s^2, the latter by the sensors' distance.
        independent: How many of the samples count as independent; all if None.

    Raises:
        PoorExcitation: The motion leaves an axis vaguer than 10 deg.
    """
    # Longer than a screen: residuals and their derivatives share the readings and the tangents.
    names = [f"{which}_{i}" for which in ("first", "second") for i in AXES]
    moving = np.linalg.norm(first_rate, axis=1) + np.linalg.norm(second_rate, axis=1) > LEAST_RATE
    if moving.sum() < 5:
        raise PoorExcitation(names, float("inf"), ADVICE)
    w1, w2 = first_rate[moving], second_rate[moving]
    forces = None
    if first_force is not None and second_force is not None:
        forces = (first_force[moving] * force_weight, second_force[moving] * force_weight)
    j1, j2 = _best_start(w1, w2, forces)
    B1, B2 = _tangent(j1), _tangent(j2)
    parameters = [
        FitParameter(f"{which}_tilt_{k}", "rad", 0.0, VAGUE)
        for which in ("first", "second")
        for k in "ab"
    ]

    def axes(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        a, b = j1 + B1 @ t[:2], j2 + B2 @ t[2:]
        na, nb = np.linalg.norm(a), np.linalg.norm(b)
        a, b = a / na, b / nb
        return a, b, (B1 - np.outer(a, a @ B1)) / na, (B2 - np.outer(b, b @ B2)) / nb

    def residuals(t: np.ndarray) -> np.ndarray:
        # |w1 x j1| - |w2 x j2|, and a1 . j1 - a2 . j2
        a, b, _, _ = axes(t)
        rates = np.linalg.norm(np.cross(w1, a), axis=1) - np.linalg.norm(np.cross(w2, b), axis=1)
        return rates if forces is None else np.concatenate([rates, forces[0] @ a - forces[1] @ b])

    def jacobian(t: np.ndarray) -> np.ndarray:
        a, b, da, db = axes(t)
        J = np.hstack([_slope(w1, a) @ da, -_slope(w2, b) @ db])
        return J if forces is None else np.vstack([J, np.hstack([forces[0] @ da, -forces[1] @ db])])

    # Ask before the search runs away along what is not seen.
    labels = [item.name for item in parameters]
    scatter = float(np.mean(residuals(np.zeros(4)) ** 2))
    covariance_of(jacobian(np.zeros(4)) * VAGUE, min(scatter, LEAST_RATE**2), labels, ADVICE)
    fit = solve(residuals, parameters, jacobian=jacobian, residual_unit="rad/s", advice=ADVICE)
    a, b, da, db = axes(fit.values)
    spread = np.zeros((6, 4))
    spread[:3, :2], spread[3:, 2:] = da, db
    share = 1.0 if independent is None else max(len(fit.residuals) / independent, 1.0)
    covariance = spread @ fit.covariance @ spread.T * share
    if forces is None:
        b = b * np.sign(b[np.argmax(np.abs(b))])
    sign = np.sign(a[np.argmax(np.abs(a))])
    if forces is not None or sign < 0:
        a, b = a * sign, b * (sign if forces is not None else 1.0)
    whole = Fit(
        tuple(names),
        ("1",) * 6,
        np.concatenate([a, b]),
        covariance,
        max(fit.dof / share, 1.0),
        fit.condition,
        fit.residuals,
        "rad/s",
    )
    return HingeAxes(a, b, whole, forces is not None)


def _best_start(
    w1: np.ndarray, w2: np.ndarray, forces: tuple[np.ndarray, np.ndarray] | None
) -> tuple[np.ndarray, np.ndarray]:
    """The pair of a grid of directions that fits best."""
    pick = np.linspace(0, len(w1) - 1, min(len(w1), COARSE)).round().astype(int)
    k = np.arange(STARTS) + 0.5  # a spiral of equal areas over half a sphere
    height, turn = 1 - k / STARTS, np.pi * (1 + np.sqrt(5)) * k
    radius = np.sqrt(1 - height**2)
    grid = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    across = [
        np.sqrt(np.maximum(np.sum(w**2, axis=1)[:, None] - (w @ grid.T) ** 2, 0))
        for w in (w1[pick], w2[pick])
    ]
    cost = (
        np.sum(across[0] ** 2, axis=0)[:, None]
        + np.sum(across[1] ** 2, axis=0)[None]
        - 2 * across[0].T @ across[1]
    )
    signs = np.ones_like(cost)
    if forces is not None:
        along = [f[pick] @ grid.T for f in forces]
        product = along[0].T @ along[1]
        signs = np.where(product < 0, -1.0, 1.0)
        squares = np.sum(along[0] ** 2, axis=0)[:, None] + np.sum(along[1] ** 2, axis=0)[None]
        cost = cost + squares - 2 * np.abs(product)
    first, second = np.unravel_index(int(np.argmin(cost)), cost.shape)
    return grid[first], grid[second] * signs[first, second]


def _slope(w: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Gradient of |w x axis| by the axis, shape (n, 3)."""
    across = np.cross(w, axis)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(np.cross(across / np.maximum(length, 1e-12), w))


def _tangent(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors across an axis, shape (3, 2)."""
    return np.asarray(np.linalg.svd(axis[None])[2][1:].T)
