"""Joint definitions that do not fit the motion are found before anything moves, and the warning
stays with the session.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench import plan
from testbench.planning.segment_frames import _differs, _Read
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.reporting.report import report

# The last wrist joint as an elbow; in these segment frames its axis is y of the upper arm, against
# the flexion.
PROTOCOL = """\
name: fitting
purpose: An elbow in steps
robot: ur3e
sensors:
  arm:
    preset: xsens_dot
    link: wrist_1_link
    segment: {name: upper_arm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 0, 0]}, position_mm: [0, 45, 0]}
  forearm:
    preset: xsens_dot
    link: wrist_3_link
    segment: {name: forearm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
joints:
  elbow: JOINT
variables:
  flexion_deg: FLEXIONS
sections:
  - name: reference
    role: reference
    steps: [{move_to_deg: [180, -90, -90, 0, 90, 0], dwell_s: 2}]
  - name: judged
    SECTION
estimate: {filters: [vqf_6d], align: reference_pose, calibrate: none}
"""
POSES = (
    "{for_each: [flexion_deg], steps: [{move_to_deg: [180, -90, -90, 0, 90, flexion_deg], "
    "dwell_s: 1}]}"
)
SWEEP = (
    "{steps: [{sweep: {wrist_3_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: "
    "2}}}, dwell_s: 1}]}"
)
FITTING = "sequence: ZXZ, reference_joint: wrist_3_joint"


@pytest.fixture
def written(tmp_path):
    """Writes the protocol with a joint definition, its flexions and the section that is judged."""

    def write(
        joint, flexions="[0, 30, 60]", section=POSES, sensors="proximal: arm, distal: forearm"
    ):
        file = tmp_path / "fitting.yaml"
        text = PROTOCOL.replace("JOINT", f"{{{sensors}, {joint}}}").replace("FLEXIONS", flexions)
        file.write_text(
            text.replace(
                "    SECTION", "    " + section.strip("{}").replace(", steps:", "\n    steps:")
            )
        )
        return file

    return write


@pytest.fixture
def warned(written):
    """Sentences about the joint."""
    return lambda *args, **more: [
        w for w in plan(written(*args, **more)).check.warnings if w.startswith("joint 'elbow'")
    ]


@pytest.mark.parametrize("joint", [FITTING, "sequence: ZXZ", "sequence: YXZ, sign: -1"])
@pytest.mark.parametrize("section", [POSES, SWEEP])
def test_definitions_that_fit_are_passed_in_silence(warned, joint, section):
    if section == SWEEP and "ZXZ" in joint:
        joint += ", continuous: true"  # the angle between two axes has no sign of its own
    assert warned(joint, section=section) == []


def test_a_definition_that_others_are_compared_with_is_looked_at_too(warned):
    [only] = warned(
        f"{FITTING}, compare: [{{definition: {{isb: knee}}}}, {{sequence: YXZ, sign: -1}}]"
    )
    assert (
        "isb_knee" in only
        and "does not follow it: over 60.0 deg of that it changes by 0.0 deg" in only
    )
    assert "give it `flexion: third`" in only
    [mine] = warned(
        "sequence: ZXZ, compare: [{definition: {isb: knee}}]"
    )  # without an arm's joint, against its own
    assert "isb_knee" in mine and "the true one, ZXZ," in mine


def test_a_motion_that_is_not_the_flexion_is_noticed_without_a_reference_joint(warned):
    [only] = warned("definition: {isb: elbow}")
    assert (
        "true flexion, isb_elbow of the segments, differs from flexion_deg" in only
        and "changes by 0.0 deg" in only
    )
    other = warned("sequence: ZXZ, reference_joint: elbow_joint")
    assert (
        "true flexion, elbow_joint, differs from flexion_deg" in other[0]
        and "flexion_variable" in other[0]
    )


@pytest.mark.parametrize("flexions", ["[0, 30, 60]", "[0, 2, 4]"])
@pytest.mark.parametrize("reference", [", reference_joint: wrist_3_joint", ""])
def test_a_wrong_sign_is_called_one_however_small_the_angles(warned, flexions, reference):
    [only] = warned("sequence: YXZ" + reference, flexions)
    assert (
        "runs against it" in only
        and "give it `sign: -1`" in only
        and "proximal and distal are swapped" in only
    )
    # the inverse of a YXZ rotation is a ZXY one of the opposite angles
    swapped = "proximal: forearm, distal: arm"
    assert warned("sequence: ZXY" + reference, flexions, sensors=swapped) == []
    assert len(warned("sequence: YXZ, sign: -1" + reference, flexions, sensors=swapped)) == 1


def test_a_wrong_sign_is_found_in_a_sweep(warned):
    [only] = warned("sequence: YXZ, reference_joint: wrist_3_joint", section=SWEEP)
    assert "runs against it" in only


def test_the_warning_stays_with_the_session_and_its_report(written, run_protocol):
    result = run_protocol(written("definition: {isb: elbow}", "[0, 30]"))
    [note] = [note for note in result.evaluation.notes if note.startswith("joint 'elbow'")]
    assert "does not follow" in note
    page = report(result.session, result.estimate, result.evaluation).read_text()
    assert (
        page.count("does not follow it: over 30.0 deg of that it changes by") == 2
    )  # with the verdict, and with the joint


@given(
    st.lists(st.floats(-80, 80), min_size=3, max_size=20), st.sampled_from(["XYZ", "YXZ", "ZXY"])
)
def test_one_turn_of_one_axis_fits_one_angle_with_one_sign(flexions, sequence):
    angles = np.zeros((len(flexions), 3))
    angles[:, sequence.index("X")] = np.radians(flexions)
    read = Rotation.from_euler(sequence, angles).as_euler(sequence)  # ours share no code with it
    names = ["first", "second", "third"]
    right = FlexionAngle(sequence=sequence, flexion=names[sequence.index("X")])
    true = np.radians(flexions)
    assert _Read(right, read).differs("it", true, "true", "") == []
    if np.ptp(true) > np.radians(1.1):
        wrong = right.model_copy(update={"sign": -1})
        [said] = _Read(wrong, read).differs("it", true, "true", "")
        assert "runs against it" in said and "`sign: 1`" in said
        other = right.model_copy(update={"flexion": names[sequence.index("Z")]})
        [said] = _Read(other, read).differs("it", true, "true", "")
        assert f"`flexion: {right.flexion}`" in said


def test_a_whole_turn_is_no_difference():
    true = np.radians([170.0, 175, 185, 190])
    read = np.radians([170.0, 175, -175, -170])
    assert _differs("it", read, true, "true", "", []) == []
