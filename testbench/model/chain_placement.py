"""How the reading of a sensor on a chain changes with where it sits, and with the chain's lengths.

With S the rotation of the sensor in the world, omega and alpha the motion of the body that a point
is fixed to (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 2): a turn delta of the sensor
about its own axes turns what it reads the other way, and a point that lies d further out is
accelerated by more,

    d reading / d delta = [reading] x         d force / d d = S' (alpha x d + omega x (omega x d))

which holds for the place of the sensor on its link and, with d along the offset of a joint in the
body before it, for the length of a segment.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.model.chain import DW, Chain, Tip, W, reach, rest, turn


@njit(cache=True)
def placement_slopes(
    chain: Chain, tip: Tip, motion: np.ndarray, reading: np.ndarray, slopes: np.ndarray
) -> None:
    """Derivatives of an ideal reading by the sensor's placement and the lengths before it.

    Args:
        chain: The joints that carry it, k of them.
        tip: The sensor in the frame of the last of them.
        motion: Angles [rad], rates [rad/s] and accelerations [rad/s^2] of the joints, shape (3, m).
        reading: Angular rate [rad/s] and specific force [m/s^2] of the sensor, shape (6,).
        slopes: Filled with the derivatives, shape (6, 6 + k): by a turn of the sensor about its own
            axes [1/rad], by its place in the frame of the last joint [1/m], and by the relative
            length of the offset of each joint [1].
    """
    count = chain.columns.shape[0]
    body, R, S = np.empty((7, 3)), np.empty((3, 3)), np.empty((3, 3))
    # of each joint: what a longer offset of it adds to the acceleration of all beyond it
    added = np.empty((count, 3))
    d = np.empty(3)
    slopes[:] = 0.0
    rest(body, R)
    for j in range(count):
        _turned(R, chain.offsets[j], d)
        _carried(body[W], body[DW], d, added[j])
        reach(body, R, S, chain.rotations[j], chain.offsets[j])
        k = chain.columns[j]
        turn(body, R, S, chain.axes[j], motion[0, k], motion[1, k], motion[2, k])
    reach(body, R, S, tip.rotation, tip.offset)
    by_place = np.empty((3, 3))
    for c in range(3):
        for r in range(3):
            d[r] = R[r, c]
        _carried(body[W], body[DW], d, by_place[c])
    for r in range(3):
        for c in range(3):
            for t in range(3):
                slopes[3 + r, 3 + c] += S[t, r] * by_place[c, t]
        for j in range(count):
            for t in range(3):
                slopes[3 + r, 6 + j] += S[t, r] * added[j, t]
    for first in (0, 3):
        x, y, z = reading[first], reading[first + 1], reading[first + 2]
        slopes[first, 1], slopes[first, 2] = -z, y
        slopes[first + 1, 0], slopes[first + 1, 2] = z, -x
        slopes[first + 2, 0], slopes[first + 2, 1] = -y, x


@njit(cache=True, inline="always")
def _turned(R: np.ndarray, x: np.ndarray, out: np.ndarray) -> None:
    """R x, filled into `out`."""
    for r in range(3):
        # (R x)_r = sum R_rk x_k
        out[r] = R[r, 0] * x[0] + R[r, 1] * x[1] + R[r, 2] * x[2]


@njit(cache=True, inline="always")
def _carried(w: np.ndarray, dw: np.ndarray, d: np.ndarray, out: np.ndarray) -> None:
    """Acceleration of a point at d against its body's origin, filled into `out`."""
    # omega x d
    x = w[1] * d[2] - w[2] * d[1]
    y = w[2] * d[0] - w[0] * d[2]
    z = w[0] * d[1] - w[1] * d[0]
    # alpha x d + omega x (omega x d)
    out[0] = dw[1] * d[2] - dw[2] * d[1] + w[1] * z - w[2] * y
    out[1] = dw[2] * d[0] - dw[0] * d[2] + w[2] * x - w[0] * z
    out[2] = dw[0] * d[1] - dw[1] * d[0] + w[0] * y - w[1] * x
