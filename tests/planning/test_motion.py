"""Motion: moves that ruckig times and that keep every limit, sweeps that begin and end at rest,
knots that lose nothing.
"""

import numpy as np
import pytest
import ruckig

from testbench import plan
from testbench.exceptions import LimitError, PlanError
from testbench.planning.expansion import FourierCommand, SineCommand
from testbench.planning.motion import MotionBuilder, faded_series, faded_sine
from testbench.records.specs.protocol_steps import Motion
from testbench.records.specs.robot import load_robot

ROBOT = load_robot("ur3e")
MS = 1_000_000


def state(trajectory, times_s):
    return trajectory.at(np.round(np.asarray(times_s) * 1e9).astype(np.int64))


# The trajectory


def moves(seed, count=12):
    """Random targets within 120 deg of home, with random scalings."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield (
            ROBOT.home + np.radians(rng.uniform(-120, 120, 6)),
            Motion(
                speed=rng.uniform(0.1, 1),
                acceleration=rng.uniform(0.1, 1),
                jerk=rng.uniform(0.1, 1),
            ),
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
    inputs.max_velocity, inputs.max_acceleration = (
        [ROBOT.velocity_limits[0]],
        [ROBOT.acceleration_limits[0]],
    )
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
        if ruckig.Ruckig(6).calculate(inputs, path) not in (
            ruckig.Result.Working,
            ruckig.Result.Finished,
        ):
            pytest.fail("ruckig refuses a move of this test")
        assert (end - start) / 1e9 == pytest.approx(path.duration, abs=2e-9)
        times = np.arange(start, end, 7 * MS)
        expected = np.array([path.at_time((t - start) / 1e9) for t in times])
        q, v, a = trajectory.at(times)
        assert np.abs(q - expected[:, 0]).max() < 2e-9  # a move ends on a whole nanosecond
        assert np.abs(v - expected[:, 1]).max() < 1e-7
        assert (
            np.abs(a - expected[:, 2]).max() < 1e-4
        )  # jerk times the rounding of a switch to a nanosecond, and its echo
        current = target


@pytest.mark.parametrize("protocol", ["quick", "elbow_dynamic"])
def test_velocity_and_acceleration_are_the_derivatives_of_position(protocol):
    trajectory = plan(protocol).trajectory
    step = 100_000  # 0.1 ms
    rng = np.random.default_rng(1)
    middle = np.sort(rng.integers(step, trajectory.time_ns[-1] - step, 4000))
    knots = trajectory.time_ns[
        np.clip(np.searchsorted(trajectory.time_ns, middle), 0, len(trajectory.time_ns) - 1)
    ]
    before = trajectory.time_ns[np.searchsorted(trajectory.time_ns, middle, side="right") - 1]
    middle = middle[(knots - middle > step) & (middle - before > step)]  # jerk jumps at a knot
    assert len(middle) > 1000
    _, v, a = trajectory.at(middle)
    (q_before, v_before, _), (q_after, v_after, _) = (
        trajectory.at(middle - step),
        trajectory.at(middle + step),
    )
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
    np.testing.assert_allclose(
        np.gradient(v, t)[1:-1], a[1:-1], atol=5e-3
    )  # its slope jumps where the fade ends
    assert np.abs(q).max() <= 0.4 + 1e-12


def test_a_sine_sweep_has_the_amplitude_frequency_and_cycles_of_the_protocol(planned):
    the_plan = planned(
        "{move_to_deg: {wrist_3_joint: 10}}",
        "{sweep: {wrist_3_joint: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 4, "
        "ramp_cycles: 1}}}, dwell_s: 0.5}",
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
    the_plan = planned(
        "{sweep: {wrist_3_joint: {sine: {amplitude_deg: 4, frequency_hz: 2, cycles: 4}}}}"
    )
    sweep = SineCommand(5, np.radians(4), 2.0, 4, 1.0, 0.0)
    t = np.linspace(0, 3, 9_001)
    expected = faded_sine(t, sweep, 3.0)
    found = state(the_plan.trajectory, t)
    for order, tolerance in enumerate((1e-9, 1e-7, 1e-4)):
        np.testing.assert_allclose(
            found[order][:, 5] - (ROBOT.home[5] if order == 0 else 0),
            expected[order],
            atol=tolerance,
        )


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
    the_plan = planned(
        "{move_to_deg: {wrist_3_joint: 15}}",
        f"{{sweep: {{wrist_3_joint: {{trapezoid: {shape}}}}}}}",
    )
    step = the_plan.steps[1]
    times = np.arange(step.start_ns, step.settled_ns, MS)
    q, v, _ = the_plan.trajectory.at(times)
    angle, rate = np.degrees(q[:, 5]), np.degrees(v[:, 5])
    assert (angle.max(), angle.min()) == pytest.approx((15, -25), abs=1e-6)
    assert (rate.max(), rate.min()) == pytest.approx((30, -30), abs=1e-6)
    constant = np.abs(np.abs(rate) - 30) < 1e-6
    assert np.count_nonzero(constant) / 1000 == pytest.approx(
        4 * (40 / 30 - 2 * np.sqrt(30 / 8000)), abs=0.01
    )
    still = np.abs(rate) < 1e-9
    assert np.count_nonzero(still) / 1000 == pytest.approx(4 * 0.25, abs=0.02)
    assert np.degrees(
        the_plan.trajectory.at(np.array([step.settled_ns]))[0][0, 5]
    ) == pytest.approx(15)


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
    series = (
        "wrist_3_joint: {fourier: {amplitudes_deg: [20, 0, 6], phases_deg: [0, 0, 90], "
        "frequency_hz: 0.5, cycles: 4}}"
    )
    sine = "wrist_2_joint: {sine: {amplitude_deg: 5, frequency_hz: 0.5, cycles: 4}}"
    the_plan = planned(f"{{sweep: {{{series}, {sine}}}}}")
    assert the_plan.duration == pytest.approx(12)
    times = np.arange(2_000 * MS, 10_000 * MS, 5 * MS)
    q = np.degrees(the_plan.trajectory.at(times)[0])
    spectrum = np.fft.rfft(q[:, 5] - q[:, 5].mean()) / (len(times) / 2)
    assert np.abs(spectrum[[4, 8, 12]]) == pytest.approx([20, 0, 6], abs=0.01)
    assert np.ptp(q[:, 4]) == pytest.approx(10, abs=0.01)


def test_a_fourier_sweep_beyond_the_joints_limits_is_refused(planned):
    series = (
        "{fourier: {amplitudes_deg: [20, 20, 20, 20], phases_deg: [0, 0, 0, 0], "
        "frequency_hz: 2, cycles: 2}}"
    )
    with pytest.raises(LimitError, match="wrist_3_joint: velocity"):
        planned(f"{{sweep: {{wrist_3_joint: {series}}}}}")


def test_a_move_that_would_last_for_days_is_refused_in_a_sentence():
    """Ruckig 0.19 answers with a code that its Python does not know: a home of a hundred million
    degrees, mistyped.
    """
    builder = MotionBuilder(ROBOT)
    builder.q[3] = -1e7
    with pytest.raises(PlanError, match="too long for ruckig"):
        builder.move(ROBOT.home, Motion())
