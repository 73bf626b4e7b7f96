"""From an orientation series to a walk: signals, cycles, lengths, and the path.

Equations are those of Cabezuelo 2019.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.gait.cycles import Cycles, find_cycles
from testbench.estimation.gait.parameters import PedestrianParameters
from testbench.model import rotation
from testbench.model.heading import yaw


@dataclass(frozen=True)
class Walk:
    """What one sensor says of a walk.

    Attributes:
        cycles: Gait cycles of the leg.
        lengths: Of each [m], shape (k,).
        headings: During each [rad], counted from the start, shape (k,).
        positions: After each, starting at the origin [m], shape (k + 1, 2).
    """

    cycles: Cycles
    lengths: np.ndarray
    headings: np.ndarray
    positions: np.ndarray

    @property
    def distance(self) -> float:
        """Length of the path [m]."""
        return float(self.lengths.sum())

    @property
    def end(self) -> np.ndarray:
        """Where it ends [m], shape (2,)."""
        return np.asarray(self.positions[-1])


def walk(
    time_ns: np.ndarray,
    q_world_from_level: np.ndarray,
    parameters: PedestrianParameters,
    heading: float = 0.0,
) -> Walk:
    """Count cycles and reckon the path.

    Args:
        time_ns: Increasing, shape (n,) [ns].
        q_world_from_level: Of the level frame, into which the readings were turned before they were
            filtered (`wearing.levelled`), shape (n, 4); rows that are not finite are passed over.
        parameters: See `PUBLISHED`.
        heading: At the start [rad].

    Returns:
        The walk. Its steps are the leg's; a person makes two for each.
    """
    step, orientation = gait_signals(q_world_from_level)
    cycles = find_cycles(time_ns, step, parameters)
    # eq. 2.28
    lengths = np.array(
        [parameters.length(float(np.degrees(swing))) for swing in cycles.swing], dtype=float
    )
    known = orientation[np.isfinite(orientation)]
    start = float(known[0]) if len(known) else 0.0
    # the sum of the changes from peak to peak
    headings = heading + orientation[cycles.peak] - start
    # eq. 2.29: x += L cos, y += L sin
    moves = lengths[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    return Walk(cycles, lengths, headings, np.vstack([np.zeros((1, 2)), np.cumsum(moves, axis=0)]))


def gait_signals(q_world_from_level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Step signal (pitch) and orientation signal (yaw) of the level frame, intrinsic ZYX.

    Args:
        q_world_from_level: Shape (n, 4); rows that are not finite give NaN.

    Returns:
        Both signals, without jumps, shape (n,) [rad] each.
    """
    q = np.asarray(q_world_from_level, float)
    known = np.isfinite(q).all(axis=1)
    step = np.full(len(q), np.nan)
    step[known] = rotation.to_euler("ZYX", q[known])[:, 1]
    orientation = np.full(len(q), np.nan)
    orientation[known] = yaw(q[known])
    return step, orientation
