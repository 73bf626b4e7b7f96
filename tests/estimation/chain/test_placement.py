"""What wrong placement does to the chain filter, and how it is found from innovations."""

from dataclasses import replace

import numpy as np
import pytest

from testbench.estimation.chain.placement import Constants, moved
from testbench.estimation.chain.placement_check import check_placement, doubted
from testbench.estimation.chain.prefit import fit_placement
from testbench.estimation.chain.run import run_filter
from testbench.estimation.chain.sensors import read_placement, read_sensor
from testbench.estimation.chain.smoother import run_smoother


@pytest.fixture(scope="module")
def constants(sensors):
    return Constants.of(sensors, np.radians(3.0), 0.01, 0.05)


@pytest.fixture(scope="module")
def recorded(sensors, constants, white_jerk, measure):
    """A lively motion of 3 s, read by sensors elsewhere than stated, and where they were."""
    rng = np.random.default_rng(15)
    motion = white_jerk(300, np.radians(60.0), np.radians(0.1), rng)
    values = 0.7 * constants.sd * rng.normal(size=len(constants.sd))
    off = moved(sensors, constants, values)
    stated, displaced = (measure(motion, np.random.default_rng(3)) for _ in range(2))
    for i, (reading, rest) in enumerate(((stated, stated.mean), (displaced, displaced.mean))):
        own = off if i else sensors
        zero = np.zeros(len(sensors.joints))
        rest += own.readings(motion[0, 0], zero, zero)[0]
        rest -= sensors.readings(motion[0, 0], zero, zero)[0]
        change = [own.readings(*m)[0] - sensors.readings(*m)[0] for m in motion[1:]]
        reading.reading[:] += np.concatenate(change)
    return stated, displaced, values


@pytest.fixture(scope="module")
def lively(settings):
    return replace(settings, start_sd=np.radians(0.1), process_noise=np.radians(60.0))


def test_the_derivatives_by_placement_and_lengths_are_those_of_differences(sensors, constants):
    rng = np.random.default_rng(0)
    motion = rng.normal(size=(3, len(sensors.joints)))
    by, unused = np.empty((6, 6 + sensors.columns.shape[1])), np.zeros((3, 6, motion.shape[1]))
    step = 1e-6
    for s in range(len(sensors.sensors)):
        reading = np.empty(6)
        read_sensor(sensors.arrays, s, motion, reading, unused)
        read_placement(sensors.arrays, s, motion, reading, by)
        expected = np.zeros((6, len(constants.sd)))
        expected[:, 6 * s : 6 * s + 6] = by[:, :6]
        for k, constant in enumerate(constants.lengths[s]):
            if constant >= 0:
                expected[:, constant] = by[:, 6 + k]
        for c in range(len(constants.sd)):
            shifted = []
            for sign in (1, -1):
                own = np.empty(6)
                value = sign * step * np.eye(len(constants.sd))[c]
                read_sensor(moved(sensors, constants, value).arrays, s, motion, own, unused)
                shifted.append(own)
            found = (shifted[0] - shifted[1]) / (2 * step)
            np.testing.assert_allclose(found, expected[:, c], atol=2e-7)


@pytest.mark.parametrize("run", [run_filter, run_smoother])
def test_the_angles_move_with_the_placement_as_the_effect_says(
    sensors, constants, recorded, lively, run
):
    """A filter that holds the constants at a small value, less one that holds them at zero."""
    samples = recorded[0].until(1.0)
    value = 1e-4 * constants.sd
    plain = run(sensors, lively, samples, constants)
    held = run(moved(sensors, constants, value), lively, samples, constants)
    expected = held.mean[:, 0] - plain.mean[:, 0]
    # what the standard deviations would be if the constants were known to lie along that value
    known = replace(constants, covariance=np.outer(value, value))
    sd = run(sensors, lively, samples, known).sd[:, 0]
    extra = np.sqrt(np.maximum(sd**2 - plain.sd[:, 0] ** 2, 0))
    np.testing.assert_allclose(extra[-100:], np.abs(expected[-100:]), atol=2e-6, rtol=0.05)


def test_a_fit_finds_where_the_sensors_sit_and_says_how_well(sensors, constants, recorded, lively):
    _, displaced, values = recorded
    fit = fit_placement(sensors, lively, displaced, constants, lambda placed, own: own)
    assert fit.settled
    normalised = (fit.values - values) / fit.sd
    assert np.sqrt(np.mean(normalised**2)) < 1.6
    told = fit.sd < 0.5 * constants.sd
    assert told.sum() > 6  # the rest is held by the prior, and named
    assert (len(fit.held) > 0) == (not told.all())
    error, before = np.abs(fit.values - values)[told], np.abs(values)[told]
    assert np.median(error / before) < 0.4


def test_lost_is_what_wrong_placement_makes_of_the_filter_not_noise(sensors, recorded, lively):
    stated, displaced, _ = recorded
    doubt = doubted(sensors)
    good = check_placement(run_filter(sensors, lively, stated, doubt), doubt)
    lost = check_placement(run_filter(sensors, lively, displaced, doubt), doubt)
    assert not good.lost and np.degrees(good.off.max()) < 1.0
    assert lost.lost and lost.evidence > 50 * good.evidence
    facts = lost.facts(sensors.joints)
    assert facts["placement_off_deg"] == pytest.approx(np.degrees(lost.off.max()))
    unsettled = check_placement(run_filter(sensors, lively, stated, doubt), doubt, settled=False)
    assert unsettled.lost


def test_without_constants_nothing_is_added(sensors, recorded, lively):
    samples = recorded[0].until(0.5)
    plain = run_filter(sensors, lively, samples)
    beside = run_filter(sensors, lively, samples, doubted(sensors))
    np.testing.assert_array_equal(plain.mean, beside.mean)
    np.testing.assert_array_equal(plain.sd, beside.sd)
