"""A robot's own log as truth.

It holds joint angles over time, or commanded poses that are each held for a while.

A log with times gives orientation, angular rate and specific force at every row, by forward
kinematics. A list of poses without times, as RoboDK scripts write it, gives the orientation during
each dwell only: the dwells are found in the samples of the sensor as stretches without turning, and
taken in their order.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.recording import ImportedSensor
from testbench.formats.tables.bytes_stream import LineStream, encoding_of
from testbench.formats.tables.fields import split_line
from testbench.formats.tables.samples_stream import Quantities, SampleStream
from testbench.formats.tables.source import Kind
from testbench.formats.tables.text_table import TextTable, decimal_of, guess_separator, head_of
from testbench.formats.tables.timeline import RegularTime
from testbench.formats.truth.joint_cells import JointCells, joint_cells
from testbench.formats.truth.joint_log import RobotLog
from testbench.formats.truth.joint_steps import MANY, fast_rows
from testbench.formats.truth.joint_titles import joint_titles, titles_that_do
from testbench.formats.truth.times import truth_stamps
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.model.windows import savitzky_golay
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth
from testbench.records.specs.protocol_steps import Role
from testbench.records.specs.robot import Robot

SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that differentiates the joint angles [s]."""
LEAST_DEGREES = 4 * np.pi
"""Angles below may be radians, or degrees of a small motion: the unit is asked for [rad]."""
MOST_TURNS = 100.0
"""16 turns: nobody lets the cable of a sensor be wound up further [rad]."""
LIMITS_WITHIN = 0.35
"""Angles that are in radians exceed the arm's limits by no more [rad]."""
REGULAR_WITHIN = 0.2
"""A log whose intervals differ by more than this part of their median is not differentiated."""
WINDOW_S = 0.1
TURNING = np.radians(1.0)
"""Angular rate above which a sensor on an arm is moving, as a mean over WINDOW_S [rad/s]."""
DWELL_AT_LEAST = 0.5
"""Part of the stated dwell that a stretch of rest must last to count as one."""
INSIDE_S = 0.2
"""Left out at either end of a dwell: the arm settles [s]."""
TRUTH_STEP_S = 0.05


def read_robot_log(
    file: Path,
    robot: Robot,
    rate: float | None,
    unit: str | None,
    findings: list[Finding],
    time_unit: str | None = None,
) -> RobotLog:
    """Read a joint log.

    Columns are found by name (`elbow_joint`, `elbow_joint_deg`, `q_measured_elbow_joint_rad`,
    `/joint_states/elbow_joint/position`, `actual_q_0`, `robot_state.q[0]`, `J1`, `joint_1`), or by
    the names in the cells (`name_0`, `position_0`); without titles, the first numbers of each line
    are the joints in order, and further ones, such as a misalignment, are left out.

    Args:
        file: Text.
        robot: Whose joints are logged.
        rate: Of a log without times [Hz], or None.
        unit: "deg" or "rad", None to go by the titles.
        findings: What was noticed; is added to.
        time_unit: Of its times, None to go by their title and size.

    Raises:
        FileProblems: The file is no such log.
        InputError: A unit cannot be told.
    """
    joints = robot.joint_names
    lists = _lists(file, len(joints), findings)
    if lists is not None:
        time = None
        if rate is not None:
            time = np.round(np.arange(len(lists)) * (NANOSECONDS / rate)).astype(np.int64)
        return _in_radians(RobotLog(time, lists), unit, robot, file, findings)
    log, stated = _titled(file, joints, rate, findings, time_unit)
    return _in_radians(log, unit or stated, robot, file, findings)


