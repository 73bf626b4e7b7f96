"""x-IMU3: files as the maker's software writes them, and rows of the maker's own examples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session

G = 9.80665
NWU_FROM_ENU = Rotation.from_euler("z", -90, degrees=True)

# Rows of "x-IMU3 - F7E4-5410-EC7B-D7E7 (USB)", github xioTechnologies/x-IMU3-CSV (MIT).
EXAMPLE = {
    "Inertial.csv": (
        "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
        "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)\n"
        "34290905,0.212382,-0.027105,0.072782,0.000092,0.031777,1.007784\n"
        "34310881,0.082383,-0.027116,-0.011192,-0.001374,0.032234,1.005128\n"
        "34330858,-0.001644,-0.042225,0.095525,-0.002289,0.031136,1.008333\n"
        "34350834,0.028813,-0.125973,-0.049486,-0.001007,0.033059,1.007509\n"
    ),
    "Magnetometer.csv": (
        "Timestamp (us),X Axis (a.u.),Y Axis (a.u.),Z Axis (a.u.)\n"
        "34282191,18.187054,-23.383354,-59.106277\n"
        "34332513,18.187054,-23.383354,-59.962891\n"
        "34382825,17.815536,-23.011734,-59.098343\n"
    ),
    "Quaternion.csv": (
        "Timestamp (us),W Element,X Element,Y Element,Z Element\n"
        "34290905,0.908128,0.014357,0.006816,0.418682\n"
        "34310881,0.908117,0.014371,0.006824,0.418704\n"
        "34330858,0.908100,0.014366,0.006824,0.418743\n"
        "34350834,0.908094,0.014382,0.006811,0.418755\n"
    ),
    "Command.json": '[{"ping":{"deviceName":"x-IMU3"}},{"time":"2022-08-11 12:03:39"}]',
}


@pytest.fixture
def load(tmp_path, clock):
    def read(*files: Path, **options) -> Session:
        return import_recording(
            "ximu3", list(files), tmp_path / "session", clock, Options(**options)
        )

    return read


def device(table, xyz, m, folder: str = "x-IMU3 673B204B (UDP)", field: float = 1 / 40) -> Path:
    """A folder of one device: magnetometer and quaternion at half and a third of the rate."""
    stamp = 19_150_794 + np.round(1e6 * m.t).astype(np.int64)
    inertial = {"Timestamp (us)": stamp} | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
    inertial |= xyz("Accelerometer {} (g)", m.acc / G)
    q = (NWU_FROM_ENU * Rotation.from_quat(m.q, scalar_first=True)).as_quat(scalar_first=True)
    for name, columns in (
        ("Inertial", inertial),
        ("Magnetometer", {"Timestamp (us)": stamp[::2]} | xyz("{} (a.u.)", field * m.mag[::2])),
        ("Quaternion", {"Timestamp (us)": stamp[::3]} | xyz("{}", 1.000121 * q[::3], "WXYZ")),
    ):
        path = table(f"{folder}/{name}.csv", columns, form="%.12g")
    return path.parent


def degrees_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    return np.degrees(2 * np.arccos(np.clip(np.abs(np.sum(p * q, axis=1)), 0, 1)))


def test_a_folder_is_read_with_its_slower_messages_at_the_times_of_inertial(
    table, xyz, motion, load
):
    m = motion(601, 100.0)
    session = load(device(table, xyz, m))
    (name,) = session.sensor_names
    assert name == "x_IMU3_673B204B_UDP"
    samples = session.imu(name)
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-5)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-6)
    np.testing.assert_allclose(samples.mag, m.mag, atol=0.05)
    assert degrees_between(samples.device_q, m.q).max() < 0.1
    assert session.manifest.sensors[name].rate_hz == pytest.approx(100)


def test_a_field_of_the_size_of_the_earths_is_taken_for_microtesla(table, xyz, motion, load):
    m = motion(301, 100.0)
    session = load(device(table, xyz, m, field=1.0))
    np.testing.assert_allclose(session.imu(session.sensor_names[0]).mag, m.mag, atol=0.05)
    assert any("taken for uT" in note for note in session.manifest.notes)


def test_nothing_is_interpolated_over_a_pause_of_a_slower_message(table, xyz, motion, load):
    m = motion(601, 100.0)
    folder = device(table, xyz, m)
    lines = (folder / "Magnetometer.csv").read_text().splitlines(keepends=True)
    (folder / "Magnetometer.csv").write_text("".join(lines[:100] + lines[150:]))
    samples = load(folder).imu("x_IMU3_673B204B_UDP")
    lost = np.flatnonzero(np.isnan(samples.mag).any(axis=1))
    assert (lost.min(), lost.max()) == (197, 297)


@pytest.mark.parametrize("form", ["RotationMatrix", "EulerAngles", "LinearAcceleration"])
def test_other_forms_of_the_orientation_are_understood(table, xyz, motion, load, form):
    m = motion(301, 100.0)
    folder = device(table, xyz, m)
    (folder / "Quaternion.csv").unlink()
    turn = NWU_FROM_ENU * Rotation.from_quat(m.q, scalar_first=True)
    columns: dict = {"Timestamp (us)": 19_150_794 + np.round(1e6 * m.t).astype(np.int64)}
    if form == "RotationMatrix":
        cells = 1.00048 * turn.as_matrix().reshape(-1, 9)
        for i, title in enumerate(("XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ")):
            columns[title] = cells[:, i]
    elif form == "EulerAngles":
        yaw, pitch, roll = turn.as_euler("ZYX", degrees=True).T
        columns |= {"Roll (deg)": roll, "Pitch (deg)": pitch, "Yaw (deg)": yaw}
    else:
        columns |= xyz("Quaternion {}", turn.as_quat(scalar_first=True), "WXYZ")
        columns |= xyz("Acceleration {} (g)", 0 * m.acc)
    table(f"{folder.name}/{form}.csv", columns, form="%.9g")
    samples = load(folder).imu("x_IMU3_673B204B_UDP")
    assert degrees_between(samples.device_q, m.q).max() < 0.01


def test_rows_of_the_makers_example_stand_upright_and_point_north(tmp_path, load):
    folder = tmp_path / "x-IMU3 - F7E4-5410-EC7B-D7E7 (USB)"
    folder.mkdir()
    for name, text in EXAMPLE.items():
        (folder / name).write_text(text)
    session = load(folder)
    samples = session.imu(session.sensor_names[0])
    earth = Rotation.from_quat(samples.device_q, scalar_first=True)
    up, field = earth.apply(samples.acc).mean(axis=0), earth.apply(samples.mag).mean(axis=0)
    assert np.degrees(np.arccos(up[2] / np.linalg.norm(up))) < 0.3
    assert abs(np.degrees(np.arctan2(field[0], field[1]))) < 3 and field[2] < 0
    assert session.manifest.recorded_utc == "2022-08-11T12:03:39+00:00"


def test_two_devices_are_two_sensors_and_a_date_never_set_is_none(table, xyz, motion, load):
    m = motion(100)
    folders = [device(table, xyz, m, f"log/{name}") for name in ("left", "right")]
    (folders[0] / "Command.json").write_text('[{"time":"2000-01-23 04:59:47"}]')
    session = load(folders[0].parent)
    assert sorted(session.sensor_names) == ["left", "right"]
    assert session.manifest.recorded_utc is None


def test_what_is_no_file_of_motion_is_named(table, xyz, motion, load, tmp_path):
    folder = device(table, xyz, motion(100))
    with pytest.raises(InputError, match=r"a magnetometer alone.*Inertial.csv"):
        load(folder / "Magnetometer.csv")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileProblems, match=r"a folder without any of Inertial.csv"):
        load(tmp_path / "empty")
    battery = table("b.csv", {"Timestamp (us)": [1, 2], "Percentage (%)": [50.0, 50.0]})
    with pytest.raises(FileProblems, match=r"b\.csv: not one of Inertial\.csv"):
        load(battery)
    with pytest.raises(InputError, match=r"both the Inertial\.csv of one device"):
        load(folder, folder / "Inertial.csv")


def test_a_slower_message_whose_time_goes_back_is_refused_with_its_line(table, xyz, motion, load):
    folder = device(table, xyz, motion(300))
    lines = (folder / "Magnetometer.csv").read_text().splitlines(keepends=True)
    (folder / "Magnetometer.csv").write_text("".join([*lines[:40], lines[20], *lines[40:]]))
    with pytest.raises(FileProblems, match=r"Magnetometer\.csv:41: time goes back here"):
        load(folder)


def test_case_20_is_read_and_the_older_devices_format_names_the_newer(cases, load, tmp_path, clock):
    file = cases / "20_ximu3_inertial" / "Inertial.csv"
    session = load(file)
    assert session.manifest.sensors[session.sensor_names[0]].rate_hz == 25
    with pytest.raises(FileProblems, match="looks like a file of the format ximu3"):
        import_recording("ngimu", [file], tmp_path / "other", clock)
