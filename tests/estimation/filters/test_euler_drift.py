"""Yaw drift of the simple Euler-angle filter under coupled roll, and its absence in the improved
one.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.filters import UniformSamples, get_filter
from tests.estimation.filters.motions import UP


def leg(roll_deg: float, phase_deg: float, offset_deg: float) -> tuple[UniformSamples, np.ndarray]:
    """Fourteen gait cycles at 0.9 Hz, 400 Hz, pitch 30 deg sin, roll offset and swing; a perfect
    gyroscope, yaw zero.
    """
    t = np.arange(round(14 / 0.9 * 400) + 1) / 400
    w = 2 * np.pi * 0.9 * t
    angles = np.column_stack(
        [0 * t, 30 * np.sin(w), offset_deg + roll_deg * np.sin(w + np.radians(phase_deg))]
    )
    true = Rotation.from_euler("ZYX", angles, degrees=True)
    gyr = np.vstack([np.zeros(3), (true[:-1].inv() * true[1:]).as_rotvec() * 400])
    return UniformSamples(1 / 400, gyr, true.inv().apply(UP)), angles


def yaw_drift_deg(name: str, samples: UniformSamples) -> float:
    """Yaw at the end, unwrapped; it is zero in truth."""
    q = Rotation.from_quat(get_filter(name).run(samples), scalar_first=True)
    return float(np.degrees(np.unwrap(q.as_euler("ZYX")[:, 0]))[-1])


@pytest.mark.parametrize(
    ("roll_deg", "phase_deg", "offset_deg", "drift_deg"),
    [(2, 90, 10, 45), (5, 90, 0, 115), (5, 90, 10, 113), (2, 0, 10, 0), (0, 0, 10, 0)],
)
@pytest.mark.parametrize("printed", [False, True])
def test_the_simple_prediction_drifts_by_tens_of_degrees_and_the_improved_one_does_not(
    roll_deg, phase_deg, offset_deg, drift_deg, printed
):
    """A drift of 50 to 60 deg, and of less than 10 to 20 deg after the improvement, was published
    (Cabezuelo 2019).
    """
    samples, _ = leg(roll_deg, phase_deg, offset_deg)
    suffix = "_as_printed" if printed else ""
    assert abs(yaw_drift_deg(f"euler_ekf_simple{suffix}", samples)) == pytest.approx(
        drift_deg, abs=3
    )
    assert abs(yaw_drift_deg("euler_ekf", samples)) < 0.35


def test_what_text_and_program_cost_on_a_leg_that_begins_inclined():
    """The misprint in the rate of roll hundredths of a degree, the start at zero all of it."""
    samples, angles = leg(5, 90, 20)
    error = {}
    for name in ("euler_ekf", "euler_ekf_as_printed", "euler_ekf_listing"):
        q = get_filter(name, {"acc_gate_m_s2": 1e-9}).run(samples)  # prediction alone
        roll = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX", degrees=True)[:, 2]
        error[name] = np.ptp(roll - angles[:, 2])
    assert error["euler_ekf"] < 0.01 < error["euler_ekf_as_printed"] < 0.5
    assert error["euler_ekf_listing"] > 20
