"""Hard iron, soft iron, and the magnetometer's axes against the accelerometer's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.methods import METHODS, methods_of
from testbench.estimation.calibration.validation import cross_validate, validate
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.covering import (
    FIELD_NOISE,
    WORLD,
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
