"""Plans: timed motion that keeps every limit, and refusals that say who, where, when and by how
much.
"""

import numpy as np
import pytest

from testbench import plan
from testbench.exceptions import (
    CollisionError,
    FileProblems,
    LimitError,
    NotFoundError,
    PlanError,
    SensorRangeError,
)
from testbench.model.collision import CollisionModel, NearestPair
from testbench.model.kinematics import Kinematics
from testbench.records.specs.robot import load_robot
from tests.planning.conftest import TOP

ROBOT = load_robot("ur3e")
MS = 1_000_000
POSES_3D = [
    (0, -90, -90, -90, 90, 180),
    (0, -90, -90, 90, 90, 180),
    (0, -90, -90, -90, 180, 180),
    (0, -90, -90, -90, 0, 180),
    (0, -90, -90, -180, 0, 180),
    (0, -90, -90, 0, 0, 180),
]
"""Castellanos Alonso 2023, table 3.3 [deg]."""
POSES_ELBOW = [
    (180 + d, -90, -90, 0, 90 - d, f) for d in range(-20, 21, 2) for f in range(0, 71, 5)
]
"""Castellanos Alonso 2023, table 3.7 [deg]."""


# Refusals


def arm_with(tool: str, robot: str = "ur3e") -> str:
    link = "link6" if robot == "xarm6" else "wrist_3_link"
    return TOP.replace("robot: ur3e", f"robot: {robot}\narm: {{tool: {tool}}}").replace(
        "wrist_3_link", link
    )


@pytest.mark.parametrize(
    ("robot", "payload"), [("ur3e", 3), ("ur5e", 5), ("ur10e", 12.5), ("xarm6", 5)]
)
def test_a_tool_heavier_than_the_arm_may_carry_is_refused_at_its_line(planned, robot, payload):
    planned("dwell_s: 1", top=arm_with(f"{{mass_kg: {payload}}}", robot))
    with pytest.raises(
        FileProblems,
        match=rf"trial\.yaml:4:.*arm\.tool\.mass_kg: .*heavier than the {payload} kg.*{robot}",
    ):
        planned("dwell_s: 1", top=arm_with(f"{{mass_kg: {payload + 0.1}}}", robot))


def test_a_centre_of_mass_that_is_no_tools_is_refused(planned):
    planned("dwell_s: 1", top=arm_with("{mass_kg: 1, centre_mm: [300, 0, 400]}"))
    with pytest.raises(
        FileProblems, match=r"arm\.tool\.centre_mm: .* 3500 mm from the flange; at most 500 mm"
    ):
        planned("dwell_s: 1", top=arm_with("{mass_kg: 1, centre_mm: [0, 0, 3500]}"))


def test_a_position_beyond_its_limit_is_refused(planned, tmp_path):
    with pytest.raises(LimitError) as caught:
        planned(
            "{name: away, move_to_deg: {shoulder_pan_joint: 30}}",
            "{name: too far, move_to_deg: {shoulder_pan_joint: -361}}",
        )
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == (
        "shoulder_pan_joint",
        "position",
        "too far",
        "deg",
    )
    assert error.limit == pytest.approx(-360)
    assert -361 <= error.value < -360
    assert error.onwards == pytest.approx(-361)
    assert error.time > 0
    assert str(error) == (  # with the digits that show the excess
        f"{tmp_path / 'trial.yaml'}:10: joint shoulder_pan_joint: position {error.value:.3f} deg "
        "exceeds -360.000 deg "
        f"at t = {error.time:.3f} s (step 'too far'), and goes on to -361.00 deg"
    )


@pytest.mark.parametrize(
    ("poses", "said"),
    [
        (["[3.1416, -1.5708, -1.5708, 0, 1.5708, 0.5]"], "3.1416 is 1.00 pi"),
        (["{wrist_3_joint: 2}", "{wrist_3_joint: -1.57}"], "-1.57 is -0.50 pi"),
        (["[0, -90, -90, 0, 0, 1.5708]"], None),
        (["{wrist_3_joint: -90}", "{wrist_3_joint: -1.57}"], None),
        (["{wrist_3_joint: 5, wrist_2_joint: 2.2}"], None),
        (["{wrist_3_joint: 0}"], None),
    ],
)
def test_angles_in_radians_are_noticed(planned, poses, said):
    the_plan = planned("{dwell_s: 0.1}", *(f"{{move_to_deg: {pose}}}" for pose in poses))
    warnings = [sentence for sentence in the_plan.check.warnings if "radians" in sentence]
    assert len(warnings) == (said is not None)
    assert said is None or said in warnings[0]


