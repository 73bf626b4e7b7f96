"""Plan: a protocol turned into a checked, timed and hashable motion; it touches no hardware."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import ConfigDict, TypeAdapter, ValidationError, with_config

from testbench.exceptions import SessionError
from testbench.records.disk.json_record import first_problem
from testbench.records.disk.tables import read_parquet, write_parquet
from testbench.records.session.sound_tables import LATEST_NS
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol import Protocol
from testbench.records.specs.protocol_steps import Role
from testbench.records.specs.robot import Robot

_KNOTS = (("q", "_rad"), ("v", "_rad_s"), ("a", "_rad_s2"))
"""Columns of the file of a plan, about each joint's name."""


@dataclass(frozen=True)
class PlannedCycles:
    """The whole cycles that a periodic sweep makes at full amplitude, its fades left out.

    Attributes:
        frequency_hz: Of the whole motion: the highest of which the frequency of every joint is a
            multiple.
        first_s: Where the first cycle begins, a whole number of cycles after the sweep does, so
            that 0 % is where the phases of the protocol count from.
        count: How many follow one another.
        motion_s: How long the sweep lasts as planned, with fades.
    """

    frequency_hz: float
    first_s: float
    count: int
    motion_s: float

    @staticmethod
    def of(data: Any) -> PlannedCycles | None:
        """From what was recorded of a step; None where that says nothing.

        Raises:
            ValueError: It says nothing that could be.
        """
        if data is None:
            return None
        keys = ("frequency_hz", "first_s", "count", "motion_s")
        found = [data.get(key) for key in keys] if isinstance(data, dict) else []
        numbers = [
            float(n) for n in found if isinstance(n, int | float) and math.isfinite(n) and n >= 0
        ]
        if len(numbers) < len(keys) or numbers[0] == 0:
            raise ValueError(f"{data!r:.80} are no cycles")
        frequency, first, count, motion = numbers
        return PlannedCycles(frequency, first, int(count), motion)


@with_config(ConfigDict(strict=True, allow_inf_nan=False))
@dataclass(frozen=True)
class PlannedStep:
    """One step of the protocol with its times from the start of the plan.

    Attributes:
        index: From 0.
        section: Name of its section.
        role: Role of its section.
        name: For people.
        kind: "move" ends at rest in a pose, "sweep" is evaluated while it moves, "hold" does not
            move.
        variables: Values of the loop variables, by name.
        start_ns: Motion begins.
        settled_ns: Motion ends and the dwell begins.
        end_ns: The dwell ends.
        place: `file:line` in the protocol.
        cycles: Of a periodic sweep that has any at full amplitude.
    """

    index: int
    section: str
    role: Role
    name: str
    kind: Literal["move", "sweep", "hold"]
    variables: dict[str, float]
    start_ns: int
    settled_ns: int
    end_ns: int
    place: str = ""
    cycles: PlannedCycles | None = None


def step_of(data: dict[str, Any]) -> PlannedStep:
    """A step from what was written of it.

    Args:
        data: Its attributes by name.

    Raises:
        ValueError: One is missing or of another type, or its times are none.
    """
    times = [data.get(key) for key in ("start_ns", "settled_ns", "end_ns")]
    for time in times:
        if isinstance(time, int) and abs(time) > LATEST_NS:
            raise ValueError(f"{time} is no time")
    cycles = PlannedCycles.of(data.get("cycles"))
    try:
        return replace(_step().validate_json(json.dumps(data | {"cycles": None})), cycles=cycles)
    except ValidationError as error:
        raise ValueError(first_problem(error)) from None


@cache
def _step() -> TypeAdapter[PlannedStep]:
    return TypeAdapter(PlannedStep)


def evaluated_steps(steps: Sequence[PlannedStep]) -> list[PlannedStep]:
    """Steps of evaluation sections alone; none where a protocol has no such section."""
    return [step for step in steps if step.role == "evaluation"]


def judged_steps(steps: list[PlannedStep]) -> list[PlannedStep]:
    """Steps whose errors count: of evaluation sections, or all but calibration if there is none."""
    return evaluated_steps(steps) or [step for step in steps if step.role != "calibration"] or steps


