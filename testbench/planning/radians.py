"""Angles that look like radians where degrees are meant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.planning.expansion import Command

TYPED_TO = 0.005
"""How near a typed number comes to a part of pi: 1.57 and 3.14 count [1]."""
WHOLE_TURN = 2 * np.pi + TYPED_TO


def radians_warning(commands: Sequence[Command]) -> str | None:
    """A sentence where every pose of a protocol stays within 2 pi degrees and one of its angles is a quarter of pi, or more."""
    moves = [command for command in commands if command.target is not None]
    angles = [np.degrees(command.target[np.isfinite(command.target)]) for command in moves if command.target is not None]
    if not angles or max(float(np.abs(pose).max(initial=0.0)) for pose in angles) > WHOLE_TURN:
        return None
    for command, pose in zip(moves, angles, strict=True):
        quarters = np.round(pose / (np.pi / 4))
        typed = (quarters != 0) & (np.abs(pose - quarters * np.pi / 4) <= TYPED_TO)
        if typed.any():
            number = float(pose[int(np.argmax(typed))])
            return (
                f"move_to_deg of step '{command.name}' looks like radians ({number:g} is {number / np.pi:.2f} pi, and no angle "
                "of the protocol is beyond 2 pi); it is taken in degrees"
            )
    return None
