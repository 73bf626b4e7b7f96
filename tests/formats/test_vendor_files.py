"""Files as vendors describe them, written by the tests; and the real imu_tk pair."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.records.session.session import Session
from tests.told import codes

G = 9.80665


@pytest.fixture
def load(tmp_path, clock):
    def read(name: str, *files: Path, **options) -> Session:
        return import_recording(
            name, list(files), tmp_path / "session", clock, Options(**options) if options else None
        )

    return read


def same(samples, m, tolerance: float = 1e-6) -> None:
    np.testing.assert_allclose(samples.acc, m.acc, atol=tolerance * 10)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=tolerance)


# --- MATRIX


def matrix_columns(m, xyz, start: float = 45_296.3) -> dict:
    seconds = np.floor(start + m.t).astype(int)
    stamps = [f"2023-03-01 {s // 3600:02d}:{s // 60 % 60:02d}:{s % 60:02d}" for s in seconds]
    columns = (
        {"dateTime": stamps}
        | xyz("acc_{}", m.acc / G, "xyz")
        | xyz("gyr_{}", np.degrees(m.gyr), "xyz")
    )
    return columns | {
        "bodySurface_temp": np.full(len(m.t), 31.5),
        "hr": np.zeros(len(m.t)),
        "remarks": [""] * len(m.t),
    }


def test_matrix_spreads_its_samples_over_the_seconds(table, xyz, motion, load):
    m = motion(1000, 100.0)
    session = load("matrix", table("MATA1.csv", matrix_columns(m, xyz)))
    samples = session.imu("MATA1")
    same(samples, m)
    np.testing.assert_array_equal(np.diff(samples.host_time_ns), 10_000_000)
    assert session.manifest.sensors["MATA1"].rate_hz == 100
    assert any("bodySurface_temp, hr, remarks" in note for note in session.manifest.notes)


def test_matrix_measures_a_rate_that_is_not_the_nominal_one(table, xyz, motion, load):
    m = motion(8000, 96.0)
    session = load("matrix", table("slow.csv", matrix_columns(m, xyz)))
    assert session.manifest.sensors["slow"].rate_hz == pytest.approx(96, rel=2e-3)
    assert session.manifest.duration_s == pytest.approx(7999 / 96, rel=2e-3)


@pytest.mark.parametrize(
    "form",
    [
        "01/03/2023 {h:02d}:{m:02d}:{s:02d}",
        "2023-03-01T{h:02d}:{m:02d}:{s:02d}+01:00",
        "{h}:{m:02d}:{s:02d}",
        "pm",
    ],
)
def test_matrix_stamps_in_several_styles_and_over_midnight(table, xyz, motion, load, form):
    m = motion(1000, 100.0)
    columns = matrix_columns(m, xyz)
    seconds = np.floor(86_395.2 + m.t).astype(int) % 86_400
    if form == "pm":
        columns["dateTime"] = [
            f"3/1/2023 {(s // 3600 - 1) % 12 + 1}:{s // 60 % 60:02d}:{s % 60:02d} "
            f"{'PM' if s > 43_200 else 'AM'}"
            for s in seconds
        ]
    else:
        columns["dateTime"] = [form.format(h=s // 3600, m=s // 60 % 60, s=s % 60) for s in seconds]
    samples = load("matrix", table("m.csv", columns)).imu("m")
    np.testing.assert_array_equal(np.diff(samples.host_time_ns), 10_000_000)


def test_matrix_without_a_time_of_day_is_refused_with_its_line(table, xyz, motion, load):
    columns = matrix_columns(motion(300), xyz)
    columns["dateTime"][100] = "yesterday"
    with pytest.raises(
        FileProblems, match=r"m\.csv:102: 'yesterday' does not end in a time of day"
    ):
        load("matrix", table("m.csv", columns))


# --- imu_tk


@pytest.mark.data
def test_the_real_imu_tk_pair_keeps_its_counts_exactly(data, load):
    files = [data / "imu_tk" / f"xsens_{kind}.mat" for kind in ("acc", "gyro")]
    session = load("imu_tk", *reversed(files))
    samples, scales = session.imu("imu"), session.manifest.content["sensors"]["imu"]["raw_counts"]
    for values, file, key, per in (
        (samples.acc, files[0], "acc", "counts_per_m_s2"),
        (samples.gyr, files[1], "gyr", "counts_per_rad_s"),
    ):
        raw = np.loadtxt(file)
        np.testing.assert_array_equal(
            np.round(values * scales[key][per] + scales[key]["offset"]), raw[:, 1:]
        )
        np.testing.assert_allclose(samples.host_time_ns * 1e-9, raw[:, 0] - raw[0, 0], atol=1e-9)
    assert session.manifest.duration_s == pytest.approx(511.688, abs=1e-3)
    assert session.manifest.sensors["imu"].rate_hz == pytest.approx(100.01, abs=0.01)
    still = samples.host_time_ns < 45e9
    assert np.linalg.norm(samples.acc[still].mean(axis=0)) == pytest.approx(
        9.81, rel=0.1
    )  # nominal scale, offsets not removed
    assert samples.acc[still].std(axis=0).max() < 0.05
    assert any("9.81744" in note for note in session.manifest.notes)


def pair(folder: Path, m, shift: float = 0.0, cut: int = 0) -> list[Path]:
    files = [folder / "a_acc.txt", folder / "a_gyro.txt"]
    np.savetxt(files[0], np.column_stack([m.t, m.acc]), fmt="%.9g")
    np.savetxt(
        files[1],
        np.column_stack([m.t + shift, m.gyr])[: len(m.t) - cut],
        fmt="%.9g",
        delimiter="   ",
    )
    return files


def test_an_imu_tk_pair_in_si_units_is_told_by_gravity_and_turns(tmp_path, motion, load):
    m = motion(600)
    session = load("imu_tk", *pair(tmp_path, m))
    same(session.imu("imu"), m)
    assert {"unit.acc_by_gravity", "unit.gyr_by_turns"} <= codes(session)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"shift": 0.5}, "a_gyro.txt:1: time 0.5, where"),
        ({"cut": 7}, "a_acc.txt:594: has more samples"),
    ],
)
def test_files_that_are_no_pair_are_refused(tmp_path, motion, load, change, said):
    with pytest.raises(FileProblems, match=said):
        load("imu_tk", *pair(tmp_path, motion(600), **change))


def test_imu_tk_needs_two_files_of_four_numbers(tmp_path, motion, load):
    with pytest.raises(InputError, match="a pair of files"):
        load("imu_tk", tmp_path / "one.txt")
    for name in ("three.txt", "other.txt"):
        (tmp_path / name).write_text("0 1 2\n0.1 1 2\n")
    with pytest.raises(FileProblems, match=r"three.txt:1: .*four numbers"):
        load("imu_tk", tmp_path / "three.txt", tmp_path / "other.txt")


# --- Technaid


def test_technaid_reads_several_sensors_with_blanks_in_their_titles(table, xyz, motion, load):
    m = motion(600, 60.0)
    columns = {" Time (s) ": m.t}
    for name in ("Shank", "Thigh"):
        columns |= (
            xyz(f" {name} Acc{{}} ", m.acc)
            | xyz(f" {name} Gyr{{}} ", m.gyr)
            | xyz(f" {name} Mag{{}} ", m.mag)
        )
        columns |= xyz(f" {name} q{{}}", m.q, "0123")
    session = load("technaid", table("gait.csv", columns))
    assert session.sensor_names == ["Shank", "Thigh"]
    samples = session.imu("Thigh")
    same(samples, m)
    np.testing.assert_allclose(samples.device_q, m.q, atol=1e-8)
    assert session.manifest.sensors["Shank"].rate_hz == pytest.approx(60, rel=1e-4)
    assert any("gyr is taken for rad/s" in note for note in session.manifest.notes)


def test_technaid_without_times_asks_for_the_rate(table, xyz, motion, load):
    m = motion(600, 60.0)
    columns = xyz("acc_{}", m.acc / G) | xyz("gyr_{}", np.degrees(m.gyr))
    with pytest.raises(InputError, match="--rate HZ"):
        load("technaid", table("t.csv", columns))
    session = load("technaid", table("t.csv", columns), rate=60.0)
    same(session.imu("t"), m)
    assert session.manifest.duration_s == pytest.approx(599 / 60)


def test_technaid_at_rest_asks_for_the_gyroscopes_unit(table, xyz, motion, load):
    m = motion(600, 60.0)
    columns = (
        {"time_s": m.t} | xyz("acc_{}", np.tile(m.acc[0], (600, 1))) | xyz("gyr_{}", 0 * m.gyr)
    )
    with pytest.raises(
        InputError,
        match=r"in which unit is the gyroscope\?.*hardly turns.*--unit gyr=UNIT \(rad/s, deg/s, "
        r"mdeg/s\)",
    ):
        load("technaid", table("t.csv", columns))
    assert len(load("technaid", table("t.csv", columns), units={"gyr": "deg/s"}).imu("t")) == 600


def technaid_pair(table, xyz, m, shift: float = 0.0, times: bool = True) -> list[Path]:
    """Physical data at 60 Hz and quaternions at half of it, each in its own file."""
    stamps = {" Time (s) ": m.t} if times else {}
    physical, quaternions = dict(stamps), {k: v[::2] + shift for k, v in stamps.items()}
    for name in ("Shank", "Thigh"):
        physical |= xyz(f" {name} Acc{{}} (m/s^2) ", m.acc)
        physical |= xyz(f" {name} Gyr{{}} (rad/s) ", m.gyr)
        quaternions |= xyz(f" {name} q{{}}", m.q[:: 2 if times else 1], "0123")
    return [table("walk_phys.csv", physical), table("walk_quat.csv", quaternions)]


@pytest.mark.parametrize("turned_round", [False, True])
def test_two_technaid_files_of_one_recording_are_merged(table, xyz, motion, load, turned_round):
    m = motion(600, 60.0)
    files = technaid_pair(table, xyz, m)
    session = load("technaid", *(files[::-1] if turned_round else files))
    assert session.sensor_names == ["Shank", "Thigh"]
    samples = session.imu("Thigh")
    same(samples, m)
    dot = np.abs(np.sum(samples.device_q * m.q, axis=1))
    assert np.degrees(2 * np.arccos(np.clip(dot, 0, 1))).max() < 0.1


def test_technaid_pairs_without_times_are_merged_row_by_row(table, xyz, motion, load):
    m = motion(600, 60.0)
    session = load("technaid", *technaid_pair(table, xyz, m, times=False), rate=60.0)
    assert np.abs(np.sum(session.imu("Shank").device_q * m.q, axis=1)).min() > 1 - 1e-9
    assert any("taken to be simultaneous" in note for note in session.manifest.notes)


def test_technaid_files_of_a_single_sensor_are_one_sensor(table, xyz, motion, load):
    m = motion(600, 60.0)
    columns = {"Time (s)": m.t} | xyz("Acc{} (m/s^2)", m.acc)
    columns |= xyz("Gyr{} (rad/s)", m.gyr)
    files = [
        table("walk_phys.csv", columns),
        table("walk_quat.csv", {"Time (s)": m.t} | xyz("q{}", m.q, "0123")),
    ]
    session = load("technaid", *files)
    assert session.sensor_names == ["walk"]
    assert session.imu("walk").device_q is not None


def test_technaid_files_without_a_common_time_are_refused(table, xyz, motion, load):
    with pytest.raises(FileProblems, match=r"walk_quat\.csv: from 100 to .*no time in common"):
        load("technaid", *technaid_pair(table, xyz, motion(600, 60.0), shift=100.0))


# --- Shimmer


def shimmer(
    table, xyz, m, separator: str = "\t", wide_only: bool = False, dates: bool = False
) -> Path:
    columns: dict = {}
    units = []
    if dates:
        columns["Shimmer_40AC_Timestamp_FormattedUnix_CAL"] = [
            f"2020/07/28 12:56:{s:06.3f}" for s in 10 + m.t
        ]
        units.append("yyyy/mm/dd hh:mm:ss.SSS")
    else:
        columns["Shimmer_40AC_Timestamp_Unix_CAL"] = 1_595_933_810_034.0 + np.round(1000 * m.t)
        units.append("ms")
    if not wide_only:
        columns |= xyz("Shimmer_40AC_Accel_LN_{}_CAL", m.acc)
        units += ["m/(s^2)"] * 3
    columns |= xyz("Shimmer_40AC_Accel_WR_{}_CAL", m.acc + (0 if wide_only else 0.4))
    columns["Shimmer_40AC_Battery_CAL"] = np.full(len(m.t), 4139.19)
    columns |= xyz("Shimmer_40AC_Gyro_{}_CAL", np.degrees(m.gyr)) | xyz(
        "Shimmer_40AC_Mag_{}_CAL", m.mag / 40
    )
    units += ["m/(s^2)"] * 3 + ["mV"] + ["deg/s"] * 3 + ["local_flux"] * 3
    below = separator.join(units) + separator + "\n"
    path = table("shimmer.csv", columns, f'"sep={separator}"\n', separator, below, "%.15g")
    lines = path.read_text().split("\n")
    path.write_text(
        "\n".join(
            [
                lines[0],
                lines[1] + separator,
                lines[2],
                *[line + separator for line in lines[3:] if line],
            ]
        )
        + "\n"
    )
    return path


@pytest.mark.parametrize("separator", ["\t", ";", ","])
def test_shimmer_with_its_row_of_units_and_trailing_separators(table, xyz, motion, load, separator):
    m = motion(600, 51.2)
    session = load("shimmer", shimmer(table, xyz, m, separator))
    samples = session.imu("Shimmer_40AC")
    same(samples, m)
    np.testing.assert_allclose(samples.mag, m.mag, atol=1e-6)
    assert samples.device_time_ns[0] == 0  # a date is no clock of the sensor
    assert session.manifest.sensors["Shimmer_40AC"].rate_hz == pytest.approx(
        51.2, rel=1e-3
    )  # though stamps are in ms
    assert any("low-noise accelerometer" in note for note in session.manifest.notes)


def test_shimmer_with_only_the_wide_range_and_dates(table, xyz, motion, load):
    m = motion(600, 51.2)
    samples = load("shimmer", shimmer(table, xyz, m, wide_only=True, dates=True)).imu(
        "Shimmer_40AC"
    )
    same(samples, m)
    np.testing.assert_allclose(samples.host_time_ns * 1e-9, m.t, atol=6e-4)


def test_shimmer_raw_counts_are_refused(table, xyz, motion, load):
    m = motion(100)
    columns = (
        {"S_Timestamp_RAW": m.t} | xyz("S_Accel_LN_{}_RAW", m.acc) | xyz("S_Gyro_{}_RAW", m.gyr)
    )
    with pytest.raises(FileProblems, match="export calibrated data"):
        load("shimmer", table("raw.csv", columns))


# --- NGIMU


def ngimu(table, xyz, m, device: str = "NGIMU - 0029D0B4", q_step: int = 1) -> list[Path]:
    columns = (
        {"Time (s)": m.t}
        | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
        | xyz("Accelerometer {} (g)", m.acc / G)
    )
    columns |= xyz("Magnetometer {} (uT)", m.mag) | {"Barometer (hPa)": np.full(len(m.t), 1027.0)}
    nwu = Rotation.from_euler("Z", -90, degrees=True) * Rotation.from_quat(
        m.q, scalar_first=True
    )  # x north, y west, z up
    q = nwu.inv().as_quat(scalar_first=True)  # the device turns the earth into the sensor
    return [
        table(f"{device}/sensors.csv", columns),
        table(
            f"{device}/quaternion.csv", {"Time (s)": m.t[::q_step]} | xyz("{}", q[::q_step], "WXYZ")
        ),
    ]


def test_ngimu_joins_sensors_and_quaternion_of_a_device(table, xyz, motion, load):
    m = motion(600, 50.0)
    files = ngimu(table, xyz, m) + ngimu(table, xyz, m, "NGIMU - 0029C1DA")
    session = load("ngimu", *files)
    assert session.sensor_names == ["NGIMU_0029D0B4", "NGIMU_0029C1DA"]
    samples = session.imu("NGIMU_0029C1DA")
    same(samples, m)
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9
    up = Rotation.from_quat(samples.device_q, scalar_first=True).apply(samples.acc)
    np.testing.assert_allclose(up, np.tile([0, 0, G], (600, 1)), atol=1e-5)
    north = Rotation.from_quat(samples.device_q, scalar_first=True).apply(samples.mag)
    np.testing.assert_allclose(north, np.tile([0, 24.0, -39.0], (600, 1)), atol=1e-4)


def test_ngimu_interpolates_a_slower_quaternion(table, xyz, motion, load):
    m = motion(601, 100.0)
    samples = load("ngimu", *ngimu(table, xyz, m, q_step=4)).imu("NGIMU_0029D0B4")
    dot = np.abs(np.sum(samples.device_q * m.q, axis=1))
    assert np.degrees(2 * np.arccos(np.clip(dot, 0, 1))).max() < 0.2


def test_ngimu_quaternion_alone(table, xyz, motion, load):
    m = motion(600, 50.0)
    session = load("ngimu", ngimu(table, xyz, m)[1])
    samples = session.imu("NGIMU_0029D0B4")
    assert np.isnan(samples.acc).all() and np.isnan(samples.gyr).all()
    assert session.analysis.estimate.filters == ["device"]


def test_two_ngimu_files_of_a_kind_in_one_folder_are_refused(table, xyz, motion, load):
    (sensors, _), m = ngimu(table, xyz, motion(100)), motion(100)
    other = table(
        f"{sensors.parent.name}/more.csv", {"Time (s)": m.t} | xyz("Gyroscope {} (deg/s)", m.gyr)
    )
    with pytest.raises(InputError, match=r"both the sensors\.csv of one device"):
        load("ngimu", sensors, other)


# --- MT Manager

OLD = (
    "// Start Time: Unknown\n// Update Rate: {rate}Hz\n// Filter Profile: human (46.1)\n// "
    "Firmware Version: 4.0.2\n"
)
NEW = (
    "// General information: \n//  MT Manager version: 2022.2.0 \n//  DeviceId: 00B42D4F\n// "
    "Coordinate system: {earth}\n"
)


def mtw(
    table, xyz, m, above: str, groups: dict, name: str = "MT_0120-000_00B432CC.txt", **more
) -> Path:
    n = len(m.t)
    columns = (
        {"PacketCounter": (65_400 + np.arange(n)) % 65_536}
        | more.pop("first", {})
        | {"Year": ["" for _ in range(n)]}
    )
    for pattern, (array, axes) in groups.items():
        columns |= xyz(pattern, array, axes)
    return table(name, columns, above, "\t")


def test_mtw_by_counter_and_update_rate_with_a_rotation_matrix(table, xyz, motion, load):
    m = motion(600, 100.0)
    matrix = Rotation.from_quat(m.q, scalar_first=True).as_matrix()
    columns = {f"Mat[{r + 1}][{c + 1}]": matrix[:, r, c] for c in range(3) for r in range(3)}
    path = mtw(
        table,
        xyz,
        m,
        OLD.format(rate="100.0"),
        {"Acc_{}": (m.acc, "XYZ"), "Gyr_{}": (m.gyr, "XYZ")},
        first=columns,
    )
    session = load("mtw", path)
    samples = session.imu("imu_00B432CC")
    same(samples, m)
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9
    np.testing.assert_array_equal(np.diff(samples.host_time_ns), 10_000_000)
    np.testing.assert_array_equal(np.diff(samples.counter), 1)  # over the wrap at 65535


def test_mtw_by_ticks_of_a_tenth_of_a_millisecond(table, xyz, motion, load):
    m = motion(600, 40.0)
    ticks = {"SampleTimeFine": (2**32 - 5000 + 250 * np.arange(600)) % 2**32}
    session = load(
        "mtw",
        mtw(
            table,
            xyz,
            m,
            NEW.format(earth="ENU"),
            {"Acc_{}": (m.acc, "XYZ"), "Quat_q{}": (m.q, "0123")},
            first=ticks,
        ),
    )
    assert session.sensor_names == ["imu_00B42D4F"]
    assert session.manifest.sensors["imu_00B42D4F"].rate_hz == 40
    np.testing.assert_array_equal(np.diff(session.imu("imu_00B42D4F").device_time_ns), 25_000_000)


@pytest.mark.parametrize("earth", ["NED", "NWU"])
def test_mtw_in_another_earth_is_turned_to_east_north_up(table, xyz, motion, load, earth):
    m = motion(600, 100.0)
    enu_from = {
        "NED": [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
        "NWU": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    }[earth]
    q = (Rotation.from_matrix(enu_from).inv() * Rotation.from_quat(m.q, scalar_first=True)).as_quat(
        scalar_first=True
    )
    groups = {"Acc_{}": (m.acc, "XYZ"), "Gyr_{}": (m.gyr, "XYZ"), "Quat_q{}": (q, "0123")}
    samples = load("mtw", mtw(table, xyz, m, NEW.format(earth=earth), groups), rate=100.0).imu(
        "imu_00B42D4F"
    )
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-9


def test_mtw_without_a_rate_asks_for_it(table, xyz, motion, load):
    m = motion(100)
    path = mtw(
        table,
        xyz,
        m,
        NEW.format(earth="ENU"),
        {"Acc_{}": (m.acc, "XYZ")},
        first={"SampleTimeFine": np.full(100, np.nan)},
    )
    with pytest.raises(
        InputError, match=r"neither an update rate in the header nor SampleTimeFine.*--rate HZ"
    ):
        load("mtw", path)


def test_mtw_ticks_that_deny_the_header_are_believed_and_both_rates_are_said(
    table, xyz, motion, load
):
    m = motion(100)
    path = mtw(
        table,
        xyz,
        m,
        OLD.format(rate="50.0"),
        {"Acc_{}": (m.acc, "XYZ")},
        first={"SampleTimeFine": 100 * np.arange(100)},
    )
    session = load("mtw", path)
    (sensor,) = session.manifest.sensors.values()
    assert sensor.rate_hz == 100
    (found,) = (f for f in session.manifest.findings if f.code == "time.header_rate_differs")
    assert found.values["stated_hz"] == 50 and found.values["measured_hz"] == pytest.approx(100)


# --- MATLAB


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize(
    "names",
    [
        ("acc", "gyr", "mag"),
        ("Accelerometer", "Gyroscope", "Magnetometer"),
        ("imu_acc", "imu_gyr", "imu_mag"),
    ],
)
def test_matlab_arrays_by_their_usual_names_and_either_shape(tmp_path, motion, load, names, wide):
    m = motion(600)
    arrays = dict(zip(names, (m.acc, np.degrees(m.gyr), m.mag), strict=True))
    savemat(
        tmp_path / "mti.mat",
        {name: a.T if wide else a for name, a in arrays.items()} | {"fs": 100.0},
    )
    session = load("mti_mat", tmp_path / "mti.mat")
    same(session.imu("imu"), m)
    assert session.manifest.sensors["imu"].rate_hz == 100
    assert any("gyr is taken for deg/s" in note for note in session.manifest.notes)


def test_matlab_structs_are_sensors(tmp_path, motion, load):
    m = motion(600)
    savemat(
        tmp_path / "two.mat",
        {"t": m.t, "MTi1": {"acc": m.acc, "gyr": m.gyr}, "MTi2": {"acc": m.acc / G, "gyr": m.gyr}},
    )
    session = load("mti_mat", tmp_path / "two.mat")
    assert session.sensor_names == ["MTi1", "MTi2"]
    same(session.imu("MTi2"), m)


def test_matlab_7_3_files_are_read_too(tmp_path, motion, load):
    import h5py

    m = motion(600)
    with h5py.File(tmp_path / "new.mat", "w") as file:
        for name, array in {"acc": m.acc, "gyr": m.gyr, "t": m.t[:, None]}.items():
            file[name] = array.T
    same(load("mti_mat", tmp_path / "new.mat").imu("imu"), m)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"x": np.zeros(5)}, "no arrays called acc, gyr"),
        (
            {"acc": np.zeros((10, 3)), "gyr": np.zeros((9, 3)), "fs": 100.0},
            "differ in length: acc 10, gyr 9",
        ),
        ({"acc": np.ones((10, 3)), "gyr": np.zeros((10, 3))}, "state it with --rate"),
        ({"acc": np.ones((10, 3)), "gyr": np.zeros((10, 3)), "fs": 0.0}, "0 Hz cannot be"),
    ],
)
def test_matlab_files_that_do_not_fit_are_refused(tmp_path, load, content, said):
    savemat(tmp_path / "bad.mat", content)
    with pytest.raises(InputError, match=said):
        load("mti_mat", tmp_path / "bad.mat")
    assert not (tmp_path / "session").exists()
