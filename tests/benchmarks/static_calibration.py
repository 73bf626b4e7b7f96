"""Calibrations a second, by every method of the registries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.methods import Method, methods_of
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.static_intervals import by_gyroscope, by_variance
from testbench.frames import STANDARD_GRAVITY
from tests.benchmarks.timing import Text, duration, rate, seconds, show

POSES, REPEATS = 24, 50
SAMPLES = 100_000


def bench_static_calibration() -> None:
    """Time each method on 24 poses, or on the six or four that it is made for, and the two ways to
    find rests by samples.
    """
    rows: list[list[str | Text]] = []
    for kind, methods, vector in (
        ("accelerometer", methods_of("accelerometer"), np.array([0.0, 0.0, STANDARD_GRAVITY])),
        ("magnetometer", methods_of("magnetometer"), np.array([3.0, 22.0, -40.0])),
    ):
        for method in methods.values():
            poses = _poses(method, vector)
            once = (
                seconds(
                    lambda method=method, poses=poses: [
                        method.function(poses) for _ in range(REPEATS)
                    ]
                )
                / REPEATS
            )
            rows.append(
                [Text(f"{kind} {method.name}"), str(len(poses)), rate(1 / once), duration(once)]
            )
    show("Calibrations", ["method", "poses", "calibrations", "each"], rows)
    rng = np.random.default_rng(1)
    resting = (np.arange(SAMPLES) // 300) % 2 == 0
    turns = np.repeat(Rotation.random(SAMPLES // 300 + 1, rng=rng).as_matrix()[:, 2], 300, axis=0)[
        :SAMPLES
    ]
    acc = (
        STANDARD_GRAVITY * turns
        + 0.01 * rng.standard_normal((SAMPLES, 3))
        + ~resting[:, None] * rng.standard_normal((SAMPLES, 3))
    )
    gyr = 0.001 * rng.standard_normal((SAMPLES, 3)) + ~resting[:, None]
    show(
        f"Static segmentation: {SAMPLES:,} samples",
        ["way", "samples"],
        [
            [Text("gyroscope"), rate(SAMPLES / seconds(lambda: by_gyroscope(gyr, 0.01)))],
            [
                Text("variance, ten thresholds each calibrated"),
                rate(SAMPLES / seconds(lambda: by_variance(acc, 0.01))),
            ],
        ],
    )


def _poses(method: Method, vector: np.ndarray) -> StaticPoses:
    rng = np.random.default_rng(0)
    world = Rotation.random(POSES, rng=rng).inv()
    expected, vertical = world.apply(vector), world.apply([0.0, 0.0, 1.0])
    length = float(np.linalg.norm(vector))
    if method.name in ("six_position", "ferraris"):
        expected = length * np.kron(np.eye(3), [[1.0], [-1.0]])
    elif method.name.startswith("rotational_2d"):
        expected = length * np.array([[0.0, 0, 1], [1, 0, 0], [-1, 0, 0], [0.6, 0, 0.8]])
    response = np.eye(3) + 0.01 * rng.standard_normal((3, 3))
    mean = expected @ response.T + 0.02 * length * rng.standard_normal(3)
    noisy = mean + 1e-4 * length * rng.standard_normal(mean.shape)
    poses = StaticPoses(noisy, np.full(mean.shape, (1e-4 * length) ** 2), length, expected)
    return replace(poses, vertical=vertical) if "vertical" in method.asks else poses
