"""Axes that a protocol states of a joint are held against the arm before anything moves."""

from __future__ import annotations

import pytest

from testbench import plan
from testbench.exceptions import InputError

PROTOCOL = """\
name: constrained
purpose: A joint of two axes
robot: ur3e
sensors:
  arm: {preset: ideal, link: wrist_1_link, segment: {name: upper_arm}}
  forearm: {preset: ideal, link: wrist_3_link, segment: {name: forearm}}
joints:
  elbow: {proximal: arm, distal: forearm, sequence: ZXZ, constraint: CONSTRAINT}
sections:
  - name: moving
    steps:
      - {move_to_deg: [180, -90, -90, WRIST_1, 90, 0]}
      - sweep:
          wrist_2_joint: {sine: {amplitude_deg: 30, frequency_hz: 0.2, cycles: 2}}
          wrist_3_joint: {sine: {amplitude_deg: 50, frequency_hz: 0.3, cycles: 3}}
estimate: {filters: [vqf_6d, fusion], align: reference_pose}
"""
FITTING = "{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1], angle_deg: 90}"


@pytest.fixture
def written(tmp_path):
    def write(constraint=FITTING, wrist_1=-45):
        file = tmp_path / "constrained.yaml"
        file.write_text(PROTOCOL.replace("CONSTRAINT", constraint).replace("WRIST_1", str(wrist_1)))
        return file

    return write


def doubts(file):
    return [warning for warning in plan(file).check.warnings if "constraint" in warning]


def test_axes_of_the_arm_are_taken(written):
    assert doubts(written()) == []


@pytest.mark.parametrize(
    ("constraint", "said"),
    [
        (
            "{proximal_axis: [0, 1, 0], distal_axis: [1, 0, 0], angle_deg: 90}",
            "40 to 140 deg apart, not 90 deg",
        ),
        (
            "{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1], angle_deg: 60}",
            "90 deg apart, not 60 deg",
        ),
        ("{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1]}", "90 deg apart, not 0 deg"),
    ],
)
def test_axes_that_do_not_keep_their_angle_are_named(written, constraint, said):
    (warning,) = doubts(written(constraint))
    assert said in warning
    assert "joint 'elbow'" in warning


def test_an_axis_that_stays_vertical_is_named(written):
    (warning,) = doubts(written(wrist_1=0))
    assert "hardly tell a heading" in warning


@pytest.mark.parametrize(
    ("constraint", "said"),
    [
        ("{proximal_axis: [0, 0, 0], distal_axis: [0, 0, 1]}", "an axis needs a direction"),
        (
            "{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1], angle_deg: 10}",
            "allowed are 0 (a hinge",
        ),
        ("{proximal_axis: [0, 1, 0]}", "distal_axis"),
        (
            "{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1], filters: [mahony_imu]}",
            "'mahony_imu'",
        ),
        ("{proximal_axis: [0, 1, 0], distal_axis: [0, 0, 1], axes_sd_deg: 0}", "axes_sd_deg"),
    ],
)
def test_a_constraint_that_makes_no_sense_is_refused_with_its_line(written, constraint, said):
    with pytest.raises(InputError) as caught:
        plan(written(constraint))
    assert said in str(caught.value)
    assert "constrained.yaml:8" in str(caught.value)
