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
from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.run import (
    ChainMotion,
    ChainSamples,
    Kept,
    begin,
    continue_filter,
    process_of,
)
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.settings import FilterSettings
from testbench.estimation.chain.state import (
    Process,
    carry,
    drive,
    joint_motion,
    propagate,
    transition,
)

KEPT_NUMBERS = 2e7
"""Numbers of the covariances that are kept at a time: 160 MB."""


def run_smoother(
    sensors: ChainSensors,
    settings: FilterSettings,
    samples: ChainSamples,
    constants: Constants | None = None,
) -> ChainMotion:
    """Filter forwards and smooth backwards.

    Arguments and result are those of `run_filter`, without states and covariances.
    """
    # Longer than a screen: both passes, and what is handed from part to part.
    point, effect = begin(sensors, settings, samples, constants)
    x, P = point.x, point.P
    n, p = effect.sensitivity.shape
    stride = max(int(KEPT_NUMBERS / (n**2 + n * p)), 1)
    marks, parts, motions = [], [], []
    samples = samples.rows(0, None)
    for first in range(0, len(samples.time), stride):
        part = samples.rows(first, first + stride)
        own = effect._replace(sensitivity=effect.sensitivity.copy())
        marks.append((FilterPoint(x.copy(), P.copy(), point.levels.copy(), point.time), own))
        motions.append(continue_filter(sensors, settings, part, point, effect))
        parts.append(part)
        point = point._replace(time=float(part.time[-1]))
    process = process_of(sensors, settings)
    # the last state is its own smoothed one
    later = Kept(x.copy(), P.copy(), effect.sensitivity.copy())
    gap = (0.0, 0.0)
    means, sds = [], []
    for part, (mark, own) in zip(reversed(parts), reversed(marks), strict=True):
        # what the innovations tell was learnt on the way there
        again = own._replace(
            information=np.zeros_like(own.information),
            score=np.zeros_like(own.score),
            swing=np.zeros_like(own.swing),
        )
        motion = continue_filter(sensors, settings, part, mark, again, keep=True)
        steps, high = np.append(np.diff(part.time), gap[0]), np.append(motion.high[1:], gap[1])
        kept = motion.kept
        _smooth(kept, later, process, steps, high)
        mean, sd = _joints(kept, effect.covariance, process.indices, settings.harmonics)
        means.append(mean)
        sds.append(sd)
        later = Kept(*(array[0].copy() for array in kept))
        gap = (float(part.time[0]) - mark.time, float(motion.high[0]))
    nis, high = (
        np.concatenate([motion.nis for motion in motions]),
        np.concatenate([motion.high for motion in motions]),
    )
    likelihood = np.concatenate([motion.likelihood for motion in motions])
    return ChainMotion(
        samples.time,
        np.concatenate(means[::-1]),
        np.concatenate(sds[::-1]),
        nis,
        likelihood,
        Kept(np.zeros((0, n)), np.zeros((0, n, n)), np.zeros((0, n, p))),
        high,
        (x, P),
        effect,
    )


@njit(cache=True)
def _smooth(kept: Kept, later: Kept, process: Process, steps: np.ndarray, high: np.ndarray) -> None:
    """Replace filtered states, covariances and sensitivities by smoothed ones.

    Args:
        kept: Of e samples.
        later: Smoothed, of the sample after the last.
        process: How the joints move.
        steps: Time to the next sample, shape (e,) [s].
        high: Part of the raised process noise that holds meanwhile, shape (e,).
    """
    harmonics, indices, _, confined, jerk, walk, raised = process
    state, covariance, sensitivity = kept
    m, n = indices.shape[0], state.shape[1]
    x, P, V = later[0].copy(), later[1].copy(), later[2].copy()
    for i in range(len(state) - 1, -1, -1):
        predicted, ahead, moved = state[i].copy(), covariance[i].copy(), sensitivity[i].copy()
        dt = steps[i]
        F = transition(predicted, m, harmonics, confined, dt)
        turned = state[i].copy()
        propagate(turned, ahead, m, harmonics, confined, dt)
        carry(turned, moved, m, harmonics, confined, dt)
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
        # x + C (x_later - predicted), likewise its sensitivity, and P + C (P_later - ahead) C'
        state[i] += gain @ (x - predicted)
        sensitivity[i] += gain @ (V - moved)
        covariance[i] += gain @ (P - ahead) @ gain.T
        covariance[i] = 0.5 * (covariance[i] + covariance[i].T)
        x, P, V = state[i], covariance[i].copy(), sensitivity[i].copy()


@njit(cache=True)
def _joints(
    kept: Kept, constants: np.ndarray, indices: np.ndarray, harmonics: int
) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles, rates and accelerations with standard deviations, shapes (e, 3, m).

    Args:
        kept: Smoothed, of e samples.
        constants: Covariance of the constants of placement, shape (p, p), or empty.
        indices: As `state_indices` gives them, shape (m, k).
        harmonics: Of the Fourier series; 0 for the kinematic state.
    """
    state, covariance, sensitivity = kept
    e, m, k = len(state), indices.shape[0], indices.shape[1]
    row = np.zeros(constants.shape[0])
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
                        # s' P s of the states that the joint depends on
                        total += (
                            slopes[order, j, r]
                            * slopes[order, j, c]
                            * covariance[i, indices[j, r], indices[j, c]]
                        )
                if constants.shape[0] > 0:
                    row[:] = 0.0
                    for r in range(k):
                        for c in range(len(row)):
                            row[c] += slopes[order, j, r] * sensitivity[i, indices[j, r], c]
                    # and (s V) C (s V)' of what is not known of the constants (Friedland 1969)
                    total += float(row @ (constants @ row))
                sd[i, order, j] = np.sqrt(max(total, 0.0))
    return mean, sd
