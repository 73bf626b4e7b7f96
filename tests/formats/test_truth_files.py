"""Truth beside the recording: joint logs, lists of commanded poses, orientations of a reference
system.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.cli import main
from testbench.evaluation.foreign_truth import UNKNOWN_TRUTH
from testbench.exceptions import FileProblems, InputError, NotFoundError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.recording import ImportedSensor
from testbench.formats.truth.attach import TruthOptions
from testbench.formats.truth.robot_log import commanded_steps, find_dwells, read_robot_log
from testbench.model.kinematics import Kinematics, Pose
from testbench.pipeline.analyse import analyse
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.robot import load_robot
from testbench.records.specs.strict import Placement
from tests.asking import analysis

LINK = "wrist_3_link"
HOME = np.array([0.0, -90, -90, -90, 90, 180])
POSES_DEG = np.array(
    [
        (0, -90, -90, -90, 90, 180),
        (0, -90, -90, 90, 90, 180),
        (0, -90, -90, -90, 180, 180),
        (0, -90, -90, -90, 0, 180),
        (0, -90, -90, -180, 0, 180),
        (0, -90, -90, 0, 0, 180),
    ],
    dtype=float,
)
"""Castellanos 2023, table 3.3."""
MOUNTING = Placement(rotation_deg={"ZYX": [30.0, 20.0, -10.0]}, position_mm=[0.0, 10.0, 40.0])


@pytest.fixture(scope="module")
def ur3e() -> Kinematics:
    return Kinematics(load_robot("ur3e"))


def smooth_steps(
    t: np.ndarray, starts: np.ndarray, move: float, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, rates and accelerations that go from pose to pose by quintics."""
    position, rate, acceleration = (np.zeros((len(t), q.shape[1])) for _ in range(3))
    position += q[0]
    for i, start in enumerate(starts):
        u = np.clip((t - start) / move, 0, 1)[:, None]
        step = q[i + 1] - q[i]
        inside = (u > 0) & (u < 1)
        position += step * (10 * u**3 - 15 * u**4 + 6 * u**5)
        rate += inside * step * (30 * u**2 - 60 * u**3 + 30 * u**4) / move
        acceleration += inside * step * (60 * u - 180 * u**2 + 120 * u**3) / move**2
    return position, rate, acceleration


@pytest.fixture(scope="module")
def run(ur3e):
    """Six poses of two seconds, moves of one; what an ideal sensor on the last link reads at 100
    Hz.
    """
    dwell, move = 2.0, 1.0
    t = np.arange(int((6 * dwell + 5 * move) * 100)) / 100
    starts = dwell + np.arange(5) * (dwell + move)
    q, v, a = smooth_steps(t, starts, move, np.radians(POSES_DEG))
    motion = ur3e.frame_motion(LINK, q, v, a, Pose.from_placement(MOUNTING))
    return (
        t,
        q,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(ur3e.robot.gravity),
    )


@pytest.fixture
def recorded(run, table, xyz, tmp_path):
    """The sensor's file, with another world (heading), and the options that read it."""
    t, _, _, gyr, acc = run
    path = table(
        "hand.csv", {"t": t} | xyz("a{}", acc, "xyz") | xyz("w{}", gyr, "xyz"), form="%.10g"
    )
    (tmp_path / "map.yaml").write_text(
        "description: run\ntime: {column: t, unit: s}\nsensors:\n  hand:\n    acc: {columns: [ax, "
        "ay, az], unit: m/s^2}\n"
        "    gyr: {columns: [wx, wy, wz], unit: rad/s}\n"
    )
    return path, Options(str(tmp_path / "map.yaml"))


@pytest.fixture
def load(recorded, tmp_path, clock):
    def read(file: Path, **truth):
        path, options = recorded
        given = {"robot": "ur3e", "links": {"": LINK}, "mountings": {"": MOUNTING}} | truth
        return import_recording(
            "generic", [path], tmp_path / "session", clock, options, TruthOptions(file, **given)
        )

    return read


JOINTS = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]


