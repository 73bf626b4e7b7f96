"""Truth from a file beside the recording.

It is a robot's joint log, its commanded poses, or orientations of a reference system.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from testbench.exceptions import InputError
from testbench.formats.recording import Recording
from testbench.formats.stamps import LOWEST_OF_TRUTH_HZ, Stamps
from testbench.formats.tables.binary_kinds import PARQUET, binary_kind
from testbench.formats.tables.recognise import find_sensors
from testbench.formats.tables.ros_bag import is_bag, open_bag
from testbench.formats.tables.samples_stream import Quantities, SampleStream, stack
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import TextTable, find_table, head_of
from testbench.formats.tables.timeline import LATEST_NS, RegularTime
from testbench.formats.tables.units import find_unit
from testbench.formats.truth.angle_names import guessed_angles, stated_angles
from testbench.formats.truth.angle_table import AngleUnit, is_coordinates, read_angles
from testbench.formats.truth.angles import give_angles
from testbench.formats.truth.c3d import read_c3d_angles
from testbench.formats.truth.joint_reading import read_otherwise
from testbench.formats.truth.joint_steps import mended
from testbench.formats.truth.markers import LISTED, give_truth, is_tracked, read_tracked
from testbench.formats.truth.reference import collect, reference_truth
from testbench.formats.truth.robot_log import (
    commanded_dwells,
    commanded_steps,
    commanded_truth,
    logged_truth,
    read_robot_log,
)
from testbench.formats.truth.ros_truth import give_bag_truth, joint_log
from testbench.formats.truth.times import ask_if_too_long, later_than_samples_ns, truth_stamps
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.findings.catalogue import finding
from testbench.records.session.manifest import JointTruthRecord
from testbench.records.specs.protocol import Analysis
from testbench.records.specs.robot import load_robot
from testbench.records.specs.strict import Placement

MOST_UNSURE_DEG = 30.0
"""What is less sure is no truth [deg]."""
HIGHEST_OF_TRUTH_HZ = 100_000.0
"""As of samples: no log is faster [Hz]."""
_POSES = re.compile(
    r"(quat\w*|\bq|orientation\w*)[\s_.\[(]*[wxyz0]|^\W*time\W.*\b[wW]\b", re.IGNORECASE
)


@dataclass
class TruthOptions:
    """What a person says of the truth.

    Attributes:
        file: A joint log, a list of commanded joint angles, or a table of orientations.
        robot: Name or file of the arm; None: the file holds orientations.
        links: Link of each sensor ("" for all).
        mountings: Sensor in the link, or in the body whose orientation the file holds ("" for all).
        dwell: How long each commanded pose is held [s].
        move: How long each move takes [s]; None: found in the samples.
        offset: Added to the file's times [s]; None where nobody knows when the file began.
        rate: Of a log without times [Hz].
        joint_unit: "deg" or "rad", where the log does not say.
        calibration_poses: The first so many commanded poses calibrate the sensors and are not
            judged.
        time_unit: Of its times, where neither title nor size tell it.
        clusters: Markers of each sensor, or the one body that carries it, in the file of a motion
            capture system; frame or topic of a bag of ROS.
        sd_deg: Standard uncertainty of its orientations about each axis [deg]; None where nobody
            says.
        angles: Column of the file by joint, or by joint.angle, with a minus before it where it
            counts the other way.
    """

    file: Path
    robot: str | None = None
    links: dict[str, str] = field(default_factory=dict)
    mountings: dict[str, Placement] = field(default_factory=dict)
    dwell: float | None = None
    move: float | None = None
    offset: float | None = None
    rate: float | None = None
    joint_unit: AngleUnit | None = None
    calibration_poses: int = 0
    time_unit: str | None = None
    clusters: dict[str, list[str]] = field(default_factory=dict)
    angles: dict[str, str] = field(default_factory=dict)
    sd_deg: float | None = None

    def __post_init__(self) -> None:
        if self.rate is not None and not LOWEST_OF_TRUTH_HZ <= self.rate <= HIGHEST_OF_TRUTH_HZ:
            raise InputError(
                f"--truth-rate {self.rate:g}: a rate lies between {LOWEST_OF_TRUTH_HZ:g} and "
                f"{HIGHEST_OF_TRUTH_HZ:g} Hz"
            )
        if self.offset is not None and not abs(self.offset) * NANOSECONDS <= LATEST_NS:
            raise InputError(f"--truth-offset {self.offset:g}: no log begins so much later")
        if self.sd_deg is not None and not 0 < self.sd_deg <= MOST_UNSURE_DEG:
            raise InputError(
                f"--truth-sd {self.sd_deg:g}: a standard uncertainty is above 0 and at most "
                f"{MOST_UNSURE_DEG:g} deg"
            )
        if self.time_unit is not None:
            self.time_unit = find_unit("time", self.time_unit).name


def attach_truth(recording: Recording, options: TruthOptions) -> None:
    """Give each sensor of a recording its truth, or joints their true angles.

    Args:
        recording: Is changed.
        options: What to read and how.

    Raises:
        InputError: Something is missing; says which option states it.
        FileProblems: The file is malformed.
    """
    names = list(recording.sensors)
    for key in (*options.links, *options.mountings, *options.clusters):
        if key and key not in names:
            raise InputError(
                f"--link, --mounting or --truth-cluster names the sensor '{key}'; the recording "
                f"has {', '.join(names)}"
            )
    if not options.file.is_file() and not is_bag(options.file):
        raise InputError(f"--truth {options.file}: the file does not exist")
    if _holds_angles(recording, options):
        _from_angles(recording, options)
        return
    if options.robot is None:
        _from_orientations(recording, options)
    else:
        _from_robot(recording, options)
    for sensor in recording.sensors.values():
        sensor.details |= _stated(options)
    changes = {"align": "motion", "align_clock": options.dwell is None}
    if options.calibration_poses:
        changes["calibrate"] = "static_poses"
    settings = recording.analysis.estimate.model_copy(update=changes)
    recording.analysis = Analysis.model_validate(
        recording.analysis.model_dump() | {"estimate": settings.model_dump()}
    )


def _stated(options: TruthOptions) -> dict[str, Any]:
    """What a person said of the truth, as entries of each sensor in the manifest."""
    said: dict[str, Any] = {}
    if options.offset is not None:
        said |= {"truth_offset_s": options.offset}
    if options.sd_deg is not None:
        said |= {"truth_sd_deg": options.sd_deg, "truth_sd_from": "as was stated"}
    return said


def _holds_angles(recording: Recording, options: TruthOptions) -> bool:
    """Whether the truth is angles of joints: as stated, or as the file and the joints tell."""
    if options.angles or is_bag(options.file):
        return bool(options.angles)
    if options.robot is not None or options.clusters:
        return False
    if is_coordinates(options.file):
        return True
    if recording.analysis.body is None or not recording.analysis.body.joints:
        return False
    if options.file.suffix.lower() == ".c3d":
        return bool(read_c3d_angles(options.file).names)
    if binary_kind(options.file) is PARQUET:
        return True
    return not is_tracked(options.file) and not any(map(_POSES.search, head_of(options.file)))


def _from_angles(recording: Recording, options: TruthOptions) -> None:
    """Joints get the columns of the file that are their angles."""
    alien = {
        "--robot": options.robot is not None,
        "--link": bool(options.links),
        "--mounting": bool(options.mountings),
        "--dwell": options.dwell is not None,
        "--move": options.move is not None,
        "--truth-sd": options.sd_deg is not None,
        "--calibration-poses": bool(options.calibration_poses),
        "--truth-cluster": bool(options.clusters),
    }
    given = [flag for flag, used in alien.items() if used]
    if given:
        raise InputError(f"{', '.join(given)}: has no effect on a truth of joint angles")
    if is_bag(options.file):
        raise InputError(f"{options.file} is a bag of ROS, which has no column for --truth-angle")
    body = recording.analysis.body
    if body is None or not body.joints:
        raise InputError(
            f"{options.file} holds angles of joints, and the recording has no joint: name one with "
            "--joint NAME=PROXIMAL:DISTAL"
        )
    titles = [title.lstrip("-").strip() for title in options.angles.values()]
    table = read_angles(options.file, titles, options.rate, options.time_unit)
    flag = "--truth-angle"
    chosen = (
        stated_angles(options.angles, body.joints, table.titles, flag)
        if options.angles
        else guessed_angles(body.joints, table)
    )
    if not chosen:
        listing = ", ".join(table.titles[:LISTED])
        raise InputError(
            f"{options.file}: which of its columns are angles of {', '.join(body.joints)}? Answer "
            f"with {flag} JOINT.ANGLE=COLUMN, such as knee.flexion=knee_angle_r; it has {listing}"
        )
    later, said = later_than_samples_ns(recording, table.unix_ns, int(np.ptp(table.time_ns)))
    recording.findings += said
    if not options.angles:
        found = [str(own) for own in chosen]
        recording.findings.append(finding("truth.angles_guessed", columns=found))
    shift = later + round((options.offset or 0.0) * NANOSECONDS)
    placed = replace(table, time_ns=table.time_ns + shift)
    record = JointTruthRecord(offset_s=options.offset)
    give_angles(recording, placed, chosen, options.joint_unit, record)


# One piece: most lines check the answers against what the robot's log holds.
def _from_robot(recording: Recording, options: TruthOptions) -> None:
    assert options.robot is not None
    if options.clusters:
        raise InputError("--truth-cluster belongs to markers or bodies; leave it out, or --robot")
    kinematics = Kinematics(load_robot(options.robot))
    missing = [
        name for name in recording.sensors if name not in options.links and "" not in options.links
    ]
    if missing:
        listing = ", ".join(kinematics.link_names)
        raise InputError(
            f"which link carries {', '.join(missing)}? Answer with --link SENSOR=LINK; links: "
            f"{listing}"
        )
    for name in recording.sensors:
        kinematics.check_carrier(options.links.get(name, options.links.get("", "")))
    joints = kinematics.robot.joint_names
    log = (
        joint_log(open_bag([options.file]), joints, recording.origin_ns)
        if is_bag(options.file)
        else read_robot_log(
            options.file,
            kinematics.robot,
            options.rate,
            options.joint_unit,
            recording.findings,
            options.time_unit,
        )
    )
    if options.time_unit is not None and (log.time_ns is None or options.rate is not None):
        raise InputError(f"--truth-time-unit has no effect: no times of {options.file} are used")
    if log.time_ns is not None and not log.time_stated:
        ask_if_too_long(recording, options.file, int(log.time_ns[-1]))
    log = mended(log, kinematics.robot)
    shift = round((options.offset or 0.0) * NANOSECONDS)
    recording.findings += [found.at(options.file.name) for found in log.findings]
    if log.time_ns is not None:
        later, said = later_than_samples_ns(recording, log.unix_ns, int(log.time_ns[-1]))
        recording.findings += said
        shift += later
    if log.time_ns is None and options.dwell is None:
        raise InputError(
            f"{options.file} has {len(log.q)} joint poses without times: state how long each is "
            "held (--dwell S), or the rate of a regular log (--truth-rate HZ)"
        )
    if log.time_ns is not None and options.dwell is not None:
        raise InputError(f"{options.file} has times: leave --dwell out, or the times")
    if options.calibration_poses and (
        options.dwell is None or options.calibration_poses >= len(log.q)
    ):
        raise InputError(
            f"--calibration-poses {options.calibration_poses} asks for a list of more commanded "
            f"poses than that; {options.file} has "
            f"{len(log.q)}{' rows, with times' if log.time_ns is not None else ''}"
        )
    dwells = []
    for name, sensor in recording.sensors.items():
        link = options.links.get(name, options.links.get("", ""))
        mounting = Pose.from_placement(
            options.mountings.get(name, options.mountings.get("", Placement()))
        )
        if log.time_ns is not None:
            sensor.truth = logged_truth(kinematics, log, link, mounting, shift)
            otherwise = read_otherwise(kinematics, log, link, sensor)
            if otherwise is not None:
                recording.findings.append(otherwise.at(name))
                sensor.details["truth_otherwise"] = otherwise.values["how"]
        else:
            assert options.dwell is not None
            dwells.append(
                commanded_dwells(
                    len(log.q),
                    sensor,
                    options.dwell,
                    options.move,
                    shift,
                    name,
                    recording.findings,
                )
            )
            sensor.truth = commanded_truth(kinematics, log.q, link, mounting, dwells[-1])
        sensor.details |= {
            "truth": f"{kinematics.robot.name}, link {link}",
            "truth_link": link,
            "truth_world": "z_up",
            "truth_sd_deg": kinematics.orientation_sd_deg(link, log.q),
            "truth_sd_from": f"zeros and twists of {kinematics.robot.name}, by its robot file",
        }
    if dwells:
        recording.steps = commanded_steps(
            dwells, log.q, kinematics.robot.joint_names, options.calibration_poses
        )
    recording.findings.append(
        finding(
            "truth.joint_poses",
            file=options.file.name,
            poses=len(log.q),
            robot=kinematics.robot.name,
        )
    )


def _from_orientations(recording: Recording, options: TruthOptions) -> None:
    """The same orientations for every sensor, each with its own mounting."""
    if options.dwell is not None or options.links or options.calibration_poses:
        raise InputError(
            "--dwell, --calibration-poses and --link belong to a robot's log; state the arm with "
            "--robot"
        )
    if _from_bodies(recording, options):
        return
    if options.clusters:
        raise InputError(
            f"{options.file} is no export of a motion capture system that this bench knows, and no "
            "bag of ROS: --truth-cluster has no effect on it"
        )
    table, _ = find_table(
        options.file,
        _POSES,
        "a table of orientations (titles such as time_s, q_w, q_x, q_y, q_z); for a robot's log "
        "state --robot",
    )
    found = next((f for f in find_sensors(table.names).values() if "quaternion" in f.columns), None)
    plain = {name.lower(): name for name in table.names}
    columns = (
        found.columns["quaternion"] if found else [plain[axis] for axis in "wxyz" if axis in plain]
    )
    if len(columns) != 4:
        has = ", ".join(table.names)
        raise table.problem(f"no four columns of a quaternion (q_w, q_x, q_y, q_z); it has {has}")
    kinds: dict[str, Kind] = dict.fromkeys(columns, "float")
    stamps = _stamps(table, options)
    stream = SampleStream(table, kinds, lambda c: _only_q(c, columns), stamps.timeline)
    time, q = collect(stream)
    if not stamps.stated:
        ask_if_too_long(recording, options.file, int(time[-1]))
    said = [*stamps.findings, *stream.findings()]
    unix_ns = stream.first_time_ns() if stamps.unix else None
    later, clock = later_than_samples_ns(recording, unix_ns, int(time[-1]))
    recording.findings += [*(found.at(options.file.name) for found in said), *clock]
    for name, sensor in recording.sensors.items():
        mounting = Pose.from_placement(
            options.mountings.get(name, options.mountings.get("", Placement()))
        ).quaternion
        sensor.truth = reference_truth(
            options.file.name,
            time + later + round((options.offset or 0.0) * NANOSECONDS),
            q,
            mounting,
            None,
            recording.findings,
        )
    recording.findings.append(finding("truth.orientations", file=options.file.name, count=len(q)))


def _from_bodies(recording: Recording, options: TruthOptions) -> bool:
    """Each sensor its own markers, body or frame; False if the file holds none of these."""
    shift = round((options.offset or 0.0) * NANOSECONDS)
    own, mountings = options.clusters, options.mountings
    if is_bag(options.file):
        times = (recording.origin_ns, shift)
        bag = open_bag([options.file])
        give_bag_truth(recording, bag, own, mountings, times)
        return True
    tracked = read_tracked(options.file, options.rate)
    if tracked is None:
        return False
    give_truth(recording, tracked, own, mountings, shift)
    return True


def _only_q(columns: Columns, titles: list[str]) -> Quantities:
    return Quantities(None, None, None, stack(columns, titles))


def _stamps(table: TextTable, options: TruthOptions) -> Stamps:
    stamps = truth_stamps(table, options.rate, options.time_unit)
    if stamps is not None:
        return stamps
    if options.time_unit is not None:
        raise InputError(f"--truth-time-unit has no effect: no times of {options.file} are used")
    if options.rate is None:
        columns = ", ".join(table.names[:20])
        raise InputError(
            f"{options.file} has no column of times that is called time, t or timestamp, with its "
            f"unit or without (its columns: {columns}); state its rate with --truth-rate HZ, or "
            "name the column in a mapping (truth.time)"
        )
    rate = options.rate
    return Stamps(lambda: RegularTime(rate), [])
