"""Ranges of Euler angles across gimbal lock: by SciPy's rotations, with what the motion is known to
be.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.evaluation.euler_ranges import euler_range_rows
from testbench.records.session.samples import Truth

COUNT = 2001


def ranges(true: Rotation, error: Rotation, sequence: str):
    time = np.arange(COUNT, dtype=np.int64) * 10_000_000
    estimate = SimpleNamespace(
        host_time_ns=time,
        flagged=np.zeros(COUNT, bool),
        orientation={"device": (true * error).as_quat(scalar_first=True)},
    )
    steps = [SimpleNamespace(section="limit", kind="sweep", start_ns=time[0], end_ns=time[-1])]
    truth = Truth(time, true.as_quat(scalar_first=True), None, None)
    (row,) = euler_range_rows("s", estimate, truth, steps, {"limit": sequence})
    return row


def white(sd_deg: float) -> Rotation:
    return Rotation.from_rotvec(
        np.radians(sd_deg) * np.random.default_rng(0).standard_normal((COUNT, 3))
    )


def there_and_back(most_deg: float, times: int) -> np.ndarray:
    return np.radians(most_deg) * (0.5 - 0.5 * np.cos(2 * np.pi * times * np.linspace(0, 1, COUNT)))


@pytest.mark.parametrize(
    ("sequence", "axis", "most"), [("ZYX", 1, 120), ("XYZ", 1, 130), ("ZXZ", 0, -60)]
)
def test_each_passage_of_lock_turns_the_outer_angles_by_half_a_turn_and_back(sequence, axis, most):
    vectors = np.zeros((COUNT, 3))
    vectors[:, axis] = there_and_back(most, 3)
    if sequence == "ZXZ":  # through zero, where this sequence locks
        vectors[:, axis] += np.radians(30)
    row = ranges(Rotation.from_rotvec(vectors), white(0.05), sequence)
    assert 0 < row.locked_percent < 50
    assert (row.true_deg[0], row.true_deg[2]) == pytest.approx((180, 180), abs=1e-6)
    # 0.05 deg is 0.3 deg where lock is 10 deg away; the extremes of some thousand samples lie at 4
    # of those, to both sides
    assert (row.estimated_deg[0], row.estimated_deg[2]) == pytest.approx((180, 180), abs=2.4)


def test_a_passage_between_two_samples_is_one_too():
    pitch = np.where(np.arange(COUNT) // 20 % 2 == 0, 60.0, 120.0)
    row = ranges(Rotation.from_rotvec(np.radians(pitch)[:, None] * [0, 1, 0]), white(0.05), "ZYX")
    assert row.locked_percent == 0
    assert (row.true_deg[0], row.true_deg[2]) == pytest.approx((180, 180), abs=1e-6)
    assert (row.estimated_deg[0], row.estimated_deg[2]) == pytest.approx((180, 180), abs=1.2)


@pytest.mark.parametrize("turn_deg", [40.0, 300.0, 1000.0])
def test_away_from_lock_a_turn_counts_in_full(turn_deg):
    yaw = there_and_back(turn_deg, 1) + np.radians(170)
    row = ranges(
        Rotation.from_euler("ZYX", np.column_stack([yaw, 0 * yaw + 0.5, 0 * yaw])),
        white(0.0),
        "ZYX",
    )
    assert row.true_deg == pytest.approx([turn_deg, 0, 0], abs=1e-3)
    assert row.estimated_deg == pytest.approx([turn_deg, 0, 0], abs=1e-3)


def test_a_full_turn_beside_passages_of_lock_counts_in_full():
    time = np.linspace(0, 1, COUNT)
    yaw = np.radians(500) * np.clip(2 * time, 0, 1)
    pitch = np.radians(120) * np.sin(np.pi * np.clip(2 * time - 1, 0, 1))
    row = ranges(
        Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, 0 * yaw])), white(0.0), "ZYX"
    )
    assert row.true_deg[0] == pytest.approx(500, abs=1e-6)
    assert row.true_deg[2] == pytest.approx(180, abs=1e-6)
