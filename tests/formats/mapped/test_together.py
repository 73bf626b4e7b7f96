"""Quantities of several files come to one time line."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from tests.formats.mapped.mappings import PHONE, check
from tests.told import codes


def test_a_gyroscope_of_another_file_comes_to_the_accelerometers_times(motion, load, phone):
    m = motion(600)
    session = load(PHONE, *phone(m))
    assert session.sensor_names == ["phone"]
    samples = session.imu("phone")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-7)
    np.testing.assert_allclose(samples.gyr[2:-2], m.gyr[2:-2], atol=0.01)
    assert {"structure.interpolated", "structure.no_file"} <= codes(session)


def test_the_times_of_a_faster_gyroscope_count(motion, load, phone):
    m = motion(1200, 200.0)
    session = load(PHONE, *phone(m, acc_every=4))
    assert session.manifest.sensors["phone"].rate_hz == pytest.approx(200)
    assert len(session.imu("phone")) == 1200
    np.testing.assert_allclose(session.imu("phone").acc[10:-10], m.acc[10:-10], atol=0.05)


def test_a_slow_magnetometer_stands_at_its_own_instants(motion, load, phone, table, xyz):
    m = motion(600)
    slow = table("Mag.csv", {"t": m.t[3::10] + 0.001} | xyz("{}", m.mag[3::10], "xyz"))
    session = load(PHONE, *phone(m), slow)
    mag = session.imu("phone").mag
    at = np.flatnonzero(np.isfinite(mag[:, 0]))
    np.testing.assert_array_equal(at, np.arange(3, 600, 10))
    np.testing.assert_allclose(mag[at], m.mag[3::10], atol=1e-6)
    assert "structure.lower_rate" in codes(session)
    assert np.isfinite(session.imu("phone").gyr[2:-2]).all()


def test_two_phones_are_two_folders(motion, load, phone):
    m = motion(600)
    session = load(PHONE, *phone(m, "left/"), *phone(m, "right/"))
    assert session.sensor_names == ["left", "right"]


def test_a_pause_of_a_file_stays_a_pause(motion, load, phone, table, xyz):
    m = motion(600)
    acc, _ = phone(m)
    kept = (m.t < 2) | (m.t > 3)
    gyr = table("Gyr.csv", {"t": m.t[kept]} | xyz("{}", m.gyr[kept], "xyz"))
    lost = ~np.isfinite(load(PHONE, acc, gyr).imu("phone").gyr[:, 0])
    np.testing.assert_array_equal(np.flatnonzero(lost), np.flatnonzero(~kept))


def test_files_of_one_sensor_need_times(motion, load, phone):
    files = phone(motion(300))
    with pytest.raises(FileProblems, match="each needs `time` and none a stated rate"):
        load(PHONE.replace("time: {column: t, unit: s}", "rate_hz: 100"), *files)
    with pytest.raises(FileProblems, match="each needs `time`"):
        load(PHONE, *files, rate=100.0)


def test_the_files_of_sensor_logger_and_phyphox_read_by_their_mappings(
    motion, table, xyz, tmp_path, clock
):
    m = motion(600)
    ns = 1_700_000_000_000_000_000 + (m.t * 1e9).round().astype(np.int64)
    for kind, values in (("TotalAcceleration", m.acc), ("Gyroscope", m.gyr)):
        table(f"{kind}.csv", {"time": ns, "seconds_elapsed": m.t} | xyz("{}", values, "zyx"[::-1]))
    files = [tmp_path / "TotalAcceleration.csv", tmp_path / "Gyroscope.csv"]
    session = import_recording("generic", files, tmp_path / "a", clock, Options("sensor_logger"))
    check(session.imu("phone"), m)
    table("Accelerometer.csv", {"time": ns} | xyz("{}", 0 * m.acc, "xyz"))
    (tmp_path / "Metadata.csv").write_text("version,device name\n3,Pixel\n")
    session = import_recording(
        "generic", [tmp_path], tmp_path / "c", clock, Options("sensor_logger")
    )
    check(session.imu("phone"), m)
    (left,) = (f for f in session.manifest.findings if f.code == "structure.files_unread")
    assert left.values["files"] == ["Accelerometer.csv", "Metadata.csv"]
    table("Notes.csv", {"time": ns})
    with pytest.raises(InputError, match=r"Notes\.csv: no sensor of the mapping reads it"):
        import_recording("generic", [tmp_path], tmp_path / "d", clock, Options("sensor_logger"))
    files = []
    for kind, unit, values in (("Accelerometer", "m/s^2", m.acc), ("Gyroscope", "rad/s", m.gyr)):
        columns = {'"Time (s)"': m.t} | xyz(f'"{{}} ({unit})"', values)
        files.append(table(f"{kind}.csv", columns))
    session = import_recording("generic", files, tmp_path / "b", clock, Options("phyphox"))
    check(session.imu("phone"), m)


def test_the_files_of_a_phone_are_one_sensor_or_refused(cases, tmp_path, clock):
    folder = cases / "19_phone_one_file_a_quantity"
    files = [folder / "Accelerometer.csv", folder / "Gyroscope.csv"]
    asked = Options(str(folder / "map.yaml"))
    with pytest.raises(FileProblems, match="acc and gyr are both read from x, y, z of Acc"):
        import_recording("generic", files, tmp_path / "s", clock, asked)
    session = import_recording("generic", files, tmp_path / "s", clock, Options("sensor_logger"))
    assert session.sensor_names == ["phone"] and len(session.imu("phone")) == 375
    assert np.isfinite(session.imu("phone").gyr).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("Gyr*.csv", "Rate*.csv"), r"map.yaml:6:\d+: .*0 of the files .* fit"),
        (("Gyr*.csv", "'*.csv'"), r"map.yaml:6:\d+: .*2 of the files .* fit"),
        (("file: Gyr*.csv, ", ""), r"map.yaml:6:\d+: .*names no `file`, and 2 files were given"),
        (("file: Gyr*.csv, ", "optional: true, "), "optional goes with a `file`"),
    ],
)
def test_a_quantity_whose_file_is_not_single_is_refused(motion, load, phone, change, said):
    with pytest.raises(FileProblems, match=said):
        load(PHONE.replace(*change), *phone(motion(300)))
