"""Plans: timed motion that keeps every limit, and refusals that say who, where, when and by how much."""

import numpy as np
import pytest
import ruckig

from testbench import plan
from testbench.exceptions import CollisionError, LimitError, NotFoundError, PlanError, SensorRangeError
from testbench.model.collision import CollisionModel, NearestPair
from testbench.model.kinematics import Kinematics
from testbench.planning.expansion import FourierCommand, SineCommand
from testbench.planning.motion import MotionBuilder, faded_series, faded_sine
from testbench.records.protocol_steps import Motion
from testbench.records.robot import load_robot

ROBOT = load_robot("ur3e")
MS = 1_000_000
POSES_3D = [
    (0, -90, -90, -90, 90, 180), (0, -90, -90, 90, 90, 180), (0, -90, -90, -90, 180, 180),
    (0, -90, -90, -90, 0, 180), (0, -90, -90, -180, 0, 180), (0, -90, -90, 0, 0, 180),
]  # fmt: skip
"""Castellanos Alonso 2023, table 3.3 [deg]."""
POSES_ELBOW = [(180 + d, -90, -90, 0, 90 - d, f) for d in range(-20, 21, 2) for f in range(0, 71, 5)]
"""Castellanos Alonso 2023, table 3.7 [deg]."""
TOP = """\
name: trial
purpose: For a test
robot: ur3e
sensors: {hand: {preset: ideal, link: wrist_3_link, mounting: {position_mm: [0, 0, 10]}}}
"""


@pytest.fixture
def planned(tmp_path):
    """Plans a protocol of the given steps (YAML, one a line)."""

    def make(*steps, motion="{speed: 1, acceleration: 1, jerk: 1}", robot=None, top=TOP):
        lines = "".join(f"      - {step}\n" for step in steps)
        file = tmp_path / "trial.yaml"
        file.write_text(f"{top}motion: {motion}\nsections:\n  - name: part\n    steps:\n{lines}")
        return plan(file, robot)

    return make


def state(trajectory, times_s):
    return trajectory.at(np.round(np.asarray(times_s) * 1e9).astype(np.int64))


# Refusals


def test_a_position_beyond_its_limit_is_refused(planned, tmp_path):
    with pytest.raises(LimitError) as caught:
        planned(
            "{name: away, move_to_deg: {shoulder_pan_joint: 30}}", "{name: too far, move_to_deg: {shoulder_pan_joint: -361}}"
        )
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == ("shoulder_pan_joint", "position", "too far", "deg")
    assert error.limit == pytest.approx(-360)
    assert -361 <= error.value < -360
    assert error.onwards == pytest.approx(-361)
    assert error.time > 0
    assert str(error) == (  # with the digits that show the excess
        f"{tmp_path / 'trial.yaml'}:10: joint shoulder_pan_joint: position {error.value:.3f} deg exceeds -360.000 deg "
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
    text = TOP + "sections:\n  - {name: part, steps: [{name: turn, move_to_deg: {wrist_3_joint: 30}, dwell_s: DWELL}]}\n"
    for dwell, where in (("1", "in 'turn', of section part"), ("0.1", "nowhere, for nothing dwells")):
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
    sweep = "{wrist_3_joint: {sine: {amplitude_deg: 60, frequency_hz: 1, cycles: 2, ramp_cycles: 4}}}"
    with pytest.raises(LimitError) as caught:
        planned(f"{{name: fast, sweep: {sweep}}}")
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == ("wrist_3_joint", "velocity", "fast", "deg/s")
    assert abs(error.limit) == pytest.approx(360)
    assert 360 < abs(error.value) < 365
    assert error.onwards == pytest.approx(np.copysign(360 * 2 * np.pi / 6, error.value), rel=0.05)  # of the whole sine
    assert str(error).startswith(f"{tmp_path / 'trial.yaml'}:9: joint wrist_3_joint: velocity ")


def test_an_acceleration_beyond_its_limit_is_refused(planned, tmp_path):
    sweep = "{wrist_3_joint: {sine: {amplitude_deg: 5, frequency_hz: 2.5, cycles: 2}}}"
    with pytest.raises(LimitError) as caught:
        planned("{dwell_s: 1}", f"{{name: sharp, sweep: {sweep}}}")
    error = caught.value
    assert (error.joint, error.quantity, error.step, error.unit) == ("wrist_3_joint", "acceleration", "sharp", "deg/s^2")
    assert abs(error.value) > abs(error.limit) == pytest.approx(800)
    assert error.time > 1
    assert f"{tmp_path / 'trial.yaml'}:10: " in str(error)


def test_a_rate_beyond_the_scaled_limit_is_refused(planned):
    sweep = "sweep: {wrist_3_joint: {trapezoid: {amplitude_deg: 20, rate_deg_s: 200}}}"
    planned(f"{{{sweep}}}")
    with pytest.raises(PlanError, match=r"trial\.yaml:9: joint wrist_3_joint: a rate of 200\.00 deg/s exceeds 180\.00 deg/s"):
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
        CollisionError, match=r"and the floor (collide|come within \d\.\d mm \(margin .* mm\)) at t = .* s \(step 'down'"
    ):
        planned(
            "{name: stretch, move_to_deg: [0, -45, 0, 0, 0, 0]}", "{name: down, move_to_deg: [0, 40, 0, 0, 0, 0]}", robot=robot
        )


