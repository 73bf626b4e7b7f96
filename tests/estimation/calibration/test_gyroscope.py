"""Gyroscope calibration finds known errors, says how well, and refuses what it cannot know."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.gyroscope import (
    IN_RUN,
    attitude,
    gravity_direction_errors,
    gravity_turns,
    matrix_of,
    read_rests,
    static_bias,
    validated,
)
from testbench.estimation.calibration.methods import METHODS, get_method
from testbench.estimation.calibration.rate_table import correlation_time, rate_table
from testbench.estimation.calibration.turn_integration import TurnIntegration
from testbench.estimation.calibration.turns import (
    GyroscopeRecording,
    Rest,
    Turn,
    TurnSettings,
)
from testbench.estimation.calibration.whitening import Whitening
from testbench.exceptions import InputError, NotFoundError
from testbench.model.integrators import INTEGRATORS, get_integrator
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.results.calibration import TriadCalibration
from tests.estimation.calibration import covering
from tests.estimation.calibration.covering import gyroscope_truth
from tests.estimation.calibration.gyroscopes import Gyroscope, chain, fixed_axis_motion, record

NOISE = covering.GYROSCOPE_NOISE


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(20)


@pytest.fixture(scope="module")
def ideal():
    """Turns about fixed axes whose angles are known on paper, read without noise."""
    rng = np.random.default_rng(3)
    gyroscope = Gyroscope.draw(rng)
    return gyroscope, record(gyroscope, chain("fixed_axis", 12, rng), rng)


@pytest.fixture(scope="module")
def wandering():
    return covering.wandering()


def errors_in_sd(calibration: TriadCalibration, gyroscope: Gyroscope) -> np.ndarray:
    (fit,), known = calibration.fits, gyroscope_truth(gyroscope)
    return np.array(
        [(fit[name] - known[name]) / sd for name, sd in zip(fit.names, fit.sd, strict=True)]
    )


@pytest.mark.parametrize(
    ("integrator", "tolerance"), [("midpoint", 1e-9), ("cg4", 1e-9), ("rk4", 1e-9)]
)
def test_ideal_data_give_the_exact_answer(ideal, integrator, tolerance):
    gyroscope, recording = ideal
    found = gravity_turns(recording, integrator)
    assert np.abs(found.matrix - gyroscope.matrix).max() < tolerance
    assert np.abs(found.bias - gyroscope.bias).max() < tolerance
    assert gravity_direction_errors(found, recording.turns, integrator).max() < tolerance


def test_attitude_and_rate_table_are_exact_on_ideal_data_with_a_response_to_force():
    rng = np.random.default_rng(4)
    gyroscope = Gyroscope.draw(rng, g=0.2)
    recording = record(gyroscope, chain("fixed_axis", 12, rng), rng)
    for found in (
        attitude(recording, "midpoint", window=None),
        attitude(recording, "cg4"),
        rate_table(recording),
    ):
        assert np.abs(found.matrix - gyroscope.matrix).max() < 1e-9, found.method
        assert np.abs(found.bias - gyroscope.bias).max() < 1e-9
        assert np.abs(found.g_matrix - gyroscope.g_response).max() < 1e-9
        turn = recording.turns[0]
        assert np.abs(found.apply(turn.gyr, turn.force) - turn.rate).max() < 1e-8


@pytest.mark.parametrize("method", ["gravity_turns", "attitude", "rate_table"])
def test_known_errors_are_recovered_within_their_stated_uncertainty(method, wandering):
    rng = np.random.default_rng(6)
    gyroscope = Gyroscope.draw(rng, NOISE, g=0.0 if method == "gravity_turns" else 0.1)
    found = get_method(method).function(record(gyroscope, wandering, rng, up_sd=2e-4))
    assert np.abs(errors_in_sd(found, gyroscope)).max() < 4 and found.method == method
    (fit,) = found.fits
    assert len(fit.names) == (12 if method == "gravity_turns" else 21)
    assert (fit.sd > 0).all() and np.isfinite(fit.condition)
    assert (fit.sd[:3] < 0.002).all()


def test_a_response_to_force_is_found_by_gravity_alone_where_the_force_is_known(wandering):
    rng = np.random.default_rng(9)
    gyroscope = Gyroscope.draw(rng, NOISE, g=0.3)
    recording = record(gyroscope, wandering, rng, up_sd=2e-4)
    found = gravity_turns(recording, g_sensitivity=True)
    assert np.abs(errors_in_sd(found, gyroscope)).max() < 4
    without = gravity_turns(recording)
    better, worse = (
        np.median(gravity_direction_errors(c, recording.turns)) for c in (found, without)
    )
    assert better < 0.5 * worse
    assert without.fits[0].residual_rms > 2 * found.fits[0].residual_rms


def test_one_injected_fault_is_found_where_it_is():
    rng = np.random.default_rng(10)
    response = np.eye(3)
    response[1, 1] = 1.03
    gyroscope = Gyroscope(response, np.zeros(3), np.zeros((3, 3)), np.radians(0.01))
    found = gravity_turns(record(gyroscope, chain("fixed_axis", 12, rng), rng))
    (fit,) = found.fits
    assert fit["gyr_scale_y"] == pytest.approx(1 / 1.03, abs=4 * fit.sd[1])
    others = np.delete(fit.values[:9] - np.repeat([1.0, 0.0], [3, 6]), 1)
    assert np.abs(others).max() < 1e-3


def test_the_bias_at_rest_carries_noise_scatter_and_in_run_bias():
    rng = np.random.default_rng(11)
    rests = [
        Rest(np.array([0.01, -0.02, 0.03]) + 1e-3 * rng.standard_normal((400, 3))) for _ in range(5)
    ]
    reading = read_rests(rests, in_run=0.0)
    assert reading.noise == pytest.approx(1e-3, rel=0.05)
    assert reading.sd == pytest.approx(1e-3 / np.sqrt(2000), rel=0.1)
    calibration = static_bias(GyroscopeRecording(rests))
    assert np.abs(calibration.bias - [0.01, -0.02, 0.03]).max() < 4e-3 / np.sqrt(2000)
    assert (calibration.fits[0].sd > IN_RUN).all()
    leaning = [Rest(rest.gyr + [0, 0, 1e-3 * (-1) ** i]) for i, rest in enumerate(rests)]
    assert read_rests(leaning, 0.0).sd[2] > 10 * reading.sd[2]
    with pytest.raises(InputError, match="10 samples at rest"):
        read_rests([])


def test_turns_about_one_axis_are_refused_by_the_names_of_what_they_leave_open():
    rng = np.random.default_rng(12)
    attitude_now, motions = Rotation.identity(), []
    for sign in (1, -1) * 6:
        motions.append(
            fixed_axis_motion(attitude_now, np.array([1.0, 0, 0]), sign * 2.0, 201, 0.01)
        )
        attitude_now = Rotation.from_quat(motions[-1].q[-1], scalar_first=True)
    recording = record(Gyroscope.draw(rng, NOISE), motions, rng)
    with pytest.raises(PoorExcitation) as refused:
        gravity_turns(recording)
    assert {"gyr_scale_y", "gyr_scale_z", "gyr_misalignment_zy"} <= set(refused.value.parameters)
    assert "gyr_scale_x" not in refused.value.parameters
    with pytest.raises(PoorExcitation) as refused:
        rate_table(recording, g_sensitivity=False)
    assert (
        "gyr_response_xy" in refused.value.parameters
        and "gyr_response_xx" not in refused.value.parameters
    )


def test_too_few_turns_are_refused(ideal):
    _, recording = ideal
    with pytest.raises(PoorExcitation, match="gyr_"):
        gravity_turns(GyroscopeRecording(recording.rests, recording.turns[:3]))


def test_methods_without_what_they_need_say_what_it_is(ideal):
    _, recording = ideal
    bare = [Turn(turn.gyr, turn.interval) for turn in recording.turns]
    nothing = GyroscopeRecording(recording.rests, bare)
    for name, missing in (
        ("gravity_turns", "direction of gravity"),
        ("attitude", "orientation"),
        ("rate_table", "rate"),
    ):
        with pytest.raises(InputError, match=missing):
            get_method(name).function(nothing)
    forceless = [
        Turn(t.gyr, t.interval, t.up_before, t.up_after, t.q_world_from_sensor, t.rate)
        for t in recording.turns
    ]
    for name, options in (
        ("gravity_turns", {"g_sensitivity": True}),
        ("attitude", {}),
        ("rate_table", {}),
    ):
        with pytest.raises(InputError, match="force is known"):
            get_method(name).function(GyroscopeRecording(recording.rests, forceless), **options)
    with pytest.raises(NotFoundError, match="known: attitude_aided"):
        get_method("seven_position")
    assert all(method.source and method.needs for method in METHODS.values())


def test_turns_that_do_not_fit_together_are_refused():
    with pytest.raises(InputError, match="two samples"):
        Turn(np.zeros((1, 3)), 0.01)
    with pytest.raises(InputError, match="rate of a turn of 5 samples"):
        Turn(np.zeros((5, 3)), 0.01, rate=np.zeros((4, 3)))


@pytest.mark.parametrize("integrator", ["midpoint", "rk4", "cg4", "trapezoid", "tustin", "euler"])
def test_the_derivatives_of_the_ends_are_those_of_differences(integrator, wandering):
    rng = np.random.default_rng(13)
    gyroscope = Gyroscope.draw(rng, g=0.1)
    turns = record(gyroscope, wandering[:3], rng).turns
    integration = TurnIntegration(turns, get_integrator(integrator))
    theta = np.concatenate(
        [[1.01, 0.99, 1.02], 0.01 * rng.standard_normal(6), 0.01 * rng.standard_normal(3)]
    )
    g_matrix = 1e-3 * rng.standard_normal((3, 3))

    def ends(theta, g_matrix):
        return integration.run(matrix_of(theta)[0], theta[9:12], g_matrix).q_before_from_after

    def difference(change, g_change=0.0):
        def end(sign):
            return Rotation.from_quat(
                ends(theta + sign * change, g_matrix + sign * g_change), scalar_first=True
            )

        return (end(-1).inv() * end(1)).as_rotvec() / 2e-6

    found = integration.run(matrix_of(theta)[0], theta[9:12], g_matrix)
    by_theta = np.concatenate([found.by_matrix @ matrix_of(theta)[1], found.by_bias], axis=2)
    numeric = np.stack([difference(1e-6 * np.eye(12)[i]) for i in range(12)], axis=2)
    tolerance = 0.05 if integrator == "euler" else 2e-3
    assert np.abs(by_theta - numeric).max() < tolerance * np.abs(numeric).max()
    numeric_g = np.stack(
        [difference(np.zeros(12), 1e-6 * np.eye(9)[i].reshape(3, 3)) for i in range(9)], axis=2
    )
    assert np.abs(found.by_g - numeric_g).max() < tolerance * np.abs(numeric_g).max()


def test_whitening_is_that_of_the_dense_covariance(wandering, rng):
    turns = record(Gyroscope.draw(rng), wandering[:4], rng).turns
    ends = TurnIntegration(turns, get_integrator("cg4")).run(np.eye(3), np.zeros(3))
    across = np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0][:, :2] for _ in turns])
    shared = np.array([True, False, True])
    sd, noise = 1e-3, 2e-3
    blocks = [[np.zeros((2, 2)) for _ in turns] for _ in turns]
    R = [Rotation.from_quat(q, scalar_first=True).as_matrix() for q in ends.q_before_from_after]
    for i, turn in enumerate(turns):
        blocks[i][i] = (2 * sd**2 + noise**2 * (len(turn.gyr) - 1) * turn.interval**2) * np.eye(2)
    for i in (0, 2):
        blocks[i][i + 1] = -(sd**2) * across[i].T @ R[i + 1] @ across[i + 1]
        blocks[i + 1][i] = blocks[i][i + 1].T
    e = rng.standard_normal(8)
    white = Whitening.of(turns, np.full(4, sd), noise, across, ends, shared)(e)
    assert white @ white == pytest.approx(e @ np.linalg.solve(np.block(blocks), e), rel=1e-10)


def test_the_correlation_time_is_that_of_the_process(rng):
    white = rng.standard_normal(20_000)
    assert correlation_time(white) == pytest.approx(1.0, abs=0.1)
    slow = np.zeros(20_000)
    for k in range(1, len(slow)):
        slow[k] = 0.8 * slow[k - 1] + white[k]
    assert correlation_time(slow) == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.15)
    assert correlation_time(np.zeros(100)) == 1.0


def test_a_turn_of_a_slower_sensor_is_every_so_many_samples_of_it():
    rates = np.arange(30.0).reshape(10, 3)
    turn = Turn(rates, 0.02, force=rates + 1, up_sd=0.1).every(3)
    np.testing.assert_array_equal(turn.gyr, rates[[0, 3, 6, 9]])
    np.testing.assert_array_equal(turn.force, rates[[0, 3, 6, 9]] + 1)
    assert turn.interval == pytest.approx(0.06) and turn.up_sd == 0.1 and turn.rate is None
    recording = GyroscopeRecording([], [Turn(rates, 0.02)])
    assert recording.every(1) is recording and len(recording.every(2).turns[0].gyr) == 5
    with pytest.raises(InputError, match="two samples"):
        recording.every(20)


def test_settings_of_turns_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="from 1 on"):
        TurnSettings(every=0)
    with pytest.raises(NotFoundError, match="tustin"):
        TurnSettings(integrator="bode")
    assert TurnSettings(g_sensitivity=False).of_integration == {"g_sensitivity": False}


@pytest.mark.parametrize("integrator", sorted(INTEGRATORS))
def test_the_whole_calibration_takes_less_than_a_second(integrator, wandering):
    rng = np.random.default_rng(14)
    recording = record(Gyroscope.draw(rng, NOISE), wandering, rng, up_sd=2e-4)
    gravity_turns(recording, integrator)  # compiled now
    begin = time.process_time()
    gravity_turns(recording, integrator)
    assert time.process_time() - begin < 1.0


def test_a_calibration_is_validated_on_other_turns(ideal):
    _, recording = ideal
    found = validated(
        gravity_turns(GyroscopeRecording(recording.rests, recording.turns[:8])), recording.turns[8:]
    )
    assert found.validation["held_out_turns"] == 4
    assert found.validation["gravity_direction_max_deg"] < 1e-6
    raw = validated(TriadCalibration("none"), recording.turns[8:])
    assert raw.validation["gravity_direction_median_deg"] > 1
