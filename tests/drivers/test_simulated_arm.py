"""The simulated arm: its servo, its encoders, its repeatability, and how it stops."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import TransferFunction, lsim

from testbench import plan
from testbench.drivers.arms.simulated import SimulatedArm, draw_zero_errors
from testbench.exceptions import DriverError
from testbench.records.session.plan import Plan
from testbench.records.specs.robot import Robot

SECOND = 1_000_000_000
PERFECT = {
    "encoder_resolution_deg": 0.0,
    "encoder_noise_deg": 0.0,
    "velocity_noise_deg_s": 0.0,
    "repeatability_deg": 0.0,
}


@pytest.fixture(scope="module")
def quick_plan() -> Plan:
    return plan("quick")


def arm_with(the_plan: Plan, seed: int = 0, **servo: float) -> SimulatedArm:
    """An arm that is about to begin the plan, with changes to its servo."""
    spec = the_plan.robot.spec
    changed = spec.model_copy(update={"servo": spec.servo.model_copy(update=servo)})
    arm = SimulatedArm(Robot(changed, the_plan.robot.urdf, the_plan.robot.text), seed)
    arm.prepare(the_plan)
    arm.kickoff()
    return arm


def read_all(arm: SimulatedArm, end_ns: int, chunk_ns: int) -> dict[str, np.ndarray]:
    parts = [arm.read(until).to_columns() for until in range(chunk_ns, end_ns + chunk_ns, chunk_ns)]
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


@pytest.mark.parametrize(
    ("natural_frequency_hz", "damping_ratio"), [(12.0, 1.0), (5.0, 0.6), (20.0, 1.5)]
)
def test_each_joint_follows_its_reference_as_a_second_order_system(
    quick_plan, natural_frequency_hz, damping_ratio
):
    arm = arm_with(
        quick_plan,
        natural_frequency_hz=natural_frequency_hz,
        damping_ratio=damping_ratio,
        **PERFECT,
    )
    samples = arm.read(10 * SECOND)
    omega = 2 * np.pi * natural_frequency_hz
    system = TransferFunction([omega**2], [1, 2 * damping_ratio * omega, omega**2])
    t = np.arange(0, 5001) * 0.002
    sent = quick_plan.trajectory.at((t * 1e9).astype(np.int64))[0]
    for joint in range(6):
        _, expected, _ = lsim(system, sent[:, joint] - sent[0, joint], t)
        expected = np.interp(samples.host_time_ns / 1e9, t, expected + sent[0, joint])
        assert np.abs(samples.q_measured[:, joint] - expected)[:-1].max() < 1e-9


def test_on_a_ramp_the_joint_lags_by_twice_the_damping_over_the_frequency(quick_plan):
    arm = arm_with(quick_plan, **PERFECT)
    samples = arm.read(8 * SECOND)
    v = np.gradient(samples.q_sent, samples.host_time_ns / 1e9, axis=0)
    a = np.gradient(v, samples.host_time_ns / 1e9, axis=0)
    servo = quick_plan.robot.spec.servo
    lag = 2 * servo.damping_ratio / (2 * np.pi * servo.natural_frequency_hz)
    # long after the last change of speed
    steady = np.array(
        [np.all(np.abs(a[max(i - 20, 0) : i + 2, 5]) < 1e-6) for i in range(len(a))]
    ) & (np.abs(v[:, 5]) > 0.1)
    if not steady.any():  # the protocol has no such stretch on this joint: look at the fastest one
        joint = int(np.argmax(np.abs(v).max(axis=0)))
        steady = np.array(
            [np.all(np.abs(a[max(i - 20, 0) : i + 2, joint]) < 1e-6) for i in range(len(a))]
        )
        steady &= np.abs(v[:, joint]) > 0.1
    else:
        joint = 5
    assert steady.any()
    np.testing.assert_allclose(
        (samples.q_sent - samples.q_measured)[steady, joint], lag * v[steady, joint], rtol=1e-3
    )


def test_the_arm_reports_at_its_recording_rate(quick_plan):
    samples = arm_with(quick_plan).read(2 * SECOND)
    np.testing.assert_array_equal(
        np.diff(samples.host_time_ns), round(SECOND / quick_plan.robot.spec.rates.record_hz)
    )
    assert samples.joint_names == quick_plan.robot.joint_names


def test_encoders_round_to_whole_counts(quick_plan):
    resolution = 0.01
    samples = arm_with(quick_plan, encoder_resolution_deg=resolution, encoder_noise_deg=0.0).read(
        5 * SECOND
    )
    exact = arm_with(quick_plan, encoder_resolution_deg=0.0, encoder_noise_deg=0.0).read(5 * SECOND)
    counts = np.degrees(samples.q_measured) / resolution
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    difference = np.degrees(np.abs(samples.q_measured - exact.q_measured))
    assert 0.4 * resolution < difference.max() <= 0.5 * resolution + 1e-9


def test_encoders_and_rates_hiss_with_the_stated_spread(quick_plan):
    noisy = arm_with(
        quick_plan, **PERFECT | {"encoder_noise_deg": 0.01, "velocity_noise_deg_s": 0.5}
    ).read(25 * SECOND)
    exact = arm_with(quick_plan, **PERFECT).read(25 * SECOND)
    assert np.degrees(np.std(noisy.q_measured - exact.q_measured)) == pytest.approx(0.01, rel=0.02)
    assert np.degrees(np.std(noisy.v_measured - exact.v_measured)) == pytest.approx(0.5, rel=0.02)


def test_the_true_angles_miss_the_readings_by_the_repeatability_drawn_anew_for_each_move(
    quick_plan,
):
    sd = 0.02
    errors = []
    for seed in range(40):
        arm = arm_with(quick_plan, seed, **PERFECT | {"repeatability_deg": sd})
        for step in quick_plan.steps:
            if step.kind == "move" and step.end_ns - step.settled_ns > SECOND // 2:
                samples = arm.read(step.end_ns)
                errors.append(
                    arm.true_state(samples.host_time_ns[-1:])[0][0] - samples.q_measured[-1]
                )
    errors = np.degrees(errors).reshape(40, -1, 6)
    assert errors.std() == pytest.approx(sd, rel=0.05)
    assert abs(errors.mean()) < 4 * sd / np.sqrt(errors.size)
    between_moves = np.corrcoef(errors[:, 0].ravel(), errors[:, 1].ravel())[0, 1]
    assert abs(between_moves) < 0.25


def test_during_a_dwell_the_true_angles_do_not_move(quick_plan):
    arm = arm_with(quick_plan, repeatability_deg=0.05)
    step = next(step for step in quick_plan.steps if step.kind == "move")
    arm.read(step.end_ns)
    _, v, a = arm.true_state(np.arange(step.end_ns - SECOND // 2, step.end_ns, 10_000_000))
    assert np.abs(v).max() < 1e-6
    assert np.abs(a).max() < 1e-4


def test_the_true_rates_and_accelerations_are_derivatives_of_the_true_angles(quick_plan):
    arm = arm_with(quick_plan, repeatability_deg=0.05)
    arm.read(8 * SECOND)
    times = np.arange(SECOND, 8 * SECOND - SECOND // 100, 3_700_001)
    step = 100_000
    (before, v_before, _), (q, v, a), (after, v_after, _) = (
        arm.true_state(times + shift) for shift in (-step, 0, step)
    )
    h = step * 1e-9
    assert np.abs(v).max() > 0.5
    np.testing.assert_allclose((after - before) / (2 * h), v, atol=1e-4)
    np.testing.assert_allclose((v_after - v_before) / (2 * h), a, atol=5e-3 * np.abs(a).max())
    assert np.abs(q).max() < 7


@pytest.mark.parametrize("chunk_ns", [100_000_000, 330_000_000, 7 * SECOND])
def test_reading_in_pieces_gives_the_samples_of_reading_at_once_to_the_bit(quick_plan, chunk_ns):
    end = 7 * SECOND
    whole = read_all(arm_with(quick_plan, 3), end, end)
    pieces = read_all(arm_with(quick_plan, 3), end, chunk_ns)
    for key, column in whole.items():
        assert pieces[key][: len(column)].tobytes() == column.tobytes(), key


@pytest.mark.parametrize("overlap_ns", [0, 1_000_000, 3_999_999])
def test_the_true_state_just_before_a_border_between_readings_is_that_of_reading_at_once(
    quick_plan, overlap_ns
):
    """A sensor with jitter asks a little before the border, after the arm has been read beyond
    it.
    """
    moving = next(step for step in quick_plan.steps if step.kind == "move")
    border = ((moving.start_ns + moving.settled_ns) // 2) // 100_000_000 * 100_000_000
    whole, pieces = arm_with(quick_plan, 3), arm_with(quick_plan, 3)
    whole.read(border + SECOND)
    pieces.read(border)
    pieces.read(border + SECOND)
    at = np.array([border - overlap_ns])
    for expected, found in zip(whole.true_state(at), pieces.true_state(at), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def fast_moment(the_plan: Plan) -> int:
    """When the fastest joint is at its fastest."""
    (times,) = the_plan.trajectory.sample_moving(4_000_000, 1_000_000)
    return int(times[np.argmax(np.abs(the_plan.trajectory.at(times)[1]).max(axis=1))])


@pytest.mark.parametrize(
    "state", ["at rest before the first move", "in full motion", "in a dwell", "after the end"]
)
def test_stop_brings_the_arm_to_rest_from_every_state_and_a_second_stop_does_nothing(
    quick_plan, state
):
    when = {
        "at rest before the first move": 10_000_000,
        "in full motion": fast_moment(quick_plan),
        "in a dwell": quick_plan.steps[0].settled_ns + SECOND,
        "after the end": int(quick_plan.trajectory.time_ns[-1]) + SECOND,
    }[state]
    arm = arm_with(quick_plan, **PERFECT)
    before = arm.read(when)
    arm.stop()
    arm.stop()
    after = arm.read(when + 3 * SECOND)
    limits = quick_plan.robot.acceleration_limits
    times = np.arange(when + 4_000_000, when + 2 * SECOND, 2_000_000)
    q, v, a = arm.true_state(times)
    assert np.abs(v[-1]).max() < 1e-9
    if state == "in full motion":
        assert np.abs(before.v_measured[-1]).max() > 0.5
        travelled = np.abs(q[-1] - q[0])
        assert travelled.max() < 0.5 * np.abs(before.v_measured).max()
        assert (np.abs(a) < 4 * limits).all()
    assert np.abs(np.diff(after.q_measured, axis=0)).max() < 0.1  # no jump


def test_stop_is_allowed_before_anything_was_prepared(quick_plan):
    arm = SimulatedArm(quick_plan.robot, 0)
    arm.stop()
    arm.close()


def test_an_arm_that_was_not_prepared_or_not_started_says_so(quick_plan):
    arm = SimulatedArm(quick_plan.robot, 0)
    with pytest.raises(DriverError, match="before it was prepared"):
        arm.kickoff()
    arm.prepare(quick_plan)
    with pytest.raises(DriverError, match="before it was started"):
        arm.read(SECOND)


def test_the_same_seed_gives_the_same_arm_and_another_one_does_not(quick_plan):
    first, again, other = (arm_with(quick_plan, seed).read(SECOND).q_measured for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert not np.array_equal(first, other)


def test_a_stopped_arm_stays_within_its_repeatability(quick_plan):
    sd = 0.05
    arm = arm_with(quick_plan, repeatability_deg=sd)
    when = fast_moment(quick_plan)
    arm.read(when)
    arm.stop()
    arm.read(when + 2 * SECOND)
    rest = arm.true_state(np.array([when + 2 * SECOND]))[0]
    arm.read(when + 8 * SECOND)
    q, _, _ = arm.true_state(np.arange(when + 3 * SECOND, when + 8 * SECOND, 2_000_000))
    assert np.degrees(np.abs(q - rest)).max() < 6 * sd


def test_wrong_zeros_are_felt_all_through_a_run_and_not_seen_by_the_encoders(quick_plan):
    blind, exact = (
        SimulatedArm(quick_plan.robot, 3, joint_errors=wrong) for wrong in (True, False)
    )
    readings, states = [], []
    for arm in (blind, exact):
        arm.prepare(quick_plan)
        arm.kickoff()
        readings.append(arm.read(6 * SECOND))
        states.append(arm.true_state(np.arange(0, 6 * SECOND, SECOND // 7)))
    np.testing.assert_array_equal(readings[0].q_measured, readings[1].q_measured)
    offsets = states[0][0] - states[1][0]
    np.testing.assert_allclose(
        offsets, np.tile(draw_zero_errors(quick_plan.robot, 3), (len(offsets), 1)), atol=1e-12
    )
    np.testing.assert_allclose(states[0][1], states[1][1], atol=1e-12)


def test_wrong_zeros_scatter_over_seeds_as_the_robot_file_says(quick_plan):
    each = [0.0, 0.01, 0.02, 0.05, 0.1, 0.3]
    spec = quick_plan.robot.spec
    changed = spec.model_copy(
        update={"uncertainty": spec.uncertainty.model_copy(update={"joint_angle_deg": each})}
    )
    robot = Robot(changed, quick_plan.robot.urdf, quick_plan.robot.text)
    drawn = np.degrees([draw_zero_errors(robot, seed) for seed in range(600)])
    np.testing.assert_allclose(drawn.std(axis=0), each, rtol=0.12)
    assert np.abs(drawn.mean(axis=0)).max() < 0.05
    np.testing.assert_array_equal(draw_zero_errors(robot, 7), draw_zero_errors(robot, 7))
