"""The MATLAB file, read by scipy's reader."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import loadmat, whosmat

from testbench.exceptions import InputError
from testbench.formats.exporters import matlab, write_export


@pytest.fixture(scope="module")
def path(source, tmp_path_factory):
    return write_export("mat", source, tmp_path_factory.mktemp("mat") / "quick.mat").path


@pytest.fixture(scope="module")
def struct(path):
    return loadmat(path, squeeze_me=True, struct_as_record=False, chars_as_strings=True)["session"]


def test_the_file_holds_one_struct_of_version_5(path):
    assert whosmat(path) == [("session", (1, 1), "struct")]
    assert path.read_bytes().startswith(b"MATLAB 5.0 MAT-file")


def test_sensors_are_matrices_with_one_row_a_sample(struct, source):
    for sensor in ("arm", "forearm"):
        own, raw, estimated = (
            getattr(struct, f"imu_{sensor}"),
            source.imus[sensor],
            source.estimate.sensors[sensor],
        )
        for name, array in (
            ("gyr_rad_s", raw.gyr),
            ("acc_m_s2", raw.acc),
            ("mag_uT", raw.mag),
            ("device_q", raw.device_q),
        ):
            np.testing.assert_array_equal(getattr(own, name), array)
        np.testing.assert_array_equal(own.host_time_ns, estimated.host_time_ns)
        assert (
            own.host_time_ns.dtype == np.int64 and own.time_s.shape == estimated.host_time_ns.shape
        )
        for key, q in estimated.orientation.items():
            np.testing.assert_array_equal(getattr(own, f"{key}_q_world_from_sensor"), q)
        assert (own.units.gyr_rad_s, own.units.acc_m_s2, own.units.mag_uT) == (
            "rad/s",
            "m/s^2",
            "uT",
        )


def test_columns_are_columns_in_matlab(path):
    own = loadmat(path)["session"]["imu_arm"][0, 0]
    assert own["time_s"][0, 0].shape[1] == 1


def test_arm_joints_and_steps_are_there(struct, source, quick):
    arm = source.session.arm()
    assert struct.arm_joint_names.tolist() == arm.joint_names
    np.testing.assert_array_equal(struct.arm.q_measured_rad, arm.q_measured)
    np.testing.assert_array_equal(struct.arm.v_measured_rad_s, arm.v_measured)
    assert struct.arm.units.v_measured_rad_s == "rad/s"
    flexion = quick.evaluation.series["joint_elbow"]["vqf_6d_ZXZ_flexion_rad"]
    np.testing.assert_array_equal(struct.joint_elbow.vqf_6d_ZXZ_flexion_rad, flexion)
    assert struct.steps.name.tolist() == [step.name for step in source.session.steps]
    assert struct.name == source.session.name


def test_an_imported_recording_without_arm_is_written_too(imported_source, tmp_path):
    path = write_export("mat", imported_source, tmp_path / "imported.mat").path
    own = loadmat(path, squeeze_me=True, struct_as_record=False)["session"]
    assert not hasattr(own, "arm") and not hasattr(own, "steps")
    assert np.isnan(own.truth_imu.q_world_from_sensor[1200:1300]).all()


def test_a_session_too_large_for_the_format_is_refused_before_anything_is_written(
    source, tmp_path, monkeypatch
):
    monkeypatch.setattr(matlab, "LARGEST", 1000)
    with pytest.raises(InputError, match="export to parquet"):
        write_export("mat", source, tmp_path / "out.mat")
    assert list(tmp_path.iterdir()) == []


def test_names_are_made_fit_for_matlab_or_refused():
    assert matlab.field("joint-1.a") == "joint_1_a"
    with pytest.raises(InputError, match="too long"):
        matlab.field("x" * 64)
