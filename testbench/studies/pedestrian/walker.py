"""A walker on a path with turns: the poses of sensors on thigh, shank, wrist and chest.

Joint angles follow the curves of the protocol `gait` (Perry & Burnfield 2010, Kadaba et al. 1990),
stride by stride at a time and size of their own. What decides the study's errors, and where it
comes from, stands in `Walker`; nothing of it was chosen to reach a published error. Heel strike,
skin and a strap's slip are not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import yaml
from scipy.interpolate import PchipInterpolator

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.noise import random_stream
from testbench.model.rigid_motion import RigidMotion
from testbench.records.specs.shipped import shipped_folder

RATE_HZ = 200.0
"""Of the poses; splines go between them."""
STATURE = 1.61
THIGH, SHANK, UPPER_ARM, FOREARM = 0.3945, 0.3961, 0.186 * STATURE, 0.146 * STATURE
"""Lengths of segments [m]: robots/lower_limb, and Winter (Biomechanics and Motor Control of Human
Movement, 1990) for the arm.
"""
HIP_HEIGHT, SHOULDER_HEIGHT, SHOULDER_WIDTH = 0.85, 0.82 * STATURE, 0.129 * STATURE
RISE, SWAY = 0.022, 0.02
"""How far the pelvis rises and sways to either side [m] (Saunders, Inman & Eberhart 1953)."""
REST_BEFORE_S, REST_AFTER_S = 5.0, 3.0
PLACES = ("shank", "thigh", "wrist", "chest")


@dataclass(frozen=True)
class Walker:
    """Properties that decide how well a walk is reckoned.

    Attributes:
        stride_m: Mean length of a stride: 151.72 m over 109 gait cycles of the source.
        stride_s: Mean time of a stride: 105 steps a minute (Winter 1987).
        size: Of all angles of the leg and the arm over those of the curves [1].
        swing_cv: Standard deviation of a stride's size, of all angles alike [1]. This and the next
            three are those of the straight strides of a healthy walker by markers and rates
            (github mad-lab-fau/gaitmap, example data: 25 strides of either foot).
        length_cv: Of its length [1].
        length_slope: By how much of a change of size its length changes [1].
        time_cv: Of its time [1], correlated with the length by -0.75.
        speed: By how much the speed goes up and down over 50 m [1]: a choice. Length and rate
            change by the root of it each (constant walk ratio: Sekiya & Nagasaki, Gait & Posture
            7, 1998).
        turn_m: Arc of a right-angled turn [m]: about a stride, a choice.
        arm_deg: Half the arc of the shoulder, of 32 deg (Perry & Burnfield 2010, ch. 8).
        elbow_deg: Half the range of the elbow, of 29.7 deg (Clinics in Shoulder and Elbow 26(2),
            2023).
        pocket: Part of the strides in which the hand is in a pocket and the arm does not swing: the
            source did so "for some stretches".
        chest_deg: Half the swing of the chest about the left axis: that of the pelvis's tilt, 1.5
            deg (Kadaba et al. 1990). The source hung the sensor about the neck.
    """

    stride_m: float = 1.392
    stride_s: float = 1 / 0.875
    size: float = 1.0
    swing_cv: float = 0.027
    length_cv: float = 0.034
    length_slope: float = 1.0
    time_cv: float = 0.0255
    speed: float = 0.1
    turn_m: float = 1.4
    arm_deg: float = 16.0
    elbow_deg: float = 14.85
    pocket: float = 0.0
    chest_deg: float = 1.5


@dataclass(frozen=True, eq=False)
class Walked:
    """A walk.

    Attributes:
        bodies: Motion of a level frame (x forward, y left, z up while standing) at each place.
        cycles: Number of strides of the leg.
        distance: Length of the path [m].
        path: From above, shape (n, 2) [m].
        end: Where it ends [m], shape (2,).
    """

    bodies: dict[str, RigidMotion]
    cycles: int
    distance: float
    path: np.ndarray
    end: np.ndarray


@cache
def curves() -> dict[str, tuple[float, list[float], list[float]]]:
    """Mean, amplitudes and phases of each joint of the right leg and the pelvis [rad]."""
    text = (shipped_folder("protocols") / "gait.yaml").read_text("utf-8")
    sections = yaml.safe_load(text)["sections"]
    means = sections[1]["steps"][0]["move_to_deg"]
    found = {}
    for joint, wave in sections[2]["steps"][0]["sweep"].items():
        own = wave["fourier"]
        found[joint] = (
            float(np.radians(means.get(joint, 0.0))),
            np.radians(own["amplitudes_deg"]).tolist(),
            np.radians(own["phases_deg"]).tolist(),
        )
    return found


def walk_a_path(
    walker: Walker,
    strides: int,
    turns_deg: list[float],
    seed: int,
    *labels: str,
) -> Walked:
    """Walk straight, or with turns that divide the way evenly.

    Args:
        walker: Who.
        strides: Gait cycles of the leg.
        turns_deg: Turns to the left, in their order.
        seed: Of what varies from stride to stride.
        *labels: Name this walk; they select its random numbers.
    """
    rng = random_stream(seed, "walker", *labels)
    lengths, times, sizes = _strides(walker, strides, rng)
    begins = REST_BEFORE_S + np.concatenate([[0.0], np.cumsum(times)])
    end = begins[-1] + REST_AFTER_S
    t = np.arange(round(end * RATE_HZ) + 1) / RATE_HZ
    # stride number, and way along the path, without a jump of their rates
    knots = np.concatenate([[0.0, begins[0] - 0.3], begins, [begins[-1] + 0.3, end + 1]])
    count = np.concatenate([[0.0, 0.0], np.arange(strides + 1), [strides, strides]])
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    done = np.concatenate([[0.0, 0.0], way, [way[-1], way[-1]]])
    phase, along = (PchipInterpolator(knots, values)(t) for values in (count, done))
    envelope = _smooth((t - begins[0]) / walker.stride_s) * _smooth(
        (begins[-1] - t) / walker.stride_s
    )
    middles = np.concatenate([[0.0], (begins[1:] + begins[:-1]) / 2, [end + 1]])
    size = PchipInterpolator(middles, np.concatenate([sizes[:1], sizes, sizes[-1:]]))(t) * envelope
    place, heading = _path(walker, along, way[-1], np.radians(turns_deg))
    pocket = _pockets(walker, strides, phase)
    bodies = _bodies(walker, t, phase, (size, pocket * size), (place, heading))
    return Walked(bodies, strides, float(way[-1]), place, place[-1])


def _smooth(x: np.ndarray) -> np.ndarray:
    """From 0 to 1 with two continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


