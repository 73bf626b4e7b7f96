"""How sure the times of a clock are that was fitted to angular rates.

What remains after a fit is no white noise. A gyroscope's own errors last as long as a move does,
or longer. Rates between noisy orientations go against one another a span later, so that they say
more of a time than as many independent ones; smooth noise lasts, so that they say less.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

CLUSTERS_S = (2.0, 4.0, 8.0, 16.0, 32.0)
"""Residuals closer than this count as one when the uncertainty is stated: errors of a gyroscope
last as long as a move, or longer [s].
"""
FEWEST_CLUSTERS = 6
"""Fewer do not tell how much they differ."""
MEMORY_S = 4.0
"""Longest lag at which the residuals' autocorrelation counts [s]; longer memories are in the
clusters.
"""
LEVELS = 16
"""So many levels of the rate are told apart in what a fit leaves [1]."""


def by_clusters(
    jacobian: np.ndarray, residual: np.ndarray, time: np.ndarray, few: bool = True
) -> list[np.ndarray]:
    """Covariances by letting residuals hang together over several lengths, each shape (k, k).

    Args:
        jacobian: Of the residuals by what was fitted, shape (n, k).
        residual: Shape (n,).
        time: Increasing, shape (n,) [s].
        few: Whether to widen each by what few clusters do not tell of their own spread.
    """
    shortest = np.floor(time / CLUSTERS_S[0]).astype(np.int64)
    begins, sums = _cluster_sums(jacobian, residual, shortest)
    whole, number = jacobian.T @ jacobian, shortest[begins]
    found = []
    for seconds in CLUSTERS_S:
        # a longer one is made of shorter ones
        starts = _starts(number // round(seconds / CLUSTERS_S[0]))
        together = [np.add.reduceat(values, starts, axis=0) for values in sums]
        covariance, count = _jackknife_covariance(whole, *together)
        if seconds == CLUSTERS_S[0] or count >= FEWEST_CLUSTERS:
            # few clusters tell their own spread badly: Student's t in place of the normal
            wider = stdtrit(max(count - 3, 2), 0.975) / 1.96 if few else 1.0
            found.append(covariance * wider**2)
    return found


def of_a_noisy_truth(
    jacobian: np.ndarray, residual: np.ndarray, time: np.ndarray, expected: np.ndarray
) -> np.ndarray:
    """Covariance where the truth's rates hold noise of its orientations, shape (k, k).

    That is the mean of those by clusters and of one by the memory of the residuals; the largest of
    six that scatter would promise too little by half. The length of a rate with noise is longer
    than that of the rate (Rice 1945), by an amount that depends on the rate. What depends on that
    alone is the same before and after a time at which it is fastest, shifts no clock, and is taken
    out first.

    Args:
        jacobian: Of the residuals by what was fitted, shape (n, k).
        residual: Shape (n,) [rad/s].
        time: Increasing, shape (n,) [s].
        expected: The truth's rates, shape (n,) [rad/s].
    """
    own = np.empty_like(residual)
    for level in np.array_split(np.argsort(expected, kind="stable"), LEVELS):
        if len(level):
            own[level] = residual[level] - residual[level].mean()
    found = [_by_memory(jacobian, own, time), *by_clusters(jacobian, own, time, few=False)]
    return np.asarray(np.mean(found, axis=0))


def _by_memory(jacobian: np.ndarray, residual: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Covariance of a least-squares fit by the autocorrelation of its residuals, shape (k, k).

    (J'J)^-1 J'CJ (J'J)^-1, where C holds the autocovariance up to `MEMORY_S` with Bartlett's
    weights (Newey & West, Econometrica 55, 1987, eq. 5), that of the residuals and not of the
    scores: noise of a truth does not depend on how it moves.

    Args:
        jacobian: Of the residuals by what was fitted, shape (n, k).
        residual: Shape (n,).
        time: Increasing, shape (n,) [s].
    """
    usual = max(float(np.median(np.diff(time))), 1e-6)
    rows = np.round((time - time[0]) / usual).astype(np.int64)
    longest = min(round(MEMORY_S / usual), len(rows) - 1)
    size = 1 << int(rows[-1] + longest + 1).bit_length()

    def spectrum(values: np.ndarray) -> np.ndarray:
        on_grid = np.zeros((size, values.shape[1]))
        on_grid[rows] = values
        return np.fft.rfft(on_grid, axis=0)

    def at_lags(values: np.ndarray) -> np.ndarray:
        """Sums of products so many rows apart, shape (longest + 1,)."""
        return np.asarray(np.fft.irfft(np.abs(spectrum(values)[:, 0]) ** 2, size)[: longest + 1])

    pairs = np.maximum(np.round(at_lags(np.ones((len(rows), 1)))), 1.0)
    weights = 1 - np.arange(longest + 1) / (longest + 1)
    law = np.zeros(size)
    law[: longest + 1] = weights * at_lags(residual[:, None]) / pairs
    law[size - longest :] = law[longest:0:-1]
    blurred = np.fft.irfft(spectrum(jacobian) * np.fft.rfft(law)[:, None], size, axis=0)[rows]
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    return np.asarray(inverse @ (jacobian.T @ blurred) @ inverse)


def _starts(cluster: np.ndarray) -> np.ndarray:
    """First row of each cluster, of increasing numbers, shape (m,)."""
    return np.flatnonzero(np.diff(cluster, prepend=cluster[0] - 1))


def _cluster_sums(
    jacobian: np.ndarray, residual: np.ndarray, cluster: np.ndarray
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """First row of each cluster, and the sums over each of J'r and of J'J, shapes (m, k) and
    (m, k, k).
    """
    starts = _starts(cluster)
    scores = np.add.reduceat(jacobian * residual[:, None], starts, axis=0)
    informations = np.add.reduceat(jacobian[:, :, None] * jacobian[:, None, :], starts, axis=0)
    return starts, (scores, informations)


def _jackknife_covariance(
    whole: np.ndarray, scores: np.ndarray, informations: np.ndarray
) -> tuple[np.ndarray, int]:
    """Covariance of a least-squares fit by leaving out one cluster at a time, and how many clusters
    told something.

    Efron & Tibshirani 1993, chapter 11.

    What remains after the fit is mostly the gyroscope's own errors, which last as long as a move
    does; and moves may be few.

    Args:
        whole: J'J of all, shape (k, k).
        scores: J'r of each cluster, shape (m, k).
        informations: J'J of each, shape (m, k, k).
    """
    sizes = np.trace(informations, axis1=1, axis2=2)
    telling = sizes > 1e-6 * sizes.max()  # clusters at rest say nothing
    if not telling.any():
        return np.zeros_like(whole), 0
    scores, informations = scores[telling], informations[telling]
    without = whole - informations
    steps = (np.linalg.pinv(without, rcond=1e-10) @ scores[:, :, None])[:, :, 0]
    count = len(steps)
    centred = steps - steps.mean(axis=0)
    return np.asarray((count - 1) / max(count, 1) * centred.T @ centred), count
