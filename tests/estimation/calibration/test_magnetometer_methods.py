"""Hard iron, soft iron, and the magnetometer's axes against the accelerometer's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.magnetometer_axes import align_axes
from testbench.estimation.calibration.methods import METHODS, methods_of
from testbench.estimation.calibration.validation import cross_validate, validate
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.covering import (
    DIP,
    FIELD_NOISE,
    WORLD,
    as_often_as_stated,
    field_poses,
    iron,
    iron_truth,
)
from tests.estimation.calibration.simulated import FIELD, all_of, poses_of, rng

STRENGTH = float(np.linalg.norm(FIELD))
EXPECTED = WORLD.apply(FIELD)
VERTICAL = WORLD.apply([0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", methods_of("magnetometer"))
def test_ideal_readings_give_the_exact_answer(name):
    poses = field_poses()
    calibration = METHODS[name].function(poses)
    np.testing.assert_allclose(calibration.fits[0].values, iron_truth(name), rtol=1e-9, atol=1e-9)
    corrected = calibration.apply(poses.mean)
    np.testing.assert_allclose(np.linalg.norm(corrected, axis=1), STRENGTH, atol=1e-8)
    if name != "ellipsoid":  # in its own axes
        np.testing.assert_allclose(corrected, EXPECTED, atol=1e-8)
    assert calibration.method == name


def test_an_unknown_strength_is_taken_from_the_ellipsoid_and_leaves_directions_alone():
    known, unknown = (
        replace(field_poses(), magnitude=length) for length in (STRENGTH, float("nan"))
    )
    for name in ("ellipsoid", "ellipsoid_dip"):
        a, b = (METHODS[name].function(poses) for poses in (known, unknown))
        ratio = b.apply(known.mean) / a.apply(known.mean)
        np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-7)
        np.testing.assert_allclose(a.bias, b.bias, atol=1e-7)
        assert any("not given" in remark for remark in b.remarks)
    assert 0.9 < ratio[0, 0] < 1.1


def test_the_axes_are_aligned_by_a_dip_that_does_not_change():
    crooked = Rotation.from_rotvec([0.2, -0.5, 0.3])
    R, fit = align_axes(crooked.inv().apply(EXPECTED), VERTICAL)
    np.testing.assert_allclose(R, crooked.as_matrix(), atol=1e-9)
    assert fit["dip"] == pytest.approx(DIP, abs=1e-9)
    draw, inside = rng(4), np.zeros(4)
    for _ in range(300):
        field = crooked.inv().apply(
            Rotation.from_rotvec(0.003 * draw.standard_normal((24, 3))).apply(EXPECTED)
        )
        R, fit = align_axes(field, VERTICAL)
        left = (crooked * Rotation.from_matrix(R).inv()).as_rotvec()
        inside += np.abs(np.append(left, fit["dip"] - DIP)) <= fit.half_width()
    assert as_often_as_stated(inside, 300), inside


def test_axes_turned_by_a_whole_quarter_are_found_too():
    quarter = Rotation.from_euler("XYZ", [180, 90, 0], degrees=True)
    R, _ = align_axes(quarter.inv().apply(EXPECTED), VERTICAL)
    np.testing.assert_allclose(R, quarter.as_matrix(), atol=1e-9)


@pytest.mark.parametrize("name", methods_of("magnetometer"))
@pytest.mark.parametrize("noise", [0.0, FIELD_NOISE])
def test_turning_about_the_vertical_only_is_refused(name, noise):
    level = Rotation.from_rotvec(np.linspace(0, 6.1, 24)[:, None] * [0.0, 0, 1]).inv()
    poses = poses_of(level.apply(FIELD), *iron(), noise, rng(2) if noise else None)
    with pytest.raises(PoorExcitation) as caught:
        METHODS[name].function(replace(poses, vertical=level.apply([0.0, 0, 1])))
    assert any("z" in parameter for parameter in caught.value.parameters)


def test_the_dip_needs_the_accelerometer():
    with pytest.raises(InputError, match="needs the vertical"):
        METHODS["ellipsoid_dip"].function(replace(field_poses(), vertical=None))


def test_held_out_figures_are_in_microtesla():
    poses = field_poses(rng(3))
    calibration = METHODS["known_field"].function(poses)
    figures = validate(calibration, field_poses(rng(4)), magnetometer=True)
    assert 0.03 < figures["field_norm_rms_ut"] < 0.3
    assert figures["direction_rms_deg"] < 0.5
    crossed = cross_validate(METHODS["ellipsoid"].function, poses, magnetometer=True)
    assert crossed["held_out_poses"] == 24
    assert crossed["field_norm_rms_ut"] < 0.5
    assert all(value == value for values in (figures, crossed) for value in values.values())
    assert all_of(calibration.fits)[0].shape == (12,)
