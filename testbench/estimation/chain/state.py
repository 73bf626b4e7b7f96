"""The two state vectors of the chain filter, and how joint angles, rates and accelerations follow from them; compiled.

kinematic: q, v and a of the m joints. The jerk is white noise.
fourier: q = c_0 + sum over k = 1..n of c_k, each c_k with its quadrature s_k turning at k omega, so that v = omega sum k s_k
    and a = -omega^2 sum k^2 c_k. That is the Fourier series of Quijano & Valencia (Universidad del Cauca, 2018, eq 3.20) seen
    at the present phase: their a_k and b_k are c_k and s_k turned back by k omega t. The angular frequency omega is common to
    all joints and is estimated too. In this form nothing grows with time, as the derivative of cos(k omega t) by omega does.

Order of the states: kinematic [q, v, a], fourier [c_0, c_1, s_1, .. c_n, s_n, omega], each entry but omega m wide; then, where
biases are estimated, three of the gyroscope and three of the accelerometer for each sensor.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def motion_size(m: int, harmonics: int) -> int:
    """Number of states before the biases; `harmonics` 0 stands for the kinematic state."""
    return m * (2 * harmonics + 1) + 1 if harmonics else 3 * m


def state_indices(m: int, harmonics: int) -> np.ndarray:
    """The states that each joint depends on, shape (m, 3) or (m, 2 n + 2)."""
    rows = np.arange(m)[:, None]
    if not harmonics:
        return np.ascontiguousarray(rows + m * np.arange(3))
    omega = np.full((m, 1), motion_size(m, harmonics) - 1)
    return np.hstack([rows + m * np.arange(2 * harmonics + 1), omega])


@njit(cache=True)
def joint_motion(x: np.ndarray, indices: np.ndarray, harmonics: int, motion: np.ndarray, slopes: np.ndarray) -> None:
    """Joint angles, rates and accelerations of a state, and their derivatives by the states they depend on.

    Args:
        x: The state. indices: As `state_indices` gives them, shape (m, k).
        motion: Filled with q, v and a, shape (3, m). slopes: Filled with their derivatives, shape (3, m, k).
    """
    m = indices.shape[0]
    slopes[:] = 0.0
    for j in range(m):
        if harmonics == 0:
            for order in range(3):
                motion[order, j] = x[indices[j, order]]
                slopes[order, j, order] = 1.0
            continue
        omega = x[indices[j, 2 * harmonics + 1]]
        q = x[indices[j, 0]]
        rate = bend = 0.0
        slopes[0, j, 0] = 1.0
        for k in range(1, harmonics + 1):
            c, s = x[indices[j, 2 * k - 1]], x[indices[j, 2 * k]]
            q += c
            rate += k * s
            bend += k * k * c
            slopes[0, j, 2 * k - 1] = 1.0
            slopes[1, j, 2 * k] = k * omega
            slopes[2, j, 2 * k - 1] = -(k * k) * omega * omega
        slopes[1, j, 2 * harmonics + 1] = rate
        slopes[2, j, 2 * harmonics + 1] = -2.0 * omega * bend
        motion[0, j] = q
        motion[1, j] = omega * rate
        motion[2, j] = -omega * omega * bend


@njit(cache=True)
def transition(x: np.ndarray, m: int, harmonics: int, dt: float) -> np.ndarray:
    """The state after dt [s] without noise, and put into x; returns the derivative by the state before, shape (n, n)."""
    n = x.shape[0]
    F = np.eye(n)
    if harmonics == 0:
        for j in range(m):
            F[j, m + j] = dt
            F[j, 2 * m + j] = 0.5 * dt * dt
            F[m + j, 2 * m + j] = dt
        x[:] = F @ x
        return F
    last = m * (2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
        for j in range(m):
            i = m * (2 * k - 1) + j
            c, s = x[i], x[i + m]
            x[i] = cosine * c + sine * s
            x[i + m] = cosine * s - sine * c
            F[i, i] = F[i + m, i + m] = cosine
            F[i, i + m] = sine
            F[i + m, i] = -sine
            F[i, last] = k * dt * x[i + m]
            F[i + m, last] = -k * dt * x[i]
    return F


@njit(cache=True)
def propagate(x: np.ndarray, P: np.ndarray, m: int, harmonics: int, dt: float) -> None:
    """What `transition` does, with the covariance, without building the matrix: x and P are changed in place."""
    if harmonics == 0:
        _propagate_kinematic(x, P, m, dt)
    else:
        _propagate_fourier(x, P, m, harmonics, dt)


@njit(cache=True)
def _propagate_kinematic(x: np.ndarray, P: np.ndarray, m: int, dt: float) -> None:
    n, half = x.shape[0], 0.5 * dt * dt
    for j in range(m):
        x[j] += dt * x[m + j] + half * x[2 * m + j]
        x[m + j] += dt * x[2 * m + j]
    for j in range(m):
        for c in range(n):
            P[j, c] += dt * P[m + j, c] + half * P[2 * m + j, c]
    for j in range(m):
        for c in range(n):
            P[m + j, c] += dt * P[2 * m + j, c]
    for r in range(n):
        for j in range(m):
            P[r, j] += dt * P[r, m + j] + half * P[r, 2 * m + j]
        for j in range(m):
            P[r, m + j] += dt * P[r, 2 * m + j]


@njit(cache=True)
def _propagate_fourier(x: np.ndarray, P: np.ndarray, m: int, harmonics: int, dt: float) -> None:
    n = x.shape[0]
    last = m * (2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
        first = m * (2 * k - 1)
        for i in range(first, first + m):
            c, s = x[i], x[i + m]
            x[i] = cosine * c + sine * s
            x[i + m] = cosine * s - sine * c
            by_c, by_s = k * dt * x[i + m], -k * dt * x[i]
            for column in range(n):
                c, s, w = P[i, column], P[i + m, column], P[last, column]
                P[i, column] = cosine * c + sine * s + by_c * w
                P[i + m, column] = cosine * s - sine * c + by_s * w
    for r in range(n):
        w = P[r, last]
        for k in range(1, harmonics + 1):
            cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
            first = m * (2 * k - 1)
            for i in range(first, first + m):
                c, s = P[r, i], P[r, i + m]
                P[r, i] = cosine * c + sine * s + k * dt * x[i + m] * w
                P[r, i + m] = cosine * s - sine * c - k * dt * x[i] * w


@njit(cache=True)
def drive(P: np.ndarray, m: int, harmonics: int, jerk: np.ndarray, walk: np.ndarray, dt: float) -> None:
    """Add what the process noise does over dt [s] to a covariance.

    Args:
        jerk: Power spectral density of the white jerk of each joint, shape (m,) [rad^2/s^5]; kinematic state only (Bar-Shalom,
            Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, eq 6.2.3-7). walk: Growth of the
            variance of each state, shape (n,) [unit^2/s].
    """
    if harmonics == 0:
        for j in range(m):
            d = jerk[j] * dt
            q, v, a = j, m + j, 2 * m + j
            P[q, q] += d * dt**4 / 20
            P[q, v] += d * dt**3 / 8
            P[v, q] += d * dt**3 / 8
            P[q, a] += d * dt**2 / 6
            P[a, q] += d * dt**2 / 6
            P[v, v] += d * dt**2 / 3
            P[v, a] += d * dt / 2
            P[a, v] += d * dt / 2
            P[a, a] += d
    for i in range(P.shape[0]):
        P[i, i] += walk[i] * dt
        for c in range(i):  # rounding differs by row and column, and what is not symmetric may grow
            P[i, c] = P[c, i] = 0.5 * (P[i, c] + P[c, i])
