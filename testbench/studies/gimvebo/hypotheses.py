"""What an implementation could have done to give the published norms and angles.

Each hypothesis is a step of an integrator with something wrong in it, fed with our motions. Rates
in deg/s taken for rad/s are in all of them: without, norms of the published kind need thousands of
degrees a second, where the sensor ends at 250 about an axis. The speeds of the published motions
are not known, so that each hypothesis gets the factor of our speed at which the median agrees; what
the other figures are then is its test.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy.optimize import brentq, least_squares

from testbench.estimation.calibration.gyroscope import gravity_direction_errors, matrix_of
from testbench.estimation.calibration.turn_integration import TurnIntegration
from testbench.estimation.calibration.turns import Turn
from testbench.model import rotation
from testbench.model.integrators import Stages, get_integrator, steps_as_printed
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import BoxNumbers, Print

MOST_EVALUATIONS = 2000
SLOWEST, FASTEST, GRID = 0.3, 15.0, 24
"""Factors of our speed that are tried."""
LARGEST_LOG = 700.0
"""Of a norm that still is a number."""
AT_ONCE = 30
"""Steps whose norms are multiplied before they are begun anew: more would not be numbers at the
fastest.
"""
NAMED = ("q1", "q3", "lower", "upper")
"""Figures of a box plot that no factor was fitted to."""

Length = Literal["carried on", "each step from unit length"]
Half = Literal["right", "before the bracket"]


@dataclass(frozen=True)
class NormHypothesis:
    """One way to come to norms of a quaternion.

    Attributes:
        integrator: Its name.
        stages: Where its rates inside a step come from; a measured middle makes steps of two
            intervals.
        length: Whether the quaternion goes on as it is, or was scaled back after every step.
        half: Where the 1/2 of dq/dt = q (0, w) / 2 stands.
        printed: Which print says so.
    """

    integrator: str
    stages: Stages
    length: Length = "carried on"
    half: Half = "right"
    printed: Print = ""

    @property
    def label(self) -> str:
        """For people."""
        said = [f"rates {self.stages}", self.length]
        said += ["the 1/2 before the bracket"] if self.half != "right" else []
        return ", ".join(said)

    def norms(self, turn: Turn, factor: float = 1.0) -> np.ndarray:
        """Norm of the quaternion after each step of a turn.

        Args:
            turn: Rates as its hypothesis takes them for rad/s.
            factor: Of the rates.
        """
        method = get_integrator(self.integrator)
        odd = len(turn.gyr) - (self.stages == "measured" and len(turn.gyr) % 2 == 0)
        rates, covered = method.stages_from_samples(factor * turn.gyr[:odd], self.stages)
        step = covered * turn.interval
        grown = self._growth(rates, step)
        if self.length != "carried on":
            return grown
        return np.asarray(np.exp(np.clip(np.cumsum(np.log(grown)), -LARGEST_LOG, LARGEST_LOG)))

    def _growth(self, rates: np.ndarray, step: float) -> np.ndarray:
        """By what the norm grows in each step, shape (n,).

        A step is a product with a quaternion on the right, so that its norm is the growth.

        Args:
            rates: At the stages of each step, shape (n, stages, 3).
            step: Its length [s].
        """
        if self.integrator == "tustin":
            # q' (1, -h w1 / 4) = q (1, h w0 / 4); as printed, with the slope at the end solved for
            # in eq. 2.36: q' (1, -h w1 / 4) = q (1, h w0 / 2) / 2
            before, after = (np.sum((step * rates[:, i]) ** 2, axis=1) for i in (0, 1))
            printed = self.half != "right"
            least, share = (0.5, 4) if printed else (1.0, 16)
            return np.asarray(least * np.sqrt((1 + before / share) / (1 + after / 16)))
        method, grown = get_integrator(self.integrator), []
        for begin in range(0, len(rates), AT_ONCE):
            some = rates[begin : begin + AT_ONCE]
            right = self.half == "right"
            q = method.steps(some, step) if right else steps_as_printed(method, some, step)
            norm = np.linalg.norm(q, axis=1)
            grown.append(norm[1:] / norm[:-1])
        return np.concatenate(grown)


RK4 = (
    NormHypothesis("rk4", "measured"),
    NormHypothesis("rk4", "interpolated"),
    NormHypothesis("rk4", "constant"),
    NormHypothesis("rk4", "measured", "each step from unit length"),
    NormHypothesis("rk4", "interpolated", "each step from unit length"),
    NormHypothesis(
        "rk4", "measured", "each step from unit length", "before the bracket", printed="text"
    ),
)
TUSTIN = (
    NormHypothesis("tustin", "interpolated"),
    NormHypothesis("tustin", "interpolated", "each step from unit length"),
    NormHypothesis(
        "tustin", "interpolated", "each step from unit length", "before the bracket", printed="text"
    ),
    NormHypothesis("trapezoid", "interpolated"),
    NormHypothesis(
        "trapezoid",
        "interpolated",
        "each step from unit length",
        "before the bracket",
        printed="text",
    ),
)


@dataclass(frozen=True)
class Tried:
    """What a hypothesis comes to, turn by turn, each at the speed of the published median.

    Attributes:
        of: The hypothesis.
        factors: Of our speed, one for each turn at which some speed gives the median.
        boxes: Of the norms of each of these turns.
        turns: How many turns there were.
    """

    of: NormHypothesis
    factors: tuple[float, ...]
    boxes: tuple[BoxNumbers, ...]
    turns: int

    def range_of(self, figure: str) -> tuple[float, float] | None:
        """Least and largest of a figure of the box plot over the turns."""
        found = [float(getattr(box, figure)) for box in self.boxes]
        return (min(found), max(found)) if found else None

    def inside(self, published: BoxNumbers) -> list[str]:
        """Figures of the published box plot that lie in the range over our turns."""
        within = []
        for figure in NAMED:
            span = self.range_of(figure)
            if span is not None and span[0] <= float(getattr(published, figure)) <= span[1]:
                within.append(figure)
        return within


def try_norms(of: NormHypothesis, turns: Sequence[Turn], median: float) -> Tried:
    """Try a hypothesis on each turn.

    Args:
        of: The hypothesis.
        turns: Rates in deg/s that are taken for rad/s.
        median: Of the published norms.
    """
    factors, boxes = [], []
    for turn in turns:
        factor = speed_factor(partial(of.norms, turn), median)
        if factor is not None:
            factors.append(factor)
            boxes.append(BoxNumbers.of(of.norms(turn, factor)))
    return Tried(of, tuple(factors), tuple(boxes), len(turns))


def in_degrees(turns: Sequence[Turn], bias: np.ndarray) -> list[Turn]:
    """The turns with rates whose number is that of deg/s, without bias.

    Args:
        turns: With rates in rad/s.
        bias: Taken from the rates, shape (3,) [rad/s].
    """
    return [replace(turn, gyr=np.degrees(turn.gyr - bias)) for turn in turns]


def speed_factor(quantity: Callable[[float], np.ndarray], median: float) -> float | None:
    """The factor of the rates at which the median of a quantity is the wanted one.

    The smallest, None if there is none.
    """

    def off(factor: float) -> float:
        return float(np.median(quantity(factor))) - median

    factors = np.geomspace(SLOWEST, FASTEST, GRID)
    before = off(factors[0])
    for slower, faster in pairwise(factors):
        after = off(faster)
        if np.sign(after) != np.sign(before):
            return float(brentq(off, slower, faster, xtol=1e-3))
        before = after
    return None


def fit_in_degrees(
    turns: Sequence[Turn], integrator: str, stages: Stages | None = None
) -> TriadCalibration:
    """Scales and misalignments by Levenberg-Marquardt from one and zero, rates in deg/s taken for
    rad/s, bias removed beforehand.

    The right scale, pi/180, is many turns away from the start: the search ends in a minimum near
    it.
    """
    integration = TurnIntegration(turns, get_integrator(integrator), stages)
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


def angles_deg(
    calibration: TriadCalibration,
    turns: Sequence[Turn],
    integrator: str,
    stages: Stages | None = None,
) -> np.ndarray:
    """Error of gravity's direction after each turn, shape (m,) [deg]."""
    return np.degrees(gravity_direction_errors(calibration, turns, integrator, stages))
