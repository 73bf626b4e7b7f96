"""Flexions beyond what a definition reaches: refused before anything moves, or followed."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from testbench import plan
from testbench.evaluation.flexion import flexion_error
from testbench.exceptions import FileProblems
from testbench.model.joint_angle import joint_angle_series, joint_angles
from testbench.records.specs.joint_definition import FlexionAngle

PROTOCOL = """\
name: ranges
purpose: A hinge about z of both segments
robot: ur3e
sensors:
  arm:
    preset: ideal
    link: wrist_2_link
    segment: {name: upper, rotation_deg: {XYZ: [-90, 0, 0]}}
  hand:
    preset: ideal
    link: wrist_3_link
    segment: {name: lower, rotation_deg: {XYZ: [0, 0, 0]}}
joints:
  hinge: {proximal: arm, distal: hand, REFERENCE, DEFINITION}
variables:
  flexion_deg: FLEXIONS
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: [180, -90, -90, 0, 90, 0], dwell_s: 1}]
  - name: poses
    for_each: [flexion_deg]
    steps: [{move_to_deg: {wrist_3_joint: flexion_deg}, dwell_s: 0.5}]
estimate: {filters: [vqf_6d]}
"""
BY_ARM = "reference_joint: wrist_3_joint"
TAIT_BRYAN = "sequence: XZY, flexion: second"
SYMMETRIC = "sequence: XZX, flexion: second"


@pytest.fixture
def planned(tmp_path):
    """Plans with a definition and flexions."""

    def make(definition, flexions, reference=BY_ARM):
        text = PROTOCOL.replace("DEFINITION", definition).replace("REFERENCE", reference)
        file = tmp_path / "ranges.yaml"
        file.write_text(text.replace("FLEXIONS", str(flexions)))
        return plan(file)

    return make


@pytest.mark.parametrize(
    ("definition", "flexions", "said"),
    [
        (TAIT_BRYAN, [0, 60, 120], r"-90 to 90 deg only; in 1 of 3 .*wrist_3_joint 120 deg"),
        (TAIT_BRYAN, [0, 30, 92], r"in 1 of 3 .*wrist_3_joint 92 deg"),
        (TAIT_BRYAN + ", sign: 1", [-100, 0], r"wrist_3_joint -100 deg"),
        (SYMMETRIC, [-60, -30, 0, 30], r"no sign.*0 to 180 deg only; in 2 of 4 .*-60 to -30 deg"),
        ("sequence: YZY", [-5, 30], r"no sign.*in 1 of 2 .*-5 deg"),
        ("definition: axis_angle", [-60, 60], r"angle of axis_angle .* no sign.*in 1 of 2"),
        (
            "sequence: ZXY, flexion: first, compare: [{sequence: XZY}]",
            [0, 100],
            r"joints\.hinge\.compare\[0\]: the second angle of XZY",
        ),
    ],
)
def test_a_flexion_beyond_the_range_is_refused_with_a_definition_that_fits(
    planned, definition, flexions, said
):
    with pytest.raises(FileProblems, match=rf"ranges\.yaml:\d+:\d+: .*{said}") as refused:
        planned(definition, flexions)
    (problem,) = refused.value.problems
    assert problem.path.startswith("joints.hinge") and "`continuous: true`" in problem.message
    fitting = yaml.safe_load(re.search(r"fits: (\{.*?\});", problem.message)[1])
    own = ", ".join(f"{key}: {value}" for key, value in fitting.items())
    check = planned(own, flexions).check
    assert not [one for one in check.warnings if "joint 'hinge'" in one]
    (use,) = check.flexions
    assert (use.lowest_deg, use.highest_deg) == pytest.approx(
        (min(flexions), max(flexions)), abs=0.01
    )


@pytest.mark.parametrize(
    ("definition", "flexions"),
    [
        (TAIT_BRYAN, [-80, 0, 80]),
        (SYMMETRIC, [0, 60, 120]),
        ("definition: axis_angle", [5, 170]),
        ("sequence: ZXY, flexion: first", [-150, 150]),
        ("definition: {hinge: [0, 0, 1]}", [-150, 150]),
    ],
)
def test_a_flexion_within_the_range_is_planned(planned, definition, flexions):
    assert not [one for one in planned(definition, flexions).check.warnings if "hinge" in one]


def test_without_a_reference_joint_the_commanded_flexion_tells(planned):
    with pytest.raises(FileProblems, match=r"in 1 of 2 .*\(flexion_deg 120 deg\)"):
        planned(TAIT_BRYAN, [0, 120], "reference_joint: null")


@pytest.mark.parametrize("definition", [TAIT_BRYAN, SYMMETRIC, "definition: axis_angle"])
def test_a_continuous_definition_is_planned_over_the_whole_range(planned, definition):
    check = planned(definition + ", continuous: true", [-120, -60, 0, 60, 120]).check
    assert not [one for one in check.warnings if "hinge" in one]
    (use,) = check.flexions
    assert (use.lowest_deg, use.highest_deg) == pytest.approx((-120, 120), abs=0.01)


SEQUENCES = ["".join(s) for s in itertools.product("XYZ", repeat=3) if s[0] != s[1] != s[2]]
DEGREE = np.radians(1.0)


def turned(axis: str, angle: np.ndarray) -> np.ndarray:
    """Rotations about an axis, w first, shape (n, 4)."""
    xyzw = Rotation.from_euler(axis, angle[:, None]).as_quat()
    return xyzw[:, [3, 0, 1, 2]]


@pytest.mark.parametrize("sequence", [*SEQUENCES, "axis_angle"])
def test_a_filter_is_charged_with_its_own_error_beyond_the_range_too(sequence):
    """A hinge through -150 to 150 deg; the filter is off by one degree about it and half a degree
    across it, so it passes beside the singularities that the truth passes through.
    """
    axis = "Y" if sequence == "axis_angle" else sequence[1]
    true = np.radians(150) * np.sin(np.linspace(0, 4 * np.pi, 1201))
    still = np.tile([1.0, 0, 0, 0], (len(true), 1))
    about = "XYZ"[("XYZ".index(axis) + 1) % 3]
    tilt = Rotation.from_euler(about, 0.5, degrees=True)
    off = Rotation.from_euler(axis, (true + DEGREE)[:, None]) * tilt
    found = off.as_quat()[:, [3, 0, 1, 2]]
    kind = {"definition": sequence} if sequence == "axis_angle" else {"sequence": sequence}
    definition = FlexionAngle(**kind, continuous=True)
    angles = joint_angle_series(still, found, definition)
    own = joint_angle_series(still, turned(axis, true), definition)
    _, error = flexion_error(definition, angles, true, own)
    assert np.degrees(np.abs(error)).max() < 1.3
    plain = definition.model_copy(update={"continuous": False})
    _, folded = flexion_error(plain, joint_angles(still, found, plain), true, own)
    assert np.degrees(np.abs(folded)).max() > 100


def test_another_sign_than_the_true_one_is_still_the_filters(planned):
    """What a filter turns the wrong way is not taken for another branch."""
    true = np.radians(np.full(50, 40.0))
    still = np.tile([1.0, 0, 0, 0], (len(true), 1))
    definition = FlexionAngle(sequence="XZX", continuous=True)
    angles = joint_angles(still, turned("Z", -true), definition)
    _, error = flexion_error(
        definition, angles, true, joint_angles(still, turned("Z", true), "XZX")
    )
    np.testing.assert_allclose(np.degrees(error), -80, atol=1e-6)
