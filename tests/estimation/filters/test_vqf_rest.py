"""VQF's rest detection and slow sweeps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.filters import UniformSamples, get_filter
from tests.estimation.filters.motions import FIELD, UP, inclination_deg


@pytest.mark.parametrize("name", ["vqf_6d", "vqf_9d"])
@pytest.mark.parametrize(("amplitude_deg", "frequency_hz"), [(5, 0.1), (10, 0.05), (15, 0.03)])
def test_a_slow_sweep_is_learnt_as_a_bias_unless_rest_detection_is_off(
    name, amplitude_deg, frequency_hz
):
    """Rates that stay within 2 deg/s of their mean look like rest; a perfect sensor then drifts off
    by degrees.
    """
    t = np.arange(6000) / 60.0
    angle = np.radians(amplitude_deg) * np.sin(2 * np.pi * frequency_hz * np.clip(t - 3, 0, None))
    true = Rotation.from_rotvec(angle[:, None] * [1.0, 0, 0])
    gyr = np.diff(angle, prepend=0)[:, None] * 60 * np.array([1.0, 0, 0])
    samples = UniformSamples(1 / 60, gyr, true.inv().apply(UP), true.inv().apply(FIELD))
    q_true = true.as_quat(scalar_first=True)
    assert inclination_deg(get_filter(name).run(samples), q_true).max() > 1.0
    assert inclination_deg(get_filter(name, {"rest_bias": 0}).run(samples), q_true).max() < 0.01
