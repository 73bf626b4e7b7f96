"""The real gyroscope of imu_tk: 38 rests held by hand and the turns between them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from testbench.clock import SystemClock
from testbench.estimation.calibration.gyroscope import (
    gravity_direction_errors,
    gravity_turns,
    static_bias,
)
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import TrueVector, static_poses
from testbench.estimation.calibration.turns import GyroscopeRecording, turns_between_rests
from testbench.formats import import_recording
from testbench.formats.vendors.imu_tk import COUNTS_PER_RAD_S, LOCAL_GRAVITY
from testbench.frames import NANOSECONDS
from testbench.model.integrators import INTEGRATORS

pytestmark = pytest.mark.data
INTERVAL = 0.01
INITIAL_REST_S = 50.0


def rests_of(acc: np.ndarray) -> list[tuple[int, int]]:
    """Rests of 1.5 s or more: the variance over 1 s stays below six times that of the initial rest
    (after Tedaldi 2014).
    """
    window = round(1 / INTERVAL)
    mean = uniform_filter1d(acc, window, axis=0)
    variance = uniform_filter1d(np.sum((acc - mean) ** 2, axis=1), window)
    quiet = variance[window : round(INITIAL_REST_S / INTERVAL) - window].mean()
    moving = maximum_filter1d((variance > 6 * quiet).astype(np.int8), window)
    edges = np.flatnonzero(np.diff(moving, prepend=1, append=1))
    return [(int(b), int(e)) for b, e in edges.reshape(-1, 2) if e - b > 1.5 / INTERVAL]


@pytest.fixture(scope="module")
def recording(data, tmp_path_factory) -> GyroscopeRecording:
    files = [data / "imu_tk" / f"xsens_{kind}.mat" for kind in ("acc", "gyro")]
    samples = import_recording(
        "imu_tk", files, tmp_path_factory.mktemp("imu_tk") / "session", SystemClock()
    ).imu("imu")
    time = samples.device_time_ns / NANOSECONDS
    regular = np.arange(time[0], time[-1], INTERVAL)
    acc, gyr = (
        np.column_stack([np.interp(regular, time, x[:, i]) for i in range(3)])
        for x in (samples.acc, samples.gyr)
    )
    rests = rests_of(acc)
    accelerometer = norm_only(
        static_poses(acc, np.array(rests), times=regular, true=TrueVector(LOCAL_GRAVITY))
    )
    return turns_between_rests(gyr, INTERVAL, rests, accelerometer.apply(acc), up_sd=2e-4)


def test_the_recording_has_its_known_rests(recording):
    assert len(recording.rests) == 38
    assert len(recording.rests[0].gyr) * INTERVAL > 49


def test_scales_agree_between_integrators_and_with_the_sensitivity_that_the_turns_show(recording):
    """4780 counts per rad/s is where imu_tk's own search ends; testbench/formats/vendors/imu_tk.py
    says why.
    """
    for name in INTEGRATORS:
        found = gravity_turns(GyroscopeRecording(recording.rests[:1], recording.turns), name)
        (fit,) = found.fits
        counts = COUNTS_PER_RAD_S / fit.block("gyr_scale_")
        assert counts == pytest.approx([4780, 4765, 4772], rel=2e-3), name
        assert np.abs(fit.block("gyr_misalignment_")).max() < 0.06
        assert (fit.sd[:9] < 0.003).all() and fit.condition < 10
        assert np.degrees(found.bias - recording.rests[0].gyr.mean(axis=0)) == pytest.approx(
            0, abs=0.1
        )


def test_held_out_turns_are_better_by_far_with_scales_and_better_still_with_the_response_to_gravity(
    recording,
):
    train = GyroscopeRecording(recording.rests, recording.turns[::2])
    held_out = recording.turns[1::2]

    def median_deg(calibration):
        return float(np.median(np.degrees(gravity_direction_errors(calibration, held_out))))

    bias = median_deg(static_bias(train))
    nine = median_deg(gravity_turns(train))
    with_g = median_deg(gravity_turns(train, g_sensitivity=True))
    assert bias > 1.5
    assert nine < 0.5 * bias
    assert with_g < 0.2 and with_g < 0.3 * nine


def test_the_gyroscope_feels_gravity_and_its_rests_say_so(recording):
    found = gravity_turns(recording, g_sensitivity=True)
    (fit,) = found.fits
    response, sd = fit.block("gyr_g_"), fit.sd[12:]
    assert (np.abs(response) > 4 * sd).sum() >= 5
    assert np.degrees(np.abs(response).max() * LOCAL_GRAVITY) < 0.3
    assert (fit.sd[:9] < 0.0006).all()
    halves = [
        gravity_turns(
            GyroscopeRecording(recording.rests, recording.turns[i::2]), g_sensitivity=True
        ).fits[0]
        for i in (0, 1)
    ]
    apart = (halves[0].values - halves[1].values)[:9] / np.hypot(halves[0].sd, halves[1].sd)[:9]
    assert np.abs(apart).max() < 4