def _strides(
    walker: Walker, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Length [m], time [s] and size [1] of each stride, shape (count,) each."""
    z, own, other = rng.standard_normal((3, count))
    begun = rng.uniform(0, 2 * np.pi)
    speed = 1 + walker.speed * np.sin(2 * np.pi * np.arange(count) * walker.stride_m / 50.0 + begun)
    root = np.sqrt(speed)
    explained = walker.length_slope * walker.swing_cv
    rest = np.sqrt(max(walker.length_cv**2 - explained**2, 0.0))
    long = explained * z + rest * own
    deviation = long / max(walker.length_cv, 1e-12)
    late = walker.time_cv * (-0.75 * deviation + np.sqrt(1 - 0.75**2) * other)
    lengths = walker.stride_m * root * (1 + long)
    times = walker.stride_s / root * (1 + late)
    return lengths, times, walker.size * root * (1 + walker.swing_cv * z)


def _path(
    walker: Walker, along: np.ndarray, whole: float, turns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Place, shape (n, 2) [m], and heading, shape (n,) [rad], at ways along a path."""
    fine = np.linspace(0.0, whole, max(round(whole / 0.002), 2))
    heading = np.zeros(len(fine))
    for i, turn in enumerate(turns, start=1):
        middle = whole * i / (len(turns) + 1)
        heading += turn * _smooth((fine - middle) / walker.turn_m + 0.5)
    steps = np.diff(fine)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])[:-1]
    places = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    at = [np.interp(along, fine, places[:, i]) for i in range(2)]
    return np.column_stack(at), np.interp(along, fine, heading)


def _pockets(walker: Walker, strides: int, phase: np.ndarray) -> np.ndarray:
    """1 where the arm swings, 0 where the hand is in a pocket: one stretch, from a third on."""
    if walker.pocket <= 0:
        return np.ones(len(phase))
    begin = strides / 3
    end = begin + walker.pocket * strides
    return np.asarray(1 - _smooth(phase - begin + 0.5) * _smooth(end - phase + 0.5))


