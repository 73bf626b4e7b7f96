"""The generic mapping on arrays, on files of one quantity each, and on what is built wrongly."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from testbench.exceptions import BenchError, FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session
from tests.formats.foreign_arrays import mat73_with_objects, mat_with_objects
from tests.formats.test_generic import PLAIN
from tests.told import codes

ARRAYS = """\
description: arrays
time: {column: imu/t, unit: s}
sensors:
  imu:
    acc: {array: imu/acc, unit: m/s^2}
    gyr: {array: imu/gyr, unit: rad/s}
"""
PHONE = """\
description: a phone
time: {column: t, unit: s}
sensors:
  phone:
    acc: {file: Acc*.csv, columns: [x, y, z], unit: m/s^2}
    gyr: {file: Gyr*.csv, columns: [x, y, z], unit: rad/s}
    mag: {file: Mag*.csv, columns: [x, y, z], unit: uT, optional: true}
"""


@pytest.fixture
def load(tmp_path, clock):
    def read(mapping: str, *files, **options) -> Session:
        (tmp_path / "map.yaml").write_text(mapping, encoding="utf-8")
        out = tmp_path / f"session{len(list(tmp_path.glob('session*')))}"
        asked = Options(str(tmp_path / "map.yaml"), **options)
        return import_recording("generic", list(files), out, clock, asked)

    return read


@pytest.fixture
def plain(table, xyz):
    def write(m, name="data.csv", more=None, **layout):
        columns = {"t": m.t} | xyz("a{}", m.acc, "xyz") | xyz("w{}", m.gyr, "xyz") | (more or {})
        return table(name, columns, **layout)

    return write


@pytest.fixture
def phone(table, xyz):
    """The files of a phone: accelerometer, and a gyroscope some milliseconds off."""

    def write(m, folder="", late=0.004, acc_every=1, gyr_every=1):
        shifted = np.stack([np.interp(m.t + late, m.t, column) for column in m.gyr.T], axis=1)
        acc = {"t": m.t[::acc_every]} | xyz("{}", m.acc[::acc_every], "xyz")
        gyr = {"t": (m.t + late)[::gyr_every]} | xyz("{}", shifted[::gyr_every], "xyz")
        return [table(f"{folder}Acc.csv", acc), table(f"{folder}Gyr.csv", gyr)]

    return write


def check(samples, m, atol=1e-6) -> None:
    np.testing.assert_allclose(samples.acc, m.acc, atol=atol)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=atol)


# --- arrays


@pytest.mark.parametrize("kind", ["mat5", "packed", "mat7.3", "hdf5"])
def test_arrays_read_by_their_path_beside_objects_of_matlab(kind, motion, load, tmp_path):
    m = motion(600)
    struct = {"t": m.t, "acc": m.acc, "gyr": m.gyr}
    flat = {f"imu/{name}": values for name, values in struct.items()}
    path = tmp_path / ("d.h5" if kind == "hdf5" else "d.mat")
    if kind == "hdf5":
        with h5py.File(path, "w") as file:
            for name, values in flat.items():
                file.create_dataset(name, data=values, chunks=True, compression="gzip")
    elif kind == "mat7.3":
        mat73_with_objects(path, flat)
    else:
        mat_with_objects(path, {"imu": struct, "fs": 100.0}, packed=kind == "packed")
    session = load(ARRAYS, path)
    check(session.imu("imu"), m, 1e-12)
    assert ("structure.closed" in codes(session)) == (kind != "hdf5")


def test_single_columns_of_an_array_and_of_records(motion, load, tmp_path):
    m = motion(600)
    wide = np.column_stack([m.t, m.acc, m.gyr])
    records = np.zeros(600, dtype=[("t", "f8"), ("acc", "f4", 3), ("gyr", "f4", 3)])
    records["t"], records["acc"], records["gyr"] = m.t, m.acc, m.gyr
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["wide"], file["log/imu"] = wide, records
    columns = [f"'wide[{i}]'" for i in range(1, 8)]
    text = ARRAYS.replace("imu/t", columns[0])
    text = text.replace("array: imu/acc", f"columns: [{', '.join(columns[1:4])}]")
    text = text.replace("array: imu/gyr", f"columns: [{', '.join(columns[4:])}]")
    check(load(text, tmp_path / "d.h5").imu("imu"), m, 1e-12)
    check(load(ARRAYS.replace("imu/", "log/imu/"), tmp_path / "d.h5").imu("imu"), m)


def test_what_does_not_fit_in_a_file_of_arrays_is_named(motion, load, tmp_path):
    m = motion(600)
    content = {"imu": {"t": m.t[:-1], "acc": m.acc, "gyr": m.gyr, "wide": np.ones((600, 5))}}
    path = mat_with_objects(tmp_path / "d.mat", content)
    with pytest.raises(FileProblems, match=r"must be as long: .*imu/t has 599 rows"):
        load(ARRAYS, path)
    with pytest.raises(FileProblems, match=r"map.yaml:5:\d+: .*'imu/ac' is not there; d.mat has"):
        load(ARRAYS.replace("imu/acc", "imu/ac"), path)
    with pytest.raises(FileProblems, match=r"'walk' is not there.*walk \(table\) only MATLAB"):
        load(ARRAYS.replace("imu/acc", "walk"), path)
    with pytest.raises(FileProblems, match=r"'imu/wide' has 5 columns, where 3 are needed"):
        load(ARRAYS.replace("imu/acc", "imu/wide"), path)
    with pytest.raises(FileProblems, match="either columns, or array"):
        load(ARRAYS.replace("array: imu/acc, ", ""), path)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".parquet"])
def test_damaged_files_of_arrays_are_refused(suffix, motion, load, tmp_path):
    path = tmp_path / f"d{suffix}"
    savemat(tmp_path / "sound.mat", {"imu": {"t": motion(600).t}})
    for content in (
        b"",
        b"\x89HDF\r\n\x1a\n" + bytes(90),
        (tmp_path / "sound.mat").read_bytes()[:900],
    ):
        path.write_bytes(content)
        with pytest.raises(BenchError, match=path.name):
            load(ARRAYS, path)


# --- one file a quantity


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
    files = []
    for kind, unit, values in (("Accelerometer", "m/s^2", m.acc), ("Gyroscope", "rad/s", m.gyr)):
        columns = {'"Time (s)"': m.t} | xyz(f'"{{}} ({unit})"', values)
        files.append(table(f"{kind}.csv", columns))
    session = import_recording("generic", files, tmp_path / "b", clock, Options("phyphox"))
    check(session.imu("phone"), m)


# --- columns read twice, empty, or of the same title


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("[wx, wy, wz]", "[ax, ay, az]"), "acc and gyr are both read from ax, ay, az of data.csv"),
        (("[wx, wy, wz]", "[wx, ay, wz]"), "acc and gyr are both read from"),
        (("[wx, wy, wz]", "[5, 3, 7]"), "acc and gyr are both read from"),
        (("[wx, wy, wz]", "[wx, wx, wz]"), "the column wx stands twice"),
        (("[wx, wy, wz]", "[t, wy, wz]"), "t is both its time and its value"),
    ],
)
def test_a_column_taken_for_two_things_is_refused(plain, motion, load, change, said):
    with pytest.raises(FileProblems, match=r"map.yaml:6:\d+: .*" + said):
        load(PLAIN.replace(*change), plain(motion(300)))


def test_a_truth_that_is_the_device_quaternion_is_refused(plain, motion, load, xyz):
    m = motion(300)
    text = PLAIN + "    quaternion: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    text += "    truth: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    with pytest.raises(FileProblems, match="quaternion and truth are both read from"):
        load(text, plain(m, more=xyz("q{}", m.q, "wxyz")))


def test_columns_of_one_title_are_read_by_number_alone(motion, load, tmp_path):
    m = motion(300)
    rows = "\n".join(
        ",".join(f"{v:.9g}" for v in row) for row in np.column_stack([m.t, m.acc, m.gyr])
    )
    (tmp_path / "d.csv").write_text(f"t,x,y,z,x,y,z\n{rows}\n")
    text = PLAIN.replace("[ax, ay, az]", "[2, 3, 4]").replace("[wx, wy, wz]", "[5, 6, 7]")
    check(load(text, tmp_path / "d.csv").imu("imu"), m)
    with pytest.raises(FileProblems, match=r"more than one column 'x' \(its columns 2 and 5\)"):
        load(text.replace("[2, 3, 4]", "[x, y, z]"), tmp_path / "d.csv")


def test_shared_and_empty_columns_are_named(plain, motion, load):
    m = motion(300)
    nothing = {f"m{axis}": np.full(300, np.nan) for axis in "xyz"}
    text = PLAIN + "    mag: {columns: [mx, my, mz], unit: uT}\n"
    text += "  twin:\n    acc: {columns: [ax, ay, az], unit: m/s^2}\n"
    found = {f.code: f for f in load(text, plain(m, more=nothing)).manifest.findings}
    assert found["structure.empty_columns"].values["columns"] == "mx, my, mz"
    assert found["structure.shared_columns"].values["columns"] == ["ax", "ay", "az"]


# --- text


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-8-sig"])
@pytest.mark.parametrize("stated", [None, "utf-16"])
def test_utf16_with_and_without_its_mark(plain, motion, load, encoding, stated):
    m = motion(300)
    path = plain(m)
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    if stated and not encoding.startswith(stated):
        return
    key = f"text: {{encoding: {stated}}}\n" if stated else ""
    check(load(PLAIN + key, path).imu("imu"), m)


def test_the_encoding_of_any_format_can_be_stated(motion, table, tmp_path, clock, xyz):
    m = motion(300)
    columns = (
        {"time (s)": m.t} | xyz("Acc {} (m/s²)", m.acc) | xyz("Gyr {} (°/s)", np.degrees(m.gyr))
    )
    path = table("d.csv", columns)
    path.write_bytes(path.read_text(encoding="utf-8").encode("cp1252"))
    with pytest.raises(FileProblems, match=r"not utf-8 text.*--encoding cp1252"):
        import_recording("technaid", [path], tmp_path / "a", clock)
    asked = Options(encoding="cp1252")
    check(import_recording("technaid", [path], tmp_path / "b", clock, asked).imu("d"), m)
    with pytest.raises(InputError, match=r"unknown encoding.*'ebcdic'; known: utf-8"):
        Options(encoding="ebcdic")


@pytest.mark.parametrize("end", ["\r", "\r\n"])
def test_other_ends_of_lines(plain, motion, load, end):
    m = motion(300)
    path = plain(m)
    path.write_bytes(path.read_bytes().replace(b"\n", end.encode()))
    check(load(PLAIN, path).imu("imu"), m)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_below_rows_of_whole_numbers(plain, motion, load, separator):
    m = motion(300)
    path = plain(m, separator=separator, decimal=",", form="%.10f")
    head, *rows = path.read_text().splitlines()
    whole = separator.join(["0", "0", "0", "10", "0", "0", "0"])
    path.write_text("\n".join([head, whole, *rows[1:]]) + "\n")
    np.testing.assert_allclose(load(PLAIN, path).imu("imu").acc[1:], m.acc[1:], atol=1e-6)


@pytest.mark.parametrize(
    ("stamps", "unit", "said"),
    [
        ([f"0{i // 60}:{i % 60:02d}.0" for i in range(300)], "clock", "loses the hours"),
        (["1.7E+12"] * 300, "ms", "'1.7E\\+12' in the column t was rounded.*last digits"),
        (["1,70E+12"] * 300, "ns", "last digits"),
    ],
)
def test_times_that_a_spreadsheet_has_rewritten_are_refused_helpfully(
    plain, motion, load, stamps, unit, said
):
    m = motion(300)
    path = plain(m)
    head, *rows = path.read_text().splitlines()
    rows = [";".join([s, *row.split(",")[1:]]) for s, row in zip(stamps, rows, strict=True)]
    path.write_text("\n".join([head.replace(",", ";"), *rows]) + "\n")
    with pytest.raises(FileProblems, match=said + ".*without opening it in one, or state --rate"):
        load(PLAIN.replace("unit: s", f"unit: {unit}"), path)


# --- further keys


def test_full_scale_and_sampling_stand_in_the_manifest(plain, motion, load):
    text = PLAIN.replace("unit: m/s^2", "unit: m/s^2, full_scale: 16 g")
    text = (
        text.replace("unit: rad/s", "unit: rad/s, full_scale: 8.7") + "    sampling: integrated\n"
    )
    sensor = load(text, plain(motion(300))).manifest.sensors["imu"]
    assert sensor.full_scale is not None
    assert sensor.full_scale.acc_m_s2 == pytest.approx(16 * 9.80665)
    assert sensor.full_scale.gyr_rad_s == 8.7
    assert sensor.sampling == "integrated" and sensor.rate_delay_s == pytest.approx(0.005)


BODY = """\
  other:
    acc: {columns: [ax, ay, az], unit: m/s^2}
