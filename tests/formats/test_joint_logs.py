"""Joint logs as loggers leave them: wrapped angles, lost readings, titles, units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from testbench.formats.truth.joint_log import RobotLog
from testbench.formats.truth.joint_steps import mended
from testbench.formats.truth.robot_log import read_robot_log
from testbench.records.specs.robot import load_robot

UR3E = load_robot("ur3e")
JOINTS = UR3E.joint_names
T = np.arange(400) / 20.0
Q = np.radians([180.0, -90, -90, 0, 90, 0]) + np.column_stack(
    [*[np.zeros_like(T)] * 3, 0.5 * np.sin(T), 0.4 * np.sin(0.7 * T), 0.9 * T + 0.3 * np.sin(T)]
)
"""20 s at 20 Hz; the last joint turns 2.9 times round."""


def log_of(q: np.ndarray, t: np.ndarray = T) -> RobotLog:
    return RobotLog(np.round(t * 1e9).astype(np.int64), q)


def write(path: Path, titles: list[str], rows: list[list[object]]) -> Path:
    lines = [titles, *rows]
    path.write_text("".join(",".join(map(str, line)) + "\n" for line in lines))
    return path


def read(path: Path, unit: str | None = None) -> RobotLog:
    return read_robot_log(path, UR3E, None, unit, [])


@pytest.mark.parametrize("lowest", [-np.pi, 0.0, -2 * np.pi])
def test_a_wrapped_angle_goes_on_from_turn_to_turn(lowest):
    wrapped = (Q - lowest) % (2 * np.pi) + lowest
    found = mended(log_of(wrapped), UR3E)
    np.testing.assert_allclose(np.diff(found.q, axis=0), np.diff(Q, axis=0), atol=1e-9)
    (said,) = found.findings
    steps = np.any(np.abs(np.diff(wrapped, axis=0)) > np.pi, axis=1).sum()
    assert (said.code, said.values["count"]) == ("truth.whole_turns", steps)


def test_an_angle_that_turns_on_is_left_as_it_is():
    found = mended(log_of(Q), UR3E)
    assert found.q is Q or np.array_equal(found.q, Q)
    assert not found.findings


@pytest.mark.parametrize(
    ("rows", "reading"),
    [
        (slice(0, 30), 0.0),
        (slice(200, 220), 0.0),
        (slice(380, 400), 0.0),
        (slice(200, 220), 3.0),
        (slice(100, 101), 3.0),
    ],
)
def test_rows_that_no_arm_reaches_are_a_gap(rows, reading):
    q = Q.copy()
    q[rows] = reading
    found = mended(log_of(q), UR3E)
    keep = np.ones(len(T), dtype=bool)
    keep[rows] = False
    np.testing.assert_array_equal(found.time_ns, log_of(Q).time_ns[keep])
    np.testing.assert_allclose(found.q, Q[keep])
    assert found.findings[0].values["count"] == (~keep).sum()


def test_zeros_of_one_joint_and_rows_between_two_turns_are_left_out_too():
    wrapped = (Q + np.pi) % (2 * np.pi) - np.pi
    step = int(np.argmax(np.abs(np.diff(wrapped[:, 5])) > np.pi))
    blended = np.insert(wrapped, step + 1, (wrapped[step] + wrapped[step + 1]) / 2, axis=0)
    t = np.insert(T, step + 1, (T[step] + T[step + 1]) / 2)
    blended[300, 0] = 0.0
    found = mended(log_of(blended, t), UR3E)
    np.testing.assert_allclose(
        np.diff(found.q[: step + 5, 5]), np.diff(Q[: step + 5, 5]), atol=0.03
    )
    assert {one.code: one.values["count"] for one in found.findings}["truth.impossible_rows"] == 2


def test_a_home_pose_of_zeros_is_no_loss():
    q = 0.02 * np.maximum(T - 10, 0)[:, None] * np.ones(6)
    found = mended(log_of(q), UR3E)
    assert len(found.q) == len(q) and not found.findings


def test_jittering_stamps_are_no_jumps():
    rng = np.random.default_rng(3)
    late = np.sort(T + 0.045 * rng.random(len(T)))
    assert not mended(log_of(Q, late), UR3E).findings


def test_a_log_that_jumps_for_good_is_refused_with_its_line(tmp_path):
    q = np.vstack([Q[:200], Q[200:] + 1.5])
    rows = [[t, *angles] for t, angles in zip(T.tolist(), q.tolist(), strict=True)]
    log = read(write(tmp_path / "log.csv", ["time_s", *JOINTS], rows), "rad")
    with pytest.raises(FileProblems, match=r"log\.csv:202: shoulder_pan_joint turns by .*cut"):
        mended(log, UR3E)


@pytest.mark.parametrize(("first", "end"), [(200, 240), (355, 385)])
def test_a_reading_that_is_held_until_the_log_jumps_is_refused(tmp_path, first, end):
    q = np.column_stack([0.9 * np.sin(0.6 * T + i) for i in range(6)])
    q[first:end] = q[first - 1]
    rows = [[t, *angles] for t, angles in zip(T.tolist(), q.tolist(), strict=True)]
    log = read(write(tmp_path / "log.csv", ["time_s", *JOINTS], rows), "rad")
    with pytest.raises(FileProblems, match=rf"log\.csv:{end + 2}: .*leave the rows out"):
        mended(log, UR3E)


def test_degrees_that_are_stated_as_radians_are_refused(tmp_path):
    rows = [[t, *angles] for t, angles in zip(T.tolist(), np.degrees(Q).tolist(), strict=True)]
    log = read(write(tmp_path / "log.csv", ["time_s", *JOINTS], rows), "rad")
    with pytest.raises(FileProblems, match=r"log\.csv:\d+: .* in many rows.*--joint-unit deg"):
        mended(log, UR3E)


def test_several_turns_in_radians_are_asked_about_and_degrees_are_told(tmp_path):
    assert np.abs(Q).max() > 4 * np.pi
    for factor, unit in ((1.0, None), (180 / np.pi, "deg")):
        rows = [[t, *angles] for t, angles in zip(T.tolist(), (Q * factor).tolist(), strict=True)]
        path = write(tmp_path / "log.csv", ["time_s", *JOINTS], rows)
        if unit is None:
            with pytest.raises(InputError, match=r"largest is 18\.\d+\).*--joint-unit deg\|rad"):
                read(path)
        else:
            np.testing.assert_allclose(read(path).q, Q)


SHUFFLED = [2, 1, 0, 5, 4, 3]
"""The joints as a message has them, no order of the arm's."""


