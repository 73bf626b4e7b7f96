"""Where the sensors sit and how long the segments are, as constants that may be wrong.

Six of each sensor, a turn about its own axes and a shift in the frame of the joint that carries it;
then, where lengths are in doubt, the relative length of each offset between joints that carry a
sensor. The offset of the first joint from the world is left out: no reading depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.chain.effect import PlacementEffect
from testbench.estimation.chain.sensors import ChainSensors
from testbench.estimation.chain.start import StartState
from testbench.model import rotation

SHORTEST = 0.01
"""Joints closer together than this have no length between them that could be in doubt [m]."""


@dataclass(frozen=True)
class Constants:
    """Which constants of placement there are, and what is known of them beforehand.

    Attributes:
        sd: Their standard deviations, shape (p,) [rad], [m], [1].
        lengths: Which of them the offset before each joint is, -1 for none, shape (s, k).
        names: Of the joints whose offsets are among them, after the six of each sensor.
        covariance: What is left of it where they were fitted, shape (p, p), which joints' standard
            deviations then include; else empty, shape (0, 0).
    """

    sd: np.ndarray
    lengths: np.ndarray
    names: list[str]
    covariance: np.ndarray

    @staticmethod
    def of(
        sensors: ChainSensors, rotation_sd: float, position_sd: float, length_sd: float = 0.0
    ) -> Constants:
        """Those of a chain.

        Args:
            sensors: On the chain.
            rotation_sd: Of the mounting about each axis [rad].
            position_sd: Of the mounting along each axis [m].
            length_sd: Relative, of segments [1]; 0: they are as stated.
        """
        s, k = sensors.columns.shape
        lengths, names = np.full((s, k), -1, dtype=np.int64), list[str]()
        place: dict[int, int] = {}
        for i in range(s if length_sd > 0 else 0):
            for j in range(1, sensors.counts[i]):
                column = int(sensors.columns[i, j])
                if np.linalg.norm(sensors.offsets[i, j]) < SHORTEST:
                    continue
                if column not in place:
                    place[column] = 6 * s + len(names)
                    names.append(sensors.joints[column])
                lengths[i, j] = place[column]
        sd = np.concatenate(
            [np.tile(np.repeat([rotation_sd, position_sd], 3), s), np.full(len(names), length_sd)]
        )
        return Constants(sd, lengths, names, np.zeros((0, 0)))

    def at(self, start: StartState, m: int) -> PlacementEffect:
        """Their effect on a filter that begins.

        Args:
            start: Of the filter, for as many constants.
            m: Joints.
        """
        p = len(self.sd)
        return PlacementEffect(
            start.sensitivity.copy(),
            start.information.copy(),
            start.score.copy(),
            np.zeros((m, p, p)),
            self.covariance,
            self.lengths,
        )


def no_constants(sensors: ChainSensors) -> Constants:
    """Placement that is beyond doubt."""
    return Constants(
        np.zeros(0), np.full(sensors.columns.shape, -1, dtype=np.int64), [], np.zeros((0, 0))
    )


def moved(sensors: ChainSensors, constants: Constants, values: np.ndarray) -> ChainSensors:
    """Sensors and lengths as constants have them.

    Args:
        sensors: As stated.
        constants: Which.
        values: Theirs, shape (p,).
    """
    s = len(sensors.sensors)
    own = values[: 6 * s].reshape(s, 2, 3)
    turns = rotation.to_matrix(rotation.from_rotation_vector(own[:, 0]))
    offsets = sensors.offsets.copy()
    known = constants.lengths >= 0
    offsets[known] *= 1 + values[constants.lengths[known]][:, None]
    return replace(
        sensors,
        tip_rotations=sensors.tip_rotations @ turns,
        tip_offsets=sensors.tip_offsets + own[:, 1],
        offsets=offsets,
    )