@pytest.mark.parametrize(
    ("titles", "unit"),
    [
        (JOINTS, "deg"),
        ([f"{name}_rad" for name in JOINTS], "rad"),
        ([f"q_measured_{name}_rad" for name in reversed(JOINTS)], "rad"),
        ([f"J{i}" for i in range(1, 7)], "deg"),
        ([f"joint_{i} (deg)" for i in range(1, 7)], "deg"),
        ([f"actual_q_{i}" for i in range(6)], "rad"),
    ],
)
def test_a_joint_log_becomes_the_truth_of_the_sensor(run, load, table, titles, unit):
    t, q, orientation, gyr, acc = run
    values = np.degrees(q) if unit == "deg" else q
    values = values[:, ::-1] if "wrist_3" in titles[0] else values
    log = table(
        "robot.csv",
        {"timestamp": t + 1234.5} | {title: values[:, i] for i, title in enumerate(titles)},
        form="%.10g",
    )
    truth = load(log).truth("hand")
    assert truth.host_time_ns[0] == 0
    np.testing.assert_array_equal(
        np.abs(np.sum(truth.q_world_from_sensor * orientation, axis=1)).round(9), 1
    )
    np.testing.assert_allclose(truth.rate, gyr, atol=0.05)
    np.testing.assert_allclose(truth.force, acc, atol=0.5)


def test_the_whole_way_to_the_error_of_a_filter(run, load, table):
    t, q, *_ = run
    log = table(
        "robot.csv", {"time_s": t} | {name: q[:, i] for i, name in enumerate(JOINTS)}, form="%.10g"
    )
    session = load(log, joint_unit="rad")
    assert session.analysis.estimate.align == "motion" and session.analysis.estimate.align_clock
    (row,) = analyse(session, analysis("vqf_6d")).evaluation.orientation
    assert (
        row.total_rmse_deg < 1.0
    )  # moves of up to 180 degrees in a second disturb the filter's vertical
    assert session.manifest.sensors["hand"].truth == f"ur3e, link {LINK}"


def test_the_truth_of_a_robots_log_has_the_uncertainty_of_its_zeros_and_twists(run, load, table):
    t, q, *_ = run
    log = table(
        "robot.csv", {"time_s": t} | {name: q[:, i] for i, name in enumerate(JOINTS)}, form="%.10g"
    )
    session = load(log, joint_unit="rad")
    stated = session.manifest.sensors["hand"].truth_sd_deg
    # six zeros of 0.1 deg and seven twists of 0.12, of which one axis sees about a third or more
    assert np.sqrt((6 * 0.1**2 + 7 * 0.12**2) / 3) < stated < np.sqrt(6 * 0.1**2 + 7 * 0.12**2)
    evaluation = analyse(session, analysis("vqf_6d")).evaluation
    total = next(b for b in evaluation.uncertainty if b.quantity == "total")
    assert total.complete and total.expanded_deg > 2 * stated
    named = {line.source: line for line in total.sources}
    assert named["orientation of the reference, hand"].sensitivity == pytest.approx(np.sqrt(3))
    assert 0 < named["time step of the reference, hand"].contribution_deg < 0.1
    assert any("rigid" in note for note in total.assumed)
    (metric,) = [m for m in evaluation.metrics if m.name == "hand.total_rmse_deg"]
    assert metric.expanded_uncertainty == total.expanded_magnitude_deg


def test_an_angle_that_no_joint_turns_to_is_refused(run, load, table):
    t, q, *_ = run
    damaged = q.copy()
    damaged[100, 2] = -1e300
    columns = {"time_s": t} | {name: damaged[:, i] for i, name in enumerate(JOINTS)}
    with pytest.raises(InputError, match=r"angle of 1e\+300 rad, which no joint turns to"):
        load(table("robot.csv", columns, form="%.10g"), joint_unit="rad")


def test_a_log_without_times_has_a_rate_and_may_begin_later(run, load, table):
    _, q, *_ = run
    log = table("robot.csv", {f"J{i + 1}": np.degrees(q[:, i]) for i in range(6)})
    truth = load(log, rate=100.0, offset=0.25).truth("hand")
    assert list(truth.host_time_ns[:2]) == [250_000_000, 260_000_000]


@pytest.mark.parametrize("form", ["titles", "plain", "misalignment", "brackets"])
def test_a_list_of_commanded_poses_is_matched_to_the_dwells_of_the_sensor(
    run, load, tmp_path, form
):
    _, _, orientation, *_ = run
    file = tmp_path / "poses.txt"
    extra = ", 4" if form == "misalignment" else ""
    rows = [", ".join(f"{angle:g}" for angle in pose) + extra for pose in POSES_DEG]
    rows = [f"[{row}]" for row in rows] if form == "brackets" else rows
    file.write_text(
        ("J1, J2, J3, J4, J5, J6\n" if form == "titles" else "") + "\n".join(rows) + "\n"
    )
    session = load(file, dwell=2.0)
    truth = session.truth("hand")
    known = np.isfinite(truth.q_world_from_sensor[:, 0])
    assert (~known).sum() == 6 and np.array_equal(truth.judged, known)
    row = np.round(truth.host_time_ns[known] * 1e-7).astype(int)
    assert (
        np.abs(np.sum(truth.q_world_from_sensor[known] * orientation[row], axis=1)).min() > 1 - 1e-9
    )
    assert not session.analysis.estimate.align_clock
    assert any("6 dwells found" in note for note in session.manifest.notes)