segments: {imu: upper_arm, other: {name: forearm, rotation_deg: {ZYX: [0, 90, 0]}}}
joints:
  elbow: {proximal: imu, distal: other, sequence: ZXZ}
exclude: [{from_s: 0.5, to_s: 1, reason: cable touched, sensors: [other]}]
"""


def test_segments_joints_and_excluded_intervals_are_kept(plain, motion, load):
    session = load(PLAIN + BODY, plain(motion(300)))
    body = session.analysis.body
    assert body is not None and body.segments["imu"].name == "upper_arm"
    assert body.segments["other"].rotation_deg == {"ZYX": [0, 90, 0]}
    assert body.joints["elbow"].distal == "other"
    assert session.analysis.estimate.exclude[0].reason == "cable touched"
    assert "structure.body_kept" in codes(session)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{imu: upper_arm", "{hand: upper_arm", r":9:\d+: segments.hand: there is no sensor"),
        ("distal: other", "distal: hand", r":11:\d+: joints.elbow.distal: there is no sensor"),
        ("[other]}]", "[hand]}]", r":12:\d+: exclude\[0\].sensors: there is no sensor 'hand'"),
        ("to_s: 1", "to_s: 0.1", r":12:\d+: exclude\[0\]: from_s 0.5 is not before"),
        ("sequence: ZXZ", "sequence: ZZZ", r":11:\d+: joints.elbow.sequence: must be"),
        ("sequence: ZXZ", "order: ZXZ", r":11:\d+: .*unknown key 'order'"),
        ("unit: rad/s", "unit: rad/s, full_scale: 5 furlong", r":6:\d+: .*is no full scale"),
        ("unit: rad/s", "unit: rad/s, full_scale: 0", r":6:\d+: .*more than 0"),
        ("unit: rad/s", "unit: rad/s, file: 7", r":6:\d+: "),
        ("unit: rad/s", "unit: rad/s, optional: yes", r":6:\d+: .*must be true or false"),
        ("segments: {imu: upper_arm,", "segments: {imu: [1],", r":9:\d+: "),
    ],
)
def test_faults_of_further_keys_are_named_with_their_place(plain, motion, load, old, new, said):
    text = PLAIN + BODY
    assert old in text
    with pytest.raises(FileProblems, match="map.yaml" + said):
        load(text.replace(old, new, 1), plain(motion(300)))


@pytest.mark.parametrize("earth", ["ENU", "NED", "NWU"])
def test_the_earth_of_a_quaternion(plain, motion, load, xyz, earth):
    from testbench.model.earths import to_earth_frame

    m = motion(300)
    text = PLAIN + (f"    quaternion: {{columns: [qw, qx, qy, qz], order: wxyz, earth: {earth}}}\n")
    samples = load(text, plain(m, more=xyz("q{}", to_earth_frame(m.q, earth), "wxyz"))).imu("imu")
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9


def test_a_truth_in_the_rows_of_the_samples_needs_no_clock(plain, motion, load, xyz):
    m = motion(300)
    text = PLAIN + "    truth: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    session = load(text, plain(m, more=xyz("q{}", m.q, "wxyz")))
    assert "structure.truth_in_rows" in codes(session)
    assert not session.analysis.estimate.align_clock


# --- situations from public reports


@pytest.mark.parametrize(
    ("name", "count"),
    [("12_utf16_without_mark", 120), ("13_decimal_comma_whole_numbers_first", 200)],
)
def test_files_of_other_locales_are_read(name, count, cases, tmp_path, clock):
    asked = Options(str(cases / name / "map.yaml"))
    files = [cases / name / "data.csv"]
    session = import_recording("generic", files, tmp_path / "s", clock, asked)
    assert len(session.imu("imu")) == count


def test_the_files_of_a_phone_are_one_sensor_or_refused(cases, tmp_path, clock):
    folder = cases / "19_phone_one_file_a_quantity"
    files = [folder / "Accelerometer.csv", folder / "Gyroscope.csv"]
    asked = Options(str(folder / "map.yaml"))
    with pytest.raises(FileProblems, match="acc and gyr are both read from x, y, z of Acc"):
        import_recording("generic", files, tmp_path / "s", clock, asked)
    session = import_recording("generic", files, tmp_path / "s", clock, Options("sensor_logger"))
    assert session.sensor_names == ["phone"] and len(session.imu("phone")) == 375
    assert np.isfinite(session.imu("phone").gyr).all()


def test_a_log_of_a_robot_is_called_by_its_name(cases, tmp_path, clock):
    folder = cases / "22_mcap_and_bag"
    asked = Options(str(folder / "map.yaml"))
    with pytest.raises(FileProblems, match="this is an MCAP file"):
        import_recording("generic", [folder / "x.mcap"], tmp_path / "s", clock, asked)
