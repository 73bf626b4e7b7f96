"""Standard uncertainty of joint angles over time, from that of segments, headings and filters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.calibration.hinge_axis import LEAST_RATE
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.decomposition import Decomposition
from testbench.model.windows import moving_mean

MOST = 50_000
"""Instants that it is computed at; between them it is interpolated: it follows the posture."""
STEP = 1e-5
"""Of a small rotation in a numeric derivative [rad]."""
INCLINATION_SD = np.radians(0.3)
"""Of each filter's vertical while a body moves, about each level axis [rad]."""
TURNS_S = 1.0
"""A joint turns where its rate is high over so long (RMS) [s]: legs stand within a stride."""
UP_OF_SEGMENT = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class AngleBudget:
    """What makes the angles of a joint uncertain.

    Attributes:
        proximal: Covariance of the proximal segment's axes, shape (3, 3) [rad^2].
        distal: Covariance of the distal segment's axes, shape (3, 3) [rad^2].
        shared: Of what turns both segments' axes alike, shape (3, 3) [rad^2].
        relative: Of the heading between the earths of both sensors at `start_ns` [rad].
        drift: By how much they drift apart [rad / sqrt(s)].
        start_ns: When the headings were brought together, host time [ns]; None for never.
        posed: Whether an error of the relative heading is none in the standing pose.
        headings: Uncertainty of the heading that a constraint of the joint tells, shape (n,)
            [rad], in place of `relative` and `drift`; None without.
        drifted: Variance of what they have drifted apart by beside that, shape (n,) [rad^2]; None
            for none.
        hinged: Whether z of both segments is the axis of a hinge that the motion showed in both.
    """

    proximal: np.ndarray
    distal: np.ndarray
    shared: np.ndarray
    relative: float
    drift: float
    start_ns: int | None
    posed: bool
    headings: np.ndarray | None = None
    drifted: np.ndarray | None = None
    hinged: bool = False


def angle_sd(
    time_ns: np.ndarray,
    q_proximal: np.ndarray,
    q_distal: np.ndarray,
    decomposition: Decomposition,
    budget: AngleBudget,
) -> np.ndarray:
    """Standard uncertainty of the three angles.

    A small rotation e about the axes of the distal segment is d2 - R' d1 of both segments' axes;
    (1 - R') c of what both share; h (y - u) of the relative heading, u being the
    vertical in the distal segment, where it is none in the standing pose, else h u. Of a hinge
    whose axis was found in both segments, all but what both share is no more across the axis than
    the axes are seen apart.

    Args:
        time_ns: Host time, shape (n,) [ns].
        q_proximal: q_world_from_segment of the proximal segment, shape (n, 4).
        q_distal: Of the distal one, shape (n, 4).
        decomposition: How the angles are written.
        budget: What is uncertain.

    Returns:
        Shape (n, 3) [rad].
    """
    every = -(-len(time_ns) // MOST)
    if every > 1:
        rows = np.append(np.arange(0, len(time_ns) - 1, every), len(time_ns) - 1)
        few = time_ns[rows], q_proximal[rows], q_distal[rows]
        if budget.headings is not None:
            budget = replace(budget, headings=budget.headings[rows])
        if budget.drifted is not None:
            budget = replace(budget, drifted=budget.drifted[rows])
        columns = angle_sd(*few, decomposition, budget).T
        return np.column_stack([np.interp(time_ns, few[0], column) for column in columns])
    q = rotation.multiply(rotation.conjugate(q_proximal), q_distal)
    R = rotation.to_matrix(q)
    up = rotation.to_matrix(q_distal)[:, 2, :]
    covariance = budget.distal + np.einsum("nki,kl,nlj->nij", R, budget.proximal, R)
    variance = _relative_variance(time_ns, budget)
    lasting = UP_OF_SEGMENT - up if budget.posed else up
    covariance += budget.relative**2 * _outer(lasting) if budget.headings is None else 0.0
    covariance += variance[:, None, None] * _outer(up)
    covariance += 2 * INCLINATION_SD**2 * (np.eye(3) - _outer(up))
    if budget.hinged:
        covariance = _as_seen(covariance, time_ns, R)
    left = np.eye(3) - np.swapaxes(R, 1, 2)
    covariance += np.einsum("nik,kl,njl->nij", left, budget.shared, left)
    J = _derivative(q, decomposition)
    found = np.einsum("nik,nkl,nil->ni", J, covariance, J)
    return np.minimum(np.sqrt(np.maximum(found, 0.0)), np.pi)


def _as_seen(covariance: np.ndarray, time_ns: np.ndarray, R: np.ndarray) -> np.ndarray:
    """What is uncertain of a hinge across its axis, by how far the axes in both segments are apart.

    Axes that coincide in the mean over the motion, as found ones do, are apart by errors of either
    sensor and by what the joint moves beside its axis. The one does not follow the other, so that
    the mean square of their sum is at least that of the errors: what is stated is made as small
    where it is more. Instants count by the square of the rate about the axis, as they do where the
    axis is found; where the joint does not turn, as while filters still settle at the beginning,
    nothing is seen.

    Args:
        covariance: Of each sensor's own errors about the distal axes, shape (n, 3, 3) [rad^2].
        time_ns: Host time, shape (n,) [ns].
        R: Distal axes in the proximal segment, shape (n, 3, 3).

    Returns:
        Shape (n, 3, 3) [rad^2].
    """
    turned = np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])
    steps = np.diff(time_ns) / NANOSECONDS
    rate = np.nan_to_num(rotation.wrap(np.diff(turned)) / steps)
    apart = np.sum(R[1:, 2, :2] ** 2, axis=1)  # z of the proximal segment across the distal one's
    stated = covariance[1:, 0, 0] + covariance[1:, 1, 1]
    known = np.isfinite(apart)
    weight = rate[known] ** 2
    most, seen = weight @ stated[known], weight @ apart[known]
    if not 0 < seen < most:
        return covariance
    window = max(round(TURNS_S / float(np.median(steps))), 1)
    turns = np.sqrt(np.maximum(moving_mean(rate**2, window), 0.0)) > LEAST_RATE
    across = np.where(np.append(turns[:1], turns), np.sqrt(seen / most), 1.0)
    less = np.column_stack([across, across, np.ones(len(R))])
    return np.asarray(covariance * less[:, :, None] * less[:, None, :])


def _relative_variance(time_ns: np.ndarray, budget: AngleBudget) -> np.ndarray:
    """Of the heading between both sensors, beside what lasts, shape (n,) [rad^2]."""
    if budget.headings is not None:
        return budget.headings**2
    if budget.start_ns is None:
        return np.zeros(len(time_ns))
    walked = budget.drift**2 * np.abs(time_ns - budget.start_ns) / NANOSECONDS
    return np.asarray(walked if budget.drifted is None else walked + budget.drifted)


def _outer(v: np.ndarray) -> np.ndarray:
    return np.asarray(v[:, :, None] * v[:, None, :])


def _derivative(q: np.ndarray, decomposition: Decomposition) -> np.ndarray:
    """Of the three angles in a small rotation about the distal axes, shape (n, 3, 3)."""
    columns = []
    for axis in np.eye(3):
        turn = rotation.from_rotation_vector(STEP * axis)
        ahead = decomposition.angles(rotation.multiply(q, turn))
        behind = decomposition.angles(rotation.multiply(q, rotation.conjugate(turn)))
        columns.append(rotation.wrap(ahead - behind) / (2 * STEP))
    return np.stack(columns, axis=-1)
