"""How the errors of a strapdown navigation pass over a step; states are those of `strapdown`.

The products are written out for the few elements that are not 0.
"""

from __future__ import annotations

import numpy as np
from numba import njit


# One piece: the loops of a product.
@njit(cache=True)
def carry_covariance(m: np.ndarray, turn: np.ndarray, h: float) -> None:
    """P <- F P F'.

    F: position by velocity, velocity by attitude (-[f x]) and the accelerometer's bias (-R),
    attitude by the gyroscope's bias (-R).

    Args:
        m: P, shape (18, 18); updated.
        turn: R and -[f x] side by side, shape (3, 6).
        h: The step [s].
    """
    for j in range(len(m)):
        # p += h v
        for i in range(3):
            m[i, j] += h * m[3 + i, j]
        # v += h (-[f x] e - R b_a)
        for i in range(3):
            for k in range(3):
                m[3 + i, j] += h * (turn[i, 3 + k] * m[6 + k, j] - turn[i, k] * m[12 + k, j])
        # e -= h R b_g
        for i in range(3):
            for k in range(3):
                m[6 + i, j] -= h * turn[i, k] * m[9 + k, j]
    # the same of the columns: (F P) F'
    for j in range(len(m)):
        for i in range(3):
            m[j, i] += h * m[j, 3 + i]
        for i in range(3):
            for k in range(3):
                m[j, 3 + i] += h * (turn[i, 3 + k] * m[j, 6 + k] - turn[i, k] * m[j, 12 + k])
        for i in range(3):
            for k in range(3):
                m[j, 6 + i] -= h * turn[i, k] * m[j, 9 + k]


@njit(cache=True)
def _rows_back(m: np.ndarray, turn: np.ndarray, h: float) -> None:
    """I <- F' I; see `carry_covariance`.

    Args:
        m: I, shape (18, 18); updated.
        turn: R and -[f x] side by side, shape (3, 6).
        h: The step [s].
    """
    for j in range(len(m)):
        # the transposed, in reverse order: b_g -= h R' e, b_a -= h R' v
        for i in range(3):
            for k in range(3):
                m[9 + i, j] -= h * turn[k, i] * m[6 + k, j]
                m[12 + i, j] -= h * turn[k, i] * m[3 + k, j]
        # e += h (-[f x])' v
        for i in range(3):
            for k in range(3):
                m[6 + i, j] += h * turn[k, 3 + i] * m[3 + k, j]
        # v += h p
        for i in range(3):
            m[3 + i, j] += h * m[i, j]


# One piece: the loops of a product.
@njit(cache=True)
def carry_back(costate: np.ndarray, m: np.ndarray, turn: np.ndarray, h: float) -> None:
    """The costate before a step, F' c, and its information, F' I F; see `carry_covariance`.

    Args:
        costate: c, shape (18,); updated.
        m: I, shape (18, 18); updated.
        turn: R and -[f x] side by side, shape (3, 6).
        h: The step [s].
    """
    # F' c: as the rows of `_rows_back`
    for i in range(3):
        for k in range(3):
            costate[9 + i] -= h * turn[k, i] * costate[6 + k]
            costate[12 + i] -= h * turn[k, i] * costate[3 + k]
    for i in range(3):
        for k in range(3):
            costate[6 + i] += h * turn[k, 3 + i] * costate[3 + k]
    for i in range(3):
        costate[3 + i] += h * costate[i]
    # F' I, then the same of its columns
    _rows_back(m, turn, h)
    for j in range(len(m)):
        for i in range(3):
            for k in range(3):
                m[j, 9 + i] -= h * turn[k, i] * m[j, 6 + k]
                m[j, 12 + i] -= h * turn[k, i] * m[j, 3 + k]
        for i in range(3):
            for k in range(3):
                m[j, 6 + i] += h * turn[k, 3 + i] * m[j, 3 + k]
        for i in range(3):
            m[j, 3 + i] += h * m[j, i]


@njit(cache=True)
def invert_three(s: np.ndarray, out: np.ndarray) -> None:
    """The inverse of a symmetric matrix of three rows, by its cofactors.

    Args:
        s: Shape (3, 3).
        out: Filled, shape (3, 3).
    """
    # S^-1 = adj(S) / det(S); the cofactors go round by (i + 1, i + 2)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            out[j, i] = s[a, c] * s[b, d] - s[a, d] * s[b, c]
    # det(S), along its first row
    size = s[0, 0] * out[0, 0] + s[0, 1] * out[1, 0] + s[0, 2] * out[2, 0]
    for i in range(3):
        for j in range(3):
            out[i, j] /= size


@njit(cache=True)
def make_symmetric(m: np.ndarray) -> None:
    """Make a square matrix equal to the mean of itself and its transpose, in place.

    Args:
        m: Shape (n, n); updated.
    """
    # (M + M') / 2
    for i in range(len(m)):
        for j in range(i):
            m[i, j] = m[j, i] = 0.5 * (m[i, j] + m[j, i])