def _titled(
    file: Path,
    joints: list[str],
    rate: float | None,
    findings: list[Finding],
    time_unit: str | None,
) -> tuple[RobotLog, str | None]:
    """A log of columns, in the unit of the file, and that unit where it is stated."""
    table: TextTable | JointCells | None = joint_cells(file, joints)
    columns = joints
    stated: str | None = "rad"  # as sensor_msgs/JointState has it
    if table is None:
        table = _table(file, joints, findings)
        columns, stated = _joint_columns(table, joints)
    kinds: dict[str, Kind] = dict.fromkeys(columns, "float")
    stamps = truth_stamps(table, rate, time_unit)
    timeline = stamps.timeline if stamps is not None else lambda: RegularTime(rate or 1.0)
    times, angles = [], []
    stream = SampleStream(
        table,
        kinds | timeline().kinds,
        lambda c: Quantities(np.column_stack([c[n] for n in columns]), None),
        timeline,
    )
    for chunk in stream:
        times.append(chunk.host_time_ns)
        angles.append(chunk.gyr)
    q = np.concatenate(angles)
    known = np.isfinite(q).all(axis=1)
    if not known.all():
        raise table.problem("a joint angle is missing here", int(np.argmin(known)))
    untitled = any(name.startswith("further_") for name in table.names)
    if untitled and len(q) > 2 and np.all(np.diff(q[:, 0]) > 0):
        raise table.problem(
            "has no titles, and its first column only grows as time does; put titles above: "
            "time_s,J1,J2,..."
        )
    if stamps is None:
        time = np.concatenate(times) if rate is not None else None
        return RobotLog(time, q, problem=table.problem), stated
    unix_ns = stream.first_time_ns() if stamps.unix else None
    found = [*stamps.findings, *stream.findings()]
    time = np.concatenate(times)
    return RobotLog(time, q, unix_ns, found, stamps.stated, table.problem), stated


def _lists(file: Path, joints: int, findings: list[Finding]) -> np.ndarray | None:
    """Joint angles of lines such as `[0, -90, -90, 0, 90, 0]`, as a script prints them.

    None where the file has no such lines.
    """
    first = next((line for line in head_of(file) if line.strip()), "")
    if not first.lstrip().startswith(("[", "(")):
        return None
    rows: list[list[float]] = []
    with LineStream(file, encoding_of(file)) as stream:
        for number, line in enumerate(stream.lines(), 1):
            values = [
                float(text)
                for text in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", line)
            ]
            if line.strip() and len(values) < joints:
                raise FileProblems(
                    file,
                    [
                        Problem(
                            f"{len(values)} numbers, where the arm has {joints} joints", line=number
                        )
                    ],
                )
            rows += [values[:joints]] if values else []
    findings.append(finding("truth.joint_lists", file=file.name, joints=joints))
    return np.array(rows)


def _table(file: Path, joints: list[str], findings: list[Finding]) -> TextTable:
    lines, others = head_of(file), ""
    for at, line in enumerate(lines):
        if not line.strip() or line.strip(' "').lower().startswith("sep="):
            continue
        separator = guess_separator(line)
        fields = split_line(line, separator)
        if any(
            re.search("[A-Za-z]", text.replace("e", "")) for text in fields
        ) or line.lstrip().startswith("#"):
            titles = split_line(line.lstrip("# "), separator)
            if joint_titles(titles, joints):
                decimal = decimal_of(lines[at + 1 :], separator)
                return TextTable(file, titles, at + 2, separator, decimal)
            others = line if len(titles) > 1 else others  # a comment, or titles of something else
            continue
        if others and len(split_line(others, guess_separator(others))) == len(fields):
            break
        if len(fields) < len(joints):
            raise FileProblems(
                file,
                [
                    Problem(
                        f"{len(fields)} numbers, where the arm has {len(joints)} joints",
                        line=at + 1,
                    )
                ],
            )
        extra = len(fields) - len(joints)
        if extra:
            findings.append(
                finding("truth.no_titles", file=file.name, joints=len(joints), further=extra)
            )
        return TextTable(
            file,
            [*joints, *[f"further_{i}" for i in range(extra)]],
            at + 1,
            separator,
            decimal_of(lines[at:], separator),
        )
    raise FileProblems(
        file,
        [
            Problem(
                f"no columns for the joints {', '.join(joints)}, and no lines of numbers; titles "
                f"that would do: {titles_that_do(joints)}"
            )
        ],
    )


def _joint_columns(table: TextTable, joints: list[str]) -> tuple[list[str], str | None]:
    found = joint_titles(table.names, joints)
    if not found:
        raise table.problem(
            f"no columns for the joints {', '.join(joints)}; it has {', '.join(table.names)}"
        )
    if len(found) > 1:
        places = ", ".join(f"'{one.titles[0]}'" for one in found)
        raise table.problem(
            f"several columns may be the measured angle of {joints[0]}: {places}; leave one set"
        )
    stripped = {name.strip(): name for name in table.names}
    return [stripped.get(title, title) for title in found[0].titles], found[0].unit