def stored_steps(file: Path) -> list[PlannedStep]:
    """The steps of a plan that was written to a file, without their places in the protocol.

    Raises:
        SessionError: The file is missing or damaged.
    """
    try:
        notes = pq.read_schema(file).metadata or {}
        return [step_of(data) for data in json.loads(notes[b"steps"])]
    except (OSError, pa.ArrowException, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SessionError(f"the plan {file} cannot be read: {error}") from None


def stored_trajectory(file: Path, joints: Sequence[str]) -> Trajectory:
    """The motion of a plan that was written to a file.

    Args:
        file: As `Plan.save` writes it.
        joints: Names of the arm's joints, in the robot's order.

    Raises:
        SessionError: The file is missing or damaged.
    """
    table = read_parquet(file)
    columns = [[f"{kind}_{joint}{unit}" for joint in joints] for kind, unit in _KNOTS]
    missing = [name for group in columns for name in group if name not in table]
    if missing or "host_time_ns" not in table:
        raise SessionError(
            f"{file} is damaged: it has no column {(missing or ['host_time_ns'])[0]}"
        )
    q, v, a = (np.column_stack([table[name] for name in group]) for group in columns)
    return Trajectory(table["host_time_ns"], q, v, a)


@dataclass(frozen=True)
class JointUse:
    """How much of a joint's limits a plan uses; degrees and seconds."""

    joint: str
    lowest_deg: float
    highest_deg: float
    peak_speed_deg_s: float
    speed_limit_deg_s: float
    peak_acceleration_deg_s2: float
    acceleration_limit_deg_s2: float


@dataclass(frozen=True)
class SensorUse:
    """What a sensor will feel, and its full scale."""

    sensor: str
    peak_rate_deg_s: float
    range_deg_s: float
    peak_specific_force_m_s2: float
    range_m_s2: float


@dataclass(frozen=True)
class FlexionUse:
    """The true angle of a joint definition where it will be evaluated, as planned; degrees.

    Attributes:
        joint: Of the protocol.
        definition: Label of one of its definitions.
        kind: Over the "poses" or the "sweeps".
        lowest_deg: Smallest angle of the segments.
        highest_deg: Largest angle of the segments.
        arm: The arm's joint that it is compared with, or None.
        arm_deg: Range of the arm's joint, or None.
        variable: The loop variable that commands it, or None.
        commanded: Range of that variable, or None.
    """

    joint: str
    definition: str
    kind: Literal["poses", "sweeps"]
    lowest_deg: float
    highest_deg: float
    arm: str | None = None
    arm_deg: tuple[float, float] | None = None
    variable: str | None = None
    commanded: tuple[float, float] | None = None

    @property
    def sentence(self) -> str:
        """For people."""
        said = (
            f"{self.joint}: {self.definition} {self.lowest_deg:.1f} to {self.highest_deg:.1f} "
            f"deg in the evaluated {self.kind}"
        )
        if self.arm_deg is not None:
            said += ", {} {:.1f} to {:.1f}".format(self.arm, *self.arm_deg)
        if self.commanded is not None:
            said += ", commanded ({}) {:g} to {:g}".format(self.variable, *self.commanded)
        return said


@dataclass(frozen=True)
class Clearance:
    """The smallest distance between two bodies over the whole motion."""

    first: str
    second: str
    distance_mm: float
    time_s: float
    step: str


@dataclass(frozen=True)
class PlanCheck:
    """What was checked before anything moves."""

    duration_s: float
    steps: int
    joints: list[JointUse]
    sensors: list[SensorUse]
    clearance: Clearance | None
    samples: int
    warnings: list[str] = field(default_factory=list)
    flexions: list[FlexionUse] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """As plain values for JSON."""
        return asdict(self)


@dataclass(frozen=True, repr=False)
class Plan:
    """A checked motion.

    Attributes:
        protocol: What the arm shall do.
        robot: The arm.
        trajectory: The reference the arm is to follow, starting at home at time 0.
        steps: In order of time.
        check: Limits, clearance and sensor ranges, as found.
    """

    protocol: Protocol
    robot: Robot
    trajectory: Trajectory
    steps: list[PlannedStep]
    check: PlanCheck

    def __repr__(self) -> str:
        spec, robot = self.protocol.spec, self.robot.spec.name
        return f"<Plan of {spec.name} on {robot}: {len(self.steps)} steps, {self.duration:.1f} s>"

    @property
    def duration(self) -> float:
        """[s]."""
        return self.trajectory.duration

    @cached_property
    def hash(self) -> str:
        """SHA-256 over protocol, robot, trajectory and steps: same inputs, same hash."""
        digest = hashlib.sha256()
        for name, text in sorted(self.protocol.texts().items()):
            digest.update(f"{name}\0{text}\0".encode())
        digest.update(self.robot.text.encode())
        digest.update(self.robot.urdf.read_bytes())
        for array in (
            self.trajectory.time_ns,
            self.trajectory.q,
            self.trajectory.v,
            self.trajectory.a,
        ):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(
            json.dumps([self._step_data(step) for step in self.steps], sort_keys=True).encode()
        )
        return digest.hexdigest()

    @staticmethod
    def _step_data(step: PlannedStep) -> dict[str, Any]:
        data = vars(step) | {"cycles": None if step.cycles is None else asdict(step.cycles)}
        return {
            key: value
            for key, value in data.items()
            if key != "place" and not (key == "cycles" and value is None)
        }

    def save(self, path: Path) -> None:
        """Write the knots and, as metadata, the step table as plan.parquet."""
        knots = self.trajectory
        starts = np.array([step.start_ns for step in self.steps], dtype=np.int64)
        columns = {
            "host_time_ns": knots.time_ns,
            "step": np.searchsorted(starts, knots.time_ns, side="right") - 1,
        }
        for i, joint in enumerate(self.robot.joint_names):
            for (kind, unit), values in zip(_KNOTS, (knots.q, knots.v, knots.a), strict=True):
                columns[f"{kind}_{joint}{unit}"] = values[:, i]
        notes = {
            "content": "knots of the planned joint motion, joined by quintic polynomials that meet "
            "q, v and a",
            "plan_hash": self.hash,
            "steps": json.dumps([self._step_data(step) for step in self.steps]),
        }
        write_parquet(path, columns, notes)
