"""Heading between two sensors of a joint that know no north, from the axes that it turns about.

The heading d turns the earth of the second sensor into that of the first: q_earth1_from_earth2 is
the rotation by d about the vertical. Here it is constant;
`testbench.estimation.joints.joint_constraint` follows one that drifts.
"""

from __future__ import annotations

import numpy as np

from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation, covariance_of
from testbench.records.results.fit import Fit

VAGUE = np.radians(20.0)
"""A heading that is known no better than this is refused [rad]."""
LEAST_HORIZONTAL = 0.17
"""Axes nearer to the vertical than 10 deg (RMS) show no heading."""
GRID = 720
"""Headings at which the constraint of a 2D joint is looked at, half a degree apart."""
RIVAL = 1.5
"""Another minimum with less than this many times the cost of the best makes the answer
ambiguous.
"""
ADVICE_1D = "the axis of the hinge must not stay vertical"
ADVICE_2D = "the joint must move about both axes, in more than one posture"


def heading_1d(
    q_earth1_from_sensor1: np.ndarray,
    axis1: np.ndarray,
    q_earth2_from_sensor2: np.ndarray,
    axis2: np.ndarray,
    independent: float | None = None,
) -> Fit:
    """Constant heading of a hinge: its axis is one and the same direction for both sensors.

    Laidig, Schauer & Seel, Exploiting kinematic constraints to compensate magnetic disturbances
    when calculating joint angles of approximate hinge joints from orientation estimates of inertial
    sensors, ICORR 2017. In closed form: the horizontal parts of the axis, weighted by their
    lengths.

    Args:
        q_earth1_from_sensor1: Orientations of the first sensor, shape (n, 4).
        axis1: The hinge in the first sensor, shape (3,).
        q_earth2_from_sensor2: Orientations of the second, at the same instants, shape (n, 4).
        axis2: The hinge in the second sensor, pointing the same way, shape (3,).
        independent: How many of the samples count as independent; all if None.

    Returns:
        heading [rad].

    Raises:
        PoorExcitation: The axis stays vertical.
    """
    first, second = (
        _horizontal(q_earth1_from_sensor1, axis1),
        _horizontal(q_earth2_from_sensor2, axis2),
    )
    weight = np.abs(first * second)
    if np.sqrt(weight.mean()) < LEAST_HORIZONTAL:
        raise PoorExcitation(["heading"], float("inf"), ADVICE_1D)
    heading = float(np.angle(np.sum(first * np.conj(second))))
    # divided by the root of the weight, so that its sd is that of the horizontal parts
    left = np.imag(first * np.conj(second) * np.exp(-1j * heading)) / np.sqrt(weight)
    return _fit(heading, np.sqrt(weight), left, independent, ADVICE_1D)


def heading_2d(
    q_earth1_from_sensor1: np.ndarray,
    axis1: np.ndarray,
    q_earth2_from_sensor2: np.ndarray,
    axis2: np.ndarray,
    angle: float = np.pi / 2,
    independent: float | None = None,
) -> Fit:
    """Constant heading of a joint with two axes, such as elbow and forearm together.

    Laidig, Lehmann, Begin & Seel, Magnetometer-free realtime inertial motion tracking by
    exploitation of kinematic constraints in 2-DoF joints, EMBC 2019. The first axis is fixed in the
    first segment, the second in the second; with horizontal and vertical parts, j1 . j2 = a cos d +
    b sin d + c = cos(angle).

    Args:
        q_earth1_from_sensor1: Orientations of the first sensor, shape (n, 4).
        axis1: The first axis, in the first sensor, shape (3,).
        q_earth2_from_sensor2: Orientations of the second, at the same instants, shape (n, 4).
        axis2: The second axis, in the second sensor, shape (3,).
        angle: Between the axes [rad].
        independent: How many of the samples count as independent; all if None.

    Returns:
        heading [rad].

    Raises:
        PoorExcitation: The motion does not tell one heading from another.
    """
    j1 = rotation.rotate(q_earth1_from_sensor1, axis1 / np.linalg.norm(axis1))
    j2 = rotation.rotate(q_earth2_from_sensor2, axis2 / np.linalg.norm(axis2))
    # j1 . j2 - cos(angle) = a cos d + b sin d + c
    a = j1[:, 0] * j2[:, 0] + j1[:, 1] * j2[:, 1]
    b = j1[:, 1] * j2[:, 0] - j1[:, 0] * j2[:, 1]
    c = j1[:, 2] * j2[:, 2] - np.cos(angle)
    moments = np.column_stack([a, b, c]).T @ np.column_stack([a, b, c])
    grid = np.arange(GRID) * 2 * np.pi / GRID
    basis = np.column_stack([np.cos(grid), np.sin(grid), np.ones(GRID)])
    cost = np.einsum("gi,ij,gj->g", basis, moments, basis)
    valleys = np.flatnonzero((cost <= np.roll(cost, 1)) & (cost < np.roll(cost, -1)))
    found = sorted((_descend(grid[k], moments) for k in valleys), key=lambda pair: pair[0])
    noise = 1e-12 * len(a)
    if not found or (len(found) > 1 and found[1][0] < RIVAL * found[0][0] + noise):
        raise PoorExcitation(["heading"], float("inf"), ADVICE_2D)
    heading = float(rotation.wrap(np.array(found[0][1])))
    slope = -a * np.sin(heading) + b * np.cos(heading)
    return _fit(
        heading, slope, a * np.cos(heading) + b * np.sin(heading) + c, independent, ADVICE_2D
    )


def _descend(start: float, moments: np.ndarray) -> tuple[float, float]:
    """Cost and place of the minimum near a start, by Newton's method."""
    d = start
    for _ in range(20):
        v = np.array([np.cos(d), np.sin(d), 1.0])
        dv = np.array([-np.sin(d), np.cos(d), 0.0])
        curvature = dv @ moments @ dv - np.array([v[0], v[1], 0.0]) @ moments @ v
        step = float(dv @ moments @ v / curvature) if curvature > 0 else 0.0
        d -= float(np.clip(step, -2 * np.pi / GRID, 2 * np.pi / GRID))
        if abs(step) < 1e-14:
            break
    v = np.array([np.cos(d), np.sin(d), 1.0])
    return float(v @ moments @ v), d


def _fit(
    heading: float, slope: np.ndarray, left: np.ndarray, independent: float | None, advice: str
) -> Fit:
    n = len(left)
    count = float(n if independent is None else min(independent, n))
    variance = float(left @ left) / max(n - 1, 1) * n / count
    covariance, condition = covariance_of(slope[:, None] * VAGUE, variance, ["heading"], advice)
    return Fit(
        ("heading",),
        ("rad",),
        np.array([heading]),
        covariance * VAGUE**2,
        max(count - 1, 1.0),
        condition,
        left,
        "1",
    )


def _horizontal(q_earth_from_sensor: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Horizontal part of an axis as a complex number, east + i north, shape (n,)."""
    j = rotation.rotate(q_earth_from_sensor, axis / np.linalg.norm(axis))
    return np.asarray(j[:, 0] + 1j * j[:, 1])
