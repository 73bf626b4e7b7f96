"""How far joint angles of a body may be off because its axes are not those of the model.

Where few joints lie between two sensors, as at a knee, their motion shows the axes of both
segments across the axis that they turn about, and the model says what that axis is called. A
person's own lies a few degrees from there, in both segments alike. The angles of that joint hardly
feel it. Those of the joints beside it count from segments that are turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.chain.sensors import ChainSensors
from testbench.model import rotation

FREE = 3
"""Joints that turn in every direction show no axis [1]."""


@dataclass(frozen=True)
class _Group:
    """The joints between two sensors.

    Attributes:
        columns: Which joints, k of them.
        proximal: The sensor before them, None for the world.
        distal: The one after them.
    """

    columns: list[int]
    proximal: int | None
    distal: int


def anatomy_variance(sensors: ChainSensors, angles: np.ndarray, axes_sd: float) -> np.ndarray:
    """Variance of the joint angles, shape (n, m) [rad^2].

    Args:
        sensors: On the chain.
        angles: Of the joints, shape (n, m) [rad].
        axes_sd: How far an axis may be turned about each axis across it [rad].
    """
    axes, groups = _world_axes(sensors, angles), _groups(sensors)
    found = np.zeros_like(angles)
    for group in groups:
        own = axes[:, group.columns]
        # angles follow a turn of either segment by the inverse of the joints' axes
        slopes = np.linalg.pinv(np.swapaxes(own, 1, 2), rcond=1e-3)
        for other in groups:
            beside = {group.proximal, group.distal} & {other.proximal, other.distal} - {None}
            if other is group or not beside or len(other.columns) >= FREE:
                continue
            known = axes[:, other.columns]
            across = np.eye(3) - np.linalg.pinv(known) @ known
            found[:, group.columns] += axes_sd**2 * np.sum((slopes @ across) ** 2, axis=2)
    return np.minimum(found, np.pi**2)


def _world_axes(sensors: ChainSensors, angles: np.ndarray) -> np.ndarray:
    """Unit axes of all joints in the world, shape (n, m, 3)."""
    found = np.full((*angles.shape, 3), np.nan)
    for s, count in enumerate(sensors.counts):
        R = np.tile(np.eye(3), (len(angles), 1, 1))
        for j in range(count):
            column, axis = sensors.columns[s, j], sensors.axes[s, j]
            R = R @ sensors.rotations[s, j]
            found[:, column] = R @ axis
            turn = rotation.from_rotation_vector(angles[:, column, None] * axis)
            R = R @ rotation.to_matrix(turn)
    return found


def _groups(sensors: ChainSensors) -> list[_Group]:
    """The joints between every sensor and the one next before it."""
    carried = [set(sensors.columns[s, :count]) for s, count in enumerate(sensors.counts)]
    groups = []
    for distal, own in enumerate(carried):
        before = [s for s, other in enumerate(carried) if other < own]
        proximal = max(before, key=lambda s: len(carried[s]), default=None)
        between = own - (carried[proximal] if proximal is not None else set())
        groups.append(_Group(sorted(int(c) for c in between), proximal, distal))
    return groups
