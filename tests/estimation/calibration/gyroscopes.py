"""Gyroscopes with known errors on known motions; the truth comes from SciPy and from paper, not
from the code under test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.turns import GyroscopeRecording, Rest, Turn

GRAVITY = 9.80665


@dataclass(frozen=True)
class Gyroscope:
    """raw = response w + bias + g_response f + noise."""

    response: np.ndarray
    bias: np.ndarray
    g_response: np.ndarray
    noise: float = 0.0

    @staticmethod
    def draw(rng: np.random.Generator, noise: float = 0.0, g: float = 0.0) -> Gyroscope:
        return Gyroscope(
            np.eye(3) + 0.02 * rng.standard_normal((3, 3)),
            np.radians(3.0) * rng.standard_normal(3),
            np.radians(g) / GRAVITY * rng.standard_normal((3, 3)),
            noise,
        )

    def read(self, rate: np.ndarray, force: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        clean = rate @ self.response.T + self.bias + force @ self.g_response.T
        return clean + self.noise * rng.standard_normal(rate.shape)

    @property
    def matrix(self) -> np.ndarray:
        """What corrects it."""
        return np.linalg.inv(self.response)

    def tedaldi(self) -> dict[str, float]:
        """Scales and misalignments of T K, read off the matrix."""
        M = self.matrix
        scale = np.diag(M)
        T = M / scale
        return {
            **{f"gyr_scale_{axis}": scale[i] for i, axis in enumerate("xyz")},
            "gyr_misalignment_yz": -T[0, 1],
            "gyr_misalignment_zy": T[0, 2],
            "gyr_misalignment_xz": T[1, 0],
            "gyr_misalignment_zx": -T[1, 2],
            "gyr_misalignment_xy": -T[2, 0],
            "gyr_misalignment_yx": T[2, 1],
            **{f"gyr_bias_{axis}": self.bias[i] for i, axis in enumerate("xyz")},
            **{
                f"gyr_g_{a}{b}": self.g_response[i, j]
                for i, a in enumerate("xyz")
                for j, b in enumerate("xyz")
            },
        }


@dataclass(frozen=True)
class Motion:
    """A motion from rest to rest: times (n,) [s], rate in the body (n, 3) [rad/s],
    q_world_from_body (n, 4).
    """

    interval: float
    rate: np.ndarray
    q: np.ndarray

    @property
    def up(self) -> np.ndarray:
        """Direction of gravity's reaction in the body, shape (n, 3)."""
        return Rotation.from_quat(self.q, scalar_first=True).inv().apply([0.0, 0.0, 1.0])


def fixed_axis_motion(
    start: Rotation, axis: np.ndarray, angle: float, n: int, interval: float
) -> Motion:
    """A turn about one axis whose rate is a triangle over the samples, so that its angle is known
    on paper.
    """
    ramp = np.minimum(np.arange(n), np.arange(n)[::-1]).astype(float)
    steps = 0.5 * (ramp[1:] + ramp[:-1]) * interval
    rate = ramp * angle / steps.sum()
    turned = np.concatenate([[0.0], np.cumsum(steps)]) * angle / steps.sum()
    unit = axis / np.linalg.norm(axis)
    attitude = start * Rotation.from_rotvec(turned[:, None] * unit)
    return Motion(interval, rate[:, None] * unit, attitude.as_quat(scalar_first=True))


def wandering_motion(
    start: Rotation, rng: np.random.Generator, duration: float, interval: float, rate: float
) -> Motion:
    """Smooth rates about all axes at once; the orientation by SciPy's DOP853."""
    amplitude = rate * rng.standard_normal((3, 2))
    t = interval * np.arange(round(duration / interval) + 1)

    def rates(at: np.ndarray) -> np.ndarray:
        u = np.pi * np.asarray(at) / duration
        shapes = np.stack([np.sin(u) ** 2, np.sin(u) * np.sin(3 * u)], axis=-1)
        return shapes @ amplitude.T

    def derivative(at: float, q: np.ndarray) -> np.ndarray:
        x, y, z = rates(at)
        return 0.5 * np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]]) @ q

    solution = solve_ivp(
        derivative,
        (0, duration),
        start.as_quat(scalar_first=True),
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        t_eval=t,
    )
    return Motion(interval, rates(t), solution.y.T)


