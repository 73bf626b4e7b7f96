"""The Rauch-Tung-Striebel smoother over the chain filter: every instant told by all samples, those
after it too.

Rauch, Tung & Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3
(1965), 1445-1450, with the filter's transition linearised at its own estimates (Särkkä, Bayesian
Filtering and Smoothing, 2013, sect. 9.1). States and covariances of a whole recording would fill
the memory: the filter is run once to leave a mark every so often, and again from mark to mark,
backwards.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from testbench.estimation.chain.run import (
    ChainMotion,
    ChainSamples,
    continue_filter,
    holding_limits,
)
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings
from testbench.estimation.chain.start import start_state
from testbench.estimation.chain.state import (
    confinement,
    drive,
    joint_motion,
    propagate,
    state_indices,
    transition,
)

KEPT_NUMBERS = 2e7
"""Numbers of the covariances that are kept at a time: 160 MB."""


def run_smoother(
    sensors: ChainSensors, settings: FilterSettings, samples: ChainSamples
) -> ChainMotion:
    """Filter forwards and smooth backwards; arguments and result as for `run_filter`, without
    states and covariances.
    """
    x, P = start_state(sensors, settings, samples.mean, samples.counts)
    levels, now = settings.levels(), samples.start
    stride = max(int(KEPT_NUMBERS / len(x) ** 2), 1)
    marks, parts, motions = [], [], []
    samples = samples.rows(0, None)
    for begin in range(0, len(samples.time), stride):
        part = samples.rows(begin, begin + stride)
        marks.append((x.copy(), P.copy(), levels.copy(), now))
        motions.append(continue_filter(sensors, settings, part, x, P, now, levels))
        parts.append(part)
        now = float(part.time[-1])
    m = len(sensors.joints)
    indices = state_indices(m, settings.harmonics)
    later = (x.copy(), P.copy(), 0.0, 0.0)  # the last state is its own smoothed one
    means, sds = [], []
    jerk = settings.jerk(m)
    confined = confinement(holding_limits(sensors, settings), jerk)
    noise = confined, jerk, settings.walk(m), settings.raised(m)
    for part, (x0, P0, levels0, start) in zip(reversed(parts), reversed(marks), strict=True):
        kept = continue_filter(sensors, settings, part, x0, P0, start, levels0, keep=True)
        steps, high = np.append(np.diff(part.time), later[2]), np.append(kept.high[1:], later[3])
        state, covariance = kept.state, kept.covariance
        _smooth(state, covariance, later[0], later[1], m, settings.harmonics, steps, high, *noise)
        mean, sd = _joints(state, covariance, indices, settings.harmonics)
        means.append(mean)
        sds.append(sd)
        later = (
            state[0].copy(),
            covariance[0].copy(),
            float(part.time[0]) - start,
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
    )


@njit(cache=True)
def _smooth(
    state: np.ndarray,
    covariance: np.ndarray,
    x: np.ndarray,
    P: np.ndarray,
    m: int,
    harmonics: int,
    steps: np.ndarray,
    high: np.ndarray,
    confined: np.ndarray,
    jerk: np.ndarray,
    walk: np.ndarray,
    raised: np.ndarray,
) -> None:
    """Replace filtered states (e, n) and covariances (e, n, n) by smoothed ones, from the smoothed
    x, P after the last.

    `steps` and `high` are the time to the next sample [s] and whether the raised process noise
    holds meanwhile, shape (e,).
    """
    n = len(x)
    x, P = x.copy(), P.copy()
    for i in range(len(state) - 1, -1, -1):
        predicted, ahead = state[i].copy(), covariance[i].copy()
        dt = steps[i]
        F = transition(predicted, m, harmonics, confined, dt)
        turned = state[i].copy()
        propagate(turned, ahead, m, harmonics, confined, dt)
        drive(ahead, m, harmonics, jerk, confined, walk + high[i] * raised, dt)
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
