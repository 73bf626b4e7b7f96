"""What a gyroscope's calibration says of its own uncertainty, and recordings that are too short for
it.
"""

from dataclasses import replace

import numpy as np
import pytest

from testbench.estimation.calibration.gyroscope import IN_RUN, attitude, gravity_turns
from testbench.estimation.calibration.turns import GyroscopeRecording
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.gyroscopes import Gyroscope, chain, record

NOISE = np.radians(0.05)


@pytest.mark.parametrize("samples", [90, 91, 92, 93])
def test_a_turn_may_be_of_any_length(samples):
    """At 60 Hz a piece has 31 samples; with 92 of them two are left over."""
    rng = np.random.default_rng(samples)
    gyroscope, interval = Gyroscope.draw(rng), 1 / 60
    recording = record(
        gyroscope, chain("fixed_axis", 12, rng, interval, (samples - 1) * interval), rng
    )
    assert len(recording.turns[0].gyr) == samples
    found = attitude(recording, g_sensitivity=False)
    np.testing.assert_allclose(
        found.matrix, gyroscope.matrix, atol=3e-4
    )  # what the integrator leaves of a triangle of rates


def test_an_arm_that_repeats_better_than_stated_does_not_narrow_the_uncertainty():
    """The truth is exact, and stated to 0.03 deg: bias and response to gravity hang on the in-run
    bias of the rests all the same. Intervals must hold what they state.
    """
    rng = np.random.default_rng(11)
    motions, stated = chain("wandering", 12, rng, interval=0.02, duration=3.0), np.radians(0.03)
    off = []
    for _ in range(60):
        gyroscope = Gyroscope.draw(rng, NOISE, g=0.1)
        ideal = record(gyroscope, motions, rng, rest_s=1.0, in_run=IN_RUN)
        recording = GyroscopeRecording(
            ideal.rests, [replace(turn, attitude_sd=stated) for turn in ideal.turns]
        )
        (fit,) = attitude(recording).fits
        chi2_of_dof = float(np.sum(fit.residuals**2)) / (fit.residuals.size - len(fit.names))
        assert chi2_of_dof < 0.8
        real = np.concatenate([gyroscope.bias, gyroscope.g_response.reshape(-1)])
        off.append(np.abs(fit.values[9:] - real) <= fit.half_width()[9:])
    assert np.mean(off, axis=0).min() > 0.85


def test_fewer_than_five_degrees_of_freedom_are_refused():
    rng = np.random.default_rng(12)
    recording = record(Gyroscope.draw(rng, NOISE), chain("fixed_axis", 8, rng), rng, up_sd=2e-4)
    with pytest.raises(
        PoorExcitation, match="6 turns and the rests give 15 numbers for 12 parameters; 5 more"
    ):
        gravity_turns(GyroscopeRecording(recording.rests, recording.turns[:6]))
    fit = gravity_turns(recording).fits[0]
    assert np.isinf(fit.dof) or fit.dof >= 5
