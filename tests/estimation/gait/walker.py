"""A foot that walks, made of points of contact and angles; it shares nothing with the estimator.

The sole lies flat while it stands, rolls over the toe until it leaves, swings, comes down on the
heel and rolls over that. Positions and angles are smooth curves, finely sampled; the readings of a
sensor are their differences, averaged over its own interval as a low pass does.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from testbench.estimation.filters.base import UniformSamples
from testbench.estimation.gait.readings import REST_S, Readings
from testbench.estimation.signals.segmentation import detect_static, intervals_of
from testbench.model import rotation

FINE = 8
SWING_HZ = 100.0
FOOT = 0.25
GRAVITY = np.array([0.0, 0.0, 9.80665])


@dataclass(frozen=True)
class Walker:
    """A walk on a level or rising floor.

    Attributes:
        lengths: Of each stride [m].
        turns_deg: Of the foot in each stride, anticlockwise.
        stride_s: Duration of each.
        rises: Of each [m].
        rate: Of the sensor [Hz].
        sensor: From the heel, forward, left and up [m].
        worn: How the sensor is turned against the foot.
        rests: Before and after the walk [s].
        shock: Amplitude of what rings at each heel strike [m].
        heel_up_deg: Before the foot leaves.
        toe_up_deg: As it comes down.
    """

    lengths: np.ndarray
    turns_deg: np.ndarray
    stride_s: np.ndarray
    rises: np.ndarray
    rate: float = 200.0
    sensor: tuple[float, float, float] = (0.10, 0.0, 0.07)
    worn: Rotation = field(default_factory=lambda: Rotation.from_euler("ZYX", [0.4, -0.3, 0.2]))
    rests: tuple[float, float] = (3.0, 3.0)
    shock: float = 0.0004
    heel_up_deg: float = 55.0
    toe_up_deg: float = 22.0


@dataclass(frozen=True)
class Walked:
    """What the sensor went through, and what it would read without errors; n samples.

    Attributes:
        time: Shape (n,) [s].
        gyr: Shape (n, 3) [rad/s].
        acc: Shape (n, 3) [m/s^2].
        position: Of the sensor, shape (n, 3) [m].
        terminal: When each stride leaves, shape (k,) [s].
        initial: When each comes down, shape (k,) [s].
        lengths: Of each, of the heel, shape (k,) [m].
    """

    time: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    position: np.ndarray
    terminal: np.ndarray
    initial: np.ndarray
    lengths: np.ndarray


def straight(strides: int = 12, length: float = 1.3, **changed) -> Walker:
    """The same stride again and again."""
    own = {"turns_deg": np.zeros(strides), "rises": np.zeros(strides)}
    own |= {"lengths": np.full(strides, length), "stride_s": np.full(strides, 1.1)}
    return Walker(**own | changed)


def loop(strides: int = 16, length: float = 1.3, **changed) -> Walker:
    """Round a polygon, back to its start."""
    turns = np.full(strides, 360.0 / strides)
    return straight(strides, length, turns_deg=turns, **changed)


def varied(seed: int, strides: int = 30) -> Walker:
    """Lengths, speeds and turns of a person who strolls."""
    rng = np.random.default_rng(seed)
    turns = np.where(rng.random(strides) < 0.25, rng.uniform(-80, 80, strides), 0.0)
    return straight(
        strides,
        lengths=rng.uniform(0.6, 1.6, strides),
        stride_s=rng.uniform(0.95, 1.5, strides),
        turns_deg=turns,
        heel_up_deg=float(rng.uniform(35, 65)),
        toe_up_deg=float(rng.uniform(12, 28)),
        rate=float(rng.choice([120.0, 204.8, 400.0])),
        sensor=(float(rng.uniform(0.0, 0.16)), 0.0, float(rng.uniform(0.04, 0.1))),
        worn=Rotation.random(random_state=seed),
    )


def walked(walker: Walker) -> Walked:
    """Walk."""
    step = 1 / (walker.rate * FINE)
    heading = np.concatenate([[0.0], np.cumsum(np.radians(walker.turns_deg))])
    ways = np.column_stack(
        [
            walker.lengths * np.cos(0.5 * (heading[1:] + heading[:-1])),
            walker.lengths * np.sin(0.5 * (heading[1:] + heading[:-1])),
            walker.rises,
        ]
    )
    stands = np.vstack([np.zeros(3), np.cumsum(ways, axis=0)])
    parts = [_standing(walker.rests[0], step, stands[0], heading[0])]
    begin, terminal, initial = walker.rests[0], [], []
    for i, duration in enumerate(walker.stride_s):
        parts.append(_stride(walker, step, duration, stands[i : i + 2], heading[i : i + 2]))
        terminal.append(begin + 0.40 * duration)
        initial.append(begin + 0.80 * duration)
        begin += len(parts[-1][0]) * step
    parts.append(_standing(walker.rests[1], step, stands[-1], heading[-1]))
    heel, angles = (np.concatenate([part[j] for part in parts]) for j in (0, 1))
    foot = Rotation.from_euler("ZY", angles)
    sensor = heel + foot.apply(walker.sensor)
    world_from_sensor = foot * walker.worn
    force = np.gradient(np.gradient(sensor, step, axis=0), step, axis=0) + GRAVITY
    acc = world_from_sensor.inv().apply(force)
    gyr = np.zeros_like(acc)
    gyr[1:] = (world_from_sensor[:-1].inv() * world_from_sensor[1:]).as_rotvec() / step
    count = len(acc) // FINE
    mean = [x[: count * FINE].reshape(count, FINE, 3).mean(axis=1) for x in (gyr, acc, sensor)]
    time = (np.arange(count) + 0.5) / walker.rate
    return Walked(time, *mean, np.array(terminal), np.array(initial), walker.lengths)


def _standing(seconds: float, step: float, heel: np.ndarray, heading: float):
    count = round(seconds / step)
    return np.tile(heel, (count, 1)), np.tile([heading, 0.0], (count, 1))


def _stride(walker: Walker, step: float, duration: float, stands: np.ndarray, heading: np.ndarray):
    """Heel and angles (heading, pitch) of a stride: it stands for a fifth, rises to .40, swings to
    .80, and rolls over the heel to the end.
    """
    t = np.arange(round(duration / step)) * step / duration
    up, down = np.radians(walker.heel_up_deg), -np.radians(walker.toe_up_deg)
    # toe down is positive; fastest as the toe leaves, and at rest for an instant on coming down
    pitch = CubicHermiteSpline(
        [0, 0.2, 0.40, 0.47, 0.80, 0.92, 1],
        [0, 0, 0.8 * up, up, down, 0, 0],
        [0, 0, 6.5 * up, 0, 0, 0, 0],
    )(t)
    blend = np.clip((t - 0.40) / 0.40, 0, 1)
    smooth = blend**3 * (10 - 15 * blend + 6 * blend**2)
    yaw = heading[0] + smooth * (heading[1] - heading[0])
    foot = Rotation.from_euler("ZY", np.column_stack([yaw, pitch]))
    # until it leaves, the toe stays; where it lands, the heel stays
    toe = stands[0] + Rotation.from_euler("Z", heading[0]).apply([FOOT, 0, 0])
    by_toe = toe - foot.apply([FOOT, 0, 0])
    heel = by_toe + smooth[:, None] * (stands[1] - by_toe)
    heel[:, 2] += 0.03 * np.sin(np.pi * blend) ** 4
    late = np.clip((t - 0.80) * duration, 0, None)
    rings = walker.shock * np.exp(-late / 0.015) * np.sin(2 * np.pi * 45 * late)
    heel[:, 2] += np.where(late > 0, rings, 0.0)
    return heel, np.column_stack([yaw, pitch])


def with_errors(
    found: Walked, seed: int = 0, gyr_bias_deg_s: float = 0.3, acc_bias: float = 0.03
) -> tuple[np.ndarray, np.ndarray]:
    """Rates and forces with the noise and biases of a consumer part."""
    rng = np.random.default_rng(seed)
    rate = 1 / float(np.diff(found.time).mean())
    gyr = found.gyr + np.radians(0.01) * np.sqrt(rate / 2) * rng.standard_normal(found.gyr.shape)
    acc = found.acc + 0.0015 * np.sqrt(rate / 2) * rng.standard_normal(found.acc.shape)
    gyr += np.radians(gyr_bias_deg_s) * rng.standard_normal(3)
    return gyr, acc + acc_bias * rng.standard_normal(3)


def readings(found: Walked, gyr: np.ndarray, acc: np.ndarray) -> Readings:
    """As the estimator takes them.

    Args:
        found: When they were read.
        gyr: Shape (n, 3) [rad/s].
        acc: Shape (n, 3) [m/s^2].
    """
    interval = float(np.diff(found.time).mean())
    static = detect_static(gyr, interval)
    rests = intervals_of(static, round(REST_S / interval))
    bias = gyr[static].mean(axis=0) if static.any() else np.zeros(3)
    uniform = UniformSamples(interval, gyr, acc)
    return Readings(found.time, uniform, np.zeros(len(gyr), dtype=bool), rests, bias)


def swinging(cycles: int = 12, turn_deg: float = 90.0) -> tuple[np.ndarray, UniformSamples]:
    """A shank that swings, and turns half-way: pitch, and what a level sensor reads."""
    t = np.arange(-3.0, cycles + 2.0, 1 / SWING_HZ)
    during = (t >= 0) & (t < cycles)
    pitch = np.where(during, np.radians(20.0) * np.sin(2 * np.pi * t), 0.0)
    yaw = np.radians(turn_deg) / (1 + np.exp(-6 * (t - cycles / 2)))
    q = rotation.from_euler("ZYX", np.column_stack([yaw, pitch, 0 * t]))
    turns = rotation.multiply(rotation.conjugate(q[:-1]), q[1:])
    gyr = np.vstack([np.zeros((1, 3)), rotation.to_rotation_vector(turns) * SWING_HZ])
    acc = rotation.rotate(rotation.conjugate(q), np.tile([0, 0, 9.80665], (len(t), 1)))
    return pitch, UniformSamples(1 / SWING_HZ, gyr, acc, device_q=q)
