"""A joint of the arm by every definition, from the protocol to the evaluation, through a sweep that
passes 180 degrees.
"""

from __future__ import annotations

import numpy as np
import pytest

from testbench import plan
from testbench.model import rotation
from testbench.model.joint_angle import decomposition_of
from testbench.records.specs.joint_definition import FlexionAngle

# Both sensors sit as the last wrist joint's axis lies (z of its link); their segments agree where
# that joint stands at zero.
PROTOCOL = """\
name: robot_joint
purpose: The last wrist joint as a joint of the body, swept through half a turn
robot: ur3e
sensors:
  before:
    preset: ideal
    link: wrist_2_link
    segment: {name: before, rotation_deg: {XYZ: [-90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [0, 0, 0]}, position_mm: [0, 0, 20]}
  after:
    preset: ideal
    link: wrist_3_link
    segment: {name: after}
    mounting: {rotation_deg: {XYZ: [0, 90, 0]}, position_mm: [0, 0, 10]}
joints:
  wrist:
    proximal: before
    distal: after
    definition: {hinge: [0, 0, 1]}
    reference_joint: wrist_3_joint
    compare:
      - {definition: elbow}
      - {definition: knee, sign: -1}
      - {definition: {isb: ankle, side: left}}
      - {sequence: ZXY, flexion: first}
      - {sequence: YXZ, flexion: third}
      - {sequence: XYZ, flexion: third}
      - {definition: {swing_twist: [0, 0, 1]}}
      - {definition: {hinge: [0, 0, -1]}, sign: -1}
      - {definition: rotation_vector, flexion: third, continuous: true}
      - {definition: axis_angle, continuous: true}
motion: {speed: 0.5, acceleration: 0.5, jerk: 0.5}
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: {wrist_3_joint: 30}, dwell_s: 2}]
  - name: beyond
    steps:
      - sweep: {wrist_3_joint: {trapezoid: {amplitude_deg: 250, rate_deg_s: 60}}}
        dwell_s: 0.5
  - name: held
    steps: [{move_to_deg: {wrist_3_joint: 200}, dwell_s: 1}]
estimate: {filters: [vqf_6d], align: reference_pose, calibrate: none}
"""
LABELS = [
    "hinge_z",
    "isb_elbow",
    "isb_knee",
    "isb_ankle_left",
    "ZXY",
    "YXZ",
    "XYZ",
    "swing_twist_z",
    "hinge_minus_z",
    "rotation_vector",
    "axis_angle",
]


@pytest.fixture(scope="module")
def result(tmp_path_factory, run_protocol):
    file = tmp_path_factory.mktemp("protocol") / "robot_joint.yaml"
    file.write_text(PROTOCOL)
    return run_protocol(file)


def test_every_definition_gives_the_angle_of_the_arms_joint(result):
    rows = {(row.sequence, row.section): row for row in result.evaluation.joint_angle}
    assert {label for label, _ in rows} == set(LABELS)
    for label in LABELS:
        for section in ("beyond", "held"):
            assert rows[label, section].flexion_max_abs_error_deg < 0.6, (label, section)


def test_sensors_without_noise_are_not_stuck_at_rest(result):
    assert all(sensor.quality["stuck"] == 0 for sensor in result.estimate.sensors.values())
    assert {row.section for row in result.evaluation.joint_angle if row.kind == "move"} == {"held"}


def test_the_flexion_is_one_curve_through_half_a_turn(result):
    series = result.evaluation.series["joint_wrist"]
    reference = np.degrees(series["reference_rad"])
    assert np.nanmax(reference) > 270  # the sweep ends at 280 deg
    for label in LABELS:
        flexion = np.degrees(series[f"vqf_6d_{label}_flexion_rad"])
        known = np.isfinite(flexion) & np.isfinite(reference)
        np.testing.assert_allclose(flexion[known], reference[known], atol=0.6)
        assert (
            np.abs(np.diff(flexion[known])).max() < 3
        )  # 60 deg/s at 100 Hz, and what a filter adds
    raw = np.degrees(result.estimate.joints["wrist"].angles["vqf_6d", "hinge_z"][:, 0])
    assert np.abs(np.diff(raw)).max() > 300  # which the principal angle is not


def test_a_hinge_says_how_far_the_joint_is_from_being_one(result):
    tilt = np.degrees(result.estimate.joints["wrist"].angles["vqf_6d", "hinge_z"][:, 1])
    assert np.median(tilt) < 0.3
    others = next(
        row for row in result.evaluation.joint_angle if row.sequence == "hinge_z"
    ).other_mean_abs_error_deg
    assert others[0] < 0.3  # the tilt is judged, though it is about none
    assert others[1] is None  # its direction is not


def test_a_flexion_that_is_lost_in_gimbal_lock_is_announced_before_anything_moves(tmp_path):
    text = PROTOCOL.replace(
        "definition: {hinge: [0, 0, 1]}",
        "definition: {euler: ZXZ}, flexion: first".replace(", ", "\n    "),
    )
    file = tmp_path / "robot_joint.yaml"
    file.write_text(text)
    warnings = plan(file).check.warnings
    assert [
        w
        for w in warnings
        if "the first angle of ZXZ is its flexion" in w and "0.0 deg from where" in w
    ]
    assert not [w for w in warnings if "isb_elbow" in w]


def test_an_axis_that_is_wrong_reads_as_the_page_says():
    flexion, off = np.radians([10.0, 70.0, 120.0]), np.radians(20)
    axis = np.array([np.sin(off), 0, np.cos(off)])
    q = rotation.from_rotation_vector(flexion[:, None] * axis)
    read = decomposition_of(FlexionAngle(definition={"hinge": [0.0, 0.0, 1.0]})).angles(q)[:, 0]
    np.testing.assert_allclose(read, 2 * np.arctan(np.tan(flexion / 2) * np.cos(off)), atol=1e-12)
