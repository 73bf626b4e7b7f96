"""Where the heel lies ahead of a sensor on the foot, by the toe that the foot rolls over.

Up to terminal contact a foot turns about its toe: the point of the foot that does not move then.
The heel lies behind it by the length of a foot. A stride that turns the foot is as long as the way
of its heel, which a sensor ahead of it does not go.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.estimation.gait.events import FootAxes
from testbench.model import rotation

HEEL_TO_TOE = 0.25
"""Length of a foot [m]: NASA-STD-3000 (1995), volume 1, section 3: .22 to .29 from the small woman
to the large man. Only strides that turn the foot depend on it, by .3 mm a millimetre in a quarter
turn's half.
"""
TURNING = 1.0
"""Slower turns say little of what the foot turns about [rad/s]."""
LEAST_ROWS = 20
NEAREST, FARTHEST = 0.02, 0.3
"""The toe lies between these ahead of any sensor on a foot [m]."""
ROUNDS = 10
"""Of the reweighted fit; it settles within 1 mm in five."""


def heel_in_sensor(
    pushes: Sequence[slice],
    rate: np.ndarray,
    velocity: np.ndarray,
    q_world_from_sensor: np.ndarray,
    axes: FootAxes,
) -> np.ndarray:
    """From the sensor to below the heel, in the sensor's frame, shape (3,) [m]; 0 where nothing
    tells it.

    The toe at d moves by v + R (omega x d), which is 0 while the foot rolls over it; the sum of its
    magnitudes is made small (least squares, reweighted by Cauchy's function). A turn about the left
    axis does not show where on that axis d lies: in the sensor's own sagittal plane.

    Args:
        pushes: Rows of each push-off.
        rate: Angular rate, shape (n, 3) [rad/s].
        velocity: In the world, shape (n, 3) [m/s].
        q_world_from_sensor: Shape (n, 4).
        axes: Of the foot.
    """
    none = np.zeros(0, dtype=int)
    rows = np.concatenate([none, *(np.arange(own.start, own.stop) for own in pushes)])
    rows = rows[rotation.lengths(rate[rows]) > TURNING]
    if len(rows) < LEAST_ROWS:
        return np.zeros(3)
    moves = rotation.rotate(rotation.conjugate(q_world_from_sensor[rows]), velocity[rows])
    arms = np.stack([np.cross(rate[rows], axes.forward), np.cross(rate[rows], axes.up)], axis=2)
    weight, toe = np.ones(len(rows)), np.zeros(2)
    for _ in range(ROUNDS):
        normal = np.einsum("n,nij,nik->jk", weight, arms, arms)
        toe = -np.linalg.lstsq(normal, np.einsum("n,nij,ni->j", weight, arms, moves))[0]
        off = rotation.lengths(moves + arms @ toe)
        weight = 1 / (1 + (off / max(float(np.median(off)), 1e-6)) ** 2)
    if not NEAREST < toe[0] < FARTHEST:
        return np.zeros(3)
    return np.asarray((toe[0] - HEEL_TO_TOE) * axes.forward + toe[1] * axes.up)
