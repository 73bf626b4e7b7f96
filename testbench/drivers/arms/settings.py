"""What the process that drives an arm is told: how to drive it, and one motion after another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

STOP_RAD_S2 = 4.0
"""Deceleration of stops [rad/s^2]; the script manual's default for stopj is 2."""


@dataclass(frozen=True)
class Motion:
    """One step as the process is told of it.

    Attributes:
        index: Of the step; -1 for the approach.
        kind: "move" (the controller plans it), "stream" (target by target) or "hold".
        target: Joint angles at its end, shape (n,) [rad].
        speed: Of the leading joint [rad/s].
        acceleration: Of the leading joint [rad/s^2].
        path: Targets at the streaming rate, shape (k, n) [rad], or None.
        dwell: [s].
        duration: As planned [s].
    """

    index: int
    kind: str
    target: np.ndarray
    speed: float = 0.0
    acceleration: float = 0.0
    path: np.ndarray | None = None
    dwell: float = 0.0
    duration: float = 0.0


@dataclass(frozen=True)
class LinkSettings:
    """How the process drives the arm.

    Attributes:
        host: Address of the controller.
        joints: How many.
        control_hz: Rate of streaming [Hz].
        record_hz: Rate of recording [Hz].
        tracking: Largest error of following [rad].
        settled: Largest error of a pose that counts as reached [rad].
        host_silence: The arm stops when the bench is silent for so long [s].
        arm_silence: The arm stops when the controller sends nothing for so long [s].
        stuck: The client library is given up when it is at one command for so long [s].
        mass: Of the tool [kg]; None leaves the controller's setting as it is.
        centre: Centre of mass of the tool in the flange [m].
        unseen: What becomes of an arm that nobody can ask any more, for a person to read.
        joint_names: For messages.
    """

    host: str
    joints: int = 6
    control_hz: float = 500.0
    record_hz: float = 125.0
    tracking: float = float(np.radians(5.0))
    settled: float = float(np.radians(0.01))
    host_silence: float = 3.0
    arm_silence: float = 0.5
    stuck: float = 1.0
    mass: float | None = None
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    joint_names: tuple[str, ...] = ()
    unseen: ClassVar[str]