@pytest.mark.parametrize(
    ("name", "position"),
    [("name_{}", "position_{}"), ("/js/name[{}]", "/js/position[{}]"), ("name.{}", "position.{}")],
)
def test_names_in_the_cells_tell_the_joints(tmp_path, name, position):
    titles = ["%time", *(name.format(i) for i in range(6)), *(position.format(i) for i in range(6))]
    rows = []
    for i, (t, angles) in enumerate(zip(T.tolist(), Q.tolist(), strict=True)):
        order = SHUFFLED[i % 6 :] + SHUFFLED[: i % 6]
        rows.append([t, *(JOINTS[j] for j in order), *(angles[j] for j in order)])
    rows.insert(7, [T[6] + 0.01, *[f"finger_{i}" for i in range(6)], *[0.1] * 6])
    log = read(write(tmp_path / "log.csv", titles, rows))
    np.testing.assert_allclose(log.q, Q)
    np.testing.assert_array_equal(log.time_ns, log_of(Q).time_ns)


def test_lists_in_the_cells_tell_the_joints(tmp_path):
    names = "\"['" + "', '".join(JOINTS[j] for j in SHUFFLED) + "']\""
    rows = [
        [t, names, '"(' + ", ".join(str(angles[j]) for j in SHUFFLED) + ')"']
        for t, angles in zip(T.tolist(), Q.tolist(), strict=True)
    ]
    log = read(write(tmp_path / "log.csv", ["Time", "name", "position"], rows))
    np.testing.assert_allclose(log.q, Q)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ([1.0, *JOINTS, *[0.1] * 5, "x"], r"log\.csv:3: the position of wrist_3_joint, 'x'"),
        ([1.0, *JOINTS, *[0.1] * 5], r"log\.csv:3: has 12 cells, where the titles are 13"),
    ],
)
def test_a_broken_row_of_cells_is_named(tmp_path, row, said):
    titles = ["time", *(f"name_{i}" for i in range(6)), *(f"position_{i}" for i in range(6))]
    path = write(tmp_path / "log.csv", titles, [[0.0, *JOINTS, *[0.1] * 6], row])
    with pytest.raises(FileProblems, match=said):
        read(path)


