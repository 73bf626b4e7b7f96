"""A calibration file is what its model says, and what earlier versions wrote and read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from testbench.exceptions import FileProblems, InputError
from testbench.records.results.calibration_file import load_calibration, save_calibration

EARLIER = Path(__file__).parents[1] / "golden" / "calibrations" / "forearm.yaml"
"""By a version that put each entry together by hand: three triads of drawn numbers, one with
response to force and drift, one without a fit; a mounting, a warning and a note.
"""


def test_what_is_read_is_written_again_to_the_last_byte(tmp_path: Path) -> None:
    """So earlier versions go on reading what this one writes."""
    save_calibration(tmp_path / "again.yaml", load_calibration(EARLIER))
    assert (tmp_path / "again.yaml").read_bytes() == EARLIER.read_bytes()


def test_a_file_of_an_earlier_version_is_read_as_it_was_meant() -> None:
    content = yaml.safe_load(EARLIER.read_text(encoding="utf-8"))
    found = load_calibration(EARLIER)
    assert (found.sensor, found.device, found.temperature) == ("forearm", "D422CD0001", 23.5)
    assert list(found.triads) == ["accelerometer", "gyroscope", "magnetometer"]
    gyroscope, written = found.triads["gyroscope"], content["gyroscope"]
    np.testing.assert_array_equal(gyroscope.matrix, written["matrix"])
    np.testing.assert_array_equal(gyroscope.bias, written["bias_rad_s"])
    np.testing.assert_array_equal(gyroscope.drift, written["drift_rad_s_k"])
    np.testing.assert_array_equal(gyroscope.g_matrix, written["g_matrix_rad_s_per_m_s2"])
    assert gyroscope.reference == 24.75 and [fit.dof for fit in gyroscope.fits] == [np.inf, 4.5]
    assert not found.triads["magnetometer"].drift.any()
    assert found.mounting is not None and found.mounting.remarks == ("two axes alone turned",)
    assert [own.severity for own in found.findings] == ["warning", "note"]


def test_what_a_calibration_lacks_is_left_away(tmp_path: Path) -> None:
    whole = load_calibration(EARLIER)
    bare = replace(whole, triads={}, mounting=None, device=None, findings=())
    save_calibration(tmp_path / "bare.yaml", bare)
    content = yaml.safe_load((tmp_path / "bare.yaml").read_text(encoding="utf-8"))
    assert not {"accelerometer", "gyroscope", "magnetometer", "mounting"} & set(content)
    assert content["device"] is None and content["findings"] == []


def test_a_figure_that_is_no_number_is_refused_and_nothing_is_written(tmp_path: Path) -> None:
    whole = load_calibration(EARLIER)
    triad = replace(whole.triads["magnetometer"], validation={"norm_rms_ut": float("nan")})
    with pytest.raises(InputError, match=r"nothing was written.*norm_rms_ut"):
        save_calibration(tmp_path / "nan.yaml", replace(whole, triads={"magnetometer": triad}))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("triad", ["accelerometer", "magnetometer"])
def test_a_response_to_force_is_a_gyroscopes_alone(triad: str, tmp_path: Path) -> None:
    content = yaml.safe_load(EARLIER.read_text(encoding="utf-8"))
    content[triad]["g_matrix_rad_s_per_m_s2"] = np.eye(3).tolist()
    (tmp_path / "odd.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(FileProblems, match="g_matrix_rad_s_per_m_s2"):
        load_calibration(tmp_path / "odd.yaml")