def _in_radians(
    log: RobotLog, unit: str | None, robot: Robot, file: Path, findings: list[Finding]
) -> RobotLog:
    """The log, whose angles are in a unit that is stated (`unit`), or told by the arm."""
    most = float(np.abs(log.q).max())
    if unit is None and most > LEAST_DEGREES and not _could_be_radians(log, robot):
        unit = "deg"
        findings.append(finding("truth.joint_degrees", file.name, largest=most))
    if unit is None:
        raise InputError(
            f"{file}: are the joint angles in degrees or radians (the largest is {most:.4g})? "
            "Answer with --joint-unit deg|rad"
        )
    return replace(log, q=log.q * (np.pi / 180)) if unit == "deg" else log


def _could_be_radians(log: RobotLog, robot: Robot) -> bool:
    """Whether an arm could have gone through these angles if they were radians."""
    if float(np.abs(log.q).max()) > MOST_TURNS:
        return False
    low, high = robot.position_limits.T
    beyond = np.maximum(low - log.q, log.q - high).max()
    if beyond > LIMITS_WITHIN:
        return False
    return log.time_ns is None or len(log.q) < 2 or fast_rows(log, robot, log.q).mean() <= MANY


def logged_truth(
    kinematics: Kinematics, log: RobotLog, link: str, mounting: Pose, shift_ns: int
) -> Truth:
    """Truth at every row of a log with times.

    Args:
        kinematics: Of the arm.
        log: With times.
        link: That carries the sensor.
        mounting: The sensor in the link.
        shift_ns: Added to the log's times, which begin at 0 [ns].

    Raises:
        InputError: An angle cannot be one.
    """
    assert log.time_ns is not None
    fresh = np.concatenate([[True], np.diff(log.time_ns) > 0])
    time, q = log.time_ns[fresh], log.q[fresh]
    steps = np.diff(time) / NANOSECONDS
    regular = (
        len(steps) >= 5 and float(np.abs(steps / np.median(steps) - 1).max()) <= REGULAR_WITHIN
    )
    if not regular:
        motion = kinematics.frame_motion(link, q, offset=mounting)
        return Truth(time + shift_ns, motion.q_world_from_frame)
    interval = float(np.median(steps))
    window = min(max(2 * round(SMOOTHING_S / interval / 2) + 1, 5), len(time) - 1 + len(time) % 2)
    v, a = (savitzky_golay(q, window, 3, order, interval) for order in (1, 2))
    motion = kinematics.frame_motion(link, q, v, a, mounting)
    gravity = kinematics.robot.gravity
    return Truth(
        time + shift_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(gravity),
    )


def commanded_dwells(
    poses: int,
    sensor: ImportedSensor,
    dwell: float,
    move: float | None,
    shift_ns: int,
    name: str,
    findings: list[Finding],
) -> np.ndarray:
    """When each pose of a list was held, shape (n, 2): begin and end, host time [s].

    Args:
        poses: Their number.
        sensor: Its samples show the dwells.
        dwell: Of each pose [s].
        move: Time from pose to pose [s], or None to find the dwells in the samples.
        shift_ns: Of the first dwell, if `move` is given [ns].
        name: Of the sensor.
        findings: What was noticed; is added to.

    Raises:
        InputError: The samples show another number of dwells than there are poses.
    """
    if move is not None:
        starts = shift_ns / NANOSECONDS + np.arange(poses) * (dwell + move)
        return np.column_stack([starts, starts + dwell])
    spans = find_dwells(sensor, DWELL_AT_LEAST * dwell)
    if len(spans) != poses:
        raise InputError(
            f"sensor '{name}': {len(spans)} stretches of rest of {DWELL_AT_LEAST * dwell:g} s or "
            f"more, but {poses} poses; cut the recording to the poses, correct --dwell, or state "
            "how long each move takes with --move"
        )
    length = float(np.diff(spans).mean())
    findings.append(finding("truth.dwells", name, dwells=len(spans), length_s=length))
    return spans


