"""The generic mapping: any table, and what is wrong with a mapping by its line."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats import import_recording
from testbench.formats.mapping import MappingSpec, find_mapping, list_mappings
from testbench.formats.options import Options
from testbench.pipeline.analyse import analyse
from tests.asking import analysis

G = 9.80665
PLAIN = """\
description: a table
time: {column: t, unit: s}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
"""


@pytest.fixture
def load(tmp_path, clock):
    def read(mapping: str, *files: Path, **options):
        (tmp_path / "map.yaml").write_text(mapping, encoding="utf-8")
        return import_recording(
            "generic",
            list(files),
            tmp_path / "session",
            clock,
            Options(str(tmp_path / "map.yaml"), **options),
        )

    return read


@pytest.fixture
def plain(table, xyz):
    """A file with the columns that PLAIN names, in any units and layout."""

    def write(
        m, name: str = "data.csv", acc: float = 1.0, gyr: float = 1.0, more=None, **layout
    ) -> Path:
        columns = (
            {"t": m.t}
            | xyz("a{}", m.acc / acc, "xyz")
            | xyz("w{}", m.gyr / gyr, "xyz")
            | (more or {})
        )
        return table(name, columns, **layout)

    return write


def check(samples, m) -> None:
    np.testing.assert_allclose(samples.acc, m.acc, atol=1e-6)
    np.testing.assert_allclose(samples.gyr, m.gyr, atol=1e-7)


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


@pytest.mark.parametrize(
    ("acc", "acc_factor", "gyr", "gyr_factor"),
    [
        ("g", G, "deg/s", np.pi / 180),
        ("mg", G / 1000, "mdeg/s", np.pi / 180e3),
        ("m/s^2", 1.0, "rad/s", 1.0),
    ],
)
@pytest.mark.parametrize("stated", [True, False])
def test_units_stated_or_told_by_gravity_and_turns(
    plain, motion, load, acc, acc_factor, gyr, gyr_factor, stated
):
    m = motion(2400)
    text = PLAIN.replace("unit: m/s^2", f"unit: {acc}").replace("unit: rad/s", f"unit: {gyr}")
    if not stated:
        text = text.replace(f", unit: {acc}}}", "}").replace(f", unit: {gyr}}}", "}")
    check(load(text, plain(m, acc=acc_factor, gyr=gyr_factor, form="%.12g")).imu("imu"), m)


def test_a_unit_that_cannot_be_told_is_asked_for_by_its_key(plain, motion, load, tmp_path):
    m = motion(600)
    text = PLAIN.replace(", unit: m/s^2}", "}")
    with pytest.raises(
        InputError,
        match=r"\|acc\| at rest is 3.*the key sensors\.imu\.acc\.unit of the mapping, or --unit "
        r"acc=UNIT",
    ):
        load(text, plain(m, acc=9.80665 / 3))
    assert not (tmp_path / "session").exists()
    assert load(text, plain(m, acc=9.80665 / 3), units={"acc": "g"})


@pytest.mark.parametrize(
    ("layout", "key"),
    [
        ({"separator": ";"}, ""),
        ({"separator": "\t"}, "text: {separator: tab}"),
        ({"separator": ";", "decimal": ","}, ""),
        ({"separator": ";", "decimal": ","}, "text: {separator: semicolon, decimal: comma}"),
        ({"separator": "   "}, "text: {separator: blanks}"),
        ({"above": "a report\nof a device\n"}, "text: {skip_lines: 2}"),
        ({"below": "s,g,g,g,d,d,d\n"}, "text: {lines_below_header: 1}"),
        ({"above": "sep=,\n\n"}, ""),
    ],
)
def test_layouts_of_text(plain, motion, load, layout, key):
    m = motion(600)
    check(load(f"{PLAIN}{key}\n", plain(m, form="%.10f", **layout)).imu("imu"), m)


@pytest.mark.parametrize(
    ("encoding", "key"),
    [("utf-8-sig", ""), ("utf-16", ""), ("latin-1", "text: {encoding: latin-1}\n")],
)
def test_encodings(plain, motion, load, encoding, key):
    m = motion(600)
    path = plain(m, more={"température": m.t})
    path.write_text(path.read_text(encoding="utf-8"), encoding=encoding)
    check(load(PLAIN + key, path).imu("imu"), m)


def test_columns_by_number_without_titles(tmp_path, motion, load):
    m = motion(600)
    np.savetxt(tmp_path / "d.csv", np.column_stack([m.t, m.gyr, m.acc]), delimiter=",")
    text = (
        PLAIN.replace("column: t", "column: 1")
        .replace("[ax, ay, az]", "[5, 6, 7]")
        .replace("[wx, wy, wz]", "[2, 3, 4]")
    )
    check(load(text + "text: {header: false}\n", tmp_path / "d.csv").imu("imu"), m)


def test_counts_with_offset_and_scale_can_be_recovered(plain, motion, load):
    m = motion(600)
    counts = np.round(m.acc / G * 2048 + 32768)
    path = plain(m, more={"cx": counts[:, 0], "cy": counts[:, 1], "cz": counts[:, 2]}, form="%.12g")
    text = PLAIN.replace(
        "[ax, ay, az], unit: m/s^2", f"[cx, cy, cz], unit: g, offset: 32768, scale: {1 / 2048}"
    )
    session = load(text, path)
    kept = session.manifest.content["sensors"]["imu"]["raw_counts"]["acc"]
    np.testing.assert_array_equal(
        np.round(session.imu("imu").acc / G / kept["scale"] + kept["offset"]), counts
    )


def test_a_wrapping_clock_in_milliseconds(plain, motion, load):
    m = motion(600)
    ms = (65_000 + np.arange(600) * 10) % 65_536
    path = plain(m, more={"ms": ms})
    text = PLAIN.replace("{column: t, unit: s}", "{column: ms, unit: ms, wraps_bits: 16}")
    np.testing.assert_array_equal(np.diff(load(text, path).imu("imu").device_time_ns), 10_000_000)


def test_a_rate_in_place_of_times_and_a_counter_that_lost_some(plain, motion, load):
    m = motion(600)
    counter = np.arange(600) + 7 * (np.arange(600) > 250)
    text = PLAIN.replace("time: {column: t, unit: s}", "rate_hz: 100").replace(
        "  imu:\n", "  imu:\n    counter: n\n"
    )
    samples = load(text, plain(m, more={"n": counter})).imu("imu")
    assert (
        np.argmax(np.diff(samples.host_time_ns)) == 250
        and samples.host_time_ns[-1] == 6_060_000_000
    )


@pytest.mark.parametrize("axes", ["left_leg_frontal", "{x: -z, y: -y, z: -x}"])
def test_axes_turn_every_vector_and_the_orientation(plain, motion, load, axes, xyz):
    m = motion(600)
    text = PLAIN + f"    quaternion: {{columns: [qw, qx, qy, qz], order: wxyz}}\n    axes: {axes}\n"
    samples = load(text, plain(m, more=xyz("q{}", m.q, "wxyz"))).imu("imu")
    matrix = np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(samples.acc, m.acc @ matrix.T, atol=1e-6)
    np.testing.assert_allclose(samples.gyr, m.gyr @ matrix.T, atol=1e-6)
    up = Rotation.from_quat(samples.device_q, scalar_first=True).apply(samples.acc)
    np.testing.assert_allclose(up, np.tile([0, 0, G], (600, 1)), atol=1e-5)


def test_axes_by_option_do_the_same_for_any_format(plain, motion, tmp_path, clock):
    m = motion(600)
    (tmp_path / "map.yaml").write_text(PLAIN)
    options = Options(str(tmp_path / "map.yaml"), axes="x: -z, y: -y, z: -x")
    session = import_recording("generic", [plain(m)], tmp_path / "session", clock, options)
    np.testing.assert_allclose(
        session.imu("imu").acc, m.acc @ np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]]).T, atol=1e-6
    )
    assert "axes of every sensor: x: -z, y: -y, z: -x" in session.manifest.notes


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
@pytest.mark.parametrize("direction", ["earth_from_sensor", "sensor_from_earth"])
def test_orders_and_directions_of_quaternions(plain, motion, load, xyz, order, direction):
    m = motion(600)
    q = m.q if direction == "earth_from_sensor" else m.q * [1, -1, -1, -1]
    names = [f"q{axis}" for axis in order]
    text = (
        PLAIN + f"    quaternion: {{columns: [{', '.join(names)}], order: {order}, direction: "
        f"{direction}}}\n"
    )
    samples = load(text, plain(m, more=xyz("q{}", q, "wxyz"))).imu("imu")
    np.testing.assert_allclose(samples.device_q, m.q, atol=1e-8)


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


# --- truth in the mapping


def test_truth_in_the_same_rows_with_gaps_and_flipped_signs(plain, motion, load, xyz):
    m = motion(600)
    q = m.q * np.where(np.arange(600) % 37 < 20, 1, -1)[:, None]
    q[200:260] = np.nan
    q[::2] = np.nan  # half the rate of the samples
    more = xyz("q{}", q, "wxyz") | {"moving": (m.t > 2).astype(int)}
    text = PLAIN + "    truth: {columns: [qw, qx, qy, qz], order: wxyz, judged: moving}\n"
    session = load(text, plain(m, more=more))
    truth = session.truth("imu")
    known = np.isfinite(truth.q_world_from_sensor[:, 0])
    assert known.sum() == 270 and (~known).sum() == 1
    q_known = truth.q_world_from_sensor[known]
    assert np.all(np.sum(q_known[1:] * q_known[:-1], axis=1) > 0)
    row = np.round(truth.host_time_ns[known] * 1e-7).astype(int)
    assert np.abs(np.sum(truth.q_world_from_sensor[known] * m.q[row], axis=1)).min() > 1 - 1e-9
    np.testing.assert_array_equal(truth.judged[known], m.t[row] > 2)
    assert session.analysis.estimate.align == "motion" and not session.analysis.estimate.align_clock
    notes = " ".join(session.manifest.notes)
    assert "changed the sign" in notes and "1 gaps" in notes


def test_truth_in_a_file_of_its_own_at_a_lower_rate(plain, motion, load, table, xyz):
    m = motion(3000)
    plain(m)
    table(
        "optical.csv", {"ms": 1000 * m.t[::7] + 40.0} | xyz("Q{}", m.q[::7, [1, 2, 3, 0]], "xyzw")
    )
    text = PLAIN + (
        "    truth:\n      file: optical.csv\n      columns: [Qx, Qy, Qz, Qw]\n      order: xyzw\n"
        "      time: {column: ms, unit: ms}\n"
    )
    session = load(text, plain(m))
    truth = session.truth("imu")
    assert truth.host_time_ns[0] == 0 and session.analysis.estimate.align_clock
    result = analyse(session, analysis("vqf_6d"))
    (row,) = result.evaluation.orientation
    assert row.total_rmse_deg < 0.5


def test_truth_on_the_clock_of_the_samples_keeps_its_place(plain, motion, load, table, xyz):
    m = motion(600)
    table("optical.csv", {"t": m.t[50::7]} | xyz("q{}", m.q[50::7], "wxyz"))
    text = PLAIN + (
        "    truth:\n      file: optical.csv\n      columns: [qw, qx, qy, qz]\n      order: wxyz\n "
        "     same_clock: true\n"
        "      time: {column: t, unit: s}\n"
    )
    session = load(text, plain(m))
    assert session.truth("imu").host_time_ns[0] == 500_000_000
    assert not session.analysis.estimate.align_clock


def test_truth_of_a_body_that_carries_the_sensor(plain, motion, load, xyz):
    m = motion(600)
    body_from_sensor = Rotation.from_euler("ZYX", [0, 90, 0], degrees=True)
    q_body = (Rotation.from_quat(m.q, scalar_first=True) * body_from_sensor.inv()).as_quat(
        scalar_first=True
    )
    text = PLAIN + (
        "    truth:\n      columns: [qw, qx, qy, qz]\n      order: wxyz\n      mounting: "
        "{rotation_deg: {ZYX: [0, 90, 0]}}\n"
    )
    truth = load(text, plain(m, more=xyz("q{}", q_body, "wxyz"))).truth("imu")
    assert np.abs(np.sum(truth.q_world_from_sensor * m.q, axis=1)).min() > 1 - 1e-9


# --- faults


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
