"""A truth in another order or direction is told by which axes it turns about, walking, too."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.alignment.truth_reading import fit_rates, misread
from testbench.records.session.samples import ImuSamples, Truth

STEP = 0.01


@pytest.fixture(scope="module")
def walk() -> tuple[ImuSamples, np.ndarray, np.ndarray]:
    """A shank that swings by 35 deg about its hinge and by a few across it, going round a room."""
    t = np.arange(0, 60, STEP)
    angles = np.column_stack(
        [20 * np.sin(0.1 * t), 35 * np.sin(2 * np.pi * t), 2 * np.sin(4 * np.pi * t)]
    )
    q = Rotation.from_euler("ZYX", angles, degrees=True)
    gyr = (q[:-1].inv() * q[1:]).as_rotvec() / STEP
    stamps = np.round(1e9 * t[1:]).astype(np.int64)
    none = np.zeros(len(stamps), dtype=bool)
    rest = np.zeros_like(gyr)
    samples = ImuSamples(stamps, stamps, gyr, rest, None, None, np.arange(len(stamps)), none)
    return samples, stamps - round(0.5e9 * STEP), q[1:].as_quat(scalar_first=True)


@pytest.mark.parametrize(
    ("as_read", "named"),
    [(lambda q: np.roll(q, 1, axis=1), "order"), (lambda q: q * [1, -1, -1, -1], "direction")],
)
def test_a_walk_in_another_order_or_direction_is_named(walk, as_read, named):
    samples, times, q = walk
    truth = Truth(samples.device_time_ns, as_read(q))
    fit = fit_rates(samples, times, truth, 0.0)
    assert fit is not None and fit.explained < 0.95
    found = misread(samples, times, truth, fit)
    assert found is not None and named in found.code


def test_a_walk_read_right_is_not_doubted(walk):
    samples, times, q = walk
    truth = Truth(samples.device_time_ns, q)
    fit = fit_rates(samples, times, truth, 0.0)
    assert fit is not None and fit.explained > 0.99
    assert misread(samples, times, truth, fit) is None
