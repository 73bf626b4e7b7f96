"""Relative heading of two sensors from the joint between them: its centre moves as both say.

Each sensor knows how its joint's centre accelerates, but for where the centre is (the levers) and
which way its earth faces: a_centre = R a + R (w' x + w x w x) lever (Seel, Schauer & Raisch, IEEE
CCA 2012, eq. 3, for the levers; Kok, Eckhoff, Weygers & Seel, Control Engineering Practice 121,
2022, for orientations without a magnetometer). Seen from both, it is one vector, for every kind of
joint, whatever axes it turns about. For each heading the levers follow by linear least squares; the
heading that leaves least is found on a grid and between its points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.joints.limb import Limb, smooth
from testbench.frames import STANDARD_GRAVITY
from testbench.model import rotation

LEVER_SD = 0.4
"""Of a joint's centre from a sensor about each axis [m]: what the motion does not show stays
small.
"""
LEAST_MOTION = 0.15
"""RMS horizontal acceleration below which nothing is told [m/s^2]: a filter's inclination of 1 deg
feigns 0.17.
"""
LEAST_CONTRAST = 4.0
"""The worst heading leaves at least so many times the variance of the best."""
MOST_SD = np.radians(15.0)
"""A heading that is known no better is not told [rad]."""
GRID = 180
RIVAL = 1.3
"""Another minimum that leaves less than so many times the variance of the best makes the answer
ambiguous.
"""
MODEL_SD = np.radians(1.0)
"""What skin and filters add to a heading that is the same for the whole recording [rad]."""
INDEPENDENT_S = 0.5
"""Residuals so far apart count as independent [s]: they are errors of inclination and of skin."""


@dataclass(frozen=True)
class CentreHeading:
    """Heading that turns the earth of the second sensor into that of the first.

    Attributes:
        heading: About the vertical [rad].
        sd: Its standard uncertainty [rad].
        explained: Part of the first sensor's variance that both centres share [1].
    """

    heading: float
    sd: float
    explained: float


def heading_by_centre(limb: Limb, first: str, second: str) -> CentreHeading | None:
    """The relative heading of two sensors; None where the motion does not tell.

    Args:
        limb: Both sensors.
        first: Name of one.
        second: Name of the other.
    """
    a, A = centre_terms(limb, first)
    b, B = centre_terms(limb, second)
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    if known.sum() < 50:
        return None
    a, A, b, B = a[known], A[known], b[known], B[known]
    moved = np.sqrt(np.mean(np.sum(a[:, :2] ** 2, axis=1)))
    if min(moved, np.sqrt(np.mean(np.sum(b[:, :2] ** 2, axis=1)))) < LEAST_MOTION:
        return None
    cost = CentreCost(a, A, b, B)
    grid = np.arange(GRID) * 2 * np.pi / GRID
    values = np.array([cost(angle) for angle in grid])
    valleys = np.flatnonzero((values <= np.roll(values, 1)) & (values < np.roll(values, -1)))
    if not len(valleys) or values.max() < LEAST_CONTRAST * values.min():
        return None
    ranked = valleys[np.argsort(values[valleys])]
    if len(ranked) > 1 and values[ranked[1]] < RIVAL * values[ranked[0]]:
        return None
    heading, curvature = _vertex(cost, float(grid[ranked[0]]))
    least = cost(heading)
    independent = max(known.sum() * limb.interval / INDEPENDENT_S, 2.0)
    if curvature <= 0:
        return None
    sd = float(np.sqrt(2 * least / curvature / independent))
    total = float(np.sum(a**2)) / len(a)
    if sd > MOST_SD:
        return None
    return CentreHeading(
        float(rotation.wrap(np.array(heading))),
        float(np.hypot(sd, MODEL_SD)),
        1 - least / max(total, 1e-12),
    )


def centre_terms(limb: Limb, sensor: str) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration in the earth, shape (n, 3) [m/s^2], and what a lever in the sensor adds to it,
    shape (n, 3, 3) [1/s^2].

    Args:
        limb: The sensors.
        sensor: Name of one.
    """
    q, rate = limb.q[sensor], limb.rates(sensor)
    force = rotation.rotate(q, limb.acc[sensor])
    acceleration = smooth(force - [0.0, 0.0, STANDARD_GRAVITY], limb.interval)
    change = np.gradient(rate, limb.interval, axis=0)
    cross = _crosses(rate)
    lever = (_crosses(change) + cross @ cross) @ rotation.to_matrix(q)
    return acceleration, lever


