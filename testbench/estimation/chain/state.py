"""The two state vectors of the chain filter and the joint motions that follow from them; compiled.

kinematic: q, v and a of the m joints. The jerk is white noise. A joint with limits is drawn back to
the middle of its range by three equal poles, (d/dt + lambda)^3 (q - middle) = white, a Matérn
process (Hartikainen & Särkkä, Kalman filtering and smoothing solutions to temporal Gaussian process
regression models, MLSP 2010) whose stationary standard deviation is that of an angle of which
nothing is known but its range. Without limits lambda is 0: white jerk integrated three times.
fourier: q = c_0 + sum over k = 1..n of c_k, each c_k with its quadrature s_k turning at k omega, so
that v = omega sum k s_k and a = -omega^2 sum k^2 c_k. That is the Fourier series of Quijano &
Valencia (Universidad del Cauca, 2018, eq 3.20) seen at the present phase: their a_k and b_k are c_k
and s_k turned back by k omega t. The angular frequency omega is common to all joints and is
estimated too. In this form nothing grows with time, as the derivative of cos(k omega t) by omega
does.

Order of the states: kinematic [q, v, a], fourier [c_0, c_1, s_1, .. c_n, s_n, omega], each entry
but omega m wide; then, where biases are estimated, three of the gyroscope and three of the
accelerometer for each sensor, and how late each sensor's clock is; then, where scales are too, what
`SensorNoise.scale_variance` lists, sensor by sensor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Process(NamedTuple):
    """How the joints move between readings.

    Attributes:
        harmonics: Of the Fourier series; 0 for the kinematic state.
        indices: States that each joint depends on, as `state_indices` gives them, shape (m, k).
        limits: Lowest and highest angle of each joint, shape (m, 2) [rad]; infinite for none.
        confined: As `confinement` gives it, shape (m, 2).
        jerk: Power spectral density of the jerk of each joint, shape (m,) [rad^2/s^5].
        walk: Growth of the variance of each state, shape (n,) [unit^2/s].
        raised: What is added to `walk` at the raised level of process noise, shape (n,).
    """

    harmonics: int
    indices: np.ndarray
    limits: np.ndarray
    confined: np.ndarray
    jerk: np.ndarray
    walk: np.ndarray
    raised: np.ndarray


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
def joint_motion(
    x: np.ndarray, indices: np.ndarray, harmonics: int, motion: np.ndarray, slopes: np.ndarray
) -> None:
    """Joint angles, rates and accelerations of a state, and their derivatives by that.

    Args:
        x: The state, shape (n,).
        indices: As `state_indices` gives them, shape (m, k).
        harmonics: Of the Fourier series; 0 for the kinematic state.
        motion: Filled with q, v and a, shape (3, m).
        slopes: Filled with their derivatives, shape (3, m, k).
    """
    m = indices.shape[0]
    slopes[:] = 0.0
    for j in range(m):
        if harmonics == 0:
            for order in range(3):
                motion[order, j] = x[indices[j, order]]
                slopes[order, j, order] = 1.0
            continue
        # q = c_0 + sum c_k, v = omega sum k s_k, a = -omega^2 sum k^2 c_k
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


def confinement(limits: np.ndarray, jerk: np.ndarray) -> np.ndarray:
    """Middle of each joint's range, and the rate at which the state is drawn back to it.

    Of (d/dt + lambda)^3 q = white noise of density S, with lambda the rate, the stationary variance
    is 3 S / (16 lambda^5); that of an angle anywhere in a range is its square over twelve.

    Args:
        limits: Shape (m, 2), infinite for none [rad].
        jerk: As `FilterSettings.jerk` gives it, shape (m,).

    Returns:
        Middle [rad] and rate [1/s], shape (m, 2).
    """
    known = np.isfinite(limits).all(axis=1)
    span = np.where(known, np.diff(np.where(known[:, None], limits, 0.0), axis=1)[:, 0], np.inf)
    middle = np.where(known, np.where(known[:, None], limits, 0.0).mean(axis=1), 0.0)
    return np.column_stack([middle, (3 * jerk / (16 * span**2 / 12)) ** 0.2])


@njit(cache=True)
def _confined(rate: float, dt: float, f: np.ndarray) -> None:
    """The transition of q - middle, v and a of one joint over dt [s], filled into shape (3, 3)."""
    # exp(A dt) of three equal poles at -rate: their polynomials times exp(-rate dt)
    r, d = rate, np.exp(-rate * dt)
    f[0, 0], f[0, 1], f[0, 2] = 1 + r * dt + 0.5 * (r * dt) ** 2, dt + r * dt**2, 0.5 * dt**2
    f[1, 0], f[1, 1], f[1, 2] = (
        -0.5 * r**3 * dt**2,
        1 + r * dt - (r * dt) ** 2,
        dt - 0.5 * r * dt**2,
    )
    f[2, 0], f[2, 1], f[2, 2] = (
        r**3 * (0.5 * r * dt**2 - dt),
        r**2 * (r * dt**2 - 3 * dt),
        1 - 2 * r * dt + 0.5 * (r * dt) ** 2,
    )
    for i in range(3):
        for c in range(3):
            f[i, c] *= d


@njit(cache=True)
def transition(
    x: np.ndarray, m: int, harmonics: int, confined: np.ndarray, dt: float
) -> np.ndarray:
    """Move a state on without noise.

    Args:
        x: The state, shape (n,); replaced by the one after dt.
        m: Joints.
        harmonics: Of the Fourier series; 0 for the kinematic state.
        confined: As `confinement` gives it, shape (m, 2).
        dt: Time that passes [s].

    Returns:
        The derivative of the state after by that before, shape (n, n).
    """
    n = x.shape[0]
    F = np.eye(n)
    if harmonics == 0:
        f = np.empty((3, 3))
        for j in range(m):
            _confined(confined[j, 1], dt, f)
            for r in range(3):
                for c in range(3):
                    F[r * m + j, c * m + j] = f[r, c]
            x[j] -= confined[j, 0]
        x[:] = F @ x
        for j in range(m):
            x[j] += confined[j, 0]
        return F
    last = m * (2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
        for j in range(m):
            # c_k and s_k turn by k omega dt
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
def propagate(
    x: np.ndarray, P: np.ndarray, m: int, harmonics: int, confined: np.ndarray, dt: float
) -> None:
    """Move a state and its covariance on without noise, without building the matrix.

    Args:
        x: The state, shape (n,); replaced.
        P: Its covariance, shape (n, n); replaced.
        m: Joints.
        harmonics: Of the Fourier series; 0 for the kinematic state.
        confined: As `confinement` gives it, shape (m, 2).
        dt: Time that passes [s].
    """
    # F is of blocks: three states a joint, or a pair for each harmonic
    if harmonics == 0:
        _propagate_kinematic(x, P, m, confined, dt)
    else:
        _propagate_fourier(x, P, m, harmonics, dt)


@njit(cache=True)
def _propagate_kinematic(
    x: np.ndarray, P: np.ndarray, m: int, confined: np.ndarray, dt: float
) -> None:
    n = x.shape[0]
    f = np.empty((3, 3))
    for j in range(m):
        _confined(confined[j, 1], dt, f)
        v, a = m + j, 2 * m + j
        # x <- middle + F (x - middle)
        x0, x1, x2 = x[j] - confined[j, 0], x[v], x[a]
        x[j] = confined[j, 0] + f[0, 0] * x0 + f[0, 1] * x1 + f[0, 2] * x2
        x[v] = f[1, 0] * x0 + f[1, 1] * x1 + f[1, 2] * x2
        x[a] = f[2, 0] * x0 + f[2, 1] * x1 + f[2, 2] * x2
        for c in range(n):
            # F P
            p0, p1, p2 = P[j, c], P[v, c], P[a, c]
            P[j, c] = f[0, 0] * p0 + f[0, 1] * p1 + f[0, 2] * p2
            P[v, c] = f[1, 0] * p0 + f[1, 1] * p1 + f[1, 2] * p2
            P[a, c] = f[2, 0] * p0 + f[2, 1] * p1 + f[2, 2] * p2
        for r in range(n):
            # (F P) F'
            p0, p1, p2 = P[r, j], P[r, v], P[r, a]
            P[r, j] = f[0, 0] * p0 + f[0, 1] * p1 + f[0, 2] * p2
            P[r, v] = f[1, 0] * p0 + f[1, 1] * p1 + f[1, 2] * p2
            P[r, a] = f[2, 0] * p0 + f[2, 1] * p1 + f[2, 2] * p2


@njit(cache=True)
def _propagate_fourier(x: np.ndarray, P: np.ndarray, m: int, harmonics: int, dt: float) -> None:
    n = x.shape[0]
    last = m * (2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
        first = m * (2 * k - 1)
        for i in range(first, first + m):
            c, s = x[i], x[i + m]
            # c_k and s_k turn by k omega dt
            x[i] = cosine * c + sine * s
            x[i + m] = cosine * s - sine * c
            # derivatives by omega: dc / d omega = k dt s, ds / d omega = -k dt c, of what they
            # became
            by_c, by_s = k * dt * x[i + m], -k * dt * x[i]
            for column in range(n):
                # F P
                c, s, w = P[i, column], P[i + m, column], P[last, column]
                P[i, column] = cosine * c + sine * s + by_c * w
                P[i + m, column] = cosine * s - sine * c + by_s * w
    for r in range(n):
        w = P[r, last]
        for k in range(1, harmonics + 1):
            cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
            first = m * (2 * k - 1)
            for i in range(first, first + m):
                # (F P) F'
                c, s = P[r, i], P[r, i + m]
                P[r, i] = cosine * c + sine * s + k * dt * x[i + m] * w
                P[r, i + m] = cosine * s - sine * c - k * dt * x[i] * w


@njit(cache=True)
def carry(
    x: np.ndarray, V: np.ndarray, m: int, harmonics: int, confined: np.ndarray, dt: float
) -> None:
    """Move sensitivities of a state's error on.

    Args:
        x: The state after dt, shape (n,).
        V: Sensitivities, shape (n, p); replaced.
        m: Joints.
        harmonics: Of the Fourier series; 0 for the kinematic state.
        confined: As `confinement` gives it, shape (m, 2).
        dt: Time that passes [s].
    """
    if harmonics == 0:
        f = np.empty((3, 3))
        for j in range(m):
            _confined(confined[j, 1], dt, f)
            for c in range(V.shape[1]):
                # V = F V (Friedland 1969)
                q, v, a = V[j, c], V[m + j, c], V[2 * m + j, c]
                V[j, c] = f[0, 0] * q + f[0, 1] * v + f[0, 2] * a
                V[m + j, c] = f[1, 0] * q + f[1, 1] * v + f[1, 2] * a
                V[2 * m + j, c] = f[2, 0] * q + f[2, 1] * v + f[2, 2] * a
        return
    last = m * (2 * harmonics + 1)
    for k in range(1, harmonics + 1):
        cosine, sine = np.cos(k * x[last] * dt), np.sin(k * x[last] * dt)
        first = m * (2 * k - 1)
        for i in range(first, first + m):
            by_c, by_s = k * dt * x[i + m], -k * dt * x[i]
            for column in range(V.shape[1]):
                # V = F V, with the derivatives by omega of `_propagate_fourier`
                c, s, w = V[i, column], V[i + m, column], V[last, column]
                V[i, column] = cosine * c + sine * s + by_c * w
                V[i + m, column] = cosine * s - sine * c + by_s * w


@njit(cache=True)
def drive(
    P: np.ndarray,
    m: int,
    harmonics: int,
    jerk: np.ndarray,
    confined: np.ndarray,
    walk: np.ndarray,
    dt: float,
) -> None:
    """Add what the process noise does over dt [s] to a covariance.

    The integral of the noise's response is that of Gauss and Legendre at three instants, exact
    without confinement (Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and
    Navigation, 2001, eq 6.2.3-7).

    Args:
        P: Covariance of the state, shape (n, n); added to.
        m: Joints.
        harmonics: Of the Fourier series; 0 for the kinematic state.
        jerk: Power spectral density of the white jerk of each joint, shape (m,) [rad^2/s^5];
            kinematic state only.
        confined: As `confinement` gives it, shape (m, 2).
        walk: Growth of the variance of each state, shape (n,) [unit^2/s].
        dt: Time that passes [s].
    """
    if harmonics == 0:
        f = np.empty((3, 3))
        for node in range(3):
            s = 0.5 * dt * (1.0 + (node - 1) * math.sqrt(0.6))
            weight = dt * (4.0 / 9.0 if node == 1 else 5.0 / 18.0)
            for j in range(m):
                _confined(confined[j, 1], s, f)
                for r in range(3):
                    for c in range(3):
                        P[r * m + j, c * m + j] += jerk[j] * weight * f[r, 2] * f[c, 2]
    for i in range(P.shape[0]):
        P[i, i] += walk[i] * dt
        for c in range(i):  # rounding differs by row and column, and asymmetry may grow
            P[i, c] = P[c, i] = 0.5 * (P[i, c] + P[c, i])