def test_the_dwells_of_a_list_are_steps_of_the_session_and_judged_at_rest(load, tmp_path):
    np.savetxt(tmp_path / "poses.txt", POSES_DEG, fmt="%g")
    session = load(tmp_path / "poses.txt", dwell=2.0)
    steps = session.steps
    assert [(step.index, step.role, step.section, step.kind) for step in steps] == [
        (i, "evaluation", "poses", "move") for i in range(6)
    ]
    np.testing.assert_allclose(
        [step.settled_ns / 1e9 for step in steps], 3.0 * np.arange(6), atol=0.25
    )
    np.testing.assert_allclose(
        [step.end_ns / 1e9 for step in steps], 2 + 3.0 * np.arange(6), atol=0.25
    )
    assert [step.start_ns for step in steps[1:]] == [step.end_ns for step in steps[:-1]] and steps[
        0
    ].start_ns == 0
    assert [steps[3].variables[f"{joint}_deg"] for joint in JOINTS] == POSES_DEG[3].tolist()
    result = analyse(session, analysis("vqf_6d", report=True))
    (row,) = result.evaluation.orientation
    judged = result.evaluation.series["orientation_hand"]["judged"]
    time = result.estimate.sensors["hand"].host_time_ns[judged] / 1e9
    assert ((time % 3.0) < 2.0).all() and row.total_rmse_deg < 2.0
    assert "6 finished" in result.report.read_text()


def test_the_first_poses_calibrate_and_the_others_are_judged(ur3e, table, xyz, tmp_path, clock):
    """Nine dwells of 3 s; the sensor has biases and a scale error, which six of them show."""
    poses = np.vstack([POSES_DEG, POSES_DEG[[1, 3, 4]] + [0, 0, 0, 20, 30, 0]])
    dwell, move, rate = 3.0, 1.5, 100.0
    t = np.arange(int((9 * dwell + 8 * move) * rate)) / rate
    q, v, a = smooth_steps(t, dwell + np.arange(8) * (dwell + move), move, np.radians(poses))
    motion = ur3e.frame_motion(LINK, q, v, a, Pose.from_placement(MOUNTING))
    rng = np.random.default_rng(7)
    acc_bias, gyr_bias = np.array([0.15, -0.1, 0.2]), np.radians([0.5, -0.3, 0.4])
    acc = (
        1.01 * motion.specific_force_in_frame(ur3e.robot.gravity)
        + acc_bias
        + 0.01 * rng.standard_normal((len(t), 3))
    )
    gyr = motion.angular_velocity_in_frame + gyr_bias + 0.001 * rng.standard_normal((len(t), 3))
    path = table(
        "hand.csv", {"t": t} | xyz("a{}", acc, "xyz") | xyz("w{}", gyr, "xyz"), form="%.10g"
    )
    (tmp_path / "map.yaml").write_text(
        "description: run\ntime: {column: t, unit: s}\nsensors:\n  hand:\n    acc: {columns: [ax, "
        "ay, az], unit: m/s^2}\n"
        "    gyr: {columns: [wx, wy, wz], unit: rad/s}\n"
    )
    np.savetxt(tmp_path / "poses.txt", poses, fmt="%g")
    truth = TruthOptions(
        tmp_path / "poses.txt",
        robot="ur3e",
        links={"": LINK},
        mountings={"": MOUNTING},
        dwell=dwell,
        calibration_poses=6,
    )
    options = Options(str(tmp_path / "map.yaml"))
    session = import_recording("generic", [path], tmp_path / "session", clock, options, truth)
    assert [step.role for step in session.steps] == ["calibration"] * 6 + ["evaluation"] * 3
    result = analyse(session, analysis("vqf_6d"))
    found = result.estimate.sensors["hand"].calibration
    assert found.method == "static_poses" and found.poses == 6
    np.testing.assert_allclose(found.acc_bias, acc_bias, atol=0.02)
    np.testing.assert_allclose(found.gyr_bias, gyr_bias, atol=np.radians(0.05))
    judged = result.evaluation.series["orientation_hand"]["judged"]
    assert result.estimate.sensors["hand"].host_time_ns[judged].min() / 1e9 > 6 * dwell + 5 * move
    assert result.evaluation.orientation[0].inclination_rmse_deg < 0.5


