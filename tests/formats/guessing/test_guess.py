"""`testbench import --guess`: formats, columns, units and times of files, and a mapping of them."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbench.cli import main
from testbench.exceptions import InputError
from testbench.formats import import_recording
from testbench.formats.guessing.titles import read_title
from testbench.formats.options import Options
from testbench.pipeline.bring_in import guess_mapping
from tests.command_line import command
from tests.conftest import FakeClock
from tests.formats.foreign_arrays import mat_with_objects

G = 9.80665


@pytest.fixture
def round_trip(tmp_path, clock):
    """The samples of files by the mapping that was guessed of them."""

    def read(*files: Path, sensor: str = "imu"):
        found = guess_mapping(map(str, files), str(tmp_path / "guessed.yaml"))
        assert found.mapping is not None
        asked = Options(str(found.mapping))
        session = import_recording("generic", list(files), tmp_path / "s", clock, asked)
        return session.imu(sensor), session.manifest.sensors[sensor].rate_hz

    return read


def check(read, m, rate=100.0, atol=1e-5) -> None:
    samples, found = read
    np.testing.assert_allclose(samples.acc, m.acc, atol=atol)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=atol)
    assert found == pytest.approx(rate, rel=1e-3)


TITLES = {
    "short": ("a{}", "g{}", "xyz"),
    "long": ("Acceleration {} (m/s^2)", "Gyroscope {} (rad/s)", "xyz"),
    "ros": ("linear_acceleration.{}", "angular_velocity.{}", "xyz"),
    "joined": ("Acc{}", "Gyro{}", "XYZ"),
    "own": ("acc_{}_m_s2", "gyr_{}_rad_s", "xyz"),
}


@pytest.mark.parametrize("titles", TITLES)
@pytest.mark.parametrize(
    ("time", "scale"), [("t", 1.0), ("time_ms", 1e3), ("timestamp", 1e6), ("Time [ns]", 1e9)]
)
def test_titles_and_units_of_time_are_told(titles, time, scale, table, xyz, motion, round_trip):
    m = motion(2400)
    acc, gyr, axes = TITLES[titles]
    columns = {time: np.round(m.t * scale, 6)} | xyz(acc, m.acc, axes) | xyz(gyr, m.gyr, axes)
    check(round_trip(table("d.csv", columns, form="%.16g")), m)


@pytest.mark.parametrize(("acc", "gyr"), [(G, np.pi / 180), (G / 1000, 1.0)])
@pytest.mark.parametrize("layout", [{}, {"separator": ";", "decimal": ","}, {"above": "a log\n\n"}])
def test_units_are_told_by_gravity_and_turns(acc, gyr, layout, table, xyz, motion, round_trip):
    m = motion(2400)
    columns = {"t": m.t} | xyz("a{}", m.acc / acc, "xyz") | xyz("w{}", m.gyr / gyr, "xyz")
    check(round_trip(table("d.csv", columns, form="%.10f", **layout)), m)


def test_columns_without_titles_are_told_by_their_numbers(tmp_path, motion, round_trip):
    m = motion(2400)
    numbers = np.column_stack([m.t * 1000, m.gyr, m.acc / G])
    np.savetxt(tmp_path / "d.txt", numbers, fmt="%.8f")
    check(round_trip(tmp_path / "d.txt"), m)


def test_raw_counts_without_titles_are_told_by_their_numbers(tmp_path, motion, round_trip):
    m = motion(2400)
    numbers = np.column_stack([m.t * 1000, m.acc / G * 16384, np.degrees(m.gyr) * 131])
    np.savetxt(tmp_path / "d.csv", np.round(numbers), fmt="%d", delimiter=",")
    check(round_trip(tmp_path / "d.csv"), m, atol=0.01)


def test_a_gyroscope_that_the_first_file_lacks_is_that_of_the_others(table, xyz, motion, tmp_path):
    m = motion(2400)
    columns = {"time": m.t} | xyz("acc_{}", m.acc, "xyz")
    lacks = table("left.csv", columns | xyz("gyr_{}", m.gyr * np.nan, "xyz"))
    whole = table("right.csv", columns | xyz("gyr_{}", np.degrees(m.gyr), "xyz"))
    found = guess_mapping([str(lacks), str(whole)], str(tmp_path / "m.yaml"))
    written = (tmp_path / "m.yaml").read_text()
    assert re.search(r"gyr:\s+columns: \[gyr_x, gyr_y, gyr_z\]\s+unit: deg/s", written)
    assert "left.csv: no number stands in gyr_x, gyr_y, gyr_z" in found.seen


@pytest.mark.parametrize("kind", ["parquet", "mat", "hdf5"])
def test_files_of_arrays_and_columns(kind, tmp_path, motion, round_trip):
    m = motion(2400)
    path = tmp_path / f"d.{kind}"
    if kind == "parquet":
        columns = {"stamp_ns": (m.t * 1e9).round().astype(np.int64), "note": ["x"] * 2400}
        columns |= {f"acc_{x}": m.acc[:, i] for i, x in enumerate("xyz")}
        columns |= {f"gyr_{x}": m.gyr[:, i] for i, x in enumerate("xyz")}
        pq.write_table(pa.table(columns), path)
    elif kind == "mat":
        content = {"imu": {"acc": m.acc / G, "gyro": m.gyr, "t": m.t * 1e3}, "fs": 100.0}
        mat_with_objects(path, content)
    else:
        with h5py.File(path, "w") as file:
            file["imu/Accelerometer"], file["imu/Gyroscope"] = m.acc.T, m.gyr.T
            file["imu/Magnetometer"] = m.mag
            file.attrs["sampling_rate"] = 100.0
    check(round_trip(path), m)


def test_a_slow_array_has_times_of_its_own(tmp_path, motion, round_trip):
    m = motion(2400)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["acc"], file["gyr"], file["t"] = m.acc, m.gyr, m.t
        file["slow/mag"], file["slow/t"] = m.mag[::10], m.t[::10]
    samples, _ = round_trip(tmp_path / "d.h5")
    assert np.isfinite(samples.mag[:, 0]).sum() == 240


@pytest.mark.parametrize("earth", ["ENU", "NED"])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_quaternion_is_told_by_gravity(earth, direction, table, xyz, motion, round_trip):
    from testbench.model.earths import to_earth_frame

    m = motion(2400)
    q = to_earth_frame(m.q, earth) * [1, direction, direction, direction]
    columns = {"t": m.t} | xyz("a{}", m.acc, "xyz") | xyz("g{}", m.gyr, "xyz")
    samples, _ = round_trip(table("d.csv", columns | xyz("q{}", q, "wxyz")))
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-8


def test_files_of_one_quantity_each_become_one_sensor(table, xyz, motion, round_trip):
    m = motion(2400)
    files = []
    for name, values in (("Accelerometer", m.acc), ("Gyroscope", np.degrees(m.gyr))):
        ns = 1_700_000_000_000_000_000 + (m.t * 1e9).round().astype(np.int64)
        files.append(table(f"{name}.csv", {"time": ns} | xyz("{}", values, "zyx"[::-1])))
    check(round_trip(*files), m)


@pytest.mark.parametrize(("titles", "parts"), [("qi qj qk qr", "xyzw"), ("q0 q1 q2 q3", "wxyz")])
def test_a_quaternion_by_its_titles_beside_the_clock_of_a_board(
    titles, parts, table, xyz, motion, round_trip
):
    m = motion(600)
    q = dict(zip("wxyz", m.q.T, strict=True))
    columns = {"millis": np.round(m.t * 1000)} | xyz("a{}", m.acc, "xyz")
    columns |= {title: q[part] for title, part in zip(titles.split(), parts, strict=True)}
    samples, rate = round_trip(table("d.csv", columns))
    assert rate == pytest.approx(100.0)
    assert np.abs(np.sum(samples.device_q * m.q, axis=1)).min() > 1 - 1e-8


def test_the_quaternion_of_a_reference_system_is_truth(tmp_path, motion, clock):
    m = motion(600)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["imu_acc"], file["imu_gyr"], file["opt_quat"] = m.acc, m.gyr, m.q
        file["sampling_rate"] = 100.0
    found = guess_mapping([str(tmp_path / "d.h5")], str(tmp_path / "m.yaml"))
    asked = Options(str(found.mapping), units={"gyr": "rad/s"} if found.open_options else {})
    session = import_recording("generic", [tmp_path / "d.h5"], tmp_path / "s", clock, asked)
    assert session.truth("imu") is not None and session.imu("imu").device_q is None


def test_candidates_are_those_that_the_files_speak_of(table, xyz, motion, tmp_path):
    m = motion(600)
    columns = {"time": m.t} | xyz("Acc{}", m.acc, "XYZ") | xyz("Gyr{}", m.gyr, "XYZ")
    found = guess_mapping([str(table("d.csv", columns))], str(tmp_path / "a.yaml"))
    assert "technaid" not in found.formats and not found.shipped
    columns = {title if title == "time" else f"IMU1 {title}": v for title, v in columns.items()}
    found = guess_mapping([str(table("e.csv", columns))], str(tmp_path / "b.yaml"))
    assert "technaid" in found.formats
    ns = {"time": 1_700_000_000_000_000_000 + (m.t * 1e9).round().astype(np.int64)}
    files = [
        table(f"{name}.csv", ns | xyz("{}", values, "xyz"))
        for name, values in (("TotalAcceleration", m.acc), ("Gyroscope", m.gyr))
    ]
    found = guess_mapping(map(str, files), str(tmp_path / "c.yaml"))
    assert list(found.shipped) == ["sensor_logger"]


@pytest.mark.parametrize(("acc", "gyr"), [(16384, 131), (2048, 16.4)])
def test_raw_counts_are_told_with_their_scale(acc, gyr, table, xyz, motion, round_trip, tmp_path):
    m = motion(2400)
    columns = {"millis": np.round(m.t * 1000)}
    columns |= xyz("acc{}", np.round(m.acc / G * acc), "XYZ")
    columns |= xyz("gyro{}", np.round(np.degrees(m.gyr) * gyr), "XYZ")
    path = table("d.csv", columns)
    check(round_trip(path), m, atol=0.01)
    counts = "scale: [^ ]+|unit: (g|deg/s)$"
    bare = re.sub(counts, "", (tmp_path / "guessed.yaml").read_text(), flags=re.MULTILINE)
    (tmp_path / "bare.yaml").write_text(bare)

    def refused(units: dict[str, str]) -> str:
        asked = Options(str(tmp_path / "bare.yaml"), units=units)
        with pytest.raises(InputError) as told:
            import_recording("generic", [path], tmp_path / "t", FakeClock(), asked)
        return str(told.value)

    assert f"raw counts, {acc} to one g" in refused({})
    assert f"raw counts, {gyr} to one deg/s" in refused({"acc": "g"})
    assert "no unit that is stated can confirm" in refused({"acc": "g", "gyr": "deg/s"})


def test_acceleration_without_gravity_is_left_out(table, xyz, motion, tmp_path):
    m = motion(2400)
    columns = {"t": m.t} | xyz("gyr_{}", m.gyr, "xyz") | xyz("FreeAcc_{}", m.acc, "XYZ")
    found = guess_mapping([str(table("d.csv", columns))], str(tmp_path / "free.yaml"))
    assert "FreeAcc_X, FreeAcc_Y, FreeAcc_Z: left out" in found.seen[0]
    columns = {"t": m.t} | xyz("gyr_{}", m.gyr, "xyz") | xyz("LinAcc{}", 1e-3 * m.acc, "XYZ")
    found = guess_mapping([str(table("d.csv", columns))], str(tmp_path / "linear.yaml"))
    assert "gravity was removed" in found.seen[0]
    assert "acc:" not in (tmp_path / "linear.yaml").read_text()


def test_the_command_names_what_the_import_asks_for(table, xyz, motion, tmp_path):
    m = motion(600)
    columns = xyz("a{}", m.acc, "xyz") | xyz("g{}", 0 * m.gyr, "xyz")
    found = guess_mapping([str(table("d.csv", columns))], str(tmp_path / "m.yaml"))
    assert found.open_options == ("--rate HZ", "--unit gyr=UNIT")


def test_two_sensors_in_one_file_are_two(table, xyz, motion, round_trip):
    m = motion(2400)
    columns = {"t": m.t}
    for owner, sign in (("left", 1), ("right", -1)):
        columns |= xyz(f"{owner}_acc_{{}}", sign * m.acc, "xyz")
        columns |= xyz(f"{owner}_gyr_{{}}", m.gyr, "xyz")
    samples, _ = round_trip(table("d.csv", columns), sensor="right")
    np.testing.assert_allclose(samples.acc, -m.acc, atol=1e-5)


def test_two_lines_of_titles_are_joined(xyz, motion, round_trip, tmp_path):
    m = motion(2400)
    parts = [
        (side, f"{kind}_{axis}", (values if side == "left" else -values)[:, i])
        for kind, values in (("acc", m.acc), ("gyr", m.gyr))
        for i, axis in enumerate("xyz")
        for side in ("left", "right")
    ]
    lines = [("sensor", "axis", np.arange(len(m.t))), ("t", "s", m.t), *parts]
    head = "\n".join(",".join(line[i] for line in lines) for i in (0, 1))
    path = tmp_path / "d.csv"
    np.savetxt(
        path, np.column_stack([line[2] for line in lines]), "%.9g", ",", header=head, comments=""
    )
    samples, _ = round_trip(path, sensor="right")
    np.testing.assert_allclose(samples.acc, -m.acc, atol=1e-5)


@pytest.mark.parametrize("titles", ["t,a,a,a,b,b,b", "t,gyr_x,gyr_y,foo,acc_z,acc_x,bar"])
def test_numbers_alone_do_not_contradict_titles(titles, motion, tmp_path):
    m = motion(2400)
    numbers = np.column_stack([m.t, m.acc, m.gyr])
    np.savetxt(tmp_path / "d.csv", numbers, "%.9g", ",", header=titles, comments="")
    with pytest.raises(InputError, match="is recognised among its columns"):
        guess_mapping([str(tmp_path / "d.csv")], str(tmp_path / "m.yaml"))


def test_a_vendors_format_is_named_and_nothing_is_overwritten(
    table, xyz, motion, tmp_path, monkeypatch, capsys
):
    m = motion(300)
    columns = {"Time (s)": m.t} | xyz("Gyroscope {} (deg/s)", np.degrees(m.gyr))
    path = table("sensors.csv", columns | xyz("Accelerometer {} (g)", m.acc / G))
    monkeypatch.chdir(tmp_path)

    def run(*words) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["testbench", "import", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out + said.err

    code, said = run("--guess", path)
    assert code == 0 and "format ngimu: " in said and "in deg/s (by its titles)" in said
    assert (tmp_path / "sensors_mapping.yaml").is_file()
    before = (tmp_path / "sensors_mapping.yaml").read_bytes()
    code, said = run("--guess", path)
    assert code == 2 and "exists already; it is kept" in said
    assert (tmp_path / "sensors_mapping.yaml").read_bytes() == before
    assert run("ngimu", path)[0] == 2 and run("ngimu", "--out", "s")[0] == 2


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("when,price\n1,2\n3,4\n5,6\n", "is recognised among its columns: when, price"),
        ("Dear colleague,\nfind the data attached\n", "no table of numbers is found"),
        ("", "the file is empty"),
    ],
)
def test_what_fits_nothing_is_told(content, said, tmp_path):
    (tmp_path / "d.csv").write_text(content)
    with pytest.raises(InputError, match=said + ".*no format reads d.csv"):
        guess_mapping([str(tmp_path / "d.csv")], str(tmp_path / "m.yaml"))
    assert not (tmp_path / "m.yaml").exists()
    with pytest.raises(InputError, match="does not exist"):
        guess_mapping([str(tmp_path / "nothing.csv")], str(tmp_path / "m.yaml"))


@pytest.mark.parametrize(
    ("title", "kind", "part", "unit"),
    [
        ("IMU2 Acc X (g)", "acc", "x", "g"),
        ("rotationRateX(rad/s)", "gyr", "x", "rad/s"),
        ("Quat_q0", "quaternion", "0", ""),
        ("device_q_w", "quaternion", "w", ""),
        ("host_time_ns", "time", "", "ns"),
        ("Accel_LN_Z_CAL", "acc", "z", ""),
        ("PacketCounter", "counter", "", ""),
        ("price", None, "", ""),
        ("millis", "time", "", "ms"),
        ("us", "time", "", "us"),
        ("qr", "quaternion", "w", ""),
        ("quat_i", "quaternion", "x", ""),
        ("acc_x_r", "acc", "x", ""),
        ("FreeAcc_X", "free", "x", ""),
        ("userAcceleration.x(G)", "free", "x", "G"),
    ],
)
def test_what_a_title_says(title, kind, part, unit):
    found = read_title(title)
    assert (found.kind, found.part, found.unit) == (kind, part, unit)


def told_by_command(capsys, *arguments: str) -> list[str]:
    assert command("import", "--guess", *arguments) == 0
    return capsys.readouterr().out.splitlines()


def test_rate_and_units_that_are_stated_go_into_mapping_and_command(
    table, xyz, motion, tmp_path, clock, capsys
):
    m = motion(1200)
    columns = xyz("a{}", m.acc / G, "xyz") | xyz("g{}", m.gyr, "xyz")
    file = table("d.csv", columns)
    out = tmp_path / "m.yaml"
    lines = told_by_command(
        capsys,
        str(file),
        "--rate",
        "100",
        "--unit",
        "gyr=rad/s",
        "--unit",
        "acc=g",
        "--out",
        str(out),
    )
    assert any("as --unit states" in line for line in lines)
    asked = Options(str(out))
    session = import_recording("generic", [file], tmp_path / "s", clock, asked)
    check((session.imu("imu"), session.manifest.sensors["imu"].rate_hz), m)


def test_a_stated_unit_of_time_is_taken(table, xyz, motion, tmp_path):
    m = motion(600)
    columns = {"t": m.t * 10} | xyz("a{}", m.acc, "xyz") | xyz("g{}", m.gyr, "xyz")
    file, out = table("d.csv", columns), tmp_path / "m.yaml"
    guess_mapping([str(file)], str(out), units=["time=ms"])
    assert "unit: ms" in out.read_text()


def test_options_that_a_guess_has_no_use_for_are_refused(table, xyz, motion, capsys):
    file = table("d.csv", {"t": motion(300).t} | xyz("a{}", motion(300).acc, "xyz"))
    assert command("import", "--guess", file, "--axes", "x: -x, y: -y, z: z") == 2
    assert "--guess looks at the files by themselves" in " ".join(capsys.readouterr().err.split())


def test_a_file_of_orientations_beside_becomes_the_truth(table, xyz, motion, tmp_path, clock):
    m = motion(1200)
    imu = table("imu.csv", {"t": m.t} | xyz("a{}", m.acc, "xyz") | xyz("g{}", m.gyr, "xyz"))
    q = {f"q{part}": column for part, column in zip("wxyz", m.q[::2].T, strict=True)}
    mocap = table("mocap.csv", {"time": m.t[::2] + 5.0} | q)
    (tmp_path / "Metadata.csv").write_text("version,device name,platform\n3,mine,android\n")
    files = [str(imu), str(mocap), str(tmp_path / "Metadata.csv")]
    found = guess_mapping(files, str(tmp_path / "m.yaml"))
    assert any("taken for the truth" in own for own in found.seen)
    assert any("Metadata.csv: left out" in own for own in found.seen)
    session = import_recording(
        "generic", [*map(Path, files)], tmp_path / "s", clock, Options(str(found.mapping))
    )
    assert session.sensor_names == ["imu"]
    check((session.imu("imu"), session.manifest.sensors["imu"].rate_hz), m)
    truth = session.truth("imu")
    assert truth is not None and len(truth.host_time_ns) == 600


def test_what_stands_beside_does_not_kill_a_mapping_of_one_file_each(
    table, xyz, motion, round_trip, tmp_path
):
    m = motion(2400)
    acc = table("acc.csv", {"time": m.t} | xyz("{}", m.acc, "xyz"))
    gyr = table("gyro.csv", {"time": m.t} | xyz("{}", m.gyr, "xyz"))
    (tmp_path / "Metadata.csv").write_text("version,device name,platform\n3,mine,android\n")
    samples, _ = round_trip(acc, gyr, tmp_path / "Metadata.csv")
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-5)