def test_a_protocol_without_a_reference_is_told_so_once(tmp_path):
    text = (
        TOP + "sections:\n  - {name: part, steps: [{name: turn, move_to_deg: {wrist_3_joint: 30}, "
        "dwell_s: DWELL}]}\n"
    )
    for dwell, where in (
        ("1", "in 'turn', of section part"),
        ("0.1", "nowhere, for nothing dwells"),
    ):
        file = tmp_path / "trial.yaml"
        file.write_text(text.replace("DWELL", dwell))
        [said] = [w for w in plan(file).check.warnings if w.startswith("align:")]
        assert "finds no section of the role reference" in said and where in said
        file.write_text(text.replace("DWELL", dwell) + "estimate: {align: none}\n")
        assert not [w for w in plan(file).check.warnings if w.startswith("align:")]


def test_the_evaluation_says_once_where_the_frames_were_aligned(run_protocol, tmp_path):
    file = tmp_path / "trial.yaml"
    file.write_text(
        TOP.replace("sensors: {", "sensors: {wrist: {preset: ideal, link: wrist_1_link}, ")
        + "sections:\n  - {name: part, steps: [{move_to_deg: {wrist_3_joint: 30}, dwell_s: 1}]}\n"
        + "estimate: {filters: [vqf_6d, fusion]}\n"
    )
    notes = run_protocol(file).evaluation.notes
    assert len([note for note in notes if "aligned" in note]) == 1


def test_a_velocity_beyond_its_limit_is_refused(planned, tmp_path):
    sweep = (
        "{wrist_3_joint: {sine: {amplitude_deg: 60, frequency_hz: 1, cycles: 2, ramp_cycles: 4}}}"
    )
    with pytest.raises(LimitError) as caught:
        planned(f"{{name: fast, sweep: {sweep}}}")
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == (
        "wrist_3_joint",
        "velocity",
        "fast",
        "deg/s",
    )
    assert abs(error.limit) == pytest.approx(360)
    assert 360 < abs(error.value) < 365
    assert error.onwards == pytest.approx(
        np.copysign(360 * 2 * np.pi / 6, error.value), rel=0.05
    )  # of the whole sine
    assert str(error).startswith(f"{tmp_path / 'trial.yaml'}:9: joint wrist_3_joint: velocity ")


def test_an_acceleration_beyond_its_limit_is_refused(planned, tmp_path):
    sweep = "{wrist_3_joint: {sine: {amplitude_deg: 5, frequency_hz: 2.5, cycles: 2}}}"
    with pytest.raises(LimitError) as caught:
        planned("{dwell_s: 1}", f"{{name: sharp, sweep: {sweep}}}")
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == (
        "wrist_3_joint",
        "acceleration",
        "sharp",
        "deg/s^2",
    )
    assert abs(error.value) > abs(error.limit) == pytest.approx(800)
    assert error.time > 1
    assert f"{tmp_path / 'trial.yaml'}:10: " in str(error)


def test_a_rate_beyond_the_scaled_limit_is_refused(planned):
    sweep = "sweep: {wrist_3_joint: {trapezoid: {amplitude_deg: 20, rate_deg_s: 200}}}"
    planned(f"{{{sweep}}}")
    with pytest.raises(
        PlanError,
        match=r"trial\.yaml:9: joint wrist_3_joint: a rate of 200\.00 deg/s exceeds 180\.00 deg/s",
    ):
        planned(f"{{{sweep}}}", motion="{speed: 0.5}")


@pytest.mark.parametrize("robot", ["ur3e", "ur3", "ur5e", "ur10e"])
def test_a_fold_of_the_forearm_into_the_arm_is_refused(planned, robot):
    with pytest.raises(CollisionError) as caught:
        planned(
            "{name: stretch, move_to_deg: [0, -90, 0, 0, 0, 0]}",
            "{name: fold, move_to_deg: [0, -90, 175, 0, 0, 0]}",
            robot=robot,
        )
    error = caught.value
    assert error.step == "fold"
    assert error.first == "upper_arm_link"
    assert error.second in {"wrist_1_link", "wrist_2_link", "wrist_3_link"}
    assert error.clearance <= error.margin
    assert f"trial.yaml:10: {error.first} and {error.second} co" in str(error)