def commanded_truth(
    kinematics: Kinematics, q: np.ndarray, link: str, mounting: Pose, spans: np.ndarray
) -> Truth:
    """Truth during the dwells of a list of poses.

    Args:
        kinematics: Of the arm.
        q: Commanded joint angles, shape (n, n_joints) [rad].
        link: That carries the sensor.
        mounting: The sensor in the link.
        spans: Begin and end of each dwell, shape (n, 2) [s].
    """
    orientation = kinematics.frame_motion(link, q, offset=mounting).q_world_from_frame
    times, rows, known = [], [], []
    for (start, end), pose in zip(spans, orientation, strict=True):
        inside = np.arange(
            start + INSIDE_S, max(end - INSIDE_S, start + INSIDE_S + 2 * TRUTH_STEP_S), TRUTH_STEP_S
        )
        times.append(np.concatenate([inside, [inside[-1] + TRUTH_STEP_S / 2]]))
        rows.append(
            np.vstack([np.tile(pose, (len(inside), 1)), np.full((1, 4), np.nan)])
        )  # nobody knows the way to the next pose
        known.append(np.arange(len(inside) + 1) < len(inside))
    time = np.round(np.concatenate(times) * NANOSECONDS).astype(np.int64)
    return Truth(time, np.vstack(rows), judged=np.concatenate(known))


def commanded_steps(
    spans: list[np.ndarray], q: np.ndarray, joints: list[str], calibration: int
) -> list[PlannedStep]:
    """The dwells of a list of poses as steps of a session: a move to each pose, and its dwell.

    Args:
        spans: Begin and end of each dwell by each sensor, shape (n, 2) [s]; a step's dwell is what
            all of them share.
        q: Commanded joint angles, shape (n, n_joints) [rad].
        joints: Their names.
        calibration: The first so many poses calibrate the sensors and are not judged.

    Raises:
        InputError: The sensors do not share a dwell.
    """
    begins, ends = (
        np.max([span[:, 0] for span in spans], axis=0),
        np.min([span[:, 1] for span in spans], axis=0),
    )
    apart = np.flatnonzero(ends <= begins)
    if len(apart):
        raise InputError(
            f"pose {apart[0] + 1} was not held by all sensors at the same time: their clocks "
            "differ; import each by itself"
        )
    times = np.round(np.column_stack([np.append(0, ends[:-1]), begins, ends]) * NANOSECONDS).astype(
        np.int64
    )
    steps = []
    for index, (pose, (start, settled, end)) in enumerate(
        zip(np.degrees(q), times.tolist(), strict=True)
    ):
        calibrates = index < calibration
        variables = {
            f"{joint}_deg": round(float(angle), 6)
            for joint, angle in zip(joints, pose, strict=True)
        }
        section = "calibration" if calibrates else "poses"
        role: Role = "calibration" if calibrates else "evaluation"
        name = f"pose {index + 1}"
        steps.append(
            PlannedStep(
                index, section, role, name, "move", variables, min(start, settled), settled, end
            )
        )
    return steps


def find_dwells(sensor: ImportedSensor, shortest: float) -> np.ndarray:
    """Stretches without turning, shape (n, 2): begin and end, host time [s].

    Args:
        sensor: Its angular rate is used, less the median of its slower half; without one, its
            orientations.
        shortest: [s].
    """
    times, rates = [], []
    for chunk in sensor.chunks:
        size = max(round(WINDOW_S * sensor.rate), 2)
        count = len(chunk) // size
        time = chunk.host_time_ns[: count * size].reshape(count, size) / NANOSECONDS
        if np.isfinite(chunk.gyr).any():
            mean = chunk.gyr[: count * size].reshape(count, size, 3).mean(axis=1)
            quiet = mean[np.argsort(np.linalg.norm(mean, axis=1))[: max(count // 2, 1)]]
            rate = np.linalg.norm(mean - np.median(quiet, axis=0), axis=1)
        elif chunk.device_q is not None:
            first, last = (
                chunk.device_q[: count * size].reshape(count, size, 4)[:, i] for i in (0, -1)
            )
            span = np.maximum(time[:, -1] - time[:, 0], 1e-9)
            rate = (
                rotation.angle(
                    rotation.multiply(
                        rotation.conjugate(rotation.normalise(first)), rotation.normalise(last)
                    )
                )
                / span
            )
        else:
            raise InputError(
                "dwells cannot be found without an angular rate or an orientation; state the time "
                "of each move with --move"
            )
        times.append(time[:, [0, -1]])
        rates.append(rate)
    spans, resting = np.vstack(times), np.concatenate(rates) < TURNING
    edges = np.diff(np.concatenate([[False], resting, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    result = (
        np.column_stack([spans[begins, 0], spans[ends, 1]]) if len(begins) else np.zeros((0, 2))
    )
    return result[result[:, 1] - result[:, 0] >= shortest]
