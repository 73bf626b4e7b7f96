"""Truth from a file beside the recording.

It is a robot's joint log, its commanded poses, or orientations of a reference system.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from testbench.exceptions import InputError
from testbench.formats.recording import Recording
from testbench.formats.tables.recognise import find_sensors, find_time
from testbench.formats.tables.samples_stream import Quantities, SampleStream, stack
from testbench.formats.tables.source import Columns, Kind
from testbench.formats.tables.text_table import TextTable, find_table
from testbench.formats.tables.timeline import RegularTime, StampedTime, Timeline
from testbench.formats.truth.reference import collect, reference_truth
from testbench.formats.truth.robot_log import (
    commanded_dwells,
    commanded_steps,
    commanded_truth,
    logged_truth,
    read_robot_log,
)
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.specs.protocol import Analysis
from testbench.records.specs.robot import load_robot
from testbench.records.specs.strict import Placement

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
    """

    file: Path
    robot: str | None = None
    links: dict[str, str] = field(default_factory=dict)
    mountings: dict[str, Placement] = field(default_factory=dict)
    dwell: float | None = None
    move: float | None = None
    offset: float | None = None
    rate: float | None = None
    joint_unit: str | None = None
    calibration_poses: int = 0


def attach_truth(recording: Recording, options: TruthOptions) -> None:
    """Give each sensor of a recording its truth.

    Args:
        recording: Is changed.
        options: What to read and how.

    Raises:
        InputError: Something is missing; says which option states it.
        FileProblems: The file is malformed.
    """
    names = list(recording.sensors)
    for key in (*options.links, *options.mountings):
        if key and key not in names:
            raise InputError(
                f"--link or --mounting names the sensor '{key}'; the recording has "
                f"{', '.join(names)}"
            )
    if not options.file.is_file():
        raise InputError(f"--truth {options.file}: the file does not exist")
    notes: list[str] = []
    if options.offset is not None:
        for sensor in recording.sensors.values():
            sensor.details |= {"truth_offset_s": options.offset}
    if options.robot is None:
        _from_orientations(recording, options, notes)
    else:
        _from_robot(recording, options, notes)
    recording.notes += [f"truth: {note}" for note in notes]
    changes = {"align": "motion", "align_clock": options.dwell is None}
    if options.calibration_poses:
        changes["calibrate"] = "static_poses"
    settings = recording.analysis.estimate.model_copy(update=changes)
    recording.analysis = Analysis.model_validate(
        recording.analysis.model_dump() | {"estimate": settings.model_dump()}
    )


# One piece: most lines check the answers against what the robot's log holds.
def _from_robot(recording: Recording, options: TruthOptions, notes: list[str]) -> None:
    assert options.robot is not None
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
    log = read_robot_log(
        options.file, kinematics.robot.joint_names, options.rate, options.joint_unit, notes
    )
    shift = round((options.offset or 0.0) * NANOSECONDS)
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
        else:
            assert options.dwell is not None
            dwells.append(
                commanded_dwells(
                    len(log.q), sensor, options.dwell, options.move, shift, name, notes
                )
            )
            sensor.truth = commanded_truth(kinematics, log.q, link, mounting, dwells[-1])
        sensor.details |= {"truth": f"{kinematics.robot.name}, link {link}"}
    if dwells:
        recording.steps = commanded_steps(
            dwells, log.q, kinematics.robot.joint_names, options.calibration_poses
        )
    notes.append(f"{options.file.name}: {len(log.q)} joint poses of {kinematics.robot.name}")


def _from_orientations(recording: Recording, options: TruthOptions, notes: list[str]) -> None:
    """The same orientations for every sensor, each with its own mounting."""
    if options.dwell is not None or options.links or options.calibration_poses:
        raise InputError(
            "--dwell, --calibration-poses and --link belong to a robot's log; state the arm with "
            "--robot"
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
        raise table.problem(
            f"no four columns of a quaternion (q_w, q_x, q_y, q_z); it has {', '.join(table.names)}"
        )
    kinds: dict[str, Kind] = dict.fromkeys(columns, "float")
    stream = SampleStream(table, kinds, lambda c: _only_q(c, columns), _times(table, options))
    time, q = collect(stream)
    for name, sensor in recording.sensors.items():
        mounting = Pose.from_placement(
            options.mountings.get(name, options.mountings.get("", Placement()))
        ).quaternion
        own: list[str] = []
        sensor.truth = reference_truth(
            time + round((options.offset or 0.0) * NANOSECONDS), q, mounting, None, own
        )
        notes += [note for note in own if note not in notes]
    notes.append(
        f"{options.file.name}: {len(q)} orientations, w first, taken for q_world_from_body"
    )


def _only_q(columns: Columns, titles: list[str]) -> Quantities:
    return Quantities(None, None, None, stack(columns, titles))


def _times(table: TextTable, options: TruthOptions) -> Callable[[], Timeline]:
    found = find_time(table.names)
    if options.rate is not None:
        rate = options.rate
        return lambda: RegularTime(rate)
    if found is None:
        raise InputError(
            f"{options.file} has no column of times; state its rate with --truth-rate HZ"
        )
    column, unit = found

    def make() -> Timeline:
        return StampedTime(column, unit or "s")  # type: ignore[arg-type]

    return make
