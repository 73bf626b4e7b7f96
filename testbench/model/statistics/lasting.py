"""How sure a coefficient of a short fit is whose residuals last.

Errors of orientation hang together over seconds, and a sweep may be shorter than that: its
residuals are few independent ones, and clusters of them are one or two. They are taken to follow a
law of first order, R(t) = s2 exp(-t / tau), whose s2 and tau are those that fit best by residual
maximum likelihood (Patterson & Thompson, Biometrika 58, 1971), which counts what the fit itself
took out. Whitened, such a series is one difference after another, so that a likelihood costs no
more than a fit.
"""

from __future__ import annotations

import numpy as np
from numba import njit

TAUS = 24
"""Correlation times that are tried."""
SHORTEST, LONGEST = 1 / 3, 5.0
"""The first of them in median intervals, the last in durations of the whole; one of five durations
is a random walk.
"""
DOUBT = 0.8
"""Of the times whose log-likelihood falls short of the largest by no more, the worst is taken."""


def lasting_sd(
    time_s: np.ndarray, columns: np.ndarray, values: np.ndarray, influence: np.ndarray
) -> float:
    """Standard uncertainty of a weighted sum of values with memory.

    Args:
        time_s: Of the values, increasing, shape (n,) [s].
        columns: That explain them, but for their errors, shape (n, p).
        values: Shape (n,).
        influence: Weight of each value in the sum, shape (n,).

    Returns:
        In the unit of the sum; NaN for too few values.
    """
    n, p = columns.shape
    gaps = np.diff(time_s, prepend=time_s[:1])
    if n < p + 4 or not time_s[-1] > time_s[0]:
        return float("nan")
    shortest = SHORTEST * float(np.median(gaps[1:]))
    taus = np.geomspace(shortest, LONGEST * (time_s[-1] - time_s[0]), TAUS)
    likelihood, variance = _by_time(
        np.ascontiguousarray(columns), np.ascontiguousarray(values), influence, gaps, taus
    )
    known = np.isfinite(likelihood) & np.isfinite(variance)
    if not known.any():
        return float("nan")
    kept = known & (likelihood >= likelihood[known].max() - DOUBT)
    return float(np.sqrt(max(variance[kept].max(), 0.0)))


@njit(cache=True)
def _by_time(
    columns: np.ndarray,
    values: np.ndarray,
    influence: np.ndarray,
    gaps: np.ndarray,
    taus: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Log-likelihood of each correlation time, and the variance of the sum by it, shape (g,) each.

    Args:
        columns: That explain the values, shape (n, p).
        values: With errors that last, shape (n,).
        influence: Weight of each in the sum, shape (n,).
        gaps: Time since the value before, shape (n,) [s].
        taus: Shape (g,) [s].
    """
    n, p = columns.shape
    likelihood, variance = np.empty(len(taus)), np.empty(len(taus))
    white = np.empty((n, p + 1))
    for g in range(len(taus)):
        held = total = logarithms = 0.0
        for i in range(n):
            # each value less what the one before it tells of it, over what is left of its variance
            phi = np.exp(-gaps[i] / taus[g]) if i else 0.0
            left = max(1.0 - phi * phi, 1e-12)
            logarithms += np.log(left)
            scale = 1.0 / np.sqrt(left)
            for j in range(p):
                before = columns[i - 1, j] if i else 0.0
                white[i, j] = (columns[i, j] - phi * before) * scale
            white[i, p] = (values[i] - phi * (values[i - 1] if i else 0.0)) * scale
            # influence' R influence
            held *= phi
            total += influence[i] * (influence[i] + 2 * held)
            held += influence[i]
        products = white.T @ white
        inner = products[:p, :p]
        determinant = np.linalg.det(inner)
        if not determinant > 0.0:
            likelihood[g] = variance[g] = np.nan
            continue
        explained = products[p, :p] @ np.linalg.solve(inner, products[:p, p])
        s2 = max(products[p, p] - explained, 1e-300) / (n - p)
        likelihood[g] = -0.5 * ((n - p) * np.log(s2) + logarithms + np.log(determinant))
        variance[g] = total * s2
    return likelihood, variance
