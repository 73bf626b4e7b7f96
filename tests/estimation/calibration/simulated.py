"""Triads with known errors in poses at rest. Rotations are SciPy's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.poses import StaticPoses
from testbench.records.results.fit import Fit

GRAVITY = 9.80665
UP = np.array([0.0, 0.0, GRAVITY])
FIELD = np.array([3.0, 22.0, -40.0])
"""Of the earth in mid latitudes, ENU [uT]."""
SIX = GRAVITY * np.kron(np.eye(3), [[1.0], [-1.0]])
SAMPLES = 200
LEVEL = 0.95


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def turned(vector: np.ndarray, count: int, seed: int = 7) -> np.ndarray:
    """A vector of the world in the axes of `count` poses of any orientation, shape (count, 3)."""
    return Rotation.random(count, rng=rng(seed)).inv().apply(vector)


def part(seed: int = 1, error: float = 0.01, bias: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Response and bias of one part."""
    draw = rng(seed)
    return np.eye(3) + error * draw.standard_normal((3, 3)), bias * draw.standard_normal(3)


def poses_of(
    expected: np.ndarray,
    response: np.ndarray,
    bias: np.ndarray,
    noise: float = 0.0,
    draw: np.random.Generator | None = None,
    direction_sd: float = 0.0,
    **known: object,
) -> StaticPoses:
    """Means as a part with these errors gives them, and their variances as 200 samples tell them.

    `noise` is the standard deviation of a mean. The true direction differs from the expected one by
    `direction_sd` about each axis across it.
    """
    true, m = expected, len(expected)
    variance = np.full((m, 3), max(noise, 1e-6) ** 2)
    added = np.zeros((m, 3))
    if draw is not None:
        true = Rotation.from_rotvec(direction_sd * draw.standard_normal((m, 3))).apply(expected)
        added = noise * draw.standard_normal((m, 3))
        variance = variance * draw.chisquare(SAMPLES - 1, (m, 3)) / (SAMPLES - 1)
    magnitude = float(np.linalg.norm(expected[0]))
    poses = StaticPoses(
        true @ response.T + bias + added, variance, magnitude, expected, direction_sd
    )
    return replace(poses, **known)


def truth_of(method: str, response: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """What a method's parameters are of a part with these errors, by linear algebra that the
    methods do not use.
    """
    A = np.linalg.inv(response)
    if method == "norm_only":
        upper = np.linalg.qr(A)[1]
        upper = upper * np.sign(np.diag(upper))[:, None]
        scale = np.diag(upper)
        return np.array(
            [
                -upper[0, 1] / scale[1],
                upper[0, 2] / scale[2],
                -upper[1, 2] / scale[2],
                *scale,
                *bias,
            ]
        )
    if method == "ellipsoid":
        _, s, vt = np.linalg.svd(A)
        root = vt.T @ np.diag(s) @ vt
        return np.array([*root[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]], *bias])
    if method == "six_position":
        return np.column_stack([bias, np.diag(response)]).reshape(-1)
    if method == "axis_model":
        return np.column_stack([response, bias]).reshape(-1)
    if method == "rotational_3d":
        return A.reshape(-1)
    if method == "rotational_3d_bias":
        return np.column_stack([A, -A @ bias]).reshape(-1)
    return np.concatenate([response.reshape(-1), bias])


def all_of(fits: tuple[Fit, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, standard uncertainties and half widths of all parameters."""
    return tuple(
        np.concatenate(part)
        for part in zip(*((f.values, f.sd, f.half_width(LEVEL)) for f in fits), strict=True)
    )