@pytest.mark.parametrize("robot", ["ur3e", "ur5e", "ur10e"])
def test_an_arm_that_reaches_into_the_floor_is_refused(planned, robot):
    with pytest.raises(
        CollisionError,
        match=r"and the floor (collide|come within \d\.\d mm \(margin .* mm\)) at t = .* s \(step "
        r"'down'",
    ):
        planned(
            "{name: stretch, move_to_deg: [0, -45, 0, 0, 0, 0]}",
            "{name: down, move_to_deg: [0, 40, 0, 0, 0, 0]}",
            robot=robot,
        )


def test_the_first_contact_and_the_worst_are_both_named(planned, monkeypatch):
    seen = []

    def nearest(self, q):
        """Two bodies that touch first, and two others that overlap most, later; a known function of
        the elbow's angle.
        """
        elbow = float(np.degrees(q[2]))
        gap, other = 0.030 - 0.001 * elbow, 0.080 - 0.0015 * elbow
        pair = (
            NearestPair("hand", "foot", gap) if gap <= other else NearestPair("head", "wall", other)
        )
        seen.append(pair)
        return pair

    monkeypatch.setattr(CollisionModel, "nearest", nearest)
    with pytest.raises(CollisionError) as caught:
        planned(
            "{name: near, move_to_deg: [0, -90, 20, 0, 0, 0]}",
            "{name: deep, move_to_deg: [0, -90, 150, 0, 0, 0]}",
            "{name: away, move_to_deg: [0, -90, 0, 0, 0, 0]}",
        )
    error = caught.value
    first = next(pair for pair in seen if pair.distance <= error.margin)
    worst = min(seen, key=lambda pair: pair.distance)
    assert (error.first, error.second, error.clearance) == (
        first.first,
        first.second,
        first.distance,
    )
    assert (error.worst.first, error.worst.second, error.worst.clearance) == (
        worst.first,
        worst.second,
        worst.distance,
    )
    assert {first.first, worst.first} == {
        "hand",
        "head",
    } and error.worst.clearance == pytest.approx(-0.145)
    assert (
        error.step == "deep"
        and error.worst.step in {"deep", "away"}
        and error.time < error.worst.time
    )
    said = str(error)
    assert (
        f"hand and foot come within {1e3 * first.distance:.1f} mm (margin 5.0 mm) at t = "
        f"{error.time:.3f} s (step 'deep')" in said
    )
    assert (
        f"; at worst head and wall overlap by 145.0 mm, at t = {error.worst.time:.3f} s (step "
        f"'{error.worst.step}')" in said
    )


def test_a_path_that_collides_between_two_free_poses_is_refused(planned):
    ends = [(0, -45, 0, 0, 0, 0), (0, 225, 0, 0, 0, 0)]
    model = CollisionModel(Kinematics(ROBOT))
    assert all(model.nearest(np.radians(pose)).distance > 0.005 for pose in ends)
    with pytest.raises(CollisionError):
        planned(*[f"{{move_to_deg: {list(pose)}}}" for pose in ends])


@pytest.mark.parametrize(
    ("parameters", "quantity", "limit"),
    [
        ("gyroscope: {range_deg_s: 50}", "angular rate", 50),
        ("accelerometer: {range_g: 1}", "specific force", 9.80665),
    ],
)
def test_a_motion_that_would_saturate_a_sensor_is_refused(planned, parameters, quantity, limit):
    top = TOP.replace("preset: ideal", f"preset: ideal, parameters: {{{parameters}}}")
    with pytest.raises(SensorRangeError) as caught:
        planned("{name: turn, move_to_deg: {wrist_1_joint: 40, wrist_3_joint: 90}}", top=top)
    error = caught.value
    assert (error.sensor, error.quantity, error.step) == ("hand", quantity, "turn")
    assert error.value > error.limit == pytest.approx(limit)
    assert "trial.yaml:9: sensor hand: " in str(error)


def test_an_arm_without_the_links_of_the_protocol_is_refused(planned):
    with pytest.raises(
        Exception,
        match=r"trial\.yaml:4:.*sensors\.hand\.link: unknown .* 'wrist_3_link'; known: .*panda",
    ):
        planned("{dwell_s: 1}", robot="panda")