def test_the_first_contact_and_the_worst_are_both_named(planned, monkeypatch):
    seen = []

    def nearest(self, q):
        """Two bodies that touch first, and two others that overlap most, later; a known function of the elbow's angle."""
        elbow = float(np.degrees(q[2]))
        gap, other = 0.030 - 0.001 * elbow, 0.080 - 0.0015 * elbow
        pair = NearestPair("hand", "foot", gap) if gap <= other else NearestPair("head", "wall", other)
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
    assert (error.first, error.second, error.clearance) == (first.first, first.second, first.distance)
    assert (error.worst.first, error.worst.second, error.worst.clearance) == (worst.first, worst.second, worst.distance)
    assert {first.first, worst.first} == {"hand", "head"} and error.worst.clearance == pytest.approx(-0.145)
    assert error.step == "deep" and error.worst.step in {"deep", "away"} and error.time < error.worst.time
    said = str(error)
    assert (
        f"hand and foot come within {1e3 * first.distance:.1f} mm (margin 5.0 mm) at t = {error.time:.3f} s (step 'deep')"
        in said
    )
    assert f"; at worst head and wall overlap by 145.0 mm, at t = {error.worst.time:.3f} s (step '{error.worst.step}')" in said


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
    with pytest.raises(Exception, match=r"trial\.yaml:4:.*sensors\.hand\.link: unknown .* 'wrist_3_link'; known: .*panda"):
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
    assert all(use.peak_acceleration_deg_s2 <= use.acceleration_limit_deg_s2 * (1 + 1e-6) for use in check.joints)
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
    assert [s.kind for s in steps] == ["move", "hold"] + ["move"] * 6 + ["sweep"]  # the first pose is the reference pose
    assert steps[1].variables == {"misalignment_deg": 0, "flexion_deg": 0}


def test_the_check_reports_what_the_trajectory_does(planned):
    the_plan = planned("{move_to_deg: {shoulder_pan_joint: 60, wrist_3_joint: -40}, dwell_s: 0.2}")
    q, v, a = the_plan.trajectory.at(np.arange(0, round(the_plan.duration * 1e9), MS))
    for i, use in enumerate(the_plan.check.joints):
        assert (use.lowest_deg, use.highest_deg) == pytest.approx(
            (np.degrees(q[:, i].min()), np.degrees(q[:, i].max())), abs=1e-3
        )
        assert use.peak_speed_deg_s == pytest.approx(np.degrees(np.abs(v[:, i]).max()), rel=1e-3, abs=1e-9)
        assert use.peak_acceleration_deg_s2 == pytest.approx(np.degrees(np.abs(a[:, i]).max()), rel=0.02, abs=1e-9)


