"""APDM Opal: the HDF5 layouts of its versions, written with h5py."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session

NWU_FROM_ENU = Rotation.from_euler("z", -90, degrees=True)
START_US = 1_600_000_000_000_000


@pytest.fixture
def load(tmp_path, clock):
    def read(*files: Path, **options) -> Session:
        return import_recording(
            "apdm", list(files), tmp_path / "session", clock, Options(**options)
        )

    return read


def orientation(m, conjugate: bool) -> np.ndarray:
    turn = NWU_FROM_ENU * Rotation.from_quat(m.q, scalar_first=True)
    return (turn.inv() if conjugate else turn).as_quat(scalar_first=True)


def version_5(path: Path, m, later_us: int = 0, conjugate: bool = True) -> Path:
    with h5py.File(path, "w") as file:
        file.attrs["FileFormatVersion"] = 5
        for key, label, shift in (("1262", "Left Foot", 0), ("1338", "Lumbar", later_us)):
            group = file.create_group(f"Sensors/{key}")
            group["Accelerometer"] = m.acc.astype("f4")
            group["Gyroscope"] = m.gyr.astype("f4")
            group["Magnetometer"] = m.mag.astype("f4")
            group["Time"] = (START_US + shift + np.round(1e6 * m.t)).astype("u8")
            settings = group.create_group("Configuration")
            settings.attrs["Label 0"] = np.bytes_(label.ljust(20, "\0"))
            file[f"Processed/{key}/Orientation"] = orientation(m, conjugate)
    return path


def older(path: Path, m, times: bool = True) -> Path:
    with h5py.File(path, "w") as file:
        file.attrs["FileFormatVersion"] = 3
        file.attrs["CaseIdList"] = np.array([b"SI-000133"])
        file.attrs["MonitorLabelList"] = np.array([b"Trunk\0\0"])
        group = file.create_group("SI-000133")
        group.attrs["SampleRate"] = 128.0
        group["Calibrated/Accelerometers"] = m.acc
        group["Calibrated/Gyroscopes"] = m.gyr
        group["Calibrated/Magnetometers"] = m.mag
        group["Calibrated/Orientation"] = orientation(m, False)
        group["Raw/Accelerometers"] = (1000 * m.acc).astype("i4")
        if times:
            group["Time"] = (START_US + np.round(1e6 * m.t)).astype("u8")
    return path


@pytest.mark.parametrize("conjugate", [False, True])
def test_version_5_keeps_labels_and_the_common_clock_and_gravity_tells_the_direction(
    tmp_path, motion, load, conjugate
):
    m = motion(640, 128.0)
    session = load(version_5(tmp_path / "a.h5", m, 2_000_000, conjugate))
    assert session.sensor_names == ["Left_Foot", "Lumbar"]
    first, second = (session.imu(name) for name in session.sensor_names)
    assert (first.host_time_ns[0], second.host_time_ns[0]) == (0, 2_000_000_000)
    np.testing.assert_allclose(first.acc, m.acc, atol=1e-5)
    np.testing.assert_allclose(first.gyr, m.gyr, atol=1e-6)
    np.testing.assert_allclose(first.mag, m.mag, atol=1e-5)
    assert np.abs(np.sum(first.device_q * m.q, axis=1)).min() > 1 - 1e-9
    assert session.manifest.recorded_utc == "2020-09-13T12:26:40+00:00"


def test_an_older_layout_is_read_by_its_case_ids(tmp_path, motion, load):
    m = motion(640, 128.0)
    session = load(older(tmp_path / "b.h5", m))
    samples = session.imu("Trunk")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-9)
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9


def test_without_times_the_rate_of_the_file_holds(tmp_path, motion, load):
    session = load(older(tmp_path / "b.h5", motion(640, 128.0), times=False))
    assert session.manifest.duration_s == pytest.approx(639 / 128)
    (said,) = [own for own in session.manifest.findings if own.code == "time.by_rows"]
    assert said.values == {"rate_hz": 128, "who": "the file"}


def test_an_orientation_that_gravity_denies_is_left_out(tmp_path, motion, load):
    m = motion(640, 128.0)
    path = version_5(tmp_path / "a.h5", m)
    with h5py.File(path, "a") as file:
        del file["Processed/1262/Orientation"]
        file["Processed/1262/Orientation"] = np.roll(orientation(m, False), 1, axis=1)
    session = load(path)
    assert session.imu("Left_Foot").device_q is None
    assert session.imu("Lumbar").device_q is not None
    assert any("fits the measured gravity in neither" in note for note in session.manifest.notes)


def test_what_cannot_be_is_refused_by_name(tmp_path, motion, load):
    m = motion(300, 128.0)
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["results/values"] = np.zeros((3, 3))
    with pytest.raises(FileProblems, match=r"no /Sensors/<id>.*the file has results"):
        load(other)
    path = version_5(tmp_path / "a.h5", m)
    with h5py.File(path, "a") as file:
        del file["Sensors/1262/Time"]
        file["Sensors/1262/Time"] = np.arange(7, dtype="u8")
    with pytest.raises(FileProblems, match="Time has 7 rows, where the sensor has 300"):
        load(path)
    with h5py.File(path, "a") as file:
        del file["Sensors/1262/Time"]
        file["Sensors/1262/Time"] = np.full(300, 2**63, dtype="u8")
    with pytest.raises(FileProblems, match="no microseconds since 1970"):
        load(path)
    (tmp_path / "cut.h5").write_bytes(path.read_bytes()[:3000])
    with pytest.raises(FileProblems, match="not a readable HDF5 file"):
        load(tmp_path / "cut.h5")


def test_case_21_is_read_and_the_matlab_reader_names_the_format(cases, load, tmp_path, clock):
    file = cases / "21_apdm_opal_hdf5" / "opal.h5"
    assert load(file).manifest.sensors["imu_1234"].rate_hz == 25
    with pytest.raises(FileProblems, match="looks like a file of the format apdm"):
        import_recording("mti_mat", [file], tmp_path / "other", clock)
