"""Made-up motions that the tests of filters share."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from testbench.estimation.filters import UniformSamples
from testbench.model import rotation

UP = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([0.0, 24.0, -39.0])  # magnetic north along y: east, north, up


@cache
def wander(
    seconds: float = 20.0,
    rate: float = 100.0,
    noise: float = 1.0,
    bias: tuple[float, float, float] = (0, 0, 0),
    seed: int = 4,
    jitter: float = 0.0,
) -> tuple[UniformSamples, np.ndarray]:
    """A wandering turn without acceleration, and q_enu_from_sensor; jitter is that of the
    intervals, as a fraction.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    intervals = (1 + jitter * rng.uniform(-1, 1, n)) / rate
    t = np.cumsum(intervals)
    rates = np.column_stack(
        [0.8 * np.sin(0.9 * t), 0.6 * np.cos(0.7 * t), 0.5 * np.sin(1.3 * t + 1)]
    )
    q = [Rotation.from_euler("XYZ", [0.2, -0.3, 0.5])]
    for step in Rotation.from_rotvec(rates[1:] * intervals[1:, None]):
        q.append(q[-1] * step)
    true = Rotation.concatenate(q)
    gyr = rates + np.array(bias) + noise * 0.002 * rng.standard_normal((n, 3))
    acc = true.inv().apply(UP) + noise * 0.05 * rng.standard_normal((n, 3))
    mag = true.inv().apply(FIELD) + noise * 0.3 * rng.standard_normal((n, 3))
    samples = UniformSamples(1 / rate, gyr, acc, mag, None, intervals if jitter else None)
    return samples, true.as_quat(scalar_first=True)


def degrees_between(first: np.ndarray, second: np.ndarray) -> float:
    """Largest angle between two rows of quaternions."""
    return float(
        np.degrees(rotation.angle(rotation.multiply(first, rotation.conjugate(second))).max())
    )


def heading_deg(q: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Signed heading error of each sample."""
    return np.degrees(rotation.heading_angle(rotation.multiply(q, rotation.conjugate(true))))


def inclination_deg(q: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Inclination error of each sample."""
    return np.degrees(rotation.inclination_angle(rotation.multiply(q, rotation.conjugate(true))))