# The hash


def test_the_same_inputs_give_the_same_plan():
    first, second = plan("quick"), plan("quick")
    assert first.hash == second.hash
    for name in ("time_ns", "q", "v", "a"):
        np.testing.assert_array_equal(getattr(first.trajectory, name), getattr(second.trajectory, name))


def test_another_text_another_robot_or_another_included_file_gives_another_hash(tmp_path, planned):
    step = "{move_to_deg: {wrist_3_joint: 30}, dwell_s: 0.5}"
    hashes = [planned(step).hash, planned(step, top=TOP + "# a remark\n").hash, planned(step, robot="ur5e").hash]
    text = TOP + "sections: [{name: part, include: other.yaml}]\n"
    for remark in ("", "# a remark\n"):
        (tmp_path / "other.yaml").write_text(TOP + f"sections: [{{name: x, steps: [{step}]}}]\n{remark}")
        (tmp_path / "whole.yaml").write_text(text)
        hashes.append(plan(tmp_path / "whole.yaml").hash)
    assert len(set(hashes)) == 5
    assert all(len(digest) == 64 for digest in hashes)


# The trajectory


def moves(seed, count=12):
    """Random targets within 120 deg of home, with random scalings."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield (
            ROBOT.home + np.radians(rng.uniform(-120, 120, 6)),
            Motion(speed=rng.uniform(0.1, 1), acceleration=rng.uniform(0.1, 1), jerk=rng.uniform(0.1, 1)),
        )


def built(seed):
    builder = MotionBuilder(ROBOT)
    spans = []
    for target, motion in moves(seed):
        start = builder.now_ns
        builder.move(target, motion)
        spans.append((start, builder.now_ns, target, motion))
        builder.hold(0.3)
    return builder.trajectory(), spans


@pytest.mark.parametrize("seed", range(5))
def test_moves_keep_the_scaled_limits_of_velocity_acceleration_and_jerk(seed):
    trajectory, spans = built(seed)
    for start, end, target, motion in spans:
        times = np.unique(np.append(np.arange(start, end, MS), end))
        q, v, a = trajectory.at(times)
        slack = 1 + 1e-6
        assert (np.abs(v) <= ROBOT.velocity_limits * motion.speed * slack).all()
        assert (np.abs(a) <= ROBOT.acceleration_limits * motion.acceleration * slack).all()
        jerk = np.diff(a, axis=0) / np.diff(times)[:, None] * 1e9
        assert (np.abs(jerk) <= ROBOT.jerk_limits * motion.jerk * (1 + 1e-4)).all()
        np.testing.assert_allclose(q[-1], target, atol=1e-12)
        assert not v[-1].any()
        assert not a[-1].any()


def test_every_joint_of_a_move_arrives_together_and_none_could_be_faster():
    builder = MotionBuilder(ROBOT)
    target = ROBOT.home + np.radians([90, 10, -20, 30, 5, 0])
    builder.move(target, Motion(speed=1, acceleration=1, jerk=1))
    inputs = ruckig.InputParameter(1)
    inputs.current_position, inputs.target_position = [0.0], [np.radians(90)]
    inputs.max_velocity, inputs.max_acceleration = [ROBOT.velocity_limits[0]], [ROBOT.acceleration_limits[0]]
    inputs.max_jerk = [ROBOT.jerk_limits[0]]
    alone = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(inputs, alone)
    assert builder.now_ns / 1e9 == pytest.approx(alone.duration, abs=1e-6)
    q, v, _ = state(builder.trajectory(), [0.5 * alone.duration])
    moved = (q[0] - ROBOT.home)[:5] / (target - ROBOT.home)[:5]
    np.testing.assert_allclose(moved, 0.5, atol=1e-6)
    assert (np.abs(v[0, :5]) > 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_between_its_knots_the_trajectory_is_ruckigs(seed):
    trajectory, spans = built(seed)
    current = ROBOT.home
    for start, end, target, motion in spans:
        inputs = ruckig.InputParameter(6)
        inputs.current_position, inputs.target_position = current.tolist(), target.tolist()
        inputs.max_velocity = (ROBOT.velocity_limits * motion.speed).tolist()
        inputs.max_acceleration = (ROBOT.acceleration_limits * motion.acceleration).tolist()
        inputs.max_jerk = (ROBOT.jerk_limits * motion.jerk).tolist()
        path = ruckig.Trajectory(6)
        if ruckig.Ruckig(6).calculate(inputs, path) not in (ruckig.Result.Working, ruckig.Result.Finished):
            pytest.fail("ruckig refuses a move of this test")
        assert (end - start) / 1e9 == pytest.approx(path.duration, abs=2e-9)
        times = np.arange(start, end, 7 * MS)
        expected = np.array([path.at_time((t - start) / 1e9) for t in times])
        q, v, a = trajectory.at(times)
        assert np.abs(q - expected[:, 0]).max() < 2e-9  # a move ends on a whole nanosecond
        assert np.abs(v - expected[:, 1]).max() < 1e-7
        assert np.abs(a - expected[:, 2]).max() < 1e-4  # jerk times the rounding of a switch to a nanosecond, and its echo
        current = target


@pytest.mark.parametrize("protocol", ["quick", "elbow_dynamic"])
def test_velocity_and_acceleration_are_the_derivatives_of_position(protocol):
    trajectory = plan(protocol).trajectory
    step = 100_000  # 0.1 ms
    rng = np.random.default_rng(1)
    middle = np.sort(rng.integers(step, trajectory.time_ns[-1] - step, 4000))
    knots = trajectory.time_ns[np.clip(np.searchsorted(trajectory.time_ns, middle), 0, len(trajectory.time_ns) - 1)]
    before = trajectory.time_ns[np.searchsorted(trajectory.time_ns, middle, side="right") - 1]
    middle = middle[(knots - middle > step) & (middle - before > step)]  # jerk jumps at a knot
    assert len(middle) > 1000
    _, v, a = trajectory.at(middle)
    (q_before, v_before, _), (q_after, v_after, _) = trajectory.at(middle - step), trajectory.at(middle + step)
    span = 2 * step / 1e9
    np.testing.assert_allclose((q_after - q_before) / span, v, atol=2e-6)
    np.testing.assert_allclose((v_after - v_before) / span, a, atol=2e-4)


def test_position_velocity_and_acceleration_have_no_jumps():
    trajectory = plan("quick").trajectory
    inner = trajectory.time_ns[1:-1]
    for low, high in zip(trajectory.at(inner - 1), trajectory.at(inner), strict=True):
        np.testing.assert_allclose(low, high, atol=1e-6)


def test_the_knots_strictly_increase_and_begin_and_end_at_rest():
    trajectory = plan("quick").trajectory
    assert (np.diff(trajectory.time_ns) > 0).all()
    assert trajectory.time_ns[0] == 0
    for row in (0, -1):
        assert not trajectory.v[row].any()
        assert not trajectory.a[row].any()
    np.testing.assert_array_equal(trajectory.q[0], ROBOT.home)


# Sweeps


@pytest.mark.parametrize("phase", [0.0, 0.7])
@pytest.mark.parametrize("ramp", [0.5, 1.0, 2.5])
def test_a_faded_sine_starts_and_ends_at_rest_and_is_a_sine_between(ramp, phase):
    sweep = SineCommand(5, 0.4, 0.5, 3, ramp, phase)
    duration = (3 + 2 * ramp) / 0.5
    t = np.linspace(0, duration, 20_001)
    q, v, a = faded_sine(t, sweep, duration)
    for quantity in (q, v, a):
        assert quantity[[0, -1]] == pytest.approx([0, 0], abs=1e-9)
    full = (t >= ramp / 0.5) & (t <= duration - ramp / 0.5)
    assert t[full][-1] - t[full][0] == pytest.approx(3 / 0.5, abs=1e-2)
    np.testing.assert_allclose(q[full], 0.4 * np.sin(2 * np.pi * 0.5 * t[full] + phase), atol=1e-9)
    np.testing.assert_allclose(np.gradient(q, t)[1:-1], v[1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(v, t)[1:-1], a[1:-1], atol=5e-3)  # its slope jumps where the fade ends
    assert np.abs(q).max() <= 0.4 + 1e-12


def test_a_sine_sweep_has_the_amplitude_frequency_and_cycles_of_the_protocol(planned):
    the_plan = planned(
        "{move_to_deg: {wrist_3_joint: 10}}",
        "{sweep: {wrist_3_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 4, ramp_cycles: 1}}}, dwell_s: 0.5}",
    )
    step = the_plan.steps[1]
    assert step.kind == "sweep"
    assert (step.settled_ns - step.start_ns) / 1e9 == pytest.approx((4 + 2 * 1) / 0.5, abs=1e-9)
    times = np.arange(step.start_ns + 2_000 * MS, step.settled_ns - 2_000 * MS, 5 * MS)
    angle = np.degrees(the_plan.trajectory.at(times)[0][:, 5]) - 10
    assert (angle.max(), angle.min()) == pytest.approx((20, -20), abs=1e-3)
    spectrum = np.abs(np.fft.rfft(angle))
    assert np.argmax(spectrum) == 4  # cycles in this stretch
    assert spectrum[4] / (len(angle) / 2) == pytest.approx(20, rel=1e-3)
    others = np.delete(np.arange(6), 5)
    assert not np.ptp(the_plan.trajectory.at(times)[0][:, others], axis=0).any()


def test_the_knots_of_a_sine_lose_nothing_of_it(planned):
    the_plan = planned("{sweep: {wrist_3_joint: {sine: {amplitude_deg: 4, frequency_hz: 2, cycles: 4}}}}")
    sweep = SineCommand(5, np.radians(4), 2.0, 4, 1.0, 0.0)
    t = np.linspace(0, 3, 9_001)
    expected = faded_sine(t, sweep, 3.0)
    found = state(the_plan.trajectory, t)
    for order, tolerance in enumerate((1e-9, 1e-7, 1e-4)):
        np.testing.assert_allclose(found[order][:, 5] - (ROBOT.home[5] if order == 0 else 0), expected[order], atol=tolerance)


def test_sines_of_two_joints_run_together_and_the_shorter_one_rests(planned):
    sines = "wrist_3_joint: {sine: {amplitude_deg: 9, frequency_hz: 0.5, cycles: 2}}, "
    sines += "wrist_2_joint: {sine: {amplitude_deg: 5, frequency_hz: 1, cycles: 1, phase_deg: 90}}"
    the_plan = planned(f"{{sweep: {{{sines}}}}}")
    assert the_plan.duration == pytest.approx(8)
    _, v, _ = state(the_plan.trajectory, np.linspace(0.1, 7.9, 500))
    assert (np.abs(v[:, 4]) > 0)[: 500 * 2 // 8].any()
    assert not v[np.linspace(0.1, 7.9, 500) > 3.01, 4].any()


def test_a_trapezoid_goes_there_and_back_at_a_constant_rate(planned):
    shape = "{amplitude_deg: -40, rate_deg_s: 30, cycles: 2, hold_s: 0.25}"
    the_plan = planned("{move_to_deg: {wrist_3_joint: 15}}", f"{{sweep: {{wrist_3_joint: {{trapezoid: {shape}}}}}}}")
    step = the_plan.steps[1]
    times = np.arange(step.start_ns, step.settled_ns, MS)
    q, v, _ = the_plan.trajectory.at(times)
    angle, rate = np.degrees(q[:, 5]), np.degrees(v[:, 5])
    assert (angle.max(), angle.min()) == pytest.approx((15, -25), abs=1e-6)
    assert (rate.max(), rate.min()) == pytest.approx((30, -30), abs=1e-6)
    constant = np.abs(np.abs(rate) - 30) < 1e-6
    assert np.count_nonzero(constant) / 1000 == pytest.approx(4 * (40 / 30 - 2 * np.sqrt(30 / 8000)), abs=0.01)
    still = np.abs(rate) < 1e-9
    assert np.count_nonzero(still) / 1000 == pytest.approx(4 * 0.25, abs=0.02)
    assert np.degrees(the_plan.trajectory.at(np.array([step.settled_ns]))[0][0, 5]) == pytest.approx(15)


def test_a_dwell_is_rest_of_the_stated_length(planned):
    the_plan = planned("{move_to_deg: {wrist_3_joint: 30}, dwell_s: 1.25}", "{dwell_s: 0.5}")
    first, second = the_plan.steps
    assert first.end_ns - first.settled_ns == 1_250_000_000
    assert (second.kind, second.end_ns - second.start_ns) == ("hold", 500_000_000)
    _, v, a = the_plan.trajectory.at(np.arange(first.settled_ns, second.end_ns, 10 * MS))
    assert not v.any()
    assert not a.any()


def test_a_series_of_one_harmonic_is_a_sine():
    t = np.linspace(0, 10, 501)
    sine = faded_sine(t, SineCommand(5, 0.4, 0.5, 3, 1.0, 0.7), 10.0)
    series = faded_series(t, FourierCommand(5, (0.4,), (0.7,), 0.5, 3, 1.0), 10.0)
    for one, other in zip(sine, series, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-12)


def test_a_faded_series_starts_and_ends_at_rest_and_its_rate_and_acceleration_are_its_derivatives():
    sweep = FourierCommand(5, (0.3, 0.1, 0.05), (0.2, 1.5, 4.0), 0.5, 3, 1.5)
    t = np.linspace(0, 12, 40_001)
    q, v, a = faded_series(t, sweep, 12.0)
    for quantity in (q, v, a):
        assert quantity[[0, -1]] == pytest.approx([0, 0], abs=1e-9)
    np.testing.assert_allclose(np.gradient(q, t)[1:-1], v[1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(v, t)[1:-1], a[1:-1], atol=5e-3)
    full = (t > 3) & (t < 9)
    harmonics = zip((1, 2, 3), sweep.amplitudes, sweep.phases, strict=True)
    written = sum(A * np.sin(2 * np.pi * k * 0.5 * t + phase) for k, A, phase in harmonics)
    np.testing.assert_allclose(q[full], written[full], atol=1e-12)


def test_a_fourier_sweep_moves_the_arm_through_its_harmonics_beside_a_sine(planned):
    series = "wrist_3_joint: {fourier: {amplitudes_deg: [20, 0, 6], phases_deg: [0, 0, 90], frequency_hz: 0.5, cycles: 4}}"
    sine = "wrist_2_joint: {sine: {amplitude_deg: 5, frequency_hz: 0.5, cycles: 4}}"
    the_plan = planned(f"{{sweep: {{{series}, {sine}}}}}")
    assert the_plan.duration == pytest.approx(12)
    times = np.arange(2_000 * MS, 10_000 * MS, 5 * MS)
    q = np.degrees(the_plan.trajectory.at(times)[0])
    spectrum = np.fft.rfft(q[:, 5] - q[:, 5].mean()) / (len(times) / 2)
    assert np.abs(spectrum[[4, 8, 12]]) == pytest.approx([20, 0, 6], abs=0.01)
    assert np.ptp(q[:, 4]) == pytest.approx(10, abs=0.01)


def test_a_fourier_sweep_beyond_the_joints_limits_is_refused(planned):
    series = "{fourier: {amplitudes_deg: [20, 20, 20, 20], phases_deg: [0, 0, 0, 0], frequency_hz: 2, cycles: 2}}"
    with pytest.raises(LimitError, match="wrist_3_joint: velocity"):
        planned(f"{{sweep: {{wrist_3_joint: {series}}}}}")
