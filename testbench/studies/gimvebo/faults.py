"""Faults of an implementation, fed to correct integrators on purpose: which of them gives numbers
like the published ones?

Two candidates: rates in deg/s taken for rad/s, and the factor 1/2 before the bracket, as eqs 2.33
to 2.38 of Botina & Vergara 2018 are printed. Nobody but their authors can know; what can be shown
is what each would do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, least_squares

from testbench.estimation.calibration.gyroscope import gravity_direction_errors, matrix_of
from testbench.estimation.calibration.turn_integration import TurnIntegration
from testbench.estimation.calibration.turns import Turn
from testbench.model import rotation
from testbench.model.integrators import Stages, get_integrator, steps_as_printed
from testbench.records.results.calibration import TriadCalibration

MOST_EVALUATIONS = 2000
FASTEST = 6.0


def in_degrees(turns: Sequence[Turn], bias: np.ndarray) -> list[Turn]:
    """The turns with rates whose number is that of deg/s, without bias.

    Args:
        turns: With rates in rad/s.
        bias: Taken from the rates, shape (3,) [rad/s].
    """
    return [replace(turn, gyr=np.degrees(turn.gyr - bias)) for turn in turns]


def as_printed(turns: Sequence[Turn]) -> list[Turn]:
    """The turns with rates that lead a correct integrator to the directions of the formula as
    printed.

    (q + integral of f) / 2 with dq/dt = f / 2 is half the step of twice the rate; the half changes
    the length alone.
    """
    return [replace(turn, gyr=2.0 * turn.gyr) for turn in turns]


def norms(
    turns: Sequence[Turn], integrator: str, stages: Stages, factor: float = 1.0
) -> np.ndarray:
    """Norm of the quaternion after each step of each turn, carried on from step to step; rates
    times `factor`.
    """
    method, found = get_integrator(integrator), []
    for turn in turns:
        rates = turn.gyr[: len(turn.gyr) - (stages == "measured" and len(turn.gyr) % 2 == 0)]
        found.append(
            np.linalg.norm(
                method.integrate(factor * rates, turn.interval, stages=stages)[1:], axis=1
            )
        )
    return np.concatenate(found)


def norms_as_printed(turns: Sequence[Turn], integrator: str, factor: float = 1.0) -> np.ndarray:
    """Norm after each step by the formula as printed, every step begun at unit length; rates times
    `factor`.
    """
    method, found = get_integrator(integrator), []
    for turn in turns:
        stage_rates, _ = method.stages_from_samples(factor * turn.gyr)
        found += [
            np.linalg.norm(steps_as_printed(method, step[None], turn.interval)[1])
            for step in stage_rates
        ]
    return np.array(found)


def speed_factor(quantity: Callable[[float], np.ndarray], median: float) -> float | None:
    """The factor of the rates at which the median of a quantity is the wanted one; the smallest,
    None if there is none.
    """

    def off(factor: float) -> float:
        return float(np.median(quantity(factor))) - median

    factors = np.geomspace(0.3, FASTEST, 40)
    before = off(factors[0])
    for slower, faster in pairwise(factors):
        after = off(faster)
        if np.sign(after) != np.sign(before):
            return float(brentq(off, slower, faster, xtol=1e-4))
        before = after
    return None


def fit_in_degrees(turns: Sequence[Turn], integrator: str) -> TriadCalibration:
    """Scales and misalignments by Levenberg-Marquardt from one and zero, rates in deg/s taken for
    rad/s, bias removed beforehand.

    The right scale, pi/180, is many turns away from the start: the search ends in a minimum near
    it.
    """
    integration = TurnIntegration(turns, get_integrator(integrator))
    before, after = (
        np.array([getattr(turn, key) for turn in turns]) for key in ("up_before", "up_after")
    )
    nothing = np.zeros(3)

    def difference(theta: np.ndarray) -> np.ndarray:
        ends = integration.run(
            matrix_of(np.concatenate([theta, nothing]))[0], nothing
        ).q_before_from_after
        return (rotation.rotate(rotation.conjugate(ends), before) - after).ravel()

    found = least_squares(
        difference, np.repeat([1.0, 0.0], [3, 6]), method="lm", max_nfev=MOST_EVALUATIONS
    )
    return TriadCalibration("fit_in_degrees", matrix_of(np.concatenate([found.x, nothing]))[0])


def angles_deg(calibration: TriadCalibration, turns: Sequence[Turn], integrator: str) -> np.ndarray:
    """Error of gravity's direction after each turn, shape (m,) [deg]."""
    return np.degrees(gravity_direction_errors(calibration, turns, integrator))
