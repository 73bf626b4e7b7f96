import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.pipeline.run import run
from tests.asking import run_of

ERROR_DEG = [8.0, -12.0, 6.0]


@pytest.mark.parametrize("calibrate", ["none", "static_poses"])
def test_rates_and_gravity_find_a_crooked_mounting(altered_protocol, tmp_path, calibrate):
    """Calibration poses show the mounting by gravity, the moves between them by rates; the filter
    only gives the heading.
    """

    def change(protocol):
        protocol["sensors"]["forearm"]["mounting_error"] = {
            "rotation_deg": {"XYZ": list(ERROR_DEG)}
        }
        protocol["estimate"] = {
            "filters": ["device", "vqf_6d"],
            "align": "rates",
            "calibrate": calibrate,
        }

    result = run(run_of(altered_protocol("calibration_3d", change), logs=tmp_path))
    sensor = result.estimate.sensors["forearm"]
    real = Rotation.from_euler("XYZ", ERROR_DEG, degrees=True)
    for key in ("device", "vqf_6d"):
        fit = sensor.frames[key]
        assert fit.method == "rates"
        found = Rotation.from_rotvec(fit.mounting_deg, degrees=True)
        if calibrate == "none":
            assert np.degrees((found * real.inv()).magnitude()) < 0.3
        else:  # the calibration has turned the triads already
            assert np.degrees(found.magnitude()) < 0.3
    rows = {row.filter: row for row in result.evaluation.orientation}
    assert rows["device"].inclination_rmse_deg < 0.5


def test_a_single_pose_is_warned_of(altered_protocol, tmp_path):
    def change(protocol):
        protocol["estimate"]["align"] = "rates"
        protocol["sections"] = protocol["sections"][1:]
        protocol["sections"][0]["steps"] = [{"name": "rest", "dwell_s": 10}]

    result = run(run_of(altered_protocol("static_noise", change), logs=tmp_path))
    sensor = result.estimate.sensors["matrix"]
    assert sensor.frames["vqf_6d"].method == "heading"
    assert any("the mounting cannot be solved" in str(found) for found in sensor.findings)