def test_sensors_whose_clocks_differ_share_no_dwell():
    spans = [np.array([[0.0, 2.0], [3.0, 5.0]]), np.array([[0.5, 2.5], [5.5, 7.5]])]
    with pytest.raises(InputError, match="pose 2 was not held by all sensors at the same time"):
        commanded_steps(spans, np.zeros((2, 6)), JOINTS, 0)
    shared = commanded_steps([spans[0], spans[0] + 0.25], np.zeros((2, 6)), JOINTS, 1)
    assert [(step.role, step.settled_ns, step.end_ns) for step in shared] == [
        ("calibration", 250_000_000, 2_000_000_000),
        ("evaluation", 3_250_000_000, 5_000_000_000),
    ]


def test_poses_at_a_stated_rhythm_need_no_samples_that_turn(run, load, tmp_path):
    _, _, orientation, *_ = run
    np.savetxt(tmp_path / "poses.txt", POSES_DEG, fmt="%g")
    truth = load(tmp_path / "poses.txt", dwell=2.0, move=1.0).truth("hand")
    known = np.isfinite(truth.q_world_from_sensor[:, 0])
    row = np.round(truth.host_time_ns[known] * 1e-7).astype(int)
    assert (
        np.abs(np.sum(truth.q_world_from_sensor[known] * orientation[row], axis=1)).min() > 1 - 1e-9
    )


def test_dwells_are_found_by_orientation_where_there_is_no_gyroscope(run):
    t, _, q, *_ = run
    nan = np.full((len(t), 3), np.nan)
    time = np.round(t * 1e9).astype(np.int64)
    chunk = ImuSamples(
        time, time, nan, nan, None, q, np.arange(len(t)), np.zeros(len(t), dtype=bool)
    )
    spans = find_dwells(ImportedSensor([chunk], 100.0, ""), 1.0)
    assert len(spans) == 6
    np.testing.assert_allclose(spans[:, 0], np.arange(6) * 3.0, atol=0.25)


POSE = "0,-90,-90,-90,90,180\n"
TITLES = "time_s,J1,J2,J3,J4,J5,J6\n"


@pytest.mark.parametrize(
    ("content", "given", "said"),
    [
        (
            POSE * 3,
            {"dwell": 2.0},
            r"6 stretches of rest of 1 s or more, but 3 poses.*--dwell.*--move",
        ),
        (POSE * 3, {}, r"3 joint poses without times.*--dwell S.*--truth-rate HZ"),
        (f"{TITLES}0,{POSE}1,{POSE}", {"dwell": 2.0}, "has times"),
        (
            f"{TITLES}0,0,1,1,1,1,1\n1,0,1,1,1,1,1\n",
            {},
            r"in degrees or radians \(the largest is 1\).*--joint-unit",
        ),
        (
            "time_s,J1,J2,J3\n0,0,1,1\n",
            {},
            r"no columns for the joints shoulder_pan_joint.*titles that would do.*J1 \.\. J6",
        ),
        (
            "0 0 1 1 1 1 1\n1 0 1 1 1 1 1\n2 0 1 1 1 1 1\n",
            {},
            "its first column only grows as time does; put titles above",
        ),
        ("0 1 2\n", {}, r"robot.txt:1: 3 numbers, where the arm has 6 joints"),
        ("[0, 1, 2, 3, 4, 5]\n[0, 1]\n", {}, r"robot.txt:2: 2 numbers, where the arm has 6 joints"),
        (f"{TITLES}0,{POSE}1,0,-90,,-90,90,180\n", {}, r"robot.txt:3: a joint angle is missing"),
        (f"{TITLES}1,{POSE}0,{POSE}", {}, r"robot.txt:3: time goes back"),
        (
            POSE * 6,
            {"dwell": 2.0, "calibration_poses": 6},
            r"--calibration-poses 6 asks for a list of more .* has 6$",
        ),
        (
            f"{TITLES}0,{POSE}1,{POSE}",
            {"calibration_poses": 1},
            r"--calibration-poses 1 asks .* has 2 rows, with times",
        ),
        (
            POSE * 3,
            {"links": {}},
            r"which link carries hand\? Answer with --link SENSOR=LINK.*wrist_3_link",
        ),
        (POSE * 3, {"links": {"foot": LINK}}, r"names the sensor 'foot'; the recording has hand"),
    ],
)
def test_what_is_missing_is_asked_for_and_nothing_is_written(load, tmp_path, content, given, said):
    (tmp_path / "robot.txt").write_text(content)
    with pytest.raises(InputError, match=said):
        load(tmp_path / "robot.txt", **given)
    assert not (tmp_path / "session").exists()


