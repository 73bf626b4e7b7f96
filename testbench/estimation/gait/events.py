"""When a foot leaves the ground and comes down, by its sagittal rate.

The foot turns toe down about its left axis while the heel rises, toe up while it swings, and toe
down again once the heel has struck. Terminal contact is taken where the foot turns fastest toe down
before the swing, initial contact where it ceases to turn toe up at the end of it (J. M. Jasiewicz
et al.: Gait event detection using linear accelerometers or angular velocity transducers in
able-bodied and spinal-cord injured individuals, Gait & Posture 24(4), 2006).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.model import rotation

STRAIGHT = np.radians(20.0)
"""A stride that turns the foot by more is no straight one [rad]."""
CURVED, ENOUGH = np.radians(60.0), 3
"""Without so many straight strides those that turn by less than this show the axes [rad]."""
TOE_UP = np.radians(6.0)
"""A heel strikes if the foot comes down with the toe this much above the heel [rad]."""
HEEL_UP = np.radians(12.0)
"""A foot pushes off if it leaves with the heel this much above the toe [rad]."""
LEAST_RATE = np.radians(10.0)
"""Slower turns of the foot are no event [rad/s]."""


@dataclass(frozen=True)
class FootAxes:
    """Where forward, left and up are in the sensor while the foot stands, shape (3,) each."""

    forward: np.ndarray
    left: np.ndarray
    up: np.ndarray


@dataclass(frozen=True)
class Events:
    """Of one movement from stand to stand.

    Attributes:
        terminal: Terminal contact, in rows; NaN where there is none to be seen.
        initial: Initial contact, in rows.
        heel_strikes: Whether the heel comes down first.
        pushes_off: Whether the toe leaves last.
    """

    terminal: float
    initial: float
    heel_strikes: bool
    pushes_off: bool


def foot_axes(moves: np.ndarray, q_begin: np.ndarray, q_end: np.ndarray) -> FootAxes | None:
    """The axes by the way that the foot goes; None where it only turns on the spot.

    Args:
        moves: From stand to stand in the world, shape (k, 3) [m].
        q_begin: q_world_from_sensor when it stood before, shape (k, 4).
        q_end: And after, shape (k, 4).
    """
    turns = np.abs(rotation.heading_angle(rotation.multiply(q_end, rotation.conjugate(q_begin))))
    level = moves * [1.0, 1.0, 0.0]
    size = rotation.lengths(level)
    good = (turns < STRAIGHT) & (size > 0)
    if good.sum() < ENOUGH:  # before a turn the foot lags the way as much as it leads it after
        good = (turns < CURVED) & (size > 0)
    if not good.any():
        return None
    longest = good & (size >= 0.5 * np.max(size[good]))
    along = level[longest] / size[longest, None]
    back_begin, back_end = (rotation.conjugate(q[longest]) for q in (q_begin, q_end))
    forward = np.median(
        np.concatenate([rotation.rotate(back_begin, along), rotation.rotate(back_end, along)]),
        axis=0,
    )
    ups = rotation.rotate(rotation.conjugate(q_begin), np.tile([0.0, 0.0, 1.0], (len(moves), 1)))
    up = np.median(ups, axis=0)
    up /= np.linalg.norm(up)
    forward = forward - up * (forward @ up)
    forward /= np.linalg.norm(forward)
    return FootAxes(forward, np.cross(up, forward), up)


def events_of(rate: np.ndarray, elevation: np.ndarray, speed: np.ndarray) -> Events:
    """Find the events of one movement.

    Args:
        rate: About the foot's left axis, toe down, shape (n,) [rad/s].
        elevation: Of the foot's forward axis above where it stood, shape (n,) [rad].
        speed: Along the way, shape (n,) [m/s].
    """
    middle = int(np.argmax(speed))
    pushing = int(np.argmax(rate[: middle + 1]))
    terminal = float(pushing) if rate[pushing] > LEAST_RATE else float("nan")
    lowest = float(np.min(elevation[: middle + 1]))
    initial, strikes = float(len(rate) - 1), False
    rising = np.flatnonzero((rate[middle:-1] < 0) & (rate[middle + 1 :] >= 0)) + middle
    if len(rising) and rate[middle : rising[0] + 1].min() < -LEAST_RATE:
        k = int(rising[0])
        initial = k + rate[k] / (rate[k] - rate[k + 1])
        strikes = bool(elevation[k] > TOE_UP)
    else:
        slowing = np.flatnonzero(speed[middle:] < 0.5 * speed[middle])
        initial = float(middle + slowing[0]) if len(slowing) else initial
    return Events(terminal, initial, strikes, lowest < -HEEL_UP)