def test_cells_that_never_name_all_joints_say_whom_they_name(tmp_path):
    titles = ["time", *(f"name_{i}" for i in range(6)), *(f"position_{i}" for i in range(6))]
    others = [f"panda_joint{i}" for i in range(1, 7)]
    path = write(tmp_path / "log.csv", titles, [[0.0, *others, *[0.1] * 6]])
    with pytest.raises(FileProblems, match=r"no row names all the joints .*panda_joint1"):
        read(path)


@pytest.mark.parametrize(
    ("title", "unit"),
    [
        ("/joint_states/{joint}/position", "rad"),
        ("joint_states.{joint}.position", "rad"),
        ("/ur/joint_states/{joint}/position", "rad"),
        ("robot_state.q[{zero}]", "rad"),
        ("actual_q_{zero}", "rad"),
        ("{joint}.pos", None),
        ("q[{zero}]", None),
    ],
)
def test_titles_of_loggers_are_known_and_what_was_commanded_is_left(tmp_path, title, unit):
    places = list(enumerate(JOINTS))[::-1]
    own = [title.format(joint=joint, zero=i) for i, joint in places]
    beside = [f"/joint_states/{joint}/velocity" for _, joint in places]
    beside += [f"/command/{joint}/position" for _, joint in places]
    rows = [
        [t, *(angles[i] for i, _ in places), *[9.0] * 12]
        for t, angles in zip(T.tolist(), Q.tolist(), strict=True)
    ]
    path = write(tmp_path / "log.csv", ["__time", *own, *beside], rows)
    if unit is None:
        with pytest.raises(InputError, match="--joint-unit"):
            read(path)
    np.testing.assert_allclose(read(path, None if unit else "rad").q, Q)


def test_two_sets_of_measured_angles_are_asked_about(tmp_path):
    titles = [f"/{side}/{joint}" for side in ("left", "right") for joint in JOINTS]
    path = write(tmp_path / "log.csv", ["time_s", *titles], [[0.0, *[0.1] * 12]])
    with pytest.raises(FileProblems, match=r"several columns.*'/left/.*'/right/.*leave one set"):
        read(path)


@pytest.mark.parametrize("rate", [1000.0, 100.0])
def test_a_log_in_ms_without_saying_so_is_asked_about(table, xyz, tmp_path, clock, rate):
    t = np.arange(500) / 50.0
    imu = {"t": t} | xyz("a{}", np.tile([0, 0, 9.8], (500, 1)), "xyz")
    file = table("imu.csv", imu | xyz("w{}", np.zeros((500, 3)), "xyz"), form="%.10g")
    (tmp_path / "map.yaml").write_text(
        "description: run\ntime: {column: t, unit: s}\nsensors:\n  hand:\n    acc: {columns: [ax, "
        "ay, az], unit: m/s^2}\n    gyr: {columns: [wx, wy, wz], unit: rad/s}\n"
    )
    own = np.arange(int(10 * rate)) / rate
    still = dict.fromkeys(JOINTS, 0 * own + 0.1)
    log = table("log.csv", {"time": 1000 * own} | still, form="%.10g")
    given = {"robot": "ur3e", "links": {"": "wrist_3_link"}, "joint_unit": "rad"}
    options = Options(str(tmp_path / "map.yaml"))
    with pytest.raises(InputError, match=r"--truth-time-unit ms .*--truth-time-unit s confirms"):
        import_recording(
            "generic", [file], tmp_path / "no", clock, options, TruthOptions(log, **given)
        )
    told = TruthOptions(log, **given, time_unit="ms")
    session = import_recording("generic", [file], tmp_path / "yes", clock, options, told)
    assert session.truth("hand").host_time_ns[-1] == round(own[-1] * 1e9)
