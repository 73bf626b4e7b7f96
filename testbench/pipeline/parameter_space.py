"""Search through the parameters of a filter: a grid, then Nelder-Mead from its best point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod

import numpy as np
from scipy.optimize import minimize

from testbench.estimation.filters.base import Parameter
from testbench.exceptions import InputError, NotFoundError

Point = tuple[float, ...]
"""One value for each tuned parameter, in their order."""
Cost = Callable[[Point], float]

FEWEST_VALUES = 3
"""Of a parameter in a grid of every combination; with fewer the parameters are walked through one
after the other.
"""
ROUNDS = 2
"""How often each parameter is visited where they are walked through one after the other."""
FAILED = 1e9
"""What a filter that failed counts as; larger than any error in degrees."""
AT_EDGE = 1e-3
"""Nearer than this to an end of its range, in parts of it, an optimum is at the edge."""
X_TOLERANCE, F_TOLERANCE = 2e-3, 1e-4
"""Nelder-Mead is at rest when its points differ by less: in parts of the (logarithmic) range, and
in degrees.
"""
MOST_STEPS = 60
"""Of one run of Nelder-Mead, for each parameter."""
MOST_STARTS = 4
"""Of Nelder-Mead: as long as a new simplex still finds something better."""


@dataclass(frozen=True)
class Axis:
    """The range of one parameter as numbers from 0 to 1, along its own scale."""

    parameter: Parameter

    def __post_init__(self) -> None:
        p = self.parameter
        if p.scale != "switch" and not (p.low < p.high and (p.scale == "linear" or p.low > 0)):
            raise InputError(
                f"the range of {p.name}, {p.low:g} to {p.high:g}, cannot be walked through "
                f"({p.scale})"
            )

    @property
    def continuous(self) -> bool:
        return self.parameter.scale != "switch"

    def value(self, part: float) -> float:
        """The value at a part of the range, 0 to 1."""
        p, part = self.parameter, float(np.clip(part, 0.0, 1.0))
        if part in (0.0, 1.0):
            return p.high if part else p.low
        if p.scale == "log":
            return float(p.low * (p.high / p.low) ** part)
        return float(p.low + (p.high - p.low) * part)

    def part(self, value: float) -> float | None:
        """Where in its range a value lies; None outside, as for a 0 that switches something off."""
        p = self.parameter
        if not p.low <= value <= p.high:
            return None
        if p.scale == "log":
            return float(np.log(value / p.low) / np.log(p.high / p.low))
        return float((value - p.low) / (p.high - p.low))

    def grid(self, count: int) -> list[float]:
        """Values over the range; one outside of it that the filter has by default comes first."""
        if not self.continuous:
            return [0.0, 1.0]
        values = [self.value(part) for part in np.linspace(0, 1, count)]
        default = float(self.parameter.default)
        return values if self.part(default) is not None else [default, *values]


@dataclass(frozen=True)
class Space:
    """The tuned parameters of a filter."""

    axes: tuple[Axis, ...]

    @staticmethod
    def of(parameters: Sequence[Parameter], names: Sequence[str] | None) -> Space:
        """Those named, or all.

        Raises:
            NotFoundError: No such parameter.
            InputError: There is none, or one is named twice.
        """
        known = {parameter.name: parameter for parameter in parameters}
        for name in names or []:
            if name not in known:
                raise NotFoundError("parameter to tune", name, list(known))
        wanted = list(names or known)
        if len(set(wanted)) < len(wanted):
            raise InputError("a parameter to tune is named twice")
        if not wanted:
            raise InputError("the filter has no parameter that could be tuned")
        return Space(tuple(Axis(known[name]) for name in wanted))

    @property
    def names(self) -> list[str]:
        return [axis.parameter.name for axis in self.axes]

    def at_edge(self, point: Point) -> list[str]:
        """Parameters whose value is an end of their range; switches have none."""
        result = []
        for axis, value in zip(self.axes, point, strict=True):
            part = axis.part(value) if axis.continuous else None
            if part is not None and not AT_EDGE < part < 1 - AT_EDGE:
                result.append(axis.parameter.name)
        return result


@dataclass(frozen=True)
class Effort:
    """How hard to look.

    Attributes:
        values: Of each parameter in the grid.
        points: Most points of a grid of every combination.
        refine: Go on by Nelder-Mead.
    """

    values: int = 9
    points: int = 300
    refine: bool = True

    def grid(self, space: Space) -> tuple[bool, list[list[float]]]:
        """Whether every combination is tried, and the values of each parameter."""
        for count in range(self.values, FEWEST_VALUES - 1, -1):
            grid = [axis.grid(count) for axis in space.axes]
            if prod(map(len, grid)) <= self.points:
                return True, grid
        return len(space.axes) == 1, [axis.grid(self.values) for axis in space.axes]


@dataclass
class Optimum:
    """What a search found.

    Attributes:
        point: Best of all tried.
        value: The cost there.
        tried: Every point of the grid, in order.
        evaluations: Different points in all.
        converged: Whether Nelder-Mead came to rest; True where it had nothing to do.
    """

    point: Point
    value: float
    tried: list[Point] = field(default_factory=list)
    evaluations: int = 0
    converged: bool = True


def find_optimum(space: Space, start: Point, cost: Cost, effort: Effort) -> Optimum:
    """The point of least cost.

    Args:
        space: Where to look.
        start: Values that the search begins with; it never ends worse than there.
        cost: To be made small; infinite where the filter fails.
        effort: How hard to look.
    """
    seen: dict[Point, float] = {}

    def remembered(point: Point) -> float:
        if point not in seen:
            value = cost(point)
            seen[point] = value if np.isfinite(value) else FAILED
        return seen[point]

    best = start
    remembered(best)
    every, grid = effort.grid(space)
    if every:
        for point in product(*grid):
            remembered(point)
        best = min(seen, key=lambda point: seen[point])
    else:
        for _ in range(ROUNDS):
            for i, values in enumerate(grid):
                candidates = [(*best[:i], value, *best[i + 1 :]) for value in values]
                best = min([best, *candidates], key=remembered)
    tried = list(seen)
    converged = True
    if effort.refine:
        converged = _refine(space, best, remembered, grid)
        best = min(seen, key=lambda point: seen[point])
    return Optimum(best, seen[best], tried, len(seen), converged)


def _refine(space: Space, best: Point, cost: Cost, grid: list[list[float]]) -> bool:
    """Nelder-Mead (Computer Journal 7, 1965) over what can be varied at the best point; whether it
    came to rest.
    """
    parts = [
        axis.part(value) if axis.continuous else None
        for axis, value in zip(space.axes, best, strict=True)
    ]
    free = [
        i for i, part in enumerate(parts) if part is not None
    ]  # a switch, or what is off, stays as it is
    if not free:
        return True
    start = np.array([parts[i] for i in free], dtype=float)
    step = np.array([0.5 / max(len(grid[i]) - 1, 1) for i in free])

    def of_parts(x: np.ndarray) -> float:
        point = list(best)
        for i, part in zip(free, _folded(x), strict=True):
            point[i] = space.axes[i].value(float(part))
        return cost(tuple(point))

    value = cost(best)
    for _ in range(
        MOST_STARTS
        # a simplex may fall flat: one that starts anew there finds out (Kelley, SIAM J. Optim. 10,
        # 1999)
    ):
        options = {
            "initial_simplex": np.vstack([start, start + np.diag(step)]),
            "xatol": X_TOLERANCE,
            "fatol": F_TOLERANCE,
            "maxfev": MOST_STEPS * len(free),
        }
        found = minimize(of_parts, start, method="Nelder-Mead", options=options)
        if not found.success or value - found.fun <= F_TOLERANCE:
            return bool(found.success)
        start, value, step = _folded(found.x), float(found.fun), step / 2
    return False


def _folded(x: np.ndarray) -> np.ndarray:
    """Parts of the ranges; beyond an end they come back, so that the simplex is never pressed flat
    against it.
    """
    return np.asarray(1.0 - np.abs(1.0 - np.mod(x, 2.0)))
