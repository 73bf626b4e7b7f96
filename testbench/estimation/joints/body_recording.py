"""What the joint angles of a body are computed from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from testbench.records.results.estimate import SensorEstimate
from testbench.records.specs.protocol import Body, BodyJoint


@dataclass(frozen=True)
class Read:
    """What a sensor read, at its estimate's instants.

    Attributes:
        force: Specific force, shape (n, 3) [m/s^2].
        rate: Calibrated angular rate of the interval before each, shape (n, 3) [rad/s]; NaN where
            nothing was measured.
    """

    force: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class BodyRecording:
    """What joints of a body are computed from.

    Attributes:
        body: As a person says it.
        sensors: Their estimates, by name.
        read: What they read, by name.
        true: Sensors whose truth is known.
        begin_ns: Host time of the first sample of all [ns].
    """

    body: Body
    sensors: Mapping[str, SensorEstimate]
    read: Mapping[str, Read]
    true: frozenset[str]
    begin_ns: int

    def method(self, joint: BodyJoint) -> str:
        """How the sensors of a joint are placed: as asked for, or what suits what is known."""
        asked = joint.aligned(self.body).method
        if asked != "auto":
            return asked
        both = ends(joint)
        stated = all(self.body.segment(own).rotation_deg for own in both)
        return "stated" if stated or set(both) <= self.true else "standing"


def ends(joint: BodyJoint) -> tuple[str, str]:
    """The proximal and the distal sensor of a joint."""
    return joint.proximal, joint.distal