def record(
    gyroscope: Gyroscope,
    motions: list[Motion],
    rng: np.random.Generator,
    rest_s: float = 2.0,
    up_sd: float = 0.0,
    in_run: float = 0.0,
) -> GyroscopeRecording:
    """What a bench would hand to a calibration: rests between the motions, directions with their
    error, the arm's truth.
    """
    rests, turns = [], []
    directions = [motions[0].up[0], *(motion.up[-1] for motion in motions)]
    measured = [up + np.cross(up_sd * rng.standard_normal(3), up) for up in directions]
    drift = in_run * rng.standard_normal(3)
    for up in directions:
        n = round(rest_s / motions[0].interval)
        force = np.tile(GRAVITY * up, (n, 1))
        rests.append(Rest(gyroscope.read(np.zeros((n, 3)), force, rng) + drift, GRAVITY * up))
    for motion, before, after in zip(motions, measured[:-1], measured[1:], strict=True):
        force = GRAVITY * motion.up
        gyr = gyroscope.read(motion.rate, force, rng)
        turns.append(
            Turn(
                gyr,
                motion.interval,
                before / np.linalg.norm(before),
                after / np.linalg.norm(after),
                motion.q,
                motion.rate,
                force,
                up_sd=up_sd,
            )
        )
    return GyroscopeRecording(rests, turns)


def chain(
    kind: str, count: int, rng: np.random.Generator, interval: float = 0.01, duration: float = 4.0
) -> list[Motion]:
    """Motions that follow one another."""
    attitude = Rotation.random(rng=rng)
    motions = []
    for _ in range(count):
        if kind == "fixed_axis":
            motion = fixed_axis_motion(
                attitude,
                rng.standard_normal(3),
                rng.uniform(1.5, 4.0),
                round(duration / interval) + 1,
                interval,
            )
        else:
            motion = wandering_motion(attitude, rng, duration, interval, 0.8)
        motions.append(motion)
        attitude = Rotation.from_quat(motion.q[-1], scalar_first=True)
    return motions


def turns_between_rests(
    gyr: np.ndarray,
    interval: float,
    rests: Sequence[tuple[int, int]],
    acc: np.ndarray,
    up_sd: float = 0.0,
    margin: int = 0,
) -> GyroscopeRecording:
    """Cut a recording at its rests, with the direction of gravity by the accelerometer in each.

    Args:
        gyr: Raw, at a regular interval, shape (n, 3) [rad/s].
        interval: Between samples [s].
        rests: Begin and end (exclusive) of each rest, as rows of `gyr`, m of them.
        acc: Mean calibrated specific force in each rest, shape (m, 3) [m/s^2].
        up_sd: Standard uncertainty of the force's direction about each axis [rad].
        margin: Samples by which a turn reaches into the rests at its ends, at most half of each.

    """
    borders = np.array(rests, dtype=int).reshape(-1, 2)
    force = np.array([acc[begin:end].mean(axis=0) for begin, end in borders]).reshape(-1, 3)
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    reach = [min(margin, (end - begin) // 2) for begin, end in borders]
    turns = []
    for i in range(len(borders) - 1):
        begin, end = borders[i, 1] - 1 - reach[i], borders[i + 1, 0] + 1 + reach[i + 1]
        turns.append(
            Turn(gyr[begin:end], interval, up[i], up[i + 1], force=acc[begin:end], up_sd=up_sd)
        )
    return GyroscopeRecording(
        [Rest(gyr[b:e], f) for (b, e), f in zip(borders, force, strict=True)], turns
    )
