"""Times of imported files: units, rates, clocks that are shared, local times that jump."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.stamps import unix_unit
from testbench.formats.truth.attach import TruthOptions
from testbench.records.session.session import Session

MAP = """\
description: board
time: {{column: t, unit: {unit}}}
sensors:
  imu:
    acc: {{columns: [ax, ay, az], unit: m/s^2}}
    gyr: {{columns: [wx, wy, wz], unit: rad/s}}
"""
UNIX_S = 1_600_000_000


@pytest.fixture
def load(tmp_path, clock):
    def read(name: str, *files: Path, truth: TruthOptions | None = None, **options) -> Session:
        out = tmp_path / f"session{len(list(tmp_path.glob('session*')))}"
        return import_recording(name, list(files), out, clock, Options(**options), truth)

    return read


@pytest.fixture
def board(table, xyz, tmp_path):
    """A file of our own board, and its mapping."""

    def write(m, t, unit: str = "s", name: str = "data.csv", form: str = "%.13g"):
        columns = {"t": t} | xyz("a{}", m.acc, "xyz") | xyz("w{}", m.gyr, "xyz")
        mapping = tmp_path / f"{unit}.yaml"
        mapping.write_text(MAP.format(unit=unit))
        return table(name, columns, form=form), str(mapping)

    return write


def codes(session: Session) -> list[str]:
    return [f.code for f in session.manifest.findings if f.code.startswith(("time.", "clock."))]


@pytest.mark.parametrize(
    ("stated", "factor", "fits", "read_hz"),
    [
        ("s", 1e3, "ms", "0.1 Hz"),
        ("s", 1e6, "us", "0.0001 Hz"),
        ("s", 1e9, "ns", "1e-07 Hz"),
        ("ms", 1.0, "s", "1e+05 Hz"),
        ("ms", 1e6, "us", "0.1 Hz"),
        ("us", 1e3, "ms", "1e+05 Hz"),
        ("s", 1 / 86_400, "day", "8.64e+06 Hz"),
    ],
)
def test_a_rate_that_no_sensor_has_is_asked_about_and_answered(
    board, motion, load, stated, factor, fits, read_hz
):
    m = motion(500)
    file, mapping = board(m, m.t * factor, stated)
    with pytest.raises(InputError) as caught:
        load("generic", file, mapping=mapping)
    said = str(caught.value)
    assert f"in {stated} gives {read_hz}" in said and f"in {fits} it would be 100 Hz" in said
    assert f"--unit time={fits}, or time.unit: {fits} in the mapping" in said
    session = load("generic", file, mapping=mapping, units={"time": fits})
    assert session.manifest.sensors["imu"].rate_hz == pytest.approx(100, rel=1e-3)


def test_a_slow_logger_is_confirmed_by_stating_its_unit(board, motion, load):
    m = motion(500)
    file, mapping = board(m, m.t * 1000)
    answers = {"time": "s", "gyr": "rad/s"}
    session = load("generic", file, mapping=mapping, units=answers)
    assert session.manifest.sensors["imu"].rate_hz == pytest.approx(0.1)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_unix_times_are_told_by_their_size(unit):
    size = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    for seconds in (6.4e8, 1.6e9, 4.0e9):
        assert unix_unit(seconds * size) == unit


@pytest.mark.parametrize(("unit", "size"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_unix_times_taken_for_seconds_are_refused_with_the_unit_that_fits(
    board, motion, load, unit, size
):
    m = motion(400)
    stamps = UNIX_S * int(size) + np.round(m.t * size).astype(np.int64)
    file, mapping = board(m, stamps)
    with pytest.raises(InputError, match=f"look like Unix times in {unit}.*--unit time={unit}"):
        load("generic", file, mapping=mapping)
    time = load("generic", file, mapping=mapping, units={"time": unit}).imu("imu").host_time_ns
    np.testing.assert_array_equal(time, np.round(m.t * 1e9))


def test_a_time_without_a_unit_is_read_by_its_size(table, xyz, motion, load):
    m = motion(400)
    stamps = (UNIX_S * 1000 + np.round(m.t * 1000)).astype(np.int64)
    columns = {"timestamp": stamps} | xyz("Acc{} (m/s^2)", m.acc) | xyz("Gyr{} (rad/s)", m.gyr)
    session = load("technaid", table("walk.csv", columns))
    assert codes(session) == ["time.epoch"]
    assert session.manifest.sensors["walk"].rate_hz == 100


@pytest.mark.parametrize("name", ["mti_mat", "imu_tk", "shimmer", "ngimu", "xsens_dot", "mtw"])
def test_every_format_takes_an_answer_on_its_time(name, table, xyz, motion, load, tmp_path):
    m = motion(400)
    ms = np.round(m.t * 1000).astype(int)
    acc, gyr = xyz("Acc_{}", m.acc), xyz("Gyr_{}", m.gyr)
    if name == "mti_mat":
        files = [tmp_path / "a.mat"]
        savemat(files[0], {"t": m.t * 1000, "acc": m.acc, "gyr": m.gyr})
    elif name == "imu_tk":
        files = [tmp_path / "a_acc.txt", tmp_path / "a_gyr.txt"]
        for file, values in zip(files, (m.acc, m.gyr), strict=True):
            np.savetxt(file, np.column_stack([ms, values]), fmt="%.9g")
    elif name == "shimmer":
        columns = {"S_Timestamp_CAL": m.t} | {f"S_Accel_LN_{k[-1]}_CAL": v for k, v in acc.items()}
        columns |= {f"S_Gyro_{k[-1]}_CAL": np.degrees(v) for k, v in gyr.items()}
        units = ",".join(["ms"] + ["m/(s^2)"] * 3 + ["deg/s"] * 3) + "\n"
        files = [table("s.csv", columns, below=units)]
    elif name == "ngimu":
        columns = {"Time (s)": ms} | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
        files = [table("sensors.csv", columns | xyz("Accelerometer {} (g)", m.acc / 9.80665))]
    elif name == "xsens_dot":
        columns = {"PacketCounter": np.arange(400), "SampleTimeFine": 5 + ms}
        files = [table("d.csv", columns | acc | {k: np.degrees(v) for k, v in gyr.items()})]
    else:
        columns = {"PacketCounter": np.arange(400), "SampleTimeFine": 1000 * ms}
        files = [table("MT_a_00B4AAAA.txt", columns | acc | gyr, separator="\t")]
    unit = {"shimmer": "s", "mtw": "us"}.get(name, "ms")
    with pytest.raises(InputError, match=f"Hz; in {unit} it would be 100 Hz.*--unit time={unit}"):
        load(name, *files)
    others = {"acc": "m/s^2", "gyr": "rad/s"} if name in {"mti_mat", "imu_tk"} else {}
    session = load(name, *files, units={"time": unit} | others)
    (sensor,) = session.manifest.sensors.values()
    assert sensor.rate_hz == pytest.approx(100)


def test_an_answer_that_makes_no_rate_at_all_is_refused(board, motion, load):
    m = motion(200)
    file, mapping = board(m, np.round(m.t * 1e9), "ns", form="%.0f")
    with pytest.raises(InputError, match=r"in day gives .* Hz; a rate lies between 0.001"):
        load("generic", file, mapping=mapping, units={"time": "day"})


def test_an_answer_on_time_without_a_column_of_times_is_refused(table, xyz, motion, load):
    columns = xyz("Acc{} (m/s^2)", motion(100).acc) | xyz("Gyr{} (rad/s)", motion(100).gyr)
    with pytest.raises(InputError, match="--unit time=ms: has no effect"):
        load("technaid", table("walk.csv", columns), rate=100.0, units={"time": "ms"})


def test_a_stated_rate_does_not_hide_holes_and_is_compared_with_the_stamps(board, motion, load):
    m = motion(500)
    t = m.t + 2.0 * (np.arange(500) >= 300)
    file, mapping = board(m, t)
    session = load("generic", file, mapping=mapping, rate=100.0)
    np.testing.assert_allclose(session.imu("imu").host_time_ns / 1e9, t, atol=1e-9)
    assert codes(session) == ["time.gaps", "time.by_rate", "time.holes_by_rate"]
    session = load("generic", file, mapping=mapping, rate=50.0, units={"gyr": "rad/s"})
    time = session.imu("imu").host_time_ns / 1e9
    np.testing.assert_allclose(time, 2 * t, atol=1e-9)
    found = next(f for f in session.manifest.findings if f.code == "time.rate_differs")
    assert (found.values["stated_hz"], round(float(found.values["measured_hz"]))) == (50, 100)


def test_a_rate_in_a_mapping_that_the_stamps_deny_is_said_and_not_believed(board, motion, load):
    m = motion(500)
    file, mapping = board(m, m.t)
    Path(mapping).write_text(Path(mapping).read_text() + "rate_hz: 50\n")
    session = load("generic", file, mapping=mapping)
    assert codes(session) == ["time.mapping_rate_differs"]
    assert session.manifest.sensors["imu"].rate_hz == 100


def test_a_rate_bridges_a_clock_that_began_again(board, motion, load):
    m = motion(500)
    t = np.where(np.arange(500) < 300, m.t, m.t - 2.9)
    file, mapping = board(m, t)
    with pytest.raises(InputError, match=r"data\.csv:302: time goes back from 2\.99"):
        load("generic", file, mapping=mapping)
    session = load("generic", file, mapping=mapping, rate=100.0)
    np.testing.assert_allclose(session.imu("imu").host_time_ns / 1e9, m.t, atol=1e-9)
    assert "time.restart" in codes(session)


@pytest.mark.parametrize(
    ("forms", "expected"),
    [
        (("2024-03-31T01:59:5{s:.2f}+01:00", "2024-03-31T03:00:0{s:.2f}+02:00"), []),
        (("2024-03-31 01:59:5{s:.2f}", "2024-03-31 03:00:0{s:.2f}"), ["time.hour"]),
        (("2024-10-27 02:59:5{s:.2f}", "2024-10-27 02:00:0{s:.2f}"), ["time.hour"]),
        (("23:59:5{s:.2f}", "00:00:0{s:.2f}"), []),
    ],
)
def test_daylight_saving_and_midnight_leave_no_hole(board, motion, load, forms, expected):
    m = motion(500)
    seconds = 6.0 + m.t
    texts = [forms[int(s >= 10)].format(s=s % 10) for s in seconds.round(2)]
    file, mapping = board(m, texts, "clock")
    session = load("generic", file, mapping=mapping)
    np.testing.assert_allclose(session.imu("imu").host_time_ns / 1e9, m.t, atol=1e-6)
    assert codes(session) == expected


def test_days_between_dates_are_kept(board, motion, load):
    m = motion(400)
    texts = [f"2024-05-0{1 + 2 * (i >= 200)} 10:00:0{t:.2f}" for i, t in enumerate(m.t)]
    file, mapping = board(m, texts, "clock")
    time = load("generic", file, mapping=mapping).imu("imu").host_time_ns / 1e9
    assert time[200] - time[199] == pytest.approx(2 * 86_400 + 0.01, abs=1e-5)


def test_matrix_stamps_of_whole_minutes_need_a_rate_or_a_whole_minute(table, xyz, motion, load):
    m = motion(600, 2.0)
    columns = xyz("acc_{}", m.acc / 9.80665, "xyz") | xyz("gyr_{}", np.degrees(m.gyr), "xyz")
    stamps = [f"2023-03-01 10:{int(20 + (t + 30) // 60):02d}" for t in m.t]
    whole = load("matrix", table("a.csv", {"dateTime": stamps} | columns))
    assert whole.manifest.sensors["a"].rate_hz == pytest.approx(2)
    np.testing.assert_allclose(whole.imu("a").host_time_ns / 1e9, m.t, atol=1e-6)
    short = table("b.csv", {key: v[:150] for key, v in ({"dateTime": stamps} | columns).items()})
    with pytest.raises(InputError, match=r"whole minutes.*--rate HZ"):
        load("matrix", short)
    stated = load("matrix", short, rate=2.0)
    np.testing.assert_allclose(stated.imu("b").host_time_ns / 1e9, m.t[:150], atol=1e-6)


def two_boards(board, motion, starts, unit: str = "s"):
    m = motion(400)
    files = [board(m, start + m.t, unit, f"{i}.csv") for i, start in enumerate(starts)]
    return m, [file for file, _ in files], files[0][1]


def test_files_with_unix_times_keep_their_offsets(board, motion, load):
    _, files, mapping = two_boards(board, motion, [UNIX_S + 1.5, UNIX_S])
    session = load("generic", *files, mapping=mapping)
    begins = [session.imu(name).host_time_ns[0] / 1e9 for name in session.sensor_names]
    np.testing.assert_allclose(begins, [1.5, 0.0], atol=1e-6)
    assert codes(session) == ["clock.common"]


def test_a_truth_in_the_same_rows_moves_with_its_sensor_on_the_common_clock(
    table, xyz, motion, load, tmp_path
):
    m, files = motion(400), []
    for i, start in enumerate((UNIX_S + 1.5, UNIX_S)):
        columns = {"t": start + m.t} | xyz("a{}", m.acc, "xyz") | xyz("w{}", m.gyr, "xyz")
        files.append(table(f"{i}.csv", columns | xyz("q{}", m.q, "wxyz"), form="%.13g"))
    mapping = tmp_path / "truth.yaml"
    truth = "    truth: {columns: [qw, qx, qy, qz], order: wxyz}\n"
    mapping.write_text(MAP.format(unit="s") + truth)
    session = load("generic", *files, mapping=str(mapping))
    for name in session.sensor_names:
        np.testing.assert_array_equal(
            session.truth(name).host_time_ns, session.imu(name).host_time_ns
        )


def test_files_with_clocks_of_their_own_begin_together_and_it_is_said(board, motion, load):
    _, files, mapping = two_boards(board, motion, [100.0, 3.0])
    session = load("generic", *files, mapping=mapping)
    assert [session.imu(name).host_time_ns[0] for name in session.sensor_names] == [0, 0]
    assert codes(session) == ["clock.own"]


def test_files_that_are_days_apart_begin_together_and_it_is_said(board, motion, load):
    _, files, mapping = two_boards(board, motion, [UNIX_S, UNIX_S + 200_000.0])
    session = load("generic", *files, mapping=mapping)
    assert [session.imu(name).host_time_ns[0] for name in session.sensor_names] == [0, 0]
    (found,) = (f for f in session.manifest.findings if f.code == "clock.apart")
    assert found.values["apart_s"] == pytest.approx(200_000 - 3.99, abs=0.1)


@pytest.mark.parametrize("ticks", [True, False])
def test_sensors_of_one_awinda_station_keep_the_offsets_of_their_counter(
    table, xyz, motion, load, ticks
):
    m, files = motion(400), []
    for device, first in (("00B4AAAA", 65_500), ("00B4AAAB", 65_500 + 150)):
        columns = {"PacketCounter": (first + np.arange(400)) % 65_536}
        columns |= {"SampleTimeFine": 100 * np.arange(400)} if ticks else {}
        columns |= xyz("Acc_{}", m.acc) | xyz("Gyr_{}", m.gyr)
        above = f"// DeviceId: {device}\n// Update Rate: 100.0Hz\n"
        files.append(table(f"MT_0120-000_{device}.txt", columns, above, "\t"))
    session = load("mtw", *files)
    begins = [session.imu(name).host_time_ns[0] / 1e9 for name in session.sensor_names]
    np.testing.assert_allclose(begins, [0.0, 1.5], atol=1e-6)
    assert codes(session)[:1] == ["clock.common"]
    assert set(codes(session)[1:]) == {"time.by_column" if ticks else "time.by_counter"}


def test_two_ngimus_keep_the_offsets_of_their_common_time(table, xyz, motion, load):
    m, files = motion(400), []
    for i, device in enumerate(("a", "b")):
        columns = {"Time (s)": 2.5 * i + m.t} | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
        columns |= xyz("Accelerometer {} (g)", m.acc / 9.80665)
        files.append(table(f"{device}/sensors.csv", columns))
    session = load("ngimu", *files)
    begins = [session.imu(name).host_time_ns[0] / 1e9 for name in ("a", "b")]
    np.testing.assert_allclose(begins, [0.0, 2.5], atol=1e-6)


@pytest.mark.parametrize(("later", "kept"), [(1.25, 1.25), (-0.5, -0.5), (9000.0, 0.0)])
def test_a_truth_with_unix_times_keeps_its_place(board, motion, load, table, xyz, later, kept):
    m = motion(400)
    file, mapping = board(m, UNIX_S + m.t)
    stamps = np.round((UNIX_S + later + m.t[::4]) * 1000).astype(np.int64)
    poses = table("poses.csv", {"timestamp": stamps} | xyz("q_{}", m.q[::4], "wxyz"))
    session = load("generic", file, mapping=mapping, truth=TruthOptions(poses))
    truth = session.truth("imu")
    assert truth.host_time_ns[0] / 1e9 == pytest.approx(kept, abs=1e-6)
    said = "clock.truth" if kept else "clock.truth_apart"
    assert codes(session) == ["time.epoch", said]


def test_the_unit_of_a_truths_times_is_asked_for_and_answered(board, motion, load, table, xyz):
    m = motion(400)
    file, mapping = board(m, m.t)
    poses = table("poses.csv", {"t": m.t[::4] * 1000} | xyz("q_{}", m.q[::4], "wxyz"))
    with pytest.raises(InputError, match=r"in ms it would be 25 Hz.*--truth-time-unit ms"):
        load("generic", file, mapping=mapping, truth=TruthOptions(poses))
    truth = TruthOptions(poses, time_unit="ms")
    session = load("generic", file, mapping=mapping, truth=truth)
    assert session.truth("imu").host_time_ns[-1] / 1e9 == pytest.approx(m.t[396], abs=1e-6)
    truth = TruthOptions(poses, time_unit="ms", rate=25.0)
    with pytest.raises(InputError, match="--truth-time-unit has no effect"):
        load("generic", file, mapping=mapping, truth=truth)


# --- Situations of users


@pytest.mark.parametrize(
    ("case", "name", "files", "mapped", "said"),
    [
        ("03_milliseconds_read_as_seconds", "generic", ["data.csv"], True, "in ms .* 25 Hz"),
        ("04_imu_tk_times_in_ns", "imu_tk", ["acc.txt", "gyr.txt"], False, "Unix times in ns"),
        ("08_mtw_sampletimefine_in_us", "mtw", ["MT_demo_00B4AAAA.txt"], False, "in us .* 25 Hz"),
        ("09_unix_ms_in_mat", "mti_mat", ["rec.mat"], False, "in ms .* 25 Hz"),
    ],
)
def test_the_time_is_asked_about_and_not_the_gyroscope(
    cases, load, case, name, files, mapped, said
):
    folder = cases / case
    mapping = str(folder / "map.yaml") if mapped else None
    paths = [folder / file for file in files]
    with pytest.raises(InputError, match=said) as caught:
        load(name, *paths, mapping=mapping)
    unit = str(caught.value).split("--unit time=")[1][:2]
    session = load(name, *paths, mapping=mapping, units={"time": unit})
    assert [s.rate_hz for s in session.manifest.sensors.values()] == [pytest.approx(25)]


@pytest.mark.parametrize(
    ("case", "code", "count"),
    [("05_repeated_rows", "time.repeated", 250), ("06_one_stamp_per_packet", "time.grouped", 250)],
)
def test_repeated_rows_and_packets_are_mended(cases, load, case, code, count):
    folder = cases / case
    session = load("generic", folder / "data.csv", mapping=str(folder / "map.yaml"))
    time = session.imu("imu").host_time_ns
    np.testing.assert_array_equal(time, 50_000_000 * np.arange(count))
    np.testing.assert_array_equal(session.truth("imu").host_time_ns, time)
    assert codes(session) == [code] and session.manifest.sensors["imu"].rate_hz == 20


def test_two_shimmers_keep_their_offset(cases, load):
    folder = cases / "07_two_shimmers_started_apart"
    session = load("shimmer", folder / "left.csv", folder / "right.csv")
    begins = [session.imu(name).host_time_ns[0] / 1e9 for name in session.sensor_names]
    np.testing.assert_allclose(begins, [0.0, 4.0], atol=1e-9)


def test_an_arms_log_in_unix_ms_is_read(cases, load):
    folder = cases / "17_arm_log_unix_ms"
    truth = TruthOptions(folder / "arm.csv", "ur3e", {"": "wrist_3_link"})
    session = load("generic", folder / "imu.csv", mapping=str(folder / "map.yaml"), truth=truth)
    time = session.truth("imu").host_time_ns
    assert (len(time), time[0]) == (200, 0) and time[-1] / 1e9 == pytest.approx(15.92)
