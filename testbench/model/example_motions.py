"""Motions to try the bench with, where nobody has a recording yet: a squat, a phone in a hand, a
foot that walks, a board that is laid on its sides.

All are made up: smooth, without skin, impacts or the habits of a person. What they are worth is
that the truth is known, and that everybody has the same ones.
"""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.noise import random_stream
from testbench.model.rigid_motion import RigidMotion

RATE_HZ = 100.0
"""Of the poses; splines go between them."""
FORWARD, LEFT, UP = np.eye(3)
SHANK_M, THIGH_M = 0.40, 0.42
SQUATS, SQUAT_S, STANDS_S = 6, 2.0, 4.0
KNEE_DEG, LEAN_DEG, TRUNK_DEG = 90.0, 25.0, 30.0
"""Of the knee's flexion, of the shank and of the pelvis forwards, in the deepest squat."""
STRIDES, STRIDE_M, STRIDE_S = 12, 1.25, 1.1
PIVOT_M, HEEL_M = 0.12, 0.20
"""How far the sensor on the instep and the heel lie behind the ball of the foot."""
FACES, RESTS_S, TURN_S = 18, 2.0, 1.0


def squats() -> dict[str, RigidMotion]:
    """Sensors on pelvis, thigh and shank of somebody who stands, squats and stands again."""
    t = _times(2 * STANDS_S + SQUATS * SQUAT_S)
    rng = random_stream(0, "example", "squat")
    depth = np.zeros(len(t))
    for number, size in enumerate(1 + 0.06 * rng.standard_normal(SQUATS)):
        begun = STANDS_S + number * SQUAT_S
        half = SQUAT_S / 2
        depth += size * (_smooth((t - begun) / half) - _smooth((t - begun - half) / half))
    knee, lean, trunk = (np.radians(a) * depth for a in (KNEE_DEG, LEAN_DEG, TRUNK_DEG))
    shank, thigh, pelvis = (_about(LEFT, angle) for angle in (lean, lean - knee, trunk))
    up = np.tile(UP, (len(t), 1))
    middle = rotation.rotate(shank, SHANK_M * up)
    hip = middle + rotation.rotate(thigh, THIGH_M * up)
    behind = np.tile(-0.1 * FORWARD, (len(t), 1))
    outside = np.tile(-0.06 * LEFT, (len(t), 1))
    placed = {
        "Pelvis": (pelvis, hip + rotation.rotate(pelvis, behind)),
        "RFemur": (thigh, middle + rotation.rotate(thigh, 0.22 * up + outside)),
        "RTibia": (shank, rotation.rotate(shank, 0.25 * up + outside)),
    }
    worn = rotation.normalise(rng.standard_normal((len(placed), 4)))  # as straps happen to hold it
    return {
        name: _motion(t, place, rotation.multiply(q, np.tile(own, (len(t), 1))))
        for (name, (q, place)), own in zip(placed.items(), worn, strict=True)
    }


def in_a_hand() -> RigidMotion:
    """A phone that lies, is turned about by hand for half a minute, and lies again."""
    t = _times(40.0)
    rng = random_stream(0, "example", "phone")
    moving = _smooth((t - 4.0) / 2.0) * _smooth((36.0 - t) / 2.0)

    def waves(size: float) -> np.ndarray:
        rates, phases = rng.uniform(0.15, 0.6, (4, 3)), rng.uniform(0, 2 * np.pi, (4, 3))
        both = zip(rates, phases, strict=True)
        total = sum(np.sin(2 * np.pi * t[:, None] * rate + phase) for rate, phase in both)
        return np.asarray(size * moving[:, None] * total)

    return _motion(t, waves(0.04), rotation.from_rotation_vector(waves(0.5)))


def walking_foot() -> RigidMotion:
    """A sensor on the instep: the foot rolls over its ball, swings, and comes down on its heel."""
    t = _times(2 * STANDS_S + (STRIDES + 1) * STRIDE_S)
    phase = (t - STANDS_S) / STRIDE_S
    pitch, way, lift = np.zeros((3, len(t)))
    for stride in range(STRIDES):
        own = phase - stride
        # toe-off, swing, heel contact and foot flat, in parts of a stride
        for start, end, turn in (
            (0.38, 0.60, 55.0),
            (0.60, 0.95, -75.0),
            (1.00, 1.12, 20.0),
        ):
            pitch += np.radians(turn) * _smooth((own - start) / (end - start))
        way += STRIDE_M * _smooth((own - 0.58) / 0.44)
        lift += 0.03 * _smooth((own - 0.58) / 0.2) * _smooth((1.02 - own) / 0.2)
    # with its toes up the foot stands on the heel
    ball = np.outer(way, FORWARD) + np.outer(lift + HEEL_M * np.sin(np.maximum(-pitch, 0)), UP)
    foot = _about(LEFT, pitch)
    instep = np.tile([-PIVOT_M, 0.0, 0.06], (len(t), 1))
    return _motion(t, ball + rotation.rotate(foot, instep), foot)


def laid_on_its_sides() -> RigidMotion:
    """A board that rests in many attitudes, and is turned by hand from one to the next."""
    rng = random_stream(0, "example", "sides")
    t = _times(FACES * (RESTS_S + TURN_S))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    for number in range(1, FACES):
        axis = rng.standard_normal(3)
        angle = rng.uniform(np.radians(60), np.radians(150))
        begun = number * (RESTS_S + TURN_S) - TURN_S
        done = angle * _smooth((t - begun) / TURN_S)
        q = rotation.multiply(q, _about(axis / np.linalg.norm(axis), done))
    return _motion(t, np.zeros((len(t), 3)), q)


def _times(duration: float) -> np.ndarray:
    return np.arange(round(duration * RATE_HZ) + 1) / RATE_HZ


def _motion(t: np.ndarray, place: np.ndarray, q: np.ndarray) -> RigidMotion:
    return RigidMotion(np.round(t * NANOSECONDS).astype(np.int64), place, q)


def _smooth(x: np.ndarray) -> np.ndarray:
    """From 0 to 1 with two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


def _about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Quaternions of turns about one axis, shape (n, 4)."""
    return rotation.from_rotation_vector(np.outer(angle, axis))
