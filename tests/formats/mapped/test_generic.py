"""The generic format: any table, by a mapping, and what is wrong with one by its line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats import import_recording
from testbench.formats.mapping import MappingSpec, find_mapping, list_mappings
from testbench.formats.options import Options
from tests.formats.mapped.mappings import PLAIN, check


@pytest.mark.data
def test_the_real_ferraris_session_imports_by_its_shipped_mapping(data, tmp_path, clock):
    file = data / "imucal" / "example_ferraris_session.csv"
    session = import_recording(
        "generic", [file], tmp_path / "session", clock, Options("imucal_ferraris")
    )
    samples, raw = session.imu("imu"), np.genfromtxt(file, delimiter=",", skip_header=1)
    np.testing.assert_allclose(samples.gyr, 2 * np.radians(raw[:, 1:4]), rtol=1e-12)
    np.testing.assert_array_equal(samples.acc, raw[:, 4:7])
    assert len(samples) == 10_376 and session.manifest.sensors["imu"].rate_hz == 204.8
    assert session.manifest.duration_s == pytest.approx(10_375 / 204.8)
    rest = samples.acc[540:1271]  # the section of imucal's example in which the x axis points up
    assert rest.mean(axis=0) == pytest.approx([10.3, -0.58, 0.5], abs=0.1)


@pytest.mark.data
def test_the_unit_of_the_real_ferraris_session_is_told_without_being_stated(data, load):
    text = (Path(find_mapping("imucal_ferraris").file)).read_text().replace(", unit: m/s^2", "")
    session = load(text, data / "imucal" / "example_ferraris_session.csv")
    notes = " ".join(session.manifest.notes)
    assert "acc is taken for m/s^2" in notes


@pytest.mark.parametrize("name", list_mappings())
def test_every_shipped_mapping_is_valid_and_says_where_it_is_from(name):
    spec = find_mapping(name).value
    assert spec.description and spec.source


def test_the_lines_of_a_serial_board_import_by_their_shipped_mapping(tmp_path, motion, clock):
    m = motion(600)
    np.savetxt(
        tmp_path / "log.txt",
        np.column_stack([m.t, m.acc, m.gyr]),
        fmt="%.3f" + " %.2f" * 6,
        newline="\r\n",
    )
    session = import_recording(
        "generic", [tmp_path / "log.txt"], tmp_path / "s", clock, Options("bno080_serial")
    )
    np.testing.assert_allclose(session.imu("imu").gyr, m.gyr, atol=0.0051)
    assert session.manifest.sensors["imu"].rate_hz == pytest.approx(100)


def test_axes_by_option_do_the_same_for_any_format(plain, motion, tmp_path, clock):
    m = motion(600)
    (tmp_path / "map.yaml").write_text(PLAIN)
    options = Options(str(tmp_path / "map.yaml"), axes="x: -z, y: -y, z: -x")
    session = import_recording("generic", [plain(m)], tmp_path / "session", clock, options)
    np.testing.assert_allclose(
        session.imu("imu").acc, m.acc @ np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]]).T, atol=1e-6
    )
    (said,) = [own for own in session.manifest.findings if own.code == "structure.axes"]
    assert said.values == {"axes": "x: -z, y: -y, z: -x"}


def test_parquet(motion, load, tmp_path):
    m = motion(600)
    columns = {"t": pa.array((m.t * 1e9).round().astype(np.int64))}
    columns |= {f"a{x}": m.acc[:, i] for i, x in enumerate("xyz")} | {
        f"w{x}": m.gyr[:, i].astype(np.float32) for i, x in enumerate("xyz")
    }
    pq.write_table(pa.table(columns), tmp_path / "d.parquet")
    samples = load(PLAIN.replace("unit: s", "unit: ns"), tmp_path / "d.parquet").imu("imu")
    np.testing.assert_array_equal(samples.acc, m.acc)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-6)
    np.testing.assert_array_equal(samples.host_time_ns, (m.t * 1e9).round().astype(np.int64))


def test_a_session_reads_as_parquet_of_its_own(plain, motion, load, tmp_path):
    m = motion(600)
    first = load(PLAIN, plain(m))
    shutil.copy(first.path / "imu_imu.parquet", tmp_path / "again.parquet")
    shutil.rmtree(first.path)
    text = PLAIN.replace("{column: t, unit: s}", "{column: host_time_ns, unit: ns}")
    text = text.replace("[ax, ay, az]", "[acc_x_m_s2, acc_y_m_s2, acc_z_m_s2]").replace(
        "[wx, wy, wz]", "[gyr_x_rad_s, gyr_y_rad_s, gyr_z_rad_s]"
    )
    check(load(text, tmp_path / "again.parquet").imu("imu"), m)


def test_one_mapping_for_several_files_and_several_sensors_in_one_file(
    plain, motion, load, tmp_path, xyz
):
    m = motion(600)
    session = load(PLAIN, plain(m, "left_20260101_101010.csv"), plain(m, "right.csv"))
    assert session.sensor_names == ["left", "right"]
    shutil.rmtree(session.path)
    wide = plain(m, "wide.csv", more=xyz("b{}", -m.acc, "xyz"))
    text = PLAIN + "  second:\n    acc: {columns: [bx, by, bz], unit: m/s^2}\n"
    session = load(text, wide)
    np.testing.assert_allclose(session.imu("second").acc, -m.acc, atol=1e-6)


def test_sensors_name_their_files_by_pattern(plain, motion, load):
    m = motion(600)
    text = (
        PLAIN.replace("  imu:\n", "  imu:\n    file: a*\n")
        + "  two:\n    file: b*\n    acc: {columns: [ax, ay, az], unit: m/s^2}\n"
    )
    assert load(text, plain(m, "a.csv"), plain(m, "b.csv")).sensor_names == ["imu", "two"]


def test_the_mapping_may_stand_among_the_files(plain, motion, tmp_path, clock):
    (tmp_path / "map.yaml").write_text(PLAIN)
    m = motion(600)
    check(
        import_recording("generic", [tmp_path / "map.yaml", plain(m)], tmp_path / "s", clock).imu(
            "imu"
        ),
        m,
    )


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("[ax, ay, az]", "[ax, ay, up]", 5, "data.csv has no column 'up'; it has t, ax"),
        ("[ax, ay, az]", "[ax, ay, 9]", 5, "data.csv has 7 columns, not 9"),
        ("[ax, ay, az]", "[ax, ay]", 5, "must have at least 3 entries"),
        ("unit: m/s^2", "unit: furlong", 5, "must be 'm/s^2', 'g' or 'mg'"),
        ("unit: m/s^2", "units: g", 5, "unknown key 'units'"),
        ("unit: m/s^2", "unit: g, scale: 0", 5, "a scale of 0"),
        ("unit: s}", "unit: weeks}", 2, "must be 's', 'ms'"),
        ("column: t", "column: time", 2, "no column 'time'"),
        ("time: {column: t, unit: s}\n", "", 1, "neither time nor rate_hz"),
        ("    gyr:", "    axes: {x: y, y: x, z: z}\n    gyr:", 6, "left-handed"),
        ("    gyr:", "    axes: {x: x, y: x, z: z}\n    gyr:", 6, "exactly once"),
        ("    gyr:", "    axes: nowhere\n    gyr:", 6, "unknown axis map 'nowhere'"),
        ("  imu:", "  ../imu:", 4, "must be a name"),
        (
            "    gyr:",
            "    truth: {file: no, columns: [a, b, c, d], order: wxyz}\n    gyr:",
            6,
            "needs either time or rate_hz",
        ),
    ],
)
def test_faults_of_a_mapping_are_named_with_their_line(
    plain, motion, load, tmp_path, old, new, line, said
):
    assert old in PLAIN
    with pytest.raises(FileProblems) as caught:
        load(PLAIN.replace(old, new, 1), plain(motion(600)))
    assert f"map.yaml:{line}:" in str(caught.value) and said in str(caught.value)
    assert not (tmp_path / "session").exists()


def test_a_mapping_is_needed_and_found_by_name(plain, motion, tmp_path, clock):
    path = plain(motion(100))
    with pytest.raises(InputError, match="needs a mapping: --mapping"):
        import_recording("generic", [path], tmp_path / "s", clock)
    with pytest.raises(NotFoundError, match="imucal_ferraris"):
        import_recording("generic", [path], tmp_path / "s", clock, Options("nothing"))
    (tmp_path / "map.yaml").write_text(PLAIN.replace("  imu:\n", "  imu:\n    file: data*\n"))
    with pytest.raises(InputError, match="no sensor of the mapping reads it"):
        import_recording(
            "generic",
            [path, plain(motion(100), "other.csv")],
            tmp_path / "s",
            clock,
            Options(str(tmp_path / "map.yaml")),
        )


def test_every_key_of_a_mapping_is_described():
    def undescribed(schema: dict) -> list[str]:
        return [
            name
            for name, part in schema.get("properties", {}).items()
            if "description" not in part and "$ref" not in str(part)
        ]

    schema = MappingSpec.model_json_schema()
    missing = {
        title: undescribed(part)
        for title, part in schema["$defs"].items()
        if title not in {"AxisNames", "Estimation", "Placement"}
    }
    assert {title: names for title, names in missing.items() if names} == {}


def test_a_log_of_a_robot_is_called_by_its_name(cases, tmp_path, clock):
    folder = cases / "22_mcap_and_bag"
    asked = Options(str(folder / "map.yaml"))
    with pytest.raises(FileProblems, match="this is an MCAP file"):
        import_recording("generic", [folder / "x.mcap"], tmp_path / "s", clock, asked)
