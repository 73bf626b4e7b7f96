"""Turns of a gyroscope, integrated together with their derivatives, as a compiled loop.

With corrected rates w = M (r - b - G f), a change of the parameters turns the end of a turn by

    phi_end = sum over steps of  h R_end_from_middle (dM x - M db - M dG f),   x = r - b - G f

to first order in the change and to second order in the step h. This serves as the Jacobian of a
search whose residuals are those of the chosen integrator itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from testbench.estimation.calibration.turns import Turn
from testbench.model.integrators import (
    CG4_B,
    EULER,
    HEUN,
    RK4,
    TUSTIN,
    Integrator,
    Stages,
    multiply_into,
    step_quaternion,
)


@dataclass(frozen=True)
class IntegratedTurns:
    """Ends of m turns, and how they move with the parameters.

    Attributes:
        q_before_from_after: Unit quaternions, shape (m, 4).
        by_matrix: Rotation of the end, in its own axes, by each element of M (row by row), shape
            (m, 3, 9).
        by_bias: By b, shape (m, 3, 3).
        by_g: By each element of G, shape (m, 3, 9).
    """

    q_before_from_after: np.ndarray
    by_matrix: np.ndarray
    by_bias: np.ndarray
    by_g: np.ndarray


class _Steps(NamedTuple):
    """The steps of all m turns, one after the other.

    Attributes:
        raw: Readings at the stages of each step, shape (n, stages, 3) [rad/s].
        force: Specific force there, shape (n, stages, 3) [m/s^2].
        borders: First step of each turn, and the end of the last, shape (m + 1,).
        lengths: Length of the steps of each turn, shape (m,) [s].
        weights: Share of each stage in the mean rate of a step, shape (stages,).
    """

    raw: np.ndarray
    force: np.ndarray
    borders: np.ndarray
    lengths: np.ndarray
    weights: np.ndarray


class TurnIntegration:
    """Turns, made ready for an integrator: stage readings are computed once, since they are linear
    in the readings.

    Args:
        turns: At least one.
        integrator: How to integrate.
        stages: Where the rates inside a step come from; the integrator's best if None. Steps of two
            intervals (`measured`) leave out the last interval of a turn with an even number of
            samples.
    """

    def __init__(self, turns: Sequence[Turn], integrator: Integrator, stages: Stages | None = None):
        self.integrator = integrator
        self.stages = stages = stages or integrator.best_stages
        raw, force, counts, steps = [], [], [0], []
        for turn in turns:
            n = len(turn.gyr) - (stages == "measured" and len(turn.gyr) % 2 == 0)
            at_stages, covered = integrator.stages_from_samples(turn.gyr[:n], stages)
            raw.append(at_stages)
            felt = np.zeros((n, 3)) if turn.force is None else turn.force[:n]
            force.append(integrator.stages_from_samples(felt, stages)[0])
            counts.append(len(at_stages))
            steps.append(covered * turn.interval)
        self._steps = _Steps(
            np.concatenate(raw),
            np.concatenate(force),
            np.cumsum(counts),
            np.array(steps),
            _weights(integrator),
        )

    def run(
        self, matrix: np.ndarray, bias: np.ndarray, g_matrix: np.ndarray | None = None
    ) -> IntegratedTurns:
        """Integrate every turn with rates matrix (raw - bias - g_matrix force).

        Args:
            matrix: M, shape (3, 3).
            bias: b, shape (3,) [rad/s].
            g_matrix: G, shape (3, 3) [rad/s/(m/s^2)]; none if None.
        """
        G = np.zeros((3, 3)) if g_matrix is None else g_matrix
        return IntegratedTurns(
            *_run(
                self.integrator.scheme,
                self._steps,
                np.ascontiguousarray(matrix),
                bias,
                np.ascontiguousarray(G),
                self.integrator.renormalised,
            )
        )


def _weights(integrator: Integrator) -> np.ndarray:
    """Share of each stage in the mean rate of a step."""
    ends = (0.5, 0.5)
    known = {EULER: (1.0,), HEUN: ends, TUSTIN: ends, RK4: (1 / 6, 4 / 6, 1 / 6)}
    return np.array(known.get(integrator.scheme, CG4_B if len(integrator.nodes) == 5 else (1.0,)))


@njit(cache=True)
def _corrected(
    raw: np.ndarray,
    force: np.ndarray,
    matrix: np.ndarray,
    bias: np.ndarray,
    G: np.ndarray,
    x: np.ndarray,
) -> None:
    """The reading without bias and response to force, shape (3,), into x."""
    for i in range(3):
        # raw - b - G f
        x[i] = raw[i] - bias[i] - G[i, 0] * force[0] - G[i, 1] * force[1] - G[i, 2] * force[2]


@njit(cache=True)
def _run(
    scheme: int,
    steps: _Steps,
    matrix: np.ndarray,
    bias: np.ndarray,
    G: np.ndarray,
    renormalised: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The ends of all turns and their derivatives, in the order of `IntegratedTurns`."""
    # Longer than a screen and of many branches: one loop over the steps, sums written out.
    raw, force, borders, lengths, weights = steps
    m, stages = len(lengths), raw.shape[1]
    ends = np.empty((m, 4))
    by_matrix, by_bias, by_g = np.zeros((m, 3, 9)), np.zeros((m, 3, 3)), np.zeros((m, 3, 9))
    w, x, mean_x, mean_f = np.empty((stages, 3)), np.empty(3), np.empty(3), np.empty(3)
    work, s, q, before = np.empty((5, 4)), np.empty(4), np.empty(4), np.empty(4)
    R, a_matrix, a_bias, a_g = (
        np.empty((3, 3)),
        np.empty((3, 9)),
        np.empty((3, 3)),
        np.empty((3, 9)),
    )
    for turn in range(m):
        h = lengths[turn]
        q[:] = 0.0
        q[0] = 1.0
        a_matrix[:], a_bias[:], a_g[:] = 0.0, 0.0, 0.0
        for k in range(borders[turn], borders[turn + 1]):
            mean_x[:], mean_f[:] = 0.0, 0.0
            for i in range(stages):  # x = r - b - G f and w = M x at each stage, and their means
                _corrected(raw[k, i], force[k, i], matrix, bias, G, x)
                for j in range(3):
                    w[i, j] = matrix[j, 0] * x[0] + matrix[j, 1] * x[1] + matrix[j, 2] * x[2]
                    mean_x[j] += weights[i] * x[j]
                    mean_f[j] += weights[i] * force[k, i, j]
            step_quaternion(scheme, w, h, work, s)
            before[:] = q
            multiply_into(q, s, q)
            if renormalised:
                q /= np.sqrt(np.sum(q**2))
            _rotation(before, q, R)  # halfway
            # sums over the steps of h R, h R (x) x and h R (x) f: see the module's equation
            for i in range(3):
                for j in range(3):
                    weight = h * R[i, j]
                    a_bias[i, j] += weight
                    for c in range(3):
                        a_matrix[i, 3 * j + c] += weight * mean_x[c]
                        a_g[i, 3 * j + c] += weight * mean_f[c]
        q /= np.sqrt(np.sum(q**2))
        ends[turn] = q
        _rotation(q, q, R)
        # the same in the axes of the end; - R (M db) and - R (M dG f)
        by_matrix[turn] = R.T @ a_matrix
        by_bias[turn] = -(R.T @ a_bias) @ matrix
        own = R.T @ a_g
        for i in range(3):
            for j in range(3):
                for c in range(3):
                    for row in range(3):
                        by_g[turn, i, 3 * j + c] -= own[i, 3 * row + c] * matrix[row, j]
    return ends, by_matrix, by_bias, by_g


@njit(cache=True)
def _rotation(p: np.ndarray, q: np.ndarray, R: np.ndarray) -> None:
    """Rotation matrix of the quaternion halfway between two neighbouring ones, into R."""
    # (p + q) / |p + q|: slerp at its middle (Shoemake 1985)
    w, x, y, z = p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3]
    n = 1.0 / np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = n * w, n * x, n * y, n * z
    # R of a unit quaternion (Solà, Quaternion kinematics for the error-state Kalman filter, 2017,
    # section 2)
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
