"""Truth of sensors from motion capture exports, and from bags of ROS."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.model.kinematics import Kinematics
from testbench.records.session.session import Session
from testbench.records.specs.robot import load_robot
from tests.formats import mocap
from tests.formats.bags import Ros, write_bag

MARKERS = {"foot": ["S1", "S2", "S3", "S4"]}


@pytest.fixture
def load(tmp_path, clock, table, xyz, motion):
    """Imports a sensor of 6 s at 100 Hz with a truth, and gives the session."""
    m = motion(600)
    columns = {"Time (s)": m.t} | xyz("Acc{} (m/s^2)", m.acc)
    columns |= xyz("Gyr{} (rad/s)", m.gyr)
    file = table("foot.csv", columns)

    def read(truth: Path, clusters: dict | None = None, **more) -> Session:
        options = TruthOptions(truth, clusters=clusters or {}, **more)
        out = tmp_path / f"session_{len(list(tmp_path.glob('session_*')))}"
        return import_recording("technaid", [file], out, clock, Options(), options)

    return read


def check(session: Session, q: np.ndarray, within_deg: float = 0.01) -> None:
    """The truth is the motion, but for a turn of the body, in its place in time."""
    truth = session.truth("foot")
    rows = np.round(truth.host_time_ns * 1e-7).astype(int)
    known = np.isfinite(truth.q_world_from_sensor).all(axis=1)
    off = mocap.off_deg(truth.q_world_from_sensor[known], q[rows[known]])
    assert known.sum() > 500 and off.max() < within_deg


def test_c3d_of_ezc3ds_writer_gives_the_orientation_of_a_cluster(tmp_path, motion, load):
    pytest.importorskip("ezc3d")
    q = motion(600).q
    markers = mocap.placed(q, 0.1e-3)
    markers[300:320, :2] = np.nan
    session = load(mocap.write_c3d(tmp_path / "walk.c3d", 100.0, markers), MARKERS)
    check(session, q, 0.6)
    details = session.manifest.content["sensors"]["foot"]
    assert details["truth_residual_mm"] == pytest.approx(0.12, abs=0.02)
    assert any("20 with fewer than three markers" in n for n in session.manifest.notes)
    assert session.analysis.estimate.align == "motion"


@pytest.mark.parametrize("unit", ["m", "furlong"])
def test_the_unit_of_c3d_is_read_or_refused(tmp_path, motion, load, unit):
    pytest.importorskip("ezc3d")
    path = mocap.write_c3d(tmp_path / "walk.c3d", 100.0, mocap.placed(motion(600).q), unit)
    if unit == "furlong":
        with pytest.raises(FileProblems, match="the unit of its markers is 'furlong'; known: mm"):
            load(path, MARKERS)
    else:
        check(load(path, MARKERS), motion(600).q)


def test_a_damaged_c3d_is_refused_and_not_believed(tmp_path, load, motion):
    pytest.importorskip("ezc3d")
    path = mocap.write_c3d(tmp_path / "walk.c3d", 100.0, mocap.placed(motion(600).q))
    (tmp_path / "cut.c3d").write_bytes(path.read_bytes()[:1500])
    with pytest.raises(FileProblems, match=r"cut\.c3d: not a readable C3D file"):
        load(tmp_path / "cut.c3d", MARKERS)
    (tmp_path / "text.c3d").write_text("hello")
    with pytest.raises(FileProblems, match="its second byte is not 80"):
        load(tmp_path / "text.c3d", MARKERS)


def test_without_the_package_the_way_to_read_c3d_is_said(tmp_path, load, monkeypatch):
    (tmp_path / "a.c3d").write_bytes(b"\x02\x50" + bytes(600))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"extra 'markers'.*pip install 'imu-testbench\[markers\]'"
    ):
        load(tmp_path / "a.c3d", MARKERS)


def test_trc_of_opensims_own_writer_is_read(tmp_path, motion, load):
    opensim = pytest.importorskip("opensim")
    opensim.Logger.setLevelString("Error")
    q = motion(600).q
    markers = 1000 * mocap.placed(q)
    own = opensim.TimeSeriesTableVec3()
    own.setColumnLabels(mocap.NAMES)
    for i, frame in enumerate(markers.tolist()):
        own.appendRow(i / 100, opensim.RowVectorVec3([opensim.Vec3(*point) for point in frame]))
    own.addTableMetaDataString("DataRate", "100")
    own.addTableMetaDataString("Units", "mm")
    opensim.TRCFileAdapter.write(own, str(tmp_path / "walk.trc"))
    check(load(tmp_path / "walk.trc", MARKERS), q)


@pytest.mark.parametrize("what", ["markers", "body", "euler"])
def test_motive(tmp_path, motion, load, what):
    q = motion(600).q
    form = "XYZ" if what == "euler" else "Quaternion"
    path = mocap.write_motive(tmp_path / "take.csv", 100.0, mocap.placed(q), q, form)
    if what == "euler":
        with pytest.raises(InputError, match=r"exported as XYZ; .*Rotation Type: Quaternion"):
            load(path, {"foot": ["Shank"]})
    else:
        check(load(path, MARKERS if what == "markers" else {"foot": ["Shank"]}), q)


@pytest.mark.parametrize("clusters", [MARKERS, {"foot": ["Shank"]}, {}])
def test_vicon(tmp_path, motion, load, clusters):
    q = motion(600).q
    markers = mocap.placed(q)
    markers[50:60] = np.nan
    q_lost = q.copy()
    q_lost[50:60] = np.nan
    path = mocap.write_vicon(tmp_path / "trial.csv", 100.0, markers, q_lost)
    check(load(path, clusters), q)


@pytest.mark.parametrize("titles", [False, True])
def test_qualisys_markers(tmp_path, motion, load, titles):
    q = motion(600).q
    markers = mocap.placed(q)
    markers[50:60] = np.nan
    check(load(mocap.write_qualisys(tmp_path / "m.tsv", 100.0, markers, titles), MARKERS), q)


def test_decimal_commas_of_a_motion_capture_export_are_read(tmp_path, motion, load):
    q = motion(600).q
    path = mocap.write_qualisys(tmp_path / "m.tsv", 100.0, mocap.placed(q), True)
    header, titles, rows = path.read_text().partition("Frame\t")
    path.write_text(header + titles + rows.replace(".", ","))
    check(load(path, MARKERS), q)


@pytest.mark.parametrize("system", ["TRC", "Motive", "Qualisys"])
def test_another_number_of_frames_than_the_header_says_is_told(tmp_path, motion, load, system):
    q = motion(600).q
    path, markers = tmp_path / "take.csv", mocap.placed(q)
    if system == "TRC":
        mocap.write_trc(path, 100.0, markers)
    elif system == "Motive":
        mocap.write_motive(path, 100.0, markers, q, "Quaternion")
    else:
        mocap.write_qualisys(path, 100.0, markers, True)

    def told() -> dict[str, str]:
        findings = load(path, MARKERS).manifest.findings
        return {own.code: str(own) for own in findings if own.code.startswith("truth.rows")}

    whole = path.read_text()
    assert told() == {}
    path.write_text("".join(whole.splitlines(keepends=True)[:-40]))
    assert "says 600 rows, and it holds 560" in told()["truth.rows_missing"]
    path.write_text(whole.replace("600", "550", 1))
    assert "says 550 rows, and it holds 600" in told()["truth.rows_beyond"]
    path.write_text(whole.replace("600", "", 1))
    assert told() == {}  # nothing is stated


@pytest.mark.parametrize("by_rows", [False, True])
def test_qualisys_bodies_in_the_reading_that_their_angles_confirm(tmp_path, motion, load, by_rows):
    q = motion(600).q
    path = mocap.write_bodies(tmp_path / "b.tsv", 100.0, q, by_rows)
    check(load(path, {"foot": ["Shank"]}), q)


def test_orientations_of_opensim_are_a_truth(tmp_path, motion, load):
    q = motion(600).q
    head = "DataRate=100\nDataType=Quaternion\nversion=3\nendheader\ntime\tfoot_imu\n"
    rows = (f"{i / 100}\t" + ",".join(f"{x:.9f}" for x in row) for i, row in enumerate(q))
    (tmp_path / "t.sto").write_text(head + "\n".join(rows) + "\n")
    check(load(tmp_path / "t.sto"), q)


def test_a_question_lists_what_there_is(tmp_path, motion, load):
    q = motion(600).q
    path = mocap.write_qualisys(tmp_path / "m.tsv", 100.0, mocap.placed(q), True)
    with pytest.raises(
        InputError, match=r"--truth-cluster SENSOR=M1,M2,M3.*the markers S1, S2, S3"
    ):
        load(path)
    with pytest.raises(NotFoundError, match=r"unknown marker 'S9'; known: S1, S2, S3, S4"):
        load(path, {"foot": ["S1", "S2", "S9"]})
    with pytest.raises(InputError, match="3 different markers or more"):
        load(path, {"foot": ["S1", "S2"]})
    with pytest.raises(InputError, match=r"names the sensor 'hand'; the recording has foot"):
        load(path, {"hand": ["S1", "S2", "S3"]})
    with pytest.raises(InputError, match=r"no rigid body 'Thigh'"):
        load(path, {"foot": ["Thigh"]})


def test_markers_of_two_bodies_are_refused(tmp_path, motion, load):
    markers = mocap.placed(motion(600).q)
    markers[:, 3] = markers[0, 3]
    path = mocap.write_qualisys(tmp_path / "m.tsv", 100.0, markers, True)
    with pytest.raises(InputError, match=r"are no rigid cluster: they move by \d+\.\d mm"):
        load(path, MARKERS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("\t1.50000\t", "\tsoon\t"), r"m\.tsv:161: 'soon' is not a number"),
        (("FREQUENCY\t100", "FREQUENCY\tEXT"), None),
        (("MARKER_NAMES", "MARKERS"), "neither MARKER_NAMES nor BODY_NAMES"),
    ],
)
def test_a_damaged_text_is_refused_with_its_line(tmp_path, motion, load, change, said):
    q = motion(600).q
    path = mocap.write_qualisys(tmp_path / "m.tsv", 100.0, mocap.placed(q), True)
    path.write_text(path.read_text().replace(*change, 1))
    if said is None:
        check(load(path, MARKERS), q)  # the times are in the rows
    else:
        with pytest.raises(FileProblems, match=said):
            load(path, MARKERS)
    cut = path.read_text()[:-40]
    path.write_text(cut)
    with pytest.raises(FileProblems, match=r"the file may be cut off|neither|soon"):
        load(path, MARKERS)


@pytest.mark.parametrize("system", ["motive", "qualisys"])
def test_frames_whose_stamps_stand_still_come_at_the_rate_of_the_file(
    tmp_path, motion, load, system
):
    q = motion(600).q
    path, markers = tmp_path / "take.csv", mocap.placed(q)
    if system == "motive":
        mocap.write_motive(path, 100.0, markers, q, "Quaternion")
    else:
        mocap.write_qualisys(path, 100.0, markers, True)
    path.write_text(re.sub(r"(?m)^(\d+[,\t])[^,\t]+", r"\g<1>0", path.read_text()))
    check(load(path, MARKERS), q)
    path.write_text(path.read_text().replace("100", "EXT", 1))
    with pytest.raises(FileProblems, match=r"do not increase at row 2 .*, and it states no rate"):
        load(path, MARKERS)


def test_an_offset_moves_the_truth(tmp_path, motion, load):
    q = motion(600).q
    path = mocap.write_motive(tmp_path / "t.csv", 100.0, mocap.placed(q), q, "Quaternion")
    session = load(path, {"foot": ["Shank"]}, offset=1.5)
    assert session.truth("foot").host_time_ns[0] == 1_500_000_000


@pytest.fixture
def bag_of(tmp_path, clock, motion):
    """Imports a bag of a sensor with what else is in it as truth."""

    def read(ros: Ros, more: list, form: str = "a.mcap", **truth) -> Session:
        messages = ros.imus(motion(600), "/foot/imu") + more
        file = write_bag(tmp_path / form, ros, messages)
        options = TruthOptions(file, **truth)
        return import_recording("rosbag", [file], tmp_path / "s", clock, Options(), options)

    return read


@pytest.mark.parametrize("ros1", [False, True])
def test_frames_of_a_bag_are_chained_on_the_clock_of_the_sensor(motion, bag_of, ros1):
    ros, m = Ros.of(ros1), motion(600)
    turn = Rotation.from_quat(m.q, scalar_first=True)
    fixed = Rotation.from_euler("z", 30, degrees=True)
    q = (fixed.inv() * turn).as_quat(scalar_first=True)
    static = ros.transforms(m.t[:1], "map", "base", fixed.as_quat(scalar_first=True)[None])
    session = bag_of(
        ros,
        static + ros.transforms(m.t[100:], "base", "shank", q[100:]),
        "a.bag" if ros1 else "a.mcap",
        clusters={"foot": ["shank"]},
    )
    truth = session.truth("foot")
    assert truth.host_time_ns[0] == 1_000_000_000
    dot = np.abs(np.sum(truth.q_world_from_sensor * m.q[100:], axis=1))
    assert dot.min() > 1 - 1e-9


def test_poses_of_a_bag_are_a_truth(motion, bag_of):
    ros, m = Ros.of(False), motion(600)
    poses = ros.poses(m.t, m.q, "/mocap/shank/pose")
    session = bag_of(ros, poses, clusters={"foot": ["/mocap/shank/pose"]})
    check(session, m.q)


def test_joint_states_of_a_bag_are_a_robots_log(motion, bag_of):
    ros, m = Ros.of(False), motion(600)
    kinematics = Kinematics(load_robot("ur3e"))
    joints = kinematics.robot.joint_names
    q = 0.3 * np.sin(m.t[:, None] + np.arange(len(joints)))
    order = np.arange(len(joints))[::-1]
    session = bag_of(
        ros,
        ros.joints(m.t, [joints[i] for i in order], q[:, order]),
        robot="ur3e",
        links={"": "wrist_3_link"},
    )
    expected = kinematics.frame_motion("wrist_3_link", q).q_world_from_frame
    dot = np.abs(np.sum(session.truth("foot").q_world_from_sensor * expected, axis=1))
    assert dot.min() > 1 - 1e-9


def test_what_a_bag_does_not_hold_is_named(motion, bag_of):
    ros, m = Ros.of(False), motion(600)
    poses = ros.poses(m.t, m.q, "/mocap/shank/pose")
    with pytest.raises(NotFoundError, match=r"'thigh'; known: /mocap/shank/pose"):
        bag_of(ros, poses, "a.mcap", clusters={"foot": ["thigh"]})
    with pytest.raises(InputError, match=r"--truth-cluster SENSOR=FRAME; it has /mocap/shank"):
        bag_of(ros, poses, "b.mcap")
    still = ros.transforms(m.t[:1], "map", "shank", m.q[:1])
    with pytest.raises(FileProblems, match=r"the frame shank does not move against map"):
        bag_of(ros, still, "c.mcap", clusters={"foot": ["shank"]})
    with pytest.raises(FileProblems, match=r"no messages of .*it has no joint states"):
        bag_of(ros, [], "d.mcap", robot="ur3e", links={"": "wrist_3_link"})


def test_absurd_numbers_are_lost_and_overflow_nothing(tmp_path, motion, load):
    q = motion(600).q
    markers, turns = mocap.placed(q), q.copy()
    markers[40, 1, 2], turns[50, 0] = 1e305, 1e305
    path = mocap.write_motive(tmp_path / "t.csv", 100.0, markers, turns, "Quaternion")
    check(load(path, MARKERS), q)
    check(load(path, {"foot": ["Shank"]}), q)