def test_an_unknown_robot_lists_those_that_exist(planned):
    with pytest.raises(NotFoundError, match=r"unknown robot 'ur4e'; known: .*ur3e"):
        planned("{dwell_s: 1}", robot="ur4e")


# What passes


@pytest.mark.parametrize("robot", ["ur3e", "ur3"])
@pytest.mark.parametrize("poses", [POSES_3D, POSES_ELBOW], ids=["calibration", "elbow"])
def test_the_published_poses_are_free(robot, poses):
    model = CollisionModel(Kinematics(load_robot(robot)))
    nearest = [model.nearest(np.radians(np.array(pose, float))) for pose in poses]
    assert min(found.distance for found in nearest) > 0


@pytest.mark.parametrize("robot", ["ur3e", "ur3"])
@pytest.mark.parametrize("protocol", ["calibration_3d", "elbow_flexion"])
def test_the_published_protocols_pass_with_the_path_between_the_poses(robot, protocol):
    check = plan(protocol, robot).check
    assert check.clearance.distance_mm > 0
    assert all(use.peak_speed_deg_s <= use.speed_limit_deg_s * (1 + 1e-6) for use in check.joints)
    assert all(
        use.peak_acceleration_deg_s2 <= use.acceleration_limit_deg_s2 * (1 + 1e-6)
        for use in check.joints
    )
    assert all(use.peak_rate_deg_s < use.range_deg_s for use in check.sensors)


def test_quick_lasts_under_half_a_minute():
    the_plan = plan("quick")
    assert 10 < the_plan.duration < 30
    assert the_plan.check.duration_s == the_plan.duration
    assert the_plan.check.steps == len(the_plan.steps) == 9


def test_the_steps_follow_one_another_without_a_gap():
    steps = plan("quick").steps
    assert steps[0].start_ns == 0
    assert [s.start_ns for s in steps[1:]] == [s.end_ns for s in steps[:-1]]
    assert all(s.start_ns <= s.settled_ns <= s.end_ns for s in steps)
    assert [s.kind for s in steps] == ["move", "hold"] + ["move"] * 6 + [
        "sweep"
    ]  # the first pose is the reference pose
    assert steps[1].variables == {"misalignment_deg": 0, "flexion_deg": 0}


def test_the_check_reports_what_the_trajectory_does(planned):
    the_plan = planned("{move_to_deg: {shoulder_pan_joint: 60, wrist_3_joint: -40}, dwell_s: 0.2}")
    q, v, a = the_plan.trajectory.at(np.arange(0, round(the_plan.duration * 1e9), MS))
    for i, use in enumerate(the_plan.check.joints):
        assert (use.lowest_deg, use.highest_deg) == pytest.approx(
            (np.degrees(q[:, i].min()), np.degrees(q[:, i].max())), abs=1e-3
        )
        assert use.peak_speed_deg_s == pytest.approx(
            np.degrees(np.abs(v[:, i]).max()), rel=1e-3, abs=1e-9
        )
        assert use.peak_acceleration_deg_s2 == pytest.approx(
            np.degrees(np.abs(a[:, i]).max()), rel=0.02, abs=1e-9
        )


# The hash


def test_the_same_inputs_give_the_same_plan():
    first, second = plan("quick"), plan("quick")
    assert first.hash == second.hash
    for name in ("time_ns", "q", "v", "a"):
        np.testing.assert_array_equal(
            getattr(first.trajectory, name), getattr(second.trajectory, name)
        )


def test_another_text_another_robot_or_another_included_file_gives_another_hash(tmp_path, planned):
    step = "{move_to_deg: {wrist_3_joint: 30}, dwell_s: 0.5}"
    hashes = [
        planned(step).hash,
        planned(step, top=TOP + "# a remark\n").hash,
        planned(step, robot="ur5e").hash,
    ]
    text = TOP + "sections: [{name: part, include: other.yaml}]\n"
    for remark in ("", "# a remark\n"):
        (tmp_path / "other.yaml").write_text(
            TOP + f"sections: [{{name: x, steps: [{step}]}}]\n{remark}"
        )
        (tmp_path / "whole.yaml").write_text(text)
        hashes.append(plan(tmp_path / "whole.yaml").hash)
    assert len(set(hashes)) == 5
    assert all(len(digest) == 64 for digest in hashes)
