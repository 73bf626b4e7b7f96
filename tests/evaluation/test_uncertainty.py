"""The budget of the truth: against hand calculation and closed forms; what it must and must not
depend on.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.evaluation import evaluate
from testbench.evaluation.angular_rate import judged_motion, turned_by_sensor
from testbench.evaluation.budgets import UNKNOWN_TRUTH, unknown_time
from testbench.evaluation.sensitivity import flexion_by_arm
from testbench.evaluation.time_lines import (
    JudgedMotion,
    TimeDoubt,
    arm_time_source,
    clock_source,
)
from testbench.evaluation.uncertainty import ArmSensitivity, combine
from testbench.model.kinematics import Kinematics
from testbench.planning import plan
from testbench.records.results.estimate import ClockFit, Estimate
from testbench.records.results.evaluation import Outcome
from testbench.records.session.session import Event, Session
from testbench.records.specs.protocol import AcceptanceLimit, JointDefinition
from testbench.records.specs.robot import Robot

WRIST_2, WRIST_3 = 4, 5


@pytest.fixture(scope="module")
def elbow():
    the_plan = plan("quick")
    return Kinematics(the_plan.robot), the_plan.protocol.spec


def pose(d: float, f: float) -> np.ndarray:
    return np.radians([[180 + d, -90, -90, 0, 90 - d, f]])


@pytest.mark.parametrize(("d", "f"), [(0, 30), (20, 30), (15, 60), (-10, 45)])
def test_sensitivities_of_an_euler_angle_are_those_of_its_closed_form(elbow, d, f):
    # The middle YXZ angle of this elbow is -asin(sin f cos d) (Castellanos Alonso 2023); wrist 2
    # turns by 90 deg - d.
    kinematics, spec = elbow
    joint = JointDefinition(
        proximal="arm", distal="forearm", sequence="YXZ", flexion="second", sign=-1
    )
    found, _ = flexion_by_arm(kinematics, spec.sensors, joint, pose(d, f))
    d, f = np.radians(d), np.radians(f)
    root = np.sqrt(1 - (np.sin(f) * np.cos(d)) ** 2)
    wanted = np.zeros(6)
    wanted[WRIST_3], wanted[WRIST_2] = np.cos(f) * np.cos(d) / root, np.sin(f) * np.sin(d) / root
    np.testing.assert_allclose(found[0, :6], wanted, atol=1e-6)


def test_the_joint_that_is_the_truth_has_a_sensitivity_of_one_and_the_others_none(elbow):
    kinematics, spec = elbow
    found, _ = flexion_by_arm(kinematics, spec.sensors, spec.joints["elbow"], pose(20, 0))
    np.testing.assert_array_equal(found[0], [0, 0, 0, 0, 0, 1, *[0] * len(kinematics.twists)])


def test_at_a_kink_the_larger_change_counts(elbow):
    kinematics, spec = elbow
    joint = JointDefinition(proximal="arm", distal="forearm", sequence="ZXZ", flexion="second")
    found, _ = flexion_by_arm(
        kinematics, spec.sensors, joint, pose(0, 0)
    )  # the middle angle is |f| there
    assert abs(found[0][WRIST_3]) == pytest.approx(1, abs=1e-3)


def test_a_mounting_error_about_the_flexion_axis_is_a_flexion_error_of_its_size(elbow):
    kinematics, spec = elbow
    joint = JointDefinition(proximal="arm", distal="forearm", sequence="ZXZ", flexion="second")
    _, by_mounting = flexion_by_arm(kinematics, spec.sensors, joint, pose(0, 40))
    for sensor in (by_mounting[0, :3], by_mounting[0, 3:]):
        assert np.linalg.norm(sensor) == pytest.approx(1, abs=1e-3)


def test_joints_turn_a_sensor_about_their_axes(elbow):
    kinematics, _ = elbow
    axes = kinematics.error_axes("wrist_3_link", pose(10, 30))[0, :6]
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(axes[0], [0, 0, 1], atol=1e-6)  # the arm stands upright
    beyond = kinematics.error_axes("wrist_1_link", pose(10, 30))[0, :6]
    np.testing.assert_allclose(
        beyond[[WRIST_2, WRIST_3]], 0, atol=1e-9
    )  # they move nothing before them


def test_what_lasts_does_not_average_out_and_what_is_redrawn_does():
    signed = np.array([[1.0, 0.5], [1.0, -0.5], [1.0, 0.5], [1.0, -0.5]])
    c = ArmSensitivity(signed, np.abs(signed), np.arange(4), np.full(4, 0.25), None, 2)
    mean, size = c.constant()
    np.testing.assert_allclose(mean, [1, 0], atol=1e-12)
    np.testing.assert_allclose(size, [1, 0.5])
    redrawn = c.redrawn()
    assert redrawn[0] == pytest.approx(np.sqrt(4 * (0.25**2 + 0.125**2)))
    assert redrawn[1] == pytest.approx(np.sqrt(1.25))


def test_sources_add_as_squares_and_their_freedom_by_welch_and_satterthwaite():
    fitted = ClockFit(offset_sd_s=1e-3, method="angular_rate")
    lines = [
        clock_source("a", fitted, JudgedMotion(*rates, 9.0))
        for rates in ((30.0, 40.0), (-40.0, 50.0))
    ]
    lines = [dataclasses.replace(line, degrees_of_freedom=8.0) for line in lines]
    budget = combine("elbow", "flexion", "s", lines, [])
    assert budget.combined_deg == pytest.approx(0.05)
    assert budget.expanded_deg == pytest.approx(0.05 * budget.coverage_factor)
    assert budget.combined_magnitude_deg == pytest.approx(np.hypot(0.04, 0.05))
    assert budget.degrees_of_freedom == pytest.approx(0.05**4 / ((0.03**4 + 0.04**4) / 8))


def test_a_time_that_nobody_knows_forbids_a_statement_only_where_the_truth_moves():
    arrival = ClockFit(method="arrival")
    assert clock_source("a", arrival, JudgedMotion(0.0, 20.0, 30.0)) is None
    assert clock_source("a", arrival, JudgedMotion(0.0, 20.0, float("nan"))) is None
    # a standing arm whose encoders have noise of 0.04 deg: no time does more than that, whatever
    # its rate by differences
    still = clock_source("a", arrival, JudgedMotion(0.0, 3.0, 0.04))
    assert still.contribution_deg == still.magnitude_deg == pytest.approx(0.02 / np.sqrt(3))
    assert clock_source("a", ClockFit(), JudgedMotion(0.0, 20.0, 30.0)).standard_uncertainty == 0
    budget = combine("elbow", "flexion", "s", [], [unknown_time("a")])
    assert (
        not budget.complete and budget.expanded_deg is None and budget.notes == [unknown_time("a")]
    )


def test_a_flexion_is_divided_between_the_segments_that_make_it():
    time = np.arange(0, 4, 0.01)
    thigh, shank = np.radians(10 * np.sin(time)), np.radians(200 * time)  # beyond a whole turn
    joint = JointDefinition(sequence="ZXY", flexion="first", proximal="a", distal="b")
    q_thigh, q_shank = (
        Rotation.from_euler("z", a[:, None]).as_quat(scalar_first=True) for a in (thigh, shank)
    )
    turned = turned_by_sensor(q_thigh, q_shank, joint)
    np.testing.assert_allclose(np.abs(turned), np.abs(np.column_stack([thigh, shank])), atol=1e-9)
    np.testing.assert_allclose(np.abs(turned.sum(axis=1)), np.abs(shank - thigh), atol=1e-9)
    still = turned_by_sensor(np.tile(q_thigh[:1], (len(time), 1)), q_shank, joint)
    assert np.abs(still[:, 0]).max() < 1e-12
    found = judged_motion(
        (time * 1e9).astype(np.int64), turned[:, 1], [np.arange(10, 50), np.arange(100, 140)]
    )
    assert abs(found.mean_rate) == pytest.approx(200) == found.rms_rate
    assert found.swing == pytest.approx(200 * 0.39)


def with_clocks(estimate: Estimate, **clocks: ClockFit) -> Estimate:
    sensors = {
        name: dataclasses.replace(own, clock=clocks.get(name, own.clock))
        for name, own in estimate.sensors.items()
    }
    return dataclasses.replace(estimate, sensors=sensors)


def test_the_time_of_a_sensor_that_stands_still_does_not_matter(quick):
    """The arm's sensor stays where it is while wrist 3 turns the forearm's."""
    whole = of(quick.evaluation, "elbow", "flexion", "sweep")
    lost = evaluate(quick.session, with_clocks(quick.estimate, arm=ClockFit(method="arrival")))
    for section in ("static", "sweep"):
        assert of(lost, "elbow", "flexion", section).expanded_deg == pytest.approx(
            whole.expanded_deg, rel=0.05
        )
    assert all(m.no_uncertainty is None for m in lost.metrics if m.name.startswith("elbow"))
    assert lost.outcome is quick.evaluation.outcome
    assert line(of(lost, "elbow", "flexion", "sweep"), "clock alignment, forearm").magnitude_deg > 0


def test_nothing_passes_where_a_moving_sensors_time_is_not_known(quick):
    assert quick.evaluation.outcome is Outcome.PASS
    lost = evaluate(quick.session, with_clocks(quick.estimate, forearm=ClockFit(method="arrival")))
    assert of(lost, "elbow", "flexion", "static").complete
    budget = of(lost, "elbow", "flexion", "sweep")
    assert not budget.complete and budget.notes == [unknown_time("forearm")]
    moving = [
        m for m in lost.metrics if m.section == "sweep" and m.name == "elbow.flexion_rmse_deg"
    ]
    assert moving and all(m.no_uncertainty == unknown_time("forearm") for m in moving)
    limit = AcceptanceLimit(metric="elbow.flexion_rmse_deg", section="sweep", max=90.0)
    session = Session(quick.session.path)
    session.__dict__["analysis"] = session.analysis.model_copy(update={"accept": [limit]})
    judged = evaluate(session, with_clocks(quick.estimate, forearm=ClockFit(method="arrival")))
    assert judged.outcome is Outcome.MARGINAL
    assert any("cannot pass" in note and unknown_time("forearm") in note for note in judged.notes)
    assert evaluate(session, quick.estimate).outcome is Outcome.PASS


def of(evaluation, owner, quantity, section=None):
    return next(
        b
        for b in evaluation.uncertainty
        if (b.owner, b.quantity, b.section) == (owner, quantity, section)
    )


def line(budget, name):
    return next(source for source in budget.sources if source.source.startswith(name))


def test_the_budget_of_a_run_is_what_a_hand_calculation_gives(quick):
    budget = of(quick.evaluation, "elbow", "flexion", "static")
    spec = quick.session.robot.spec
    calibration = line(budget, "kinematic calibration, wrist_3_joint")
    assert calibration.contribution_deg == pytest.approx(spec.uncertainty.joint_angle_deg)
    assert (
        sum(source.source.startswith("kinematic") for source in budget.sources) == 1
    )  # the truth is that joint alone
    poses = 6
    assert line(budget, "repeatability").contribution_deg == pytest.approx(
        spec.servo.repeatability_deg / np.sqrt(poses)
    )
    resolution = spec.servo.encoder_resolution_deg / 2 / np.sqrt(3) / np.sqrt(poses)
    assert line(budget, "resolution").contribution_deg == pytest.approx(resolution)
    # the scatter of one reading: rounding and noise of the servo block; about a hundred readings in
    # each pose
    reading = np.hypot(
        spec.servo.encoder_noise_deg, spec.servo.encoder_resolution_deg / np.sqrt(12)
    )
    assert 0.1 * reading / 2 < line(budget, "static averaging").value < 0.1 * reading * 2
    assert line(budget, "tracking").contribution_deg == 0 and line(budget, "tracking").value > 0
    assert line(budget, "mounting").contribution_deg == 0  # the reference pose takes it out
    total = np.sqrt(sum(source.contribution_deg**2 for source in budget.sources))
    # one source of 25 % reliability makes nearly all of it: Student's t for 8 (JCGM 100:2008, G.2)
    assert budget.coverage_factor == pytest.approx(2.31, abs=0.005)
    assert budget.expanded_deg == pytest.approx(budget.coverage_factor * total)
    assert (
        8 <= budget.degrees_of_freedom < 8.1
    )  # one source of 25 % reliability makes nearly all of it


def test_the_uncertainty_stands_beside_every_mean_error(quick):
    for summary in quick.evaluation.joint_summary:
        budget = of(quick.evaluation, summary.joint, "flexion", summary.section)
        assert summary.expanded_uncertainty_deg == budget.expanded_deg > 0.19
    for summary in quick.evaluation.orientation_summary:
        assert summary.expanded_uncertainty_magnitude_deg > 0.19
    means = [
        m for m in quick.evaluation.metrics if m.unit == "deg" and not m.name.endswith("iqr_deg")
    ]
    assert len(means) > 40 and all(m.expanded_uncertainty is not None for m in means)


def test_a_heading_does_not_mind_a_tilted_base_and_an_inclination_does(quick):
    heading, inclination = (
        of(quick.evaluation, "arm", part) for part in ("heading", "inclination")
    )
    assert not any(source.source.startswith("levelling") for source in heading.sources)
    assert line(inclination, "levelling").contribution_deg == pytest.approx(np.sqrt(2) * 0.1)
    assert {s.source for s in heading.sources if s.source.startswith("kinematic")} == {
        "kinematic calibration, shoulder_pan_joint"
    }


def with_uncertainty(session: Session, **changes) -> Session:
    """The session as if its robot file had said something else."""
    copy = Session(session.path)
    spec = session.robot.spec
    changed = spec.model_copy(update={"uncertainty": spec.uncertainty.model_copy(update=changes)})
    copy.__dict__["robot"] = Robot(changed, session.robot.urdf, session.robot.text)
    return copy


def test_the_robot_file_decides_how_sure_the_truth_is(quick):
    exact = evaluate(with_uncertainty(quick.session, joint_angle_deg=0.0), quick.estimate)
    assert of(exact, "elbow", "flexion", "static").expanded_deg < 0.005
    each = [0.5, 0.5, 0.5, 0.5, 0.5, 0.02]
    own = evaluate(with_uncertainty(quick.session, joint_angle_deg=each), quick.estimate)
    budget = of(own, "elbow", "flexion", "static")
    assert budget.combined_deg == pytest.approx(0.02, rel=0.02)


def test_without_an_alignment_the_mounting_counts(quick):
    session = Session(quick.session.path)
    aligned = session.analysis.model_copy(
        update={"estimate": session.analysis.estimate.model_copy(update={"align": "heading"})}
    )
    session.__dict__["analysis"] = aligned
    evaluation = evaluate(session, quick.estimate)
    # each sensor about the flexion axis; at no flexion, where the angle has a kink, about any axis
    # across the forearm
    assert (
        0.99 * np.sqrt(2)
        < line(of(evaluation, "elbow", "flexion", "static"), "mounting").sensitivity
        < 2
    )
    assert line(of(evaluation, "arm", "inclination"), "mounting").magnitude_deg == pytest.approx(
        0.5 * np.sqrt(2)
    )


def test_a_clock_that_is_less_sure_makes_sweeps_less_sure_and_leaves_poses_alone(quick):
    def slower(sensor):
        return dataclasses.replace(
            sensor, clock=dataclasses.replace(sensor.clock, offset_sd_s=0.02)
        )

    sensors = {name: slower(sensor) for name, sensor in quick.estimate.sensors.items()}
    evaluation = evaluate(quick.session, dataclasses.replace(quick.estimate, sensors=sensors))
    for section, moves in (("static", False), ("sweep", True)):
        clock = line(of(evaluation, "elbow", "flexion", section), "clock alignment, forearm")
        # a sine of 20 deg at 0.5 Hz turns at 44 deg/s RMS where it has its full size; the ramps
        # take some of it
        assert (clock.magnitude_deg > 0.5) == moves
        assert clock.contribution_deg < 0.05  # there and back: the mean hardly notices


def test_a_truth_that_did_not_come_from_the_arm_has_no_stated_uncertainty(quick, tmp_path):
    session = Session(quick.session.path)
    session.__dict__["robot"] = None
    evaluation = evaluate(session, quick.estimate)
    assert all(not b.complete and UNKNOWN_TRUTH in b.notes for b in evaluation.uncertainty)
    assert all(m.expanded_uncertainty is None for m in evaluation.metrics if m.unit == "deg")
    late = [m for m in evaluation.metrics if m.unit == "ms"]  # a delay has that of the clocks
    assert late and all(m.expanded_uncertainty > 0 for m in late)


def without_delays(session: Session) -> Session:
    """The session as if nobody had said how late its gyroscopes are."""
    copy = Session(session.path)
    manifest = session.manifest
    sensors = {
        name: own.model_copy(update={"rate_delay_s": None})
        for name, own in manifest.sensors.items()
    }
    copy.__dict__["manifest"] = manifest.model_copy(update={"sensors": sensors})
    return copy


@pytest.mark.parametrize(
    ("delay_s", "sampling", "half_ms"),
    [
        (0.5 / 60, "integrated", 1e3 / (2 * np.pi * 30)),  # a low pass of 30 Hz
        (None, "instantaneous", 1e3 / (2 * np.pi * 30)),
        (0.0121, "integrated", 0.0),  # with the low pass, as somebody stated
    ],
)
def test_the_low_pass_before_a_stated_sampling_is_in_doubt(quick, delay_s, sampling, half_ms):
    copy = Session(quick.session.path)
    manifest = quick.session.manifest
    changed = {"driver": "imported", "sampling": sampling, "rate_delay_s": delay_s, "rate_hz": 60.0}
    sensors = {name: own.model_copy(update=changed) for name, own in manifest.sensors.items()}
    copy.__dict__["manifest"] = manifest.model_copy(update={"sensors": sensors})
    doubt = TimeDoubt.of(copy, quick.estimate)
    assert doubt.gyroscope_s["forearm"] == pytest.approx(1e-3 * half_ms, rel=1e-3)
    codes = [found.code for found in doubt.findings("forearm")]
    assert codes == (["judged.low_pass_unstated"] if half_ms else [])
    assert len(doubt.notes(["forearm"])) == len(codes)


def test_a_delay_of_the_gyroscope_that_nobody_states_is_a_line_and_a_note(quick):
    known = of(quick.evaluation, "elbow", "flexion", "sweep")
    assert line(known, "group delay of the gyroscope, forearm").value == 0 and not known.assumed
    session = without_delays(quick.session)
    evaluation = evaluate(session, quick.estimate)
    budget = of(evaluation, "elbow", "flexion", "sweep")
    delay, clock = (
        line(budget, f"{name}, forearm")
        for name in ("group delay of the gyroscope", "clock alignment")
    )
    assert delay.value == pytest.approx(500 / 60, rel=1e-3)  # ms, half an interval of a DOT
    assert delay.standard_uncertainty == pytest.approx(delay.value / np.sqrt(3))
    assert delay.magnitude_deg / delay.standard_uncertainty == pytest.approx(
        clock.magnitude_deg / clock.standard_uncertainty
    )
    assert len(budget.assumed) == 2 and "8.33 ms" in budget.assumed[0]
    assert budget.complete and budget.expanded_magnitude_deg > 1.5 * known.expanded_magnitude_deg
    codes = [(found.code, found.where) for found in evaluation.findings]
    assert {("judged.delay_unstated", name) for name in ("arm", "forearm")} <= set(codes)
    assert "judged.delay_unstated" not in [found.code for found in quick.evaluation.findings]
    late, before = (
        next(
            s.errors.latency_sd_ms
            for s in own.joint_summary
            if s.errors.latency_sd_ms is not None and s.filter == "vqf_6d"
        )
        for own in (evaluation, quick.evaluation)
    )
    assert late == pytest.approx(np.hypot(before, delay.standard_uncertainty), rel=0.05)


def test_an_arm_whose_time_was_doubtful_says_so_in_the_budget(quick):
    session = Session(quick.session.path)
    record = session.manifest.arm.record
    arm = session.manifest.arm.model_copy(update={"driver": "ur"})
    session.__dict__["manifest"] = session.manifest.model_copy(update={"arm": arm})
    assert record.simulated and not session.manifest.arm.record.simulated
    told = [("arm_time_step", {"by_s": -0.02}), ("arm_time_doubtful", {"lead_s": 0.006})]
    session.__dict__["events"] = [Event(0, name, details) for name, details in told]
    doubt = TimeDoubt.of(session, quick.estimate)
    assert doubt.arm_s == 0.02
    source = arm_time_source(doubt, JudgedMotion(10.0, -30.0, 5.0))
    assert source.contribution_deg == pytest.approx(10 * 0.02 / np.sqrt(3))
    assert TimeDoubt.of(quick.session, quick.estimate).arm_s == 0