def test_an_unknown_link_or_robot_is_refused_with_those_that_exist(load, tmp_path):
    (tmp_path / "robot.txt").write_text("0,-90,-90,-90,90,180\n" * 6)
    with pytest.raises(NotFoundError, match="wrist_3_link"):
        load(tmp_path / "robot.txt", dwell=2.0, move=1.0, links={"": "tail"})
    with pytest.raises(NotFoundError, match="ur3e"):
        load(tmp_path / "robot.txt", robot="ur33")


def test_a_pose_that_is_not_six_numbers_is_named_with_its_line(tmp_path):
    (tmp_path / "poses.csv").write_text("J1,J2,J3,J4,J5,J6\n0,0,0,0,0,90\n0,0,x,0,0,0\n")
    with pytest.raises(FileProblems, match=r"poses.csv:3: 'x' in the column J3"):
        read_robot_log(tmp_path / "poses.csv", load_robot("ur3e"), None, None, [])


def test_orientations_of_a_reference_system(run, recorded, table, xyz, tmp_path, clock):
    """15 Hz, of the body that carries the sensor, in a world of its own, with sign flips and a
    gap.
    """
    t, _, q, *_ = run
    body_from_sensor = Pose.from_placement(MOUNTING).R
    world = Rotation.from_euler("Z", 70, degrees=True)
    body = (
        world
        * Rotation.from_quat(q, scalar_first=True)
        * Rotation.from_matrix(body_from_sensor).inv()
    ).as_quat(scalar_first=True)
    rows = np.arange(0, len(t), 7)
    body = body[rows] * np.where(rows % 3 == 0, -1, 1)[:, None]
    body[60:80] = np.nan
    poses = table(
        "optical.csv",
        {"time_ms": 1000 * t[rows], "x": t[rows]} | xyz("q_{}", body, "wxyz"),
        form="%.10g",
    )
    path, options = recorded
    truth = TruthOptions(poses, mountings={"": MOUNTING})
    session = import_recording("generic", [path], tmp_path / "session", clock, options, truth)
    known = np.isfinite(session.truth("hand").q_world_from_sensor[:, 0])
    assert known.sum() == len(rows) - 20 and (~known).sum() == 1
    evaluation = analyse(session, analysis("vqf_6d")).evaluation
    assert evaluation.orientation[0].total_rmse_deg < 1.0
    assert all(UNKNOWN_TRUTH in budget.notes for budget in evaluation.uncertainty)


def test_a_person_states_how_sure_orientations_are(run, recorded, table, xyz, tmp_path, clock):
    t, _, q, *_ = run
    columns = {"time_s": t} | xyz("q_{}", q, "wxyz")
    poses = table("optical.csv", columns, form="%.10g")
    path, options = recorded
    truth = TruthOptions(poses, mountings={"": MOUNTING}, sd_deg=0.4)
    session = import_recording("generic", [path], tmp_path / "session", clock, options, truth)
    assert session.manifest.sensors["hand"].truth_sd_deg == 0.4
    evaluation = analyse(session, analysis("vqf_6d")).evaluation
    heading = next(b for b in evaluation.uncertainty if b.quantity == "heading")
    line = next(s for s in heading.sources if s.source.startswith("orientation of"))
    assert heading.complete and line.contribution_deg == pytest.approx(0.4)
    for wrong in (0.0, -1.0, 31.0, float("nan")):
        with pytest.raises(InputError, match="--truth-sd"):
            TruthOptions(poses, sd_deg=wrong)


def test_the_command_line_takes_all_of_it(run, recorded, table, tmp_path, monkeypatch, capsys):
    t, q, orientation, *_ = run
    log = table(
        "robot.csv",
        {"time_s": t} | {f"{name}_deg": np.degrees(q[:, i]) for i, name in enumerate(JOINTS)},
    )
    path, options = recorded
    words = [
        "import",
        "generic",
        path,
        "--mapping",
        options.mapping,
        "--out",
        tmp_path / "session",
        "--truth",
        log,
        "--robot",
        "ur3e",
    ]
    words += [
        "--link",
        f"hand={LINK}",
        "--mounting",
        "hand=rotation_deg: {ZYX: [30, 20, -10]}, position_mm: [0, 10, 40]",
        "--json",
    ]
    monkeypatch.setattr(sys, "argv", ["testbench", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    told = json.loads(capsys.readouterr().out)
    assert told["samples"] == {"hand": len(t)} and told["rate_hz"] == {"hand": 100.0}
    truth = Session(told["session"]).truth("hand")
    assert np.abs(np.sum(truth.q_world_from_sensor * orientation, axis=1)).min() > 1 - 1e-9
