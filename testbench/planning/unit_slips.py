"""Numbers that look as if another unit was meant: radians for degrees, metres for millimetres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.planning.expansion import Command
from testbench.records.specs.protocol import Protocol

TYPED_TO = 0.005
"""How near a typed number comes to a part of pi: 1.57 and 3.14 count [1]."""
WHOLE_TURN = 2 * np.pi + TYPED_TO
FEWEST_IN_A_POSE = 2
"""One pose among others in degrees is doubted where so many of its angles, and no other but 0, are
quarters of pi.
"""
FEWEST_MEASURED = 3
"""Joints of a whole pose that were read from an arm, with three digits behind the point or more."""
MEASURED_TO = 0.01
LEAST_POSITION_MM = 1.0
"""A part whose coordinates are all smaller sits in the middle of its link, where no sensor is
mounted [mm].
"""


def unit_warnings(protocol: Protocol, commands: Sequence[Command]) -> list[str]:
    """A sentence for each kind of slip, with what was probably meant."""
    return _radians(commands) + _metres(protocol)


def _radians(commands: Sequence[Command]) -> list[str]:
    """Poses and variables called `..._deg` whose angles are few and quarters of pi.

    All stay within 2 pi degrees. Where no pose of the protocol goes beyond 2 pi one such angle is
    enough; a variable is doubted by its largest value.
    """
    moves = [command for command in commands if command.target is not None]
    angles = [
        np.degrees(command.target[np.isfinite(command.target)])
        for command in moves
        if command.target is not None
    ]
    small = not angles or max(float(np.abs(pose).max(initial=0.0)) for pose in angles) <= WHOLE_TURN
    for command, pose in zip(moves, angles, strict=True):
        typed = _quarters(pose)
        alone = typed.sum() >= FEWEST_IN_A_POSE and bool(np.all(typed | (pose == 0)))
        if typed.any() and (small or alone):
            where = (
                "no angle of the protocol is beyond 2 pi"
                if small
                else "so are all its angles but 0"
            )
            number = float(pose[int(np.argmax(typed))])
            return [
                (
                    f"move_to_deg of step '{command.name}' {_looks(number)}, and {where}); it is "
                    "taken in degrees"
                )
            ]
        if _measured(command, pose):
            shown = ", ".join(f"{angle:g}" for angle in pose.round(6))
            return [
                (
                    f"move_to_deg of step '{command.name}' looks like radians as an arm reports "
                    f"them ([{shown}]: a whole pose within 2 pi, with more than two digits behind "
                    "the point); it is taken in degrees"
                )
            ]
    values: dict[str, set[float]] = {}
    for command in commands:
        for name, value in command.variables.items():
            values.setdefault(name, set()).add(float(value))
    warnings = []
    for name, own in values.items():
        largest = max(own, key=abs)
        if name.endswith("_deg") and len(own) > 1 and _quarters(np.array([largest]))[0]:
            warnings.append(
                f"variable '{name}' {_looks(largest)}, and it goes no further); it is taken in "
                "degrees"
            )
    return warnings


def _measured(command: Command, pose: np.ndarray) -> bool:
    """Whether a pose is of all joints, small as radians are, and of numbers that nobody types."""
    if command.target is None or len(pose) < len(command.target):
        return False
    digits = np.abs(pose / MEASURED_TO - np.round(pose / MEASURED_TO)) > 1e-6
    fine = int(digits.sum())
    largest = float(np.abs(pose).max())
    return fine >= max(FEWEST_MEASURED, len(pose) / 2) and 1 <= largest <= WHOLE_TURN


def _quarters(angle: np.ndarray) -> np.ndarray:
    """Which numbers are a quarter of pi or several, but no more than 2 pi."""
    quarters = np.round(angle / (np.pi / 4))
    near = np.abs(angle - quarters * np.pi / 4) <= TYPED_TO
    return np.asarray((quarters != 0) & near & (np.abs(angle) <= WHOLE_TURN))


def _looks(number: float) -> str:
    return f"looks like radians ({number:g} is {number / np.pi:.2f} pi"


def _metres(protocol: Protocol) -> list[str]:
    """Mountings whose positions are all below a millimetre."""
    warnings = []
    for name, sensor in protocol.spec.sensors.items():
        position = sensor.mounting.position_mm
        if any(position) and max(abs(value) for value in position) < LEAST_POSITION_MM:
            given, meant = (
                ", ".join(f"{scale * value:g}" for value in position) for scale in (1, 1000)
            )
            warnings.append(
                f"sensor '{name}': position_mm [{given}] looks like metres, for all of it is below "
                f"{LEAST_POSITION_MM:g} mm; did you mean [{meant}]?"
            )
    return warnings
