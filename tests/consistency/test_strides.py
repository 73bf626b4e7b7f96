"""A foot that walks: at rest on the ground, and turned by a right angle and more in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.consistency.excerpt import thin
from testbench.consistency.strides import find_strides
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.finding import Finding, Severity
from testbench.records.session.samples import ImuSamples
from tests.benchmarks.recordings import check_samples, of_arrays
from tests.consistency.test_two_segments import recorded
from tests.system import two_segments

RATE, STRIDE_S, STANCE_S, STRIDES = 100.0, 1.2, 0.4, 24


def _bump(phase: np.ndarray, begin: float, end: float) -> np.ndarray:
    inside = np.clip((phase - begin) / (end - begin), 0, 1)
    return np.sin(np.pi * inside) ** 2


@pytest.fixture(scope="module")
def foot() -> ImuSamples:
    """Strides with a swing of -65 and +25 deg, rolling and toeing a little, no two alike."""
    rng = np.random.default_rng(11)
    fine = 4
    t = np.arange(round(STRIDES * STRIDE_S * RATE) * fine) / (RATE * fine)
    number = (t // STRIDE_S).astype(int)
    phase = (t % STRIDE_S - STANCE_S) / (STRIDE_S - STANCE_S)
    size = rng.uniform(0.85, 1.15, (STRIDES, 4))[number]
    pitch = -65 * size[:, 0] * _bump(phase, 0, 0.6) + 25 * size[:, 1] * _bump(phase, 0.5, 1)
    roll, yaw = 12 * size[:, 2] * _bump(phase, 0, 0.7), 9 * size[:, 3] * _bump(phase, 0.2, 1)
    pose = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]), degrees=True)
    smooth = np.clip(phase, 0, 1)
    ahead = 1.3 * (number + 10 * smooth**3 - 15 * smooth**4 + 6 * smooth**5)
    place = np.column_stack([ahead, 0 * ahead, 0.12 * _bump(phase, 0, 1)])
    dt = t[1] - t[0]
    force = np.gradient(np.gradient(place, dt, axis=0), dt, axis=0) + [0, 0, STANDARD_GRAVITY]
    step = (pose[:-1].inv() * pose[1:]).as_rotvec() / dt
    gyr = np.vstack([step, step[-1:]]).reshape(-1, fine, 3).mean(axis=1)
    acc = pose.inv().apply(force).reshape(-1, fine, 3).mean(axis=1)
    gyr += [0.01, -0.02, 0.01] + rng.normal(0, 0.005, gyr.shape)
    return of_arrays(RATE, gyr, acc + rng.normal(0, 0.05, acc.shape))


def _warned(samples: ImuSamples) -> dict[str, Finding]:
    return {
        one.code.removeprefix("consistency."): one
        for one in check_samples([samples])
        if one.severity is Severity.WARNING
    }


def test_every_stride_is_a_window_and_a_right_foot_raises_no_warning(foot: ImuSamples) -> None:
    excerpt = thin([foot])
    assert excerpt is not None
    windows = find_strides(excerpt, 1 / RATE)
    assert STRIDES - 3 <= len(windows) <= STRIDES
    assert _warned(foot) == {}


def test_a_mirrored_axis_and_a_wrong_scale_of_a_foot_are_named(foot: ImuSamples) -> None:
    mirrored = _warned(replace(foot, gyr=foot.gyr * [1, -1, 1]))
    assert mirrored["gyr_mirrored"].values["axes"] == ["x: +x, y: -y, z: +z"]
    assert "scale_or_rate" in _warned(replace(foot, gyr=2 * foot.gyr))


def test_turning_points_of_a_pendulum_are_no_stances() -> None:
    excerpt = thin([recorded(two_segments.pendulum(1), "upper", 1)])
    assert excerpt is not None
    assert len(find_strides(excerpt, 0.02)) <= 4