def _crosses(v: np.ndarray) -> np.ndarray:
    """Matrices of the cross product with each vector, shape (n, 3, 3)."""
    matrix = np.zeros((len(v), 3, 3))
    matrix[:, 0, 1], matrix[:, 0, 2], matrix[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return matrix - np.swapaxes(matrix, 1, 2)


class CentreCost:
    """Mean square of what a heading leaves, the levers at their best [m^2/s^4].

    All sums over time are taken once: R(d) = c P + s Q + Z, so that each is linear in c and s.

    Args:
        a: Acceleration of the first sensor, shape (n, 3) [m/s^2].
        A: What a lever in it adds, shape (n, 3, 3) [1/s^2].
        b: As `a`, of the second sensor, shape (n, 3).
        B: As `A`, of the second sensor, shape (n, 3, 3).
    """

    def __init__(self, a: np.ndarray, A: np.ndarray, b: np.ndarray, B: np.ndarray):
        self.n = len(a)
        parts = [np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3)), np.diag([0.0, 0.0, 1.0])]
        parts[1][0, 1], parts[1][1, 0] = -1.0, 1.0
        sum_of = np.einsum
        self.AA, self.BB = sum_of("nki,nkj->ij", A, A), sum_of("nki,nkj->ij", B, B)
        self.Aa, self.Bb = sum_of("nki,nk->i", A, a), sum_of("nki,nk->i", B, b)
        self.AB = np.array([sum_of("nki,kl,nlj->ij", A, part, B) for part in parts])
        self.Ab = np.array([sum_of("nki,kl,nl->i", A, part, b) for part in parts])
        self.aB = np.array([sum_of("nk,kl,nli->i", a, part, B) for part in parts])
        self.ab = np.array([sum_of("nk,kl,nl->", a, part, b) for part in parts])
        self.squares = float(np.sum(a**2) + np.sum(b**2))
        # levers are held near 0 by a residual variance of 0.3 m/s^2 squared
        self.prior = 0.3**2 / LEVER_SD**2 * np.eye(6)

    def __call__(self, heading: float) -> float:
        H, right, ab = self._normal(heading)
        left = float(self.squares - 2 * ab - right @ np.linalg.solve(H, right))
        return max(left, 0.0) / self.n

    def levers(self, heading: float) -> tuple[np.ndarray, np.ndarray]:
        """Of the joint's centre from both sensors, one after the other, in their axes.

        Args:
            heading: That brings the second sensor's earth to the first's [rad].

        Returns:
            Shape (6,) [m], and the inverse of their normal matrix, shape (6, 6) [s^4]: times the
            variance of an acceleration it is their covariance, if all are independent.
        """
        H, right, _ = self._normal(heading)
        inverse = np.linalg.inv(H)
        return -inverse @ right, inverse

    def _normal(self, heading: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Normal matrix and right side of the levers (r, s), and what a and b have in common."""
        weights = np.array([np.cos(heading), np.sin(heading), 1.0])
        AB, Ab = np.tensordot(weights, self.AB, 1), np.tensordot(weights, self.Ab, 1)
        aB, ab = weights @ self.aB, weights @ self.ab
        # left over: a + A r - R (b + B s), in r and s
        H = np.block([[self.AA, -AB], [-AB.T, self.BB]]) + self.prior
        right = np.concatenate([self.Aa - Ab, self.Bb - aB])
        return H, right, float(ab)


def _vertex(cost: CentreCost, near: float) -> tuple[float, float]:
    """Place of the minimum, and the second derivative there, by parabolas that narrow down."""
    step, place, curvature = 2 * np.pi / GRID, near, 0.0
    for _ in range(6):
        low, middle, high = cost(place - step), cost(place), cost(place + step)
        curvature = (low - 2 * middle + high) / step**2
        if curvature <= 0:
            break
        place += float(np.clip((low - high) / (2 * step) / curvature, -step, step))
        step = max(step / 3, 1e-3)
    return place, curvature
