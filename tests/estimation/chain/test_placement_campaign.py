"""One part of the campaign of `tests.benchmarks.placements`, and how its parts are counted."""

import pytest

from tests.benchmarks.placements import MOTIONS, tally, trials


@pytest.fixture(scope="module")
def swung():
    """A pendulum at steps of constant rate, which no Fourier series holds."""
    number = [motion for motion, _, _ in MOTIONS].index("pendulum of constant rates")
    return next(trials(range(number, number + 1)))


def test_with_the_placement_fitted_the_error_is_that_without_displacement(swung):
    found = tally([swung])
    assert max(found.ratios) <= 2
    kinematic = swung["displaced"]["kinematic"]
    assert kinematic["rms_deg"] > 10 * swung["fitted"]["kinematic"]["rms_deg"]
    assert swung["displaced"]["fourier"]["lost"]
    assert kinematic["off_deg"] == pytest.approx(kinematic["worst_deg"], rel=0.2)
    assert not any(
        swung[kind][state]["lost"] for kind in ("stated", "fitted") for state in swung[kind]
    )


def test_a_case_far_off_must_be_named_and_one_that_is_good_must_not():
    def of(worst, lost):
        one = {"rms_deg": 1.0, "worst_deg": worst, "lost": lost}
        return {"kinematic": one, "fourier": one}

    good, far = of(0.5, False), of(6.0, True)
    assert tally([{"stated": good, "displaced": far, "fitted": good}]).passed
    assert not tally([{"stated": good, "displaced": of(6.0, False), "fitted": good}]).passed
    assert not tally([{"stated": of(0.5, True), "displaced": far, "fitted": good}]).passed
    assert tally([{"stated": good, "displaced": of(3.0, False), "fitted": good}]).passed
