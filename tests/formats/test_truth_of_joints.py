"""Angles of joints beside the recording: which column is which, in which unit, and what is open."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.exceptions import BenchError, FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.pipeline.body_request import body_of
from testbench.pipeline.request import BodyRequest
from tests.formats import angle_files
from tests.told import codes

TIME = np.arange(600) / 100.0
FLEXION = 40 + 30 * np.sin(1.3 * TIME)
ADDUCTION = 5 * np.sin(0.9 * TIME + 1)
ROTATION = 8 * np.cos(1.1 * TIME)
ALL = np.column_stack([FLEXION, ADDUCTION, ROTATION])


@pytest.fixture
def load(tmp_path, clock, table, xyz, motion):
    """Imports thigh and shank with a joint and a truth, and gives the session."""
    m = motion(600)
    columns = {"Time (s)": m.t} | xyz("Acc{} (m/s^2)", m.acc) | xyz("Gyr{} (rad/s)", m.gyr)
    files = [table(f"{name}.csv", columns) for name in ("thigh", "shank")]

    def read(truth, joint="knee_r", sequence=(), **more):
        joints = (f"{joint}=thigh:shank",) if joint else ()
        body = body_of(BodyRequest(joints=joints, sequences=sequence)) if joint else None
        out = tmp_path / f"session_{len(list(tmp_path.glob('session_*')))}"
        options = TruthOptions(truth, **more)
        return import_recording("technaid", files, out, clock, Options(), options, body)

    return read


@pytest.fixture
def mot(tmp_path):
    def write(columns, degrees="yes", name="walk.mot"):
        return angle_files.write_mot(tmp_path / name, TIME, columns, degrees)

    return write


def check(session, *wanted, joint="knee_r"):
    """The angles of the joint are the wanted ones [deg], None where unknown."""
    own = session.true_angles(joint)
    np.testing.assert_allclose(own.host_time_ns, np.round(1e9 * TIME), atol=1)
    for found, values in zip(np.degrees(own.angles).T, wanted, strict=True):
        expected = np.full(len(TIME), np.nan) if values is None else values
        np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize(("degrees", "factor"), [("yes", 1.0), ("no", np.pi / 180), (None, 1.0)])
def test_coordinates_of_opensim_are_known_by_their_names(load, mot, degrees, factor):
    file = mot({"pelvis_tx": 0 * TIME, "knee_angle_r": factor * FLEXION}, degrees)
    session = load(file)
    check(session, FLEXION, None, None)
    assert {"truth.angles_guessed", "truth.angles"} <= codes(session)
    assert ("truth.joint_degrees" in codes(session)) == (degrees is None)
    assert "knee_r.flexion=knee_angle_r" in session.manifest.true_angles["knee_r"].truth


def test_a_plain_sequence_counts_the_flexion_of_a_knee_backwards(load, mot):
    file = mot({"knee_angle_r": FLEXION, "knee_r_adduction": ADDUCTION})
    check(load(file, sequence=("ZXY",)), -FLEXION, ADDUCTION, None)


def test_the_knee_of_gait2392_bends_to_negative_angles(load, mot):
    file = mot({"knee_angle_r": -FLEXION})
    text = file.read_text().replace("endheader", "coordinates=gait2392_simbody\nendheader")
    file.write_text(text)
    check(load(file), FLEXION, None, None)


def test_opensims_paths_and_the_side_that_alone_is_there_are_understood(load, mot):
    file = mot({"/jointset/walker_knee_l/knee_angle_l/value": FLEXION}, name="walk.sto")
    check(load(file, joint="knee"), FLEXION, None, None, joint="knee")


def test_a_joint_of_an_unknown_side_is_asked_for_where_both_are_there(load, mot):
    file = mot({"knee_angle_l": FLEXION, "knee_angle_r": FLEXION})
    with pytest.raises(InputError, match=r"which of its columns.*--truth-angle.*knee_angle_l, kn"):
        load(file, joint="knee")
    session = load(file, joint="knee", angles={"knee.flexion": "-knee_angle_l"})
    check(session, -FLEXION, None, None, joint="knee")
    assert "truth.angles_guessed" not in codes(session)


@pytest.mark.parametrize(("column", "told"), [("knee_angle_l", True), ("knee_angle_r", False)])
def test_the_knee_of_the_other_leg_is_told_by_its_name(load, mot, column, told):
    file = mot({"knee_angle_l": FLEXION, "knee_angle_r": FLEXION})
    session = load(file, angles={"knee_r.flexion": column})
    assert ("truth.both_sides" in codes(session)) == told


@pytest.mark.parametrize("unit", ["deg", "rad", None])
def test_angles_of_plug_in_gait_in_a_c3d_are_read(tmp_path, load, unit):
    pytest.importorskip("ezc3d")
    values = ALL if unit != "rad" else np.radians(ALL)
    points = {"RKneeAngles": values, "LKneeAngles": -values}
    session = load(angle_files.write_c3d(tmp_path / "walk.c3d", 100.0, points, unit))
    check(session, FLEXION, ADDUCTION, ROTATION)


def test_a_point_of_c3d_may_be_named_and_angles_of_another_unit_are_refused(tmp_path, load):
    pytest.importorskip("ezc3d")
    file = angle_files.write_c3d(tmp_path / "walk.c3d", 100.0, {"Bend": ALL})
    check(load(file, angles={"knee_r": "Bend"}), FLEXION, ADDUCTION, ROTATION)
    check(load(file, angles={"knee_r.flexion": "Anna:Bend.x"}), FLEXION, None, None)
    file = angle_files.write_c3d(tmp_path / "odd.c3d", 100.0, {"Bend": ALL}, "gon")
    with pytest.raises(FileProblems, match="the unit of its angles is 'gon'; known: deg, rad"):
        load(file, angles={"knee_r": "Bend"})


@pytest.mark.parametrize("title", ["bend_deg", "bend (deg)", "bend"])
def test_a_table_gives_angles_in_the_unit_of_its_titles(load, table, title):
    file = table("angles.csv", {"time_s": TIME, title: FLEXION})
    check(load(file, angles={"knee_r.flexion": title}), FLEXION, None, None)
    check(load(file, angles={"knee_r": "bend"}), FLEXION, None, None)
    with pytest.raises(InputError, match="which of its columns"):
        load(file)


def test_columns_called_after_the_joint_are_taken(load, table):
    named = {
        "time_s": TIME,
        "knee_r_flexion_deg": FLEXION,
        "knee_r_internal_rotation_deg": ROTATION,
    }
    check(load(table("angles.csv", named)), FLEXION, None, ROTATION)


def test_a_parquet_file_gives_angles(tmp_path, load):
    from testbench.records.disk.tables import write_parquet

    file = tmp_path / "angles.parquet"
    write_parquet(file, {"time_s": TIME, "knee_r": FLEXION, "who": np.array(["Anna"] * 600)})
    check(load(file), FLEXION, None, None)


def test_empty_rows_stay_unknown_and_are_told(load, table):
    gappy = FLEXION.copy()
    gappy[100:160] = np.nan
    session = load(table("angles.csv", {"time_s": TIME, "knee_r_deg": gappy}))
    check(session, gappy, None, None)
    (told,) = [own for own in session.manifest.findings if own.code == "truth.angles_lost"]
    assert told.values["lost"] == 60 and told.values["longest_s"] == pytest.approx(0.61)


def test_a_stated_offset_is_added_and_kept(load, mot):
    session = load(mot({"knee_angle_r": FLEXION}), offset=1.5)
    assert session.true_angles("knee_r").host_time_ns[0] == 1_500_000_000
    assert session.manifest.true_angles["knee_r"].offset_s == 1.5


@pytest.mark.parametrize(
    ("columns", "degrees", "options", "message"),
    [
        ({"knee_angle_r": FLEXION}, "no", {}, r"goes up to 70 rad.*state --joint-unit deg"),
        ({"knee_angle_r": 60 * FLEXION}, "yes", {}, r"goes up to 4200 deg, and no joint"),
        ({"knee_angle_r": FLEXION / 60}, None, {}, r"in degrees or radians.*--joint-unit deg\|rad"),
        ({"knee_angle_r": np.nan * TIME}, "yes", {}, r"has 0 known rows; 10 are needed"),
        (
            {"knee_angle_r": FLEXION},
            "yes",
            {"angles": {"hip": "a"}},
            r"joint of this recording.*'hip'; known: knee_r",
        ),
        (
            {"bend": FLEXION},
            "yes",
            {"angles": {"knee_r": "bent"}},
            r"column of the truth.*'bent'; known: bend",
        ),
        (
            {"bend": FLEXION},
            "yes",
            {"angles": {"knee_r.bend": "bend"}},
            r"joint 'knee_r' has no angle 'bend'; it has first, second, third, flexion",
        ),
        (
            {"bend": FLEXION},
            "yes",
            {"angles": {"knee_r.adduction": "bend"}},
            r"evaluated by its flexion: name that of 'knee_r', too",
        ),
        (
            {"bend": FLEXION},
            "yes",
            {"angles": {"knee_r.first": "bend", "knee_r.flexion": "bend"}},
            r"names one angle of joint 'knee_r' twice",
        ),
        ({"bend": FLEXION}, "yes", {"dwell": 2.0}, r"--dwell: has no effect on a truth of joint"),
        ({"bend": FLEXION}, "yes", {"joint": ""}, r"has no joint: name one with --joint"),
        ({"bend": FLEXION}, "yes", {"time_unit": "ms"}, r"--truth-time-unit has no effect"),
        ({"bend": FLEXION}, "yes", {"rate": 0.0}, r"--truth-rate 0: a rate lies between"),
        ({"bend": FLEXION}, "yes", {"offset": np.nan}, r"--truth-offset nan: no log begins"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(load, mot, columns, degrees, options, message):
    with pytest.raises(BenchError, match=message) as refused:
        load(mot(columns, degrees), **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("endheader\n", "there are no titles below the header"),
        ("endheader\nknee_angle_r\n1.0\n", "the titles must be time and the coordinates"),
        ("endheader\ntime\tknee_angle_r\n0\t1\n0.1\tx\n", r"walk\.mot:4: 'x' is not a number"),
        ("endheader\ntime\tknee_angle_r\n0\t1\n0\t2\n", "its times do not increase"),
    ],
)
def test_a_damaged_motion_file_is_refused(tmp_path, load, text, message):
    (tmp_path / "walk.mot").write_text(text)
    with pytest.raises(FileProblems, match=message):
        load(tmp_path / "walk.mot")


def test_columns_may_be_apart_by_blanks_and_a_rate_takes_the_place_of_times(tmp_path, load):
    lines = [f"{t:8.3f}   {f:10.6f}" for t, f in zip(TIME, FLEXION, strict=True)]
    head = "Coordinates\ninDegrees=yes\nendheader\n    time   knee_angle_r\n"
    (tmp_path / "walk.mot").write_text(head + "\n".join(lines) + "\n")
    check(load(tmp_path / "walk.mot"), FLEXION, None, None)
    slow = load(tmp_path / "walk.mot", rate=50.0).true_angles("knee_r")
    assert slow.host_time_ns[-1] == 599 * 20_000_000


def test_a_word_in_a_column_that_is_asked_for_is_named_by_its_line(tmp_path, load, table):
    columns = {"time_s": TIME, "knee_r_deg": FLEXION, "note_deg": FLEXION}
    file = table("angles.csv", columns)
    rows = file.read_text().splitlines()
    rows[51] = rows[51].rpartition(",")[0] + ",lost"
    file.write_text("\n".join(rows))
    check(load(file), FLEXION, None, None)
    with pytest.raises(FileProblems, match=r"angles\.csv:52: 'lost' in the column note_deg"):
        load(file, angles={"knee_r.flexion": "note_deg"})


def test_a_motion_file_of_opensims_own_writer_is_read(tmp_path, load):
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    own = opensim.TimeSeriesTable()
    own.setColumnLabels(["hip_flexion_r", "knee_angle_r"])
    for t, row in zip(TIME.tolist(), FLEXION.tolist(), strict=True):
        own.appendRow(t, opensim.RowVector([0.0, row]))
    own.addTableMetaDataString("inDegrees", "yes")
    for name in ("walk.mot", "walk.sto"):
        opensim.STOFileAdapter.write(own, str(tmp_path / name))
        check(load(tmp_path / name), FLEXION, None, None)


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (-3.0, r"walk\.mot:308: its times go back at row 301, from 2\.99 to 0 s"),
        (-0.01, r"walk\.mot:308: its times do not increase at row 301 \(2\.99 s\)"),
    ],
)
def test_times_that_begin_anew_or_stand_still_are_named_by_their_line(load, mot, step, message):
    time = TIME + step * (np.arange(600) >= 300)
    file = angle_files.write_mot(mot({}).with_name("walk.mot"), time, {"knee_angle_r": FLEXION})
    with pytest.raises(FileProblems, match=message):
        load(file)


def test_a_c3d_that_was_cut_off_is_refused(tmp_path, load):
    pytest.importorskip("ezc3d")
    file = angle_files.write_c3d(tmp_path / "walk.c3d", 100.0, {"RKneeAngles": ALL})
    load(file)
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    with pytest.raises(FileProblems, match=r"is cut off: its header says 600 frames, and it holds"):
        load(file)


def test_a_motion_file_with_fewer_rows_than_its_header_says_is_told(load, mot):
    file = mot({"knee_angle_r": FLEXION})
    assert "truth.rows_missing" not in codes(load(file))
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:400]))
    assert "truth.rows_missing" in codes(load(file))


def test_a_column_called_after_another_joint_is_named(load, mot):
    file = mot({"hip_flexion_r": FLEXION, "bend": FLEXION})
    session = load(file, angles={"knee_r.flexion": "hip_flexion_r"})
    assert "truth.named_otherwise" in codes(session)
    assert "truth.named_otherwise" not in codes(load(file, angles={"knee_r.flexion": "bend"}))
