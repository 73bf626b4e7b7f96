"""Whether the sensor that is said to be nearer to the trunk hangs below the other one.

How a joint's centre accelerates tells where it is from both sensors (`joint_centre`). In a standing
pose with hanging arms the segment above hip, knee, ankle, elbow and wrist is above them, and so is
its sensor; two that were exchanged are the other way round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.joints.joint_centre import INDEPENDENT_S, CentreCost, centre_terms
from testbench.estimation.joints.limb import Limb
from testbench.estimation.joints.standing import Standing
from testbench.model import rotation

HEADINGS = np.arange(60) * 2 * np.pi / 60
SURE = 3.0
"""Standard deviations that a height must differ from zero by [1]."""
LEAST = 0.05
"""A height that is no more may be of a sensor beside the joint [m]."""


@dataclass(frozen=True)
class Above:
    """How far the proximal sensor is above the distal one in the standing pose.

    Attributes:
        height: By the joint's centre [m].
        sd: Its standard uncertainty [m].
    """

    height: float
    sd: float

    @property
    def upside_down(self) -> bool:
        """Whether the proximal one surely hangs below."""
        return self.height < -max(SURE * self.sd, LEAST)


def proximal_above(limb: Limb, proximal: str, distal: str, standing: Standing) -> Above | None:
    """How far a joint's proximal sensor is above the distal one; None where too little is known.

    Args:
        limb: Both sensors.
        proximal: The one that is said to be nearer to the trunk.
        distal: The other.
        standing: The pose.
    """
    a, A = centre_terms(limb, proximal)
    b, B = centre_terms(limb, distal)
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    independent = known.sum() * limb.interval / INDEPENDENT_S
    if independent <= 6:
        return None
    cost = CentreCost(a[known], A[known], b[known], B[known])
    heading = float(min(HEADINGS, key=cost))
    levers, inverse = cost.levers(heading)
    # down from the proximal sensor to the centre, and up from there to the distal one
    down = -np.concatenate(
        [
            rotation.rotate(rotation.conjugate(standing.q[proximal]), np.array([0.0, 0.0, 1.0])),
            rotation.rotate(rotation.conjugate(standing.q[distal]), np.array([0.0, 0.0, -1.0])),
        ]
    )
    # residuals of one half second count once
    variance = cost(heading) / 3 * known.sum() / (independent - 6 / 3)
    return Above(float(down @ levers), float(np.sqrt(variance * down @ inverse @ down)))
