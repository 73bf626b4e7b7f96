"""Integrators of angular rate to the orientation q_start_from_body, as compiled loops.

dq/dt = q (0, w) / 2 is linear in q and its rates are the body's own, so a step of every method here
is a product on the right with a quaternion that hangs on the rates alone: q <- q
s(h w_1, ..., h w_m), with the rate w_i at the fraction c_i of the step.

Euler, Heun and the classical Runge-Kutta method are those of Hairer, Norsett & Wanner, Solving
Ordinary Differential Equations I, 1993, section II.1; their quaternion does not stay of unit
length, and is scaled back only where a method says so. The implicit trapezoid, Tustin's or the
bilinear rule, asks for the slope at the end as well and solves for it, which a linear equation
allows in closed form; it keeps |q|^2 (1 + (h |w| / 4)^2), so that a turn from rest to rest ends at
the length it began with. The Crouch-Grossman method and the
exponential midpoint rule are products of rotations and keep the length: Crouch & Grossman,
Numerical integration of ordinary differential equations on manifolds, J. Nonlinear Science 3, 1993;
the coefficients of order 4 with five stages are those of Jackiewicz, Marthinsen & Owren,
Construction of Runge-Kutta methods of Crouch-Grossman type of high order, Advances in Computational
Mathematics 13, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit

from testbench.exceptions import InputError, NotFoundError

EULER, HEUN, RK4, CG4, MIDPOINT, TUSTIN = range(6)
CG4_B = (
    0.1370831520630755,
    -0.0183698531564020,
    0.7397813985370780,
    -0.1907142565505889,
    0.3322195591068374,
)
CG4_C = (0.0, 0.8177227988124852, 0.3859740639032449, 0.3242290522866937, 0.8768903263420429)

Stages = Literal["interpolated", "measured", "constant"]
"""Where the rates inside a step come from: a straight line between samples; the sample in the
middle of a step of two intervals; the sample at the beginning of the step, as if the rate stayed
constant.
"""


@dataclass(frozen=True)
class Integrator:
    """A method of integration.

    Attributes:
        name: As a person types it.
        scheme: Of the compiled step.
        nodes: Where in the step it asks for the rate, from 0 to 1.
        order: Of the error of the result in the step, when the rates at the nodes are exact.
        unit: Whether the quaternion is of unit length after every step.
        renormalised: Whether it is scaled back to it.
        source: Where the method comes from.
    """

    name: str
    scheme: int
    nodes: tuple[float, ...]
    order: int
    unit: bool
    renormalised: bool
    source: str

    @property
    def best_stages(self) -> Stages:
        """Measured rates where the method gains by them, else interpolated ones."""
        return (
            "measured" if self.order > 2 and set(self.nodes) == {0.0, 0.5, 1.0} else "interpolated"
        )

    def steps(
        self, stage_rates: np.ndarray, step: float, start: np.ndarray | None = None
    ) -> np.ndarray:
        """Orientation after every step.

        Args:
            stage_rates: Angular rate in the body at the nodes of each step, shape (n, len(nodes),
                3) [rad/s].
            step: Length of a step [s].
            start: q_start_from_body before the first step, shape (4,); the identity if None.

        Returns:
            q_start_from_body, shape (n + 1, 4), the beginning included; of unit length only where
            `unit` says so.
        """
        stages = np.ascontiguousarray(stage_rates, dtype=float)
        if stages.ndim != 3 or stages.shape[1:] != (len(self.nodes), 3):
            raise InputError(
                f"{self.name} needs rates of shape (n, {len(self.nodes)}, 3), not {stages.shape}"
            )
        begin = np.array([1.0, 0.0, 0.0, 0.0]) if start is None else np.asarray(start, dtype=float)
        return run_steps(self.scheme, stages, step, begin, self.renormalised)

    def stages_from_samples(
        self, rates: np.ndarray, stages: Stages = "interpolated"
    ) -> tuple[np.ndarray, int]:
        """Stage rates from samples at a regular interval.

        Args:
            rates: Angular rate in the body, shape (n, 3) [rad/s], n >= 2.
            stages: Where the rates inside a step come from.

        Returns:
            Stage rates, shape (steps, len(nodes), 3) [rad/s], and how many intervals a step covers:
            1, or 2 for `measured`.

        Raises:
            InputError: Steps of two intervals do not fit, or the method asks for rates that are no
                samples.
        """
        rates = np.ascontiguousarray(rates, dtype=float)
        if rates.ndim != 2 or rates.shape[1] != 3 or len(rates) < 2:
            raise InputError(
                "two samples of the angular rate at least are needed, shape (n, 3), not "
                f"{rates.shape}"
            )
        if stages == "measured":
            if any(node not in (0.0, 0.5, 1.0) for node in self.nodes):
                raise InputError(
                    f"{self.name} asks for rates at {self.nodes} of a step; only its middle can be "
                    "measured"
                )
            if len(rates) % 2 == 0:
                raise InputError(
                    f"steps of two intervals need an odd number of samples, not {len(rates)}"
                )
            columns = np.array([round(2 * node) for node in self.nodes])
            return rates[2 * np.arange(len(rates) // 2)[:, None] + columns], 2
        nodes = np.zeros(len(self.nodes)) if stages == "constant" else np.array(self.nodes)
        before, after = rates[:-1, None], rates[1:, None]
        return before + nodes[:, None] * (after - before), 1

    def integrate(
        self,
        rates: np.ndarray,
        interval: float,
        start: np.ndarray | None = None,
        stages: Stages = "interpolated",
    ) -> np.ndarray:
        """Orientation from samples of the rate.

        Args:
            rates: Angular rate in the body at a regular interval, shape (n, 3) [rad/s].
            interval: Between samples [s].
            start: q_start_from_body before the first step, shape (4,); the identity if None.
            stages: Where the rates inside a step come from.

        Returns:
            q_start_from_body, shape (steps + 1, 4), as `steps` gives it.

        Raises:
            InputError: As for `stages_from_samples`.
        """
        stage_rates, covered = self.stages_from_samples(rates, stages)
        return self.steps(stage_rates, covered * interval, start)


_HNW = "Hairer, Norsett & Wanner 1993, section II.1"
INTEGRATORS = {
    entry.name: entry
    for entry in (
        Integrator(
            "euler",
            EULER,
            (0.0,),
            1,
            True,
            True,
            f"explicit Euler, scaled back to unit length; {_HNW}",
        ),
        Integrator("euler_raw", EULER, (0.0,), 1, False, False, f"explicit Euler; {_HNW}"),
        Integrator(
            "trapezoid",
            HEUN,
            (0.0, 1.0),
            2,
            False,
            False,
            f"trapezoid with Euler's predictor, Heun, explicit; {_HNW}",
        ),
        Integrator(
            "tustin",
            TUSTIN,
            (0.0, 1.0),
            2,
            False,
            False,
            f"implicit trapezoid, Tustin's or the bilinear rule; {_HNW}, section II.7",
        ),
        Integrator("rk4", RK4, (0.0, 0.5, 1.0), 4, False, False, f"classical Runge-Kutta; {_HNW}"),
        Integrator(
            "cg4",
            CG4,
            CG4_C,
            4,
            True,
            False,
            "Crouch-Grossman, five stages; Jackiewicz, Marthinsen & Owren 2000",
        ),
        Integrator(
            "midpoint",
            MIDPOINT,
            (0.5,),
            2,
            True,
            False,
            "exponential midpoint: turn by the rate of the middle",
        ),
    )
}
"""Every integrator by its name."""


def get_integrator(name: str) -> Integrator:
    """An integrator by its name.

    Raises:
        NotFoundError: No such integrator; lists those that exist.
    """
    if name not in INTEGRATORS:
        raise NotFoundError("integrator", name, list(INTEGRATORS))
    return INTEGRATORS[name]


def steps_as_printed(integrator: Integrator, stage_rates: np.ndarray, step: float) -> np.ndarray:
    """What Botina & Vergara (Universidad del Cauca, 2018) print in eqs 2.33, 2.36 and 2.38.

    They write dq/dt = f / 2 and then q <- (q + integral of f) / 2: the half, which belongs to the
    integral alone, stands before the bracket. So the length is halved with every step at rest. Only
    for showing what that does.

    Args:
        integrator: Euler's, Heun's or the classical Runge-Kutta method.
        stage_rates: Angular rate in the body at the nodes of each step, shape (n, len(nodes), 3)
            [rad/s].
        step: Length of a step [s].

    Returns:
        From the identity, shape (n + 1, 4), of any length.
    """
    q = integrator.steps(2.0 * stage_rates, step)
    return np.asarray(q * 0.5 ** np.arange(len(q))[:, None])


@njit(cache=True)
def multiply_into(p: np.ndarray, q: np.ndarray, out: np.ndarray) -> None:
    """Hamilton product p q, for compiled loops.

    Args:
        p: Left factor, shape (4,).
        q: Right factor, shape (4,).
        out: The product, shape (4,); it may be p or q.
    """
    # (pw qw - pv . qv, pw qv + qw pv + pv x qv) (Solà, Quaternion kinematics for the error-state
    # Kalman filter, 2017, section 1.2.2)
    w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@njit(cache=True)
def _exponential(x: float, y: float, z: float, out: np.ndarray) -> None:
    """Quaternion of the rotation vector (x, y, z) [rad]."""
    squared = x * x + y * y + z * z
    if squared < 1e-8:  # series, exact to rounding: the next term is below 1e-20
        out[0] = 1.0 - squared / 8.0 * (1.0 - squared / 48.0)
        factor = 0.5 * (1.0 - squared / 24.0)
    else:
        length = np.sqrt(squared)
        out[0] = np.cos(0.5 * length)
        factor = np.sin(0.5 * length) / length
    out[1], out[2], out[3] = factor * x, factor * y, factor * z


@njit(cache=True)
def _derivative(q: np.ndarray, w: np.ndarray, out: np.ndarray) -> None:
    """The product q (0, w) / 2."""
    # dq/dt = q (0, w) / 2, written out
    out[0] = -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2])
    out[1] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1])
    out[2] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2])
    out[3] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0])


# One branch a scheme; compiled, so that it cannot be looked up by the scheme's name.
@njit(cache=True)
def step_quaternion(scheme: int, w: np.ndarray, h: float, work: np.ndarray, s: np.ndarray) -> None:
    """The quaternion that one step multiplies with on the right.

    Args:
        scheme: EULER, HEUN, RK4, CG4, MIDPOINT or TUSTIN.
        w: Rates at its nodes, shape (stages, 3) [rad/s].
        h: Step [s].
        work: Shape (5, 4), overwritten.
        s: Result, shape (4,).
    """
    # Of many branches: one for each scheme, which share the arrays they work in.
    s[0], s[1], s[2], s[3] = 1.0, 0.0, 0.0, 0.0
    if scheme == EULER:
        _derivative(s, w[0], work[0])
        for j in range(4):
            s[j] += h * work[0, j]  # q' = q + h q (0, w) / 2
    elif scheme == HEUN:
        _derivative(s, w[0], work[0])
        for j in range(4):
            work[2, j] = s[j] + h * work[0, j]
        _derivative(work[2], w[1], work[1])
        for j in range(4):  # the mean of the slopes at both ends
            s[j] += 0.5 * h * (work[0, j] + work[1, j])
    elif scheme == RK4:
        _derivative(s, w[0], work[0])
        for i in range(1, 4):
            fraction = 1.0 if i == 3 else 0.5
            for j in range(4):
                work[4, j] = s[j] + fraction * h * work[i - 1, j]
            _derivative(work[4], w[2 if i == 3 else 1], work[i])
        for j in range(4):  # weights 1/6, 1/3, 1/3, 1/6 of Kutta's classical scheme
            s[j] += h / 6.0 * (work[0, j] + 2.0 * work[1, j] + 2.0 * work[2, j] + work[3, j])
    elif scheme == CG4:
        for i in range(5):
            b = CG4_B[i] * h  # exp(b1 h w1) exp(b2 h w2) ...: rates that do not depend on q
            _exponential(b * w[i, 0], b * w[i, 1], b * w[i, 2], work[0])
            multiply_into(s, work[0], s)
    elif scheme == TUSTIN:
        # q' (1, -h w1 / 4) = q (1, h w0 / 4), and the inverse of (1, -v) is (1, v) / (1 + |v|^2)
        grown = 1.0
        for j in range(3):
            s[j + 1] = 0.25 * h * w[0, j]
            work[0, j + 1] = 0.25 * h * w[1, j]
            grown += work[0, j + 1] ** 2
        work[0, 0] = 1.0
        multiply_into(s, work[0], s)
        for j in range(4):
            s[j] /= grown
    else:
        _exponential(h * w[0, 0], h * w[0, 1], h * w[0, 2], s)


@njit(cache=True)
def run_steps(
    scheme: int, stages: np.ndarray, h: float, start: np.ndarray, renormalised: bool
) -> np.ndarray:
    """Orientation after every step; the compiled loop of `Integrator.steps`.

    Args:
        scheme: EULER, HEUN, RK4, CG4, MIDPOINT or TUSTIN.
        stages: Angular rate in the body at the nodes of each step, shape (n, stages, 3) [rad/s].
        h: Length of a step [s].
        start: q_start_from_body before the first step, shape (4,).
        renormalised: Whether the quaternion is scaled back to unit length after every step.

    Returns:
        q_start_from_body, shape (n + 1, 4).
    """
    n = stages.shape[0]
    result = np.empty((n + 1, 4))
    result[0] = start
    work, s = np.empty((5, 4)), np.empty(4)
    for k in range(n):
        # q <- q s(h w)
        step_quaternion(scheme, stages[k], h, work, s)
        multiply_into(result[k], s, result[k + 1])
        if renormalised:
            result[k + 1] /= np.sqrt(np.sum(result[k + 1] ** 2))
    return result
