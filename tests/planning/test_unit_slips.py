"""Numbers in another unit than the key says are doubted, and the ranges of the joints' true angles
show them.
"""

from pathlib import Path

import pytest
import yaml

from testbench import plan
from testbench.exceptions import Excess, LimitError, PlanError

QUICK = Path(__file__).parents[2] / "protocols/quick.yaml"


@pytest.fixture
def changed(tmp_path):
    """Plans the protocol `quick` with some of its keys changed."""

    def make(change):
        data = yaml.safe_load(QUICK.read_text())
        change(data)
        file = tmp_path / "slip.yaml"
        file.write_text(yaml.safe_dump(data, sort_keys=False))
        return plan(file)

    return make


def slips(the_plan) -> list[str]:
    return [warning for warning in the_plan.check.warnings if "looks like" in warning]


def test_no_protocol_that_ships_is_doubted():
    assert slips(plan("quick")) == slips(plan("squat")) == slips(plan("calibration_3d")) == []


def test_a_variable_in_radians_is_doubted_while_the_poses_are_in_degrees(changed):
    the_plan = changed(
        lambda data: data["variables"].update(
            flexion_deg={"start": 0, "stop": 1.5708, "step": 0.2618}
        )
    )
    assert slips(the_plan) == [
        (
            "variable 'flexion_deg' looks like radians (1.5708 is 0.50 pi, and it goes no "
            "further); it "
            "is taken in degrees"
        )
    ]
    poses = next(use for use in the_plan.check.flexions if use.kind == "poses")
    assert poses.highest_deg == pytest.approx(1.5708, abs=1e-6) and poses.commanded == (
        0,
        pytest.approx(1.5708),
    )


def test_a_small_variable_that_is_no_part_of_pi_is_believed(changed):
    assert (
        slips(
            changed(
                lambda data: data["variables"].update(
                    flexion_deg={"start": 0, "stop": 2, "step": 0.5}
                )
            )
        )
        == []
    )


@pytest.mark.parametrize(
    ("pose", "doubted"),
    [
        ([3.1402, -1.5688, -1.5713, 0.0021, 1.5699, 0.4998], True),
        ([2.0412, -0.9713, -1.2207, 0.3312, 1.1699, 0.4998], True),
        ([2, -0.95, -1.25, 0.3, 1.1, 0.5], False),
        ([2.0412, -60.9713, -1.2207, 0.3312, 1.1699, 0.4998], False),
        ([0.0412, -0.0713, -0.2207, 0.3312, 0.1699, 0.4998], False),
    ],
)
def test_a_pose_as_an_arm_reports_it_is_doubted(tmp_path, pose, doubted):
    file = tmp_path / "measured.yaml"
    file.write_text(
        "name: t\npurpose: A pose pasted from a log\nrobot: ur3e\nsensors: {imu: {preset: ideal, "
        "link: wrist_3_link}}\nestimate: {filters: [vqf_6d]}\nsections:\n  - name: a\n    steps:\n"
        f"      - {{move_to_deg: {pose}, dwell_s: 1}}\n"
        "      - {move_to_deg: [180, -90, -90, 0, 90, 0], dwell_s: 1}\n"
    )
    try:
        said = slips(plan(file))
    except PlanError as error:  # an arm that is stretched along a wrong pose may hit itself
        said = [one for one in error.doubts if "looks like" in one]
    assert [("as an arm reports them" in one, True) for one in said] == [(True, True)] * doubted


def test_one_pose_in_radians_among_others_in_degrees_is_doubted(changed):
    def change(data):
        poses = [{"move_to_deg": [0, -1.5708, 0, -1.5708, 1.5708, 0], "dwell_s": 1}]
        data["sections"].insert(0, {"name": "slipped", "steps": poses})

    try:
        said = "; ".join(slips(changed(change)))
    # an arm bent like that may touch itself: the refusal says what was probably meant
    except PlanError as refused:
        said = str(refused)
    assert (
        "move_to_deg of step 'slipped' looks like radians (-1.5708 is -0.50 pi, and so are all its "
        "angles but 0)" in said
    )


def test_a_mounting_in_metres_is_doubted_and_one_at_the_origin_is_not(changed):
    def place(position):
        return lambda data: data["sensors"]["arm"]["mounting"].update(position_mm=position)

    assert slips(changed(place([-0.1, 0, 0.06]))) == [
        (
            "sensor 'arm': position_mm [-0.1, 0, 0.06] looks like metres, for all of it is below 1 "
            "mm; "
            "did you mean [-100, 0, 60]?"
        )
    ]
    assert slips(changed(place([0, 0, 0]))) == slips(changed(place([0.5, 1.0, 0]))) == []


def test_the_ranges_of_the_true_angles_stand_beside_what_is_commanded():
    check = plan("quick").check
    poses = next(use for use in check.flexions if (use.definition, use.kind) == ("ZXZ", "poses"))
    assert poses.sentence == (
        "elbow: ZXZ 0.0 to 60.0 deg in the evaluated poses, wrist_3_joint 0.0 to 60.0, commanded "
        "(flexion_deg) 0 to 60"
    )
    sweep = next(use for use in check.flexions if (use.definition, use.kind) == ("ZXZ", "sweeps"))
    assert sweep.highest_deg - sweep.lowest_deg == pytest.approx(40, abs=0.5)  # a sine of 20 deg
    assert check.to_dict()["flexions"][0]["joint"] == "elbow"


def test_a_limit_that_is_hardly_exceeded_is_shown_with_the_digits_that_say_so():
    error = LimitError(Excess("elbow", "position", 360.0004, 360.0, "deg", 1.0, "far", 375.0))
    assert str(error).startswith(
        "joint elbow: position 360.0004 deg exceeds 360.0000 deg at t = 1.000 s"
    )
    assert "goes on to 375.00 deg" in str(error)
    assert "position 400.00 deg exceeds 360.00 deg" in str(
        LimitError(Excess("elbow", "position", 400, 360, "deg", 1, "far", 400))
    )
