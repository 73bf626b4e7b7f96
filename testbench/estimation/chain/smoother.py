"""The Rauch-Tung-Striebel smoother over the chain filter, whose estimates know later samples too.

Rauch, Tung & Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3
(1965), 1445-1450, with the filter's transition linearised at its own estimates (Särkkä, Bayesian
Filtering and Smoothing, 2013, sect. 9.1). States and covariances of a whole recording would fill
the memory: the filter is run once to leave a mark every so often, and again from mark to mark,
backwards.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.chain.kernel import FilterPoint
from testbench.estimation.chain.run import (
    ChainMotion,
    ChainSamples,
    begin,
    continue_filter,
    process_of,
)
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings
from testbench.estimation.chain.state import Process, drive, joint_motion, propagate, transition

KEPT_NUMBERS = 2e7
"""Numbers of the covariances that are kept at a time: 160 MB."""


def run_smoother(
    sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples
) -> ChainMotion:
    """Filter forwards and smooth backwards.

    Arguments and result are those of `run_filter`, without states and covariances.
    """
    point, _ = begin(sensors, settings, samples, None)
    x, P = point.x, point.P
    stride = max(int(KEPT_NUMBERS / len(x) ** 2), 1)
    marks, parts, motions = [], [], []
    samples = samples.rows(0, None)
    for first in range(0, len(samples.time), stride):
        part = samples.rows(first, first + stride)
        marks.append(FilterPoint(x.copy(), P.copy(), point.levels.copy(), point.time))
        motions.append(continue_filter(sensors, settings, part, point))
        parts.append(part)
        point = point._replace(time=float(part.time[-1]))
    process = process_of(sensors, settings)
    later = (x.copy(), P.copy(), 0.0, 0.0)  # the last state is its own smoothed one
    means, sds = [], []
    for part, mark in zip(reversed(parts), reversed(marks), strict=True):
        kept = continue_filter(sensors, settings, part, mark, keep=True)
        steps, high = np.append(np.diff(part.time), later[2]), np.append(kept.high[1:], later[3])
        state, covariance = kept.state, kept.covariance
        _smooth(state, covariance, later[:2], process, steps, high)
        mean, sd = _joints(state, covariance, process.indices, settings.harmonics)
        means.append(mean)
        sds.append(sd)
        later = (
            state[0].copy(),
            covariance[0].copy(),
            float(part.time[0]) - mark.time,
            float(kept.high[0]),
        )
    nis, high = (
        np.concatenate([motion.nis for motion in motions]),
        np.concatenate([motion.high for motion in motions]),
    )
    likelihood = np.concatenate([motion.likelihood for motion in motions])
    none = np.zeros((0, len(x)))
    return ChainMotion(
        samples.time,
        np.concatenate(means[::-1]),
        np.concatenate(sds[::-1]),
        nis,
        likelihood,
        none,
        none[:, :, None],
        high,
        (x, P),
        motions[-1].effect,
    )


@njit(cache=True)
def _smooth(
    state: np.ndarray,
    covariance: np.ndarray,
    later: tuple[np.ndarray, np.ndarray],
    process: Process,
    steps: np.ndarray,
    high: np.ndarray,
) -> None:
    """Replace filtered states and covariances by smoothed ones.

    Args:
        state: States, shape (e, n).
        covariance: Their covariances, shape (e, n, n).
        later: Smoothed state and covariance of the sample after the last.
        process: How the joints move.
        steps: Time to the next sample, shape (e,) [s].
        high: Part of the raised process noise that holds meanwhile, shape (e,).
    """
    harmonics, indices, _, confined, jerk, walk, raised = process
    m, n = indices.shape[0], state.shape[1]
    x, P = later[0].copy(), later[1].copy()
    for i in range(len(state) - 1, -1, -1):
        predicted, ahead = state[i].copy(), covariance[i].copy()
        dt = steps[i]
        F = transition(predicted, m, harmonics, confined, dt)
        turned = state[i].copy()
        propagate(turned, ahead, m, harmonics, confined, dt)
        drive(ahead, m, harmonics, jerk, confined, walk + high[i] * raised, dt)
        # gain C = P F' ahead^-1, solved with ahead scaled to correlations
        scale = np.sqrt(np.diag(ahead))
        scale = np.where(scale > 0, scale, 1.0)
        for r in range(n):
            for c in range(n):
                ahead[r, c] /= scale[r] * scale[c]
            ahead[r, r] += 1e-12  # of a state that is known exactly
        gain = np.linalg.solve(ahead, (F @ covariance[i]) / scale.reshape(n, 1)).T / scale.reshape(
            1, n
        )
        for r in range(n):
            for c in range(n):
                ahead[r, c] *= scale[r] * scale[c]
        # x + C (x_later - predicted) and P + C (P_later - ahead) C'
        state[i] += gain @ (x - predicted)
        covariance[i] += gain @ (P - ahead) @ gain.T
        covariance[i] = 0.5 * (covariance[i] + covariance[i].T)
        x, P = state[i], covariance[i].copy()


@njit(cache=True)
def _joints(
    state: np.ndarray, covariance: np.ndarray, indices: np.ndarray, harmonics: int
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles, rates and accelerations with standard deviations, shapes (e, 3, m)."""
    e, m, k = len(state), indices.shape[0], indices.shape[1]
    mean, sd = np.empty((e, 3, m)), np.empty((e, 3, m))
    motion, slopes = np.empty((3, m)), np.empty((3, m, k))
    for i in range(e):
        joint_motion(state[i], indices, harmonics, motion, slopes)
        mean[i] = motion
        for order in range(3):
            for j in range(m):
                total = 0.0
                for r in range(k):
                    for c in range(k):
                        total += (
                            slopes[order, j, r]
                            * slopes[order, j, c]
                            * covariance[i, indices[j, r], indices[j, c]]
                        )
                sd[i, order, j] = np.sqrt(max(total, 0.0))
    return mean, sd
