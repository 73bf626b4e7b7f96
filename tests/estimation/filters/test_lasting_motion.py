"""What filters make of motion that lasts: of accelerations that hang together, and of a start in
motion. Where one fails, its page says so.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.filters import UniformSamples, get_filter
from testbench.model import rotation
from tests.estimation.filters.motions import UP, degrees_between, heading_deg, wander
from tests.estimation.filters.test_agreement import imufusion_loop
from tests.estimation.filters.test_broad_trials import Trial

NORTH = np.array([0.0, 20.0, -40.0])


def shaken(seconds: float = 90.0, rate: float = 100.0) -> tuple[UniformSamples, np.ndarray]:
    """A wandering sensor with a perfect gyroscope that comes to be carried to and fro, 3 m/s^2 at
    0.4 Hz.
    """
    samples, true = wander(seconds, rate, noise=0.0)
    t = np.arange(len(samples)) / rate
    there = np.column_stack([3.0 * np.sin(2.5 * t), 2.0 * np.cos(1.7 * t), 0 * t])
    there *= np.clip(t / 10 - 0.2, 0, 1)[:, None]
    carried = Rotation.from_quat(true, scalar_first=True).inv().apply(UP + there)
    return UniformSamples(samples.interval, samples.gyr, carried, samples.mag), true


def test_accelerations_that_last_do_not_pass_for_a_bias():
    samples, true = shaken()
    heading = heading_deg(get_filter("mekf_imu").run(samples), true)
    assert np.abs(heading - heading[0]).max() < 3.0


def test_gravity_cannot_turn_the_heading_of_a_filter_that_knows_its_bias():
    samples, true = shaken()
    known = {"bias_sd_rad_s": 0.0, "bias_walk_rad_s2_sqrthz": 0.0, "acc_sd_m_s2": 2.0}
    heading = heading_deg(get_filter("mekf_imu", known).run(samples), true)
    assert np.abs(heading - heading[0]).max() < 0.5


def heading_rms_deg(name: str, trial: Trial, **parameters: float) -> float:
    """Heading error of a real trial while it moves, against that of its beginning."""
    q = get_filter(name, parameters).run(trial.samples)
    known = np.isfinite(trial.true).all(axis=1)
    off = rotation.multiply(q[known], rotation.conjugate(trial.true[known]))
    heading = np.unwrap(rotation.heading_angle(off))
    moving = (heading - np.median(heading[:500]))[trial.counted[known]]
    return float(np.degrees(np.sqrt(np.mean(moving**2))))


@pytest.mark.data
@pytest.mark.parametrize("number", ["06", "10", "16"])
def test_of_real_motion_the_mekf_keeps_the_heading_as_well_as_the_gyroscope_alone(data, number):
    trial = Trial(next((Path(data) / "broad").glob(f"{number}_*.mat")))
    alone = heading_rms_deg("gyro", trial)
    assert heading_rms_deg("mekf_imu", trial) < 1.25 * alone


@pytest.mark.data
def test_of_real_motion_imufilter_fails_as_its_page_says_and_not_with_another_setting(data):
    trial = Trial(next((Path(data) / "broad").glob("10_*.mat")))
    alone = heading_rms_deg("gyro", trial)
    assert heading_rms_deg("imufilter", trial) > 10 * alone
    assert heading_rms_deg("imufilter", trial, linear_acc_var_m2_s4=1.0) < 1.25 * alone


def test_fusion_loses_what_turns_in_its_first_seconds_as_its_authors_package_does():
    rate, n = 100.0, 1000
    t = np.arange(n) / rate
    turning = (t > 0.2) & (t < 2.2)
    gyr = np.column_stack([0 * t, 0 * t, np.radians(30.0) * turning])  # 60 deg about the vertical
    true = Rotation.from_rotvec(np.cumsum(gyr, axis=0) / rate)
    samples = UniformSamples(1 / rate, gyr, np.tile(UP, (n, 1)), true.inv().apply(NORTH))
    ours = get_filter("fusion").run(samples)
    assert degrees_between(ours[1:], imufusion_loop(samples, {}, magnetometer=False)) < 5e-3
    q = true.as_quat(scalar_first=True)
    lost = heading_deg(ours, q)
    assert abs(lost[-1] - lost[0]) > 55
    kept = heading_deg(get_filter("mahony_imu").run(samples), q)
    assert abs(kept[-1] - kept[0]) < 1
    # with a rest before, nothing is lost
    later = UniformSamples(
        1 / rate,
        *(np.vstack([np.tile(own[:1], (310, 1)), own]) for own in (gyr, samples.acc, samples.mag)),
    )
    rested = heading_deg(get_filter("fusion").run(later)[310:], q)
    assert abs(rested[-1] - rested[0]) < 1
