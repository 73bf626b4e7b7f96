"""What a truth that is known step by step may be off by, against finer ones; and sensitivities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.evaluation.foreign_truth import step_sd_deg
from testbench.evaluation.sensitivity import flexion_by_turning
from testbench.model.truth import truth_at
from testbench.records.session.samples import Truth
from testbench.records.specs.joint_definition import FlexionAngle


def moving(t: np.ndarray) -> Rotation:
    return Rotation.from_euler("Z", 60 * np.sin(2 * np.pi * t)[:, None], degrees=True)


def truth_of(t: np.ndarray) -> Truth:
    q = moving(t).as_quat(scalar_first=True)
    return Truth(np.round(1e9 * t).astype(np.int64), q)


@pytest.mark.parametrize("rate", [15.0, 50.0])
def test_the_time_step_of_a_truth_is_what_even_motion_between_frames_errs_by(rate):
    coarse, fine = truth_of(np.arange(0, 10, 1 / rate)), np.arange(0.5, 9, 1e-3)
    between = truth_at(coarse, np.round(1e9 * fine).astype(np.int64))
    off = moving(fine).inv() * Rotation.from_quat(between, scalar_first=True)
    errors = np.degrees(off.magnitude())
    assert step_sd_deg(coarse) == pytest.approx(np.sqrt(np.mean(errors**2)), rel=0.05)


def test_gaps_and_short_truths_say_nothing_of_the_step():
    t = np.concatenate([np.arange(0, 5, 0.02), np.arange(7, 12, 0.02)])
    assert step_sd_deg(truth_of(t)) == pytest.approx(
        step_sd_deg(truth_of(np.arange(0, 5, 0.02))), rel=0.05
    )
    assert step_sd_deg(truth_of(np.arange(2) / 50)) == 0


@pytest.mark.parametrize(
    ("second_deg", "which"), [(0.0, "first"), (60.0, "first"), (60.0, "second")]
)
def test_an_outer_angle_answers_the_more_the_nearer_it_is_to_gimbal_lock(second_deg, which):
    turned = Rotation.from_euler("ZXY", [20, second_deg, 10], degrees=True)
    q = np.array([[1.0, 0, 0, 0]]), turned.as_quat(scalar_first=True)[None]
    axes = np.eye(3)[None]
    found = flexion_by_turning(
        list(q), [np.zeros((1, 3, 3)), axes], FlexionAngle(sequence="ZXY", flexion=which)
    )
    wanted = 1.0 if which == "second" else 1 / np.cos(np.radians(second_deg))
    assert np.linalg.norm(found) == pytest.approx(wanted, rel=1e-4)
