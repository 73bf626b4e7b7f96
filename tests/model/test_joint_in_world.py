"""The joint's rotation in the world's axes: what it sees that the proximal segment's do not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.model.joint_angle import joint_angle_series, joint_angles
from testbench.records.specs.joint_definition import FlexionAngle

FLEXION = np.radians(np.arange(0.0, 71.0, 5.0))


def segments(heading_deg: float, misaligned_deg: float = 0.0, axis: str = "x"):
    """A proximal and a distal segment of an elbow that bends about an axis of a turned earth."""
    earth = Rotation.from_euler("z", heading_deg, degrees=True)
    arm = earth * Rotation.from_euler("z", misaligned_deg, degrees=True)
    forearm = earth * Rotation.from_euler(axis, FLEXION[:, None])
    q_arm = np.tile(arm.as_quat(scalar_first=True), (len(FLEXION), 1))
    return q_arm, forearm.as_quat(scalar_first=True)


def test_a_common_heading_turns_the_angles_in_the_world_and_not_those_in_the_segment():
    pair = segments(23.8)
    own = FlexionAngle(sequence="YXZ")
    np.testing.assert_allclose(joint_angles(*pair, own)[:, 1], FLEXION, atol=1e-12)
    in_world = FlexionAngle(sequence="YXZ", seen_from="world")
    seen = np.arcsin(np.sin(FLEXION) * np.cos(np.radians(23.8)))
    np.testing.assert_allclose(joint_angles(*pair, in_world)[:, 1], seen, atol=1e-12)
    np.testing.assert_allclose(joint_angle_series(*pair, in_world)[:, 1], seen, atol=1e-12)


@pytest.mark.parametrize(("sequence", "axis"), [("ZXZ", "x"), ("ZYZ", "y")])
def test_a_misalignment_is_in_the_first_angle_of_the_segment_and_in_the_third_of_the_world(
    sequence, axis
):
    moved = {}
    for seen_from in ("proximal", "world"):
        definition = FlexionAngle(sequence=sequence, seen_from=seen_from)
        here, there = (joint_angles(*segments(0.0, d, axis), definition)[5:] for d in (-20.0, 20.0))
        moved[seen_from] = np.degrees(np.abs(there - here)).max(axis=0)
    assert moved["proximal"] == pytest.approx([40, 0, 0], abs=1e-9)
    assert moved["world"] == pytest.approx([0, 0, 40], abs=1e-9)


def test_of_a_level_proximal_segment_both_are_one():
    pair = segments(0.0)
    both = [
        joint_angles(*pair, FlexionAngle(sequence="XYZ", seen_from=seen_from))
        for seen_from in ("proximal", "world")
    ]
    np.testing.assert_allclose(*both, atol=1e-15)


def test_its_rows_have_a_name_of_their_own():
    assert FlexionAngle(sequence="ZXZ", seen_from="world").label == "ZXZ_in_world"
    assert FlexionAngle(definition="elbow", seen_from="world").label == "isb_elbow_in_world"
    assert FlexionAngle(sequence="ZXZ").label == "ZXZ"
