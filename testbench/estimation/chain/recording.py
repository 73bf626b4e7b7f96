"""What a chain is estimated from: a run of a protocol, or an import with a stated model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from testbench.estimation.signals.recording import RunFacts
from testbench.estimation.signals.segmentation import intervals_of
from testbench.exceptions import InputError, NotFoundError
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.tables import read_parquet
from testbench.records.results.estimate import SensorEstimate
from testbench.records.session.layout import PLAN
from testbench.records.session.plan import PlannedStep, evaluated_steps
from testbench.records.session.sensor_file import SensorFile
from testbench.records.session.session import Session
from testbench.records.specs.protocol_chain import ChainModel
from testbench.records.specs.robot import Robot
from testbench.records.specs.segment_alignment import SegmentAlignment
from testbench.records.specs.sensor import ImuParameters

SETTLED_NS = NANOSECONDS * 3 // 10
"""After a move the arm still swings in; this long is left out of a rest."""
LEAST_REST_NS = NANOSECONDS // 2
LONGEST_REST_NS = 10 * NANOSECONDS
"""Shortest rest that a start can be read from, and how much of a long one is used [ns]."""
GRID_NS = NANOSECONDS // 100
"""Common rests of several sensors are looked for this finely [ns]."""
LEAST_LENGTH_MM = 1.0
"""A joint nearer than this to the one before it turns in the same place [mm]."""
MOTION = "motion"
"""The one section of an import: from the rest in the start pose to the end."""


@dataclass(frozen=True)
class ChainPart:
    """A section that the filter runs over.

    Attributes:
        rest: Begin and end of the rest before it [ns].
        motion: Begin and end of its motion [ns].
        pose: Stated at that rest, shape (n_joints,) in the robot's order [rad].
    """

    rest: tuple[int, int]
    motion: tuple[int, int]
    pose: np.ndarray


@dataclass(frozen=True)
class CarriedSensor:
    """A sensor on a link.

    Attributes:
        link: That carries it.
        mounting: The sensor in the link, as stated.
        sheet: What its data sheet says.
    """

    link: str
    mounting: Pose
    sheet: ImuParameters


@dataclass(frozen=True)
class ChainRecording:
    """A recording, as far as a chain is estimated from it; what an arm measured is not in it.

    Attributes:
        robot: The arm, or the model of what was recorded.
        carried: The sensors on it, by name.
        raw: Samples of the sensors, by name.
        steps: Of a run, those that were finished.
        plan: Of a run, columns of the planned motion, shape (n,) each; None of an import.
        model: Of an import, as stated; None of a run.
        alignment: Of an import, how well a body's segments are known.
    """

    robot: Robot
    carried: Mapping[str, CarriedSensor]
    raw: Mapping[str, SensorFile]
    steps: Sequence[PlannedStep] = ()
    plan: Mapping[str, np.ndarray] | None = None
    model: ChainModel | None = None
    alignment: SegmentAlignment = field(default_factory=SegmentAlignment)

    @staticmethod
    def of(session: Session, run: RunFacts) -> ChainRecording | None:
        """That of a session; None where it has no arm with a plan, and no model is stated.

        Raises:
            InputError: The stated model is not there, or speaks of sensors that are not.
        """
        raw = {name: session.sensor(name) for name in session.sensor_names}
        wanted = run.settings.chain
        if wanted is not None and wanted.model is not None:
            return _of_import(session, wanted.model, raw, run.body.alignment)
        if session.robot is None or not (session.path / PLAN).is_file():
            return None
        columns = ["host_time_ns", *(f"q_{joint}_rad" for joint in session.robot.joint_names)]
        carried = {
            name: CarriedSensor(one.link, Pose.from_placement(one.mounting), one.imu())
            for name, one in run.placed.items()
        }
        plan = read_parquet(session.path / PLAN, columns)
        return ChainRecording(session.robot, carried, raw, run.steps, plan)

    @property
    def sections(self) -> list[str]:
        """Those that are estimated where none is named."""
        if self.model is not None:
            return [MOTION]
        judged = [step.section for step in evaluated_steps(self.steps)]
        return list(dict.fromkeys(judged))

    def part(self, section: str, sensors: Mapping[str, SensorEstimate]) -> ChainPart:
        """A section of it.

        Args:
            section: Its name.
            sensors: Those used, with clocks and rests.

        Raises:
            InputError: There is no such section, or no rest that it could start from.
        """
        if self.model is not None:
            if section != MOTION:
                raise InputError(f"an import has one section, '{MOTION}'")
            pose = _stated_pose(self.robot, self.model)
            return _from_rest(sensors, self.model.rest_s, pose)
        begin, end, begins, ends = _rest(self.steps, section)
        return ChainPart((begin, end), (begins, ends), self._planned_pose(end))

    def _planned_pose(self, time_ns: int) -> np.ndarray:
        """The pose by the plan at a rest, not the measured one, shape (n_joints,) [rad]."""
        assert self.plan is not None
        table = self.plan
        planned_end = np.searchsorted(table["host_time_ns"], time_ns, side="right") - 1
        row = int(np.clip(planned_end, 0, len(table["host_time_ns"]) - 1))
        return np.array([table[f"q_{joint}_rad"][row] for joint in self.robot.joint_names])


def _of_import(
    session: Session,
    model: ChainModel,
    raw: Mapping[str, SensorFile],
    alignment: SegmentAlignment,
) -> ChainRecording:
    if len(model.sensors) > 1 and any(own.code == "clock.own" for own in session.manifest.findings):
        raise InputError(
            "the clocks of its sensors have nothing in common, and the chain filter needs one time "
            "for all; give the files Unix times, or one file"
        )
    carried = {}
    for name, one in model.sensors.items():
        if name not in raw:
            raise NotFoundError("sensor of estimate.chain.model", name, list(raw))
        sheet = one.imu()
        if one.preset is None:  # what it filters is not known, and its stamps are what files say
            described = session.manifest.sensors[name]
            sheet = sheet.model_copy(
                update={
                    "sampling": described.sampling or "instantaneous",
                    "rate_hz": described.rate_hz or sheet.rate_hz,
                    "gyroscope": sheet.gyroscope.model_copy(update={"bandwidth_hz": None}),
                    "accelerometer": sheet.accelerometer.model_copy(update={"bandwidth_hz": None}),
                }
            )
        carried[name] = CarriedSensor(one.link, Pose.from_placement(one.mounting), sheet)
    robot = session.chain_robot
    assert robot is not None
    return ChainRecording(robot, carried, raw, model=model, alignment=alignment)


def lengths_of(robot: Robot, model: ChainModel) -> np.ndarray:
    """Lengths of the offset before each joint in multiples of the robot's, shape (n_joints,).

    Raises:
        InputError: The robot states no stature, or a joint has no length before it.
    """
    lengths = np.ones(len(robot.joint_names))
    if model.stature_mm is not None:
        own = robot.spec.stature_mm
        if own is None:
            raise InputError(
                f"{robot.name} states no stature (stature_mm of its robot.yaml), so that "
                "estimate.chain.model.stature_mm scales nothing; state lengths_mm"
            )
        lengths[:] = model.stature_mm / own
    kinematics = Kinematics(robot)
    for joint, length in model.lengths_mm.items():
        column = _joint_index(robot, joint)
        before = 1000 * kinematics.offset_before(joint)
        if before < LEAST_LENGTH_MM:
            raise InputError(
                f"estimate.chain.model.lengths_mm: {joint} turns where the joint before it does, "
                "and has no length"
            )
        lengths[column] = length / before
    return lengths


def _joint_index(robot: Robot, joint: str) -> int:
    if joint not in robot.joint_names:
        raise NotFoundError(f"joint of {robot.name}", joint, robot.joint_names)
    return robot.joint_names.index(joint)


def _stated_pose(robot: Robot, model: ChainModel) -> np.ndarray:
    """The start pose of an import, shape (n_joints,) [rad]: home, but for what is stated."""
    pose = robot.home.copy()
    for joint, angle in model.start_deg.items():
        pose[_joint_index(robot, joint)] = np.radians(angle)
    return pose


def _from_rest(
    sensors: Mapping[str, SensorEstimate], stated_s: Sequence[float] | None, pose: np.ndarray
) -> ChainPart:
    """From the first rest of all sensors together, or the stated one, to the end."""
    first = max(int(one.host_time_ns[0]) for one in sensors.values())
    last = min(int(one.host_time_ns[-1]) for one in sensors.values())
    grid = np.arange(first, last, GRID_NS)
    resting = np.ones(len(grid), dtype=bool)
    for one in sensors.values():
        row = np.searchsorted(one.host_time_ns, grid).clip(max=len(one.host_time_ns) - 1)
        resting &= one.static[row]
    found = grid[0] + GRID_NS * intervals_of(resting, LEAST_REST_NS // GRID_NS)
    if stated_s is not None:
        begin, end = (round(NANOSECONDS * second) for second in stated_s)
        found = np.array([own for own in found if own[0] <= begin and end <= own[1]])
        if not len(found):
            raise InputError(
                f"the sensors are not at rest from {stated_s[0]:g} to {stated_s[1]:g} s, "
                "which estimate.chain.model.rest_s states"
            )
        found[0] = begin, end
    if not len(found):
        raise InputError(
            "there is no rest of all its sensors together, of at least half a second, to start from"
        )
    begin, end = int(found[0][0]), int(found[0][1])
    if last - end < LEAST_REST_NS:
        raise InputError("nothing moves after the rest that it would start from")
    return ChainPart((max(begin, end - LONGEST_REST_NS), end), (end, last), pose)


def _rest(steps: Sequence[PlannedStep], section: str) -> tuple[int, int, int, int]:
    """Begin and end of the rest before a section, and begin and end of its motion [ns]."""
    own = [i for i, step in enumerate(steps) if step.section == section]
    if not own:
        raise InputError("the recording has no finished step of it")
    first, last = own[0], own[-1]
    if first > 0:
        before = steps[first - 1]
        begin, end = (
            before.settled_ns + (SETTLED_NS if before.settled_ns > before.start_ns else 0),
            steps[first].start_ns,
        )
        begins = steps[first].start_ns
    elif steps[first].kind == "hold":  # the arm starts at rest
        begin, end = steps[first].start_ns, steps[first].end_ns
        begins = end
    else:
        raise InputError("no rest comes before it; put a dwell in front, which gives the start")
    begin = max(begin, end - LONGEST_REST_NS)
    if end - begin < LEAST_REST_NS:
        raise InputError(
            f"the rest before it lasts {max(end - begin, 0) / NANOSECONDS:.2f} s; 0.5 s are needed"
        )
    return begin, end, begins, steps[last].end_ns
