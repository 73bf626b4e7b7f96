"""Every accelerometer method: exact on ideal data, right within its own uncertainty, and no surer
of itself than it may be.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.attitude_aided import attitude_aided
from testbench.estimation.calibration.axis_model import orthogonality
from testbench.estimation.calibration.methods import METHODS, methods_of
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.rotational import likeness
from testbench.estimation.calibration.triad_model import ACCELEROMETER
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.covering import DRIFT, NOISE, heated, set_up, truth_for
from tests.estimation.calibration.simulated import (
    GRAVITY,
    SIX,
    UP,
    all_of,
    part,
    poses_of,
    rng,
    truth_of,
    turned,
)


@pytest.mark.parametrize("name", methods_of("accelerometer"))
def test_ideal_readings_give_the_exact_answer(name):
    forces, response, bias = set_up(name)
    calibration = METHODS[name].function(poses_of(forces, response, bias))
    values, _, _ = all_of(calibration.fits)
    np.testing.assert_allclose(values, truth_for(name, response, bias), atol=1e-9)
    corrected = calibration.apply(forces @ response.T + bias)
    if name != "norm_only":  # turned as a whole
        np.testing.assert_allclose(corrected, forces, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(corrected, axis=1), GRAVITY, atol=1e-9)
    assert calibration.method == name


@pytest.mark.parametrize("name", methods_of("accelerometer"))
def test_the_known_errors_lie_within_the_stated_uncertainty(name):
    forces, response, bias = set_up(name)
    truth = truth_for(name, response, bias)
    errors = []
    for seed in range(20):
        poses = poses_of(forces, response, bias, NOISE, rng(seed))
        values, sd, _ = all_of(METHODS[name].function(poses).fits)
        if name.startswith(
            "rotational_nearest"
        ):  # a small rotation about the sensor's axes, not a difference of vectors
            left = Rotation.from_matrix(response) * Rotation.from_rotvec(values[:3]).inv()
            errors.append(
                np.concatenate([left.as_rotvec(), values[3:] - bias[: len(values) - 3]]) / sd
            )
        else:
            errors.append((values - truth) / sd)
    errors = np.array(errors)
    assert np.abs(errors).max() < 5
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.4


@pytest.mark.parametrize("name", ["attitude_aided", "norm_only"])
def test_drift_with_temperature_is_found_where_the_temperature_varied(name):
    function = METHODS[name].function
    temperature = heated().temperature
    calibration = function(heated())
    np.testing.assert_allclose(calibration.drift, DRIFT, atol=1e-9)
    np.testing.assert_allclose(calibration.bias, part()[1], atol=1e-9)
    assert calibration.reference == pytest.approx(temperature.mean())
    lengths = np.linalg.norm(calibration.apply(heated().mean, temperature=temperature), axis=1)
    np.testing.assert_allclose(lengths, GRAVITY, atol=1e-8)
    steady = function(replace(heated(), temperature=20 + (temperature - temperature.mean()) / 160))
    assert not steady.drift.any()
    assert steady.reference is None


def test_the_arms_orientation_is_worth_what_its_covariance_says():
    """Measured gain over the norm alone equals the predicted one, for the parameters that both
    have: bias and scale.
    """
    forces, (response, bias) = turned(UP, 24), part()
    truth = truth_of("norm_only", response, bias)
    predicted, errors = [], []
    draw = rng(3)
    for _ in range(400):
        poses = poses_of(forces, response, bias, NOISE, draw, direction_sd=5e-4)
        by_norm, by_arm = norm_only(poses), attitude_aided(poses)
        predicted.append([by_norm.fits[0].sd[6:], by_arm.fits[0].sd[9:]])
        errors.append([by_norm.bias - truth[6:], by_arm.bias - bias])
    measured = np.sqrt(np.mean(np.square(errors), axis=0))
    stated = np.sqrt(np.mean(np.square(predicted), axis=0))
    np.testing.assert_allclose(measured[0] / measured[1], stated[0] / stated[1], rtol=0.12)
    assert (measured[1] < measured[0]).all()


def test_a_vague_direction_costs_nothing_against_the_norm_alone():
    """Where the arm hardly knows the direction, what is left is what the norm says."""
    forces, (response, bias) = turned(UP, 30), part()
    poses = poses_of(forces, response, bias, NOISE, rng(1))
    vague = attitude_aided(replace(poses, direction_sd=np.radians(0.5))).fits[0]
    blind = norm_only(poses).fits[0]
    np.testing.assert_allclose(vague.sd[9:], blind.sd[6:], rtol=0.02)


@given(st.integers(0, 10_000))
def test_norm_only_does_not_care_how_the_whole_is_turned(seed):
    """A frame turned before the sensor changes nothing: lengths are all it sees."""
    response, bias = part(seed, 0.03, 0.3)
    R = Rotation.random(rng=rng(seed)).as_matrix()
    forces = turned(UP, 16, seed)
    a, b = (
        norm_only(poses_of(forces, response, bias)),
        norm_only(poses_of(forces @ R.T, response, bias)),
    )
    np.testing.assert_allclose(a.matrix, b.matrix, atol=1e-8)
    assert np.abs(np.tril(a.matrix, -1)).max() == 0.0
    c = norm_only(poses_of(forces, response @ R, bias))
    np.testing.assert_allclose(a.fits[0].values, c.fits[0].values, atol=1e-7)


def test_the_worked_example_of_the_thesis():
    """Castellanos Alonso 2023, annex G: the printed matrix to four digits, its determinant, and
    what it hides.
    """
    B = np.array(
        [
            [7.6467, 6.1838, -0.2367],
            [6.3236, -7.5506, -0.2625],
            [0.0265, -0.0547, 9.6081],
            [0.0657, -0.0071, -10.0659],
            [-7.5156, -6.2212, -0.2421],
            [7.6009, 6.2452, -0.2297],
        ]
    )
    A = GRAVITY * np.array([[-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 1], [1, 0, 0], [-1, 0, 0]])
    poses = StaticPoses(B, np.full((6, 3), 1e-6), expected=A)
    mapped = METHODS["rotational_3d"].function(poses)
    printed = [[-0.7665, -0.6419, -0.0032], [-0.6310, 0.7702, 0.0004], [-0.0230, 0.0160, -0.9956]]
    np.testing.assert_allclose(mapped.matrix, printed, atol=5e-5)
    near = likeness(mapped.matrix)
    assert near.determinant == pytest.approx(0.9910, abs=5e-5)
    assert any("0.9910" in remark for remark in mapped.remarks)
    np.testing.assert_allclose(near.R @ near.R.T, np.eye(3), atol=1e-12)
    assert np.linalg.norm(mapped.matrix - near.R) == pytest.approx(near.distance)
    # Beside it: a rotation and a bias of 24 mg in z, which the map without a bias has smeared over
    # its entries.
    rotated = METHODS["rotational_nearest_bias"].function(poses)
    np.testing.assert_allclose(rotated.matrix @ rotated.matrix.T, np.eye(3), atol=1e-12)
    kabsch, _ = Rotation.align_vectors(A - A.mean(axis=0), B - B.mean(axis=0))
    np.testing.assert_allclose(rotated.matrix, kabsch.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(rotated.bias[2], -0.2386, atol=5e-4)

    def left(calibration):
        return np.sqrt(np.mean((calibration.apply(B) - A) ** 2))

    with_bias = METHODS["rotational_3d_bias"].function(poses)
    assert left(with_bias) < left(rotated) < left(mapped)


def test_orthogonality_by_six_turns_of_60_degrees():
    turns = np.radians(np.arange(0, 360, 60))
    forces = GRAVITY * np.column_stack([np.cos(turns), np.zeros(6), np.sin(turns)])
    good = orthogonality(poses_of(forces, np.eye(3), np.zeros(3)))
    np.testing.assert_allclose(good.theta, [1, 0, 0, 1, 0], atol=1e-12)
    assert good.axes == ("x", "z")
    assert good.angle == pytest.approx(np.pi / 2, abs=1e-12)
    draw, inside, off = rng(1), 0, np.radians(0.6)
    response = np.array([[1, 0, 0], [0, 1, 0], [1.02 * np.sin(off), 0, 1.02 * np.cos(off)]])
    for _ in range(1000):
        found = orthogonality(poses_of(forces, response, np.array([0.05, 0, -0.02]), NOISE, draw))
        inside += abs(found.angle - (np.pi / 2 - off)) <= found.angle_half_width
    assert 930 <= inside <= 970
    assert found.scale[1] == pytest.approx(1.02, abs=1e-3)
    assert found.fits[0]["bias_x"] == pytest.approx(0.05, abs=5e-3)
    with pytest.raises(PoorExcitation, match="response_x"):
        orthogonality(poses_of(forces[:2].repeat(3, axis=0), np.eye(3), np.zeros(3)))


@pytest.mark.parametrize("name", ["six_position", "ferraris"])
@pytest.mark.parametrize("missing", range(6))
def test_five_faces_are_refused_and_the_missing_one_is_named(name, missing):
    faces = ["+x", "-x", "+y", "-y", "+z", "-z"]
    poses = poses_of(np.delete(SIX, missing, axis=0), np.eye(3), np.zeros(3))
    with pytest.raises(PoorExcitation) as caught:
        METHODS[name].function(poses)
    axis = faces[missing][1]
    assert faces[missing] in str(caught.value)
    assert caught.value.parameters == (f"bias_{axis}", f"response_{axis}{axis}")


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("name", ["attitude_aided", "axis_model", "norm_only"])
def test_poses_about_one_axis_are_refused_and_the_blind_parameters_named(name, noise):
    angles = np.linspace(0, 6, 20)
    plane = GRAVITY * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(20)])
    poses = poses_of(plane, np.eye(3), np.zeros(3), noise, rng(1) if noise else None)
    with pytest.raises(PoorExcitation) as caught:
        METHODS[name].function(poses)
    assert any(parameter.endswith("z") for parameter in caught.value.parameters)
    assert "bias_x" not in caught.value.parameters


def test_too_few_poses_are_refused():
    few = poses_of(turned(UP, 8), np.eye(3), np.zeros(3))
    with pytest.raises(PoorExcitation, match="8 poses are fewer than 9"):
        norm_only(few)
    with pytest.raises(PoorExcitation, match="9 observations are fewer"):
        attitude_aided(few.subset(np.arange(3)))


@pytest.mark.parametrize(
    "name", [name for name, method in methods_of("accelerometer").items() if "arm" in method.asks]
)
def test_methods_that_need_the_arm_say_so(name):
    with pytest.raises(InputError, match="orientation is known"):
        METHODS[name].function(replace(poses_of(SIX, np.eye(3), np.zeros(3)), expected=None))


def test_a_crooked_plane_is_refused_by_the_flat_method():
    with pytest.raises(InputError, match="plane of two axes"):
        METHODS["rotational_2d"].function(poses_of(SIX, np.eye(3), np.zeros(3)))


def test_nothing_vague_gets_through():
    """Whatever is not refused has every uncertainty below what was known before."""
    fit = attitude_aided(poses_of(turned(UP, 6), *part(), 0.02, rng(2))).fits[0]
    assert (fit.sd[:9] < ACCELEROMETER.response).all()
    assert (fit.sd[9:] < ACCELEROMETER.bias).all()