def _angle(joint: str, phase: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Angle of a joint [rad], shape (n,): zero while it stands."""
    mean, amplitudes, phases = curves()[joint]
    wave = np.full(len(phase), mean)
    for k, (amplitude, begun) in enumerate(zip(amplitudes, phases, strict=True), start=1):
        wave += amplitude * np.sin(2 * np.pi * k * phase + begun)
    return size * wave


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """Quaternions of turns about one axis, shape (n, 4)."""
    vector = np.zeros((len(angle), 3))
    vector[:, axis] = angle
    return rotation.from_rotation_vector(vector)


def _chained(*turns: np.ndarray) -> np.ndarray:
    q = turns[0]
    for turn in turns[1:]:
        q = rotation.multiply(q, turn)
    return q


# Longer than a screen: a chain of segments, one after the other.
def _bodies(
    walker: Walker,
    t: np.ndarray,
    phase: np.ndarray,
    sizes: tuple[np.ndarray, np.ndarray],
    where: tuple[np.ndarray, np.ndarray],
) -> dict[str, RigidMotion]:
    """Poses of all places: the chain of robots/lower_limb from the pelvis on, and an arm."""
    (size, swinging), (place, heading) = sizes, where

    def angle(joint: str) -> np.ndarray:
        return _angle(joint, phase, size)

    turned = _about(2, heading)
    pelvis = _chained(
        turned,
        _about(0, angle("pelvis_list")),
        _about(2, angle("pelvis_rotation")),
        _about(1, -angle("pelvis_tilt")),
    )
    thigh = _chained(
        pelvis,
        _about(0, angle("hip_r_adduction")),
        _about(2, angle("hip_r_rotation")),
        _about(1, -angle("hip_r_flexion")),
    )
    shank = rotation.multiply(thigh, _about(1, angle("knee_r_flexion")))
    cycle = 2 * np.pi * phase
    body = np.column_stack(
        [
            place,
            HIP_HEIGHT + RISE * size * np.cos(2 * cycle),
        ]
    ) + rotation.rotate(turned, np.outer(SWAY * size * np.sin(cycle), [0.0, 1.0, 0.0]))
    hip = body + rotation.rotate(pelvis, np.tile([0.0, -0.0882, 0.0], (len(t), 1)))
    knee = hip + rotation.rotate(thigh, np.tile([0.0, 0.0, -THIGH], (len(t), 1)))
    chest = _chained(
        turned,
        _about(0, angle("pelvis_list")),
        _about(2, -angle("pelvis_rotation")),
        _about(1, np.radians(walker.chest_deg) * size * np.sin(2 * cycle)),
    )
    trunk = body + np.array([0.0, 0.0, SHOULDER_HEIGHT - HIP_HEIGHT])
    shoulder = trunk + rotation.rotate(chest, np.tile([0.0, SHOULDER_WIDTH, 0.0], (len(t), 1)))
    # the left arm swings with the right leg: forward where that heel strikes
    forward = swinging * np.cos(cycle)
    shoulder_angle = np.radians(walker.arm_deg) * forward - np.radians(8.0) * swinging
    elbow_angle = np.radians(walker.elbow_deg) * (forward + swinging)
    upper = rotation.multiply(chest, _about(1, -shoulder_angle))
    fore = rotation.multiply(upper, _about(1, -elbow_angle))
    elbow = shoulder + rotation.rotate(upper, np.tile([0.0, 0.0, -UPPER_ARM], (len(t), 1)))
    at = {
        "thigh": (thigh, hip + _fixed(thigh, [0.07, 0.0, -0.2])),
        "shank": (shank, knee + _fixed(shank, [0.05, 0.0, -0.15])),
        "wrist": (fore, elbow + _fixed(fore, [0.0, 0.03, -FOREARM])),
        "chest": (chest, trunk + _fixed(chest, [0.1, 0.0, -0.15])),
    }
    time_ns = np.round(t * NANOSECONDS).astype(np.int64)
    return {name: RigidMotion(time_ns, position, q) for name, (q, position) in at.items()}


def _fixed(q: np.ndarray, offset: list[float]) -> np.ndarray:
    """Where a point that is fixed to a body lies from its origin, in the world, shape (n, 3)."""
    return rotation.rotate(q, np.tile(offset, (len(q), 1)))
