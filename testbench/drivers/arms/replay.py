"""Replay: a recorded motion drives the bench as if an arm moved now.

The motion is that of a session's `arm.parquet`, or of a CSV table with `time_s` and a column
`q_<joint>_rad` or `q_<joint>_deg` for each joint. It is taken as it is: nothing moves, the plan's
steps are found at the times at which the motion first rests in their poses.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.catalogue import REPLAY
from testbench.drivers.arms.entry import WantedArm
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, InputError
from testbench.frames import NANOSECONDS
from testbench.records.disk.tables import read_parquet
from testbench.records.session.layout import ARM, table_file
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Event, Session
from testbench.records.specs.robot import Robot

LARGEST_LOG = 500_000_000
"""Bytes of a CSV log that are read at most."""
REACHED_RAD = float(np.radians(0.5))
"""A pose counts as reached when every joint is this near."""
REST_RAD_S = float(np.radians(0.5))


class ReplayArm(SteppingArm):
    """A recorded motion in real time.

    Args:
        robot: Whose joints the log names.
        log: A session's folder, a Parquet or a CSV file.
        time: Of the session.
    """

    entry = REPLAY

    def __init__(self, robot: Robot, log: Path, time: SessionTime):
        self.robot, self.log, self.time = robot, log, time
        self._next = 0
        self._events: list[Event] = []
        self._told: list[Event] = []
        self._kicked = self._stopped = False
        self._held_ns: int | None = None
        self._shift_ns = 0

    def connect(self) -> None:
        """Read the log.

        Raises:
            InputError: It is missing, malformed, too large, or lacks a joint.
        """
        table = _read_log(self.log)
        n = len(next(iter(table.values()))) if table else 0
        if n < 2:
            raise InputError(f"{self.log} holds no motion")
        self._time = _times(table, self.log)
        if np.any(np.diff(self._time) <= 0):
            raise InputError(f"{self.log}: its times do not increase")
        self._q = np.column_stack(
            [_joint(table, joint, self.log) for joint in self.robot.joint_names]
        )
        if not np.isfinite(self._q).all():
            raise InputError(f"{self.log}: a joint angle is not finite")
        self._v = np.gradient(self._q, self._time / NANOSECONDS, axis=0)

    def check_way(self, plan: Plan, steps: list[PlannedStep] | None = None) -> None:
        """Find the steps in the log.

        Raises:
            InputError: A step's pose never occurs where it should.
        """
        rest = np.abs(self._v).max(axis=1) < REST_RAD_S
        at = 0
        for step in plan.steps if steps is None else steps:
            target = plan.trajectory.at(np.array([step.settled_ns]))[0][0]
            near = np.abs(self._q - target).max(axis=1) < REACHED_RAD
            moved = at
            if step.kind == "sweep":  # it ends where it began: look for the rest after the motion
                leaving = np.flatnonzero(~rest[at:])
                moved = at + (int(leaving[0]) if len(leaving) else 0)
            found = np.flatnonzero(near[moved:] & rest[moved:])
            if not len(found):
                raise InputError(f"{self.log} never rests in the pose of step '{step.name}'")
            settled = moved + int(found[0])
            away = np.flatnonzero(~near[settled:])
            end = settled + int(away[0]) - 1 if len(away) else len(self._time) - 1
            wanted = self._time[settled] + step.end_ns - step.settled_ns
            end = max(min(end, int(np.searchsorted(self._time, wanted))), settled)
            for index, name in (
                (at, "step_started"),
                (settled, "step_settled"),
                (end, "step_ended"),
            ):
                self._events.append(Event(int(self._time[index]), name, {"index": step.index}))
            at = end

    def prepare(self, plan: Plan) -> None:
        """Nothing to approach."""

    def kickoff(self) -> None:
        self.time.start()
        self._kicked = True

    def read(self, until_ns: int) -> ArmSamples:
        if not self._kicked:
            raise DriverError("the recorded motion was read before it was started")
        self.time.wait_until(until_ns)
        until = until_ns - self._shift_ns if self._held_ns is None else self._held_ns
        last = (
            len(self._time)
            if self._stopped
            else int(np.searchsorted(self._time, until, side="right"))
        )
        rows = slice(self._next, self._next if self._stopped else max(last, self._next))
        self._next = rows.stop
        q = self._q[rows]
        return ArmSamples(
            self.robot.joint_names, self._time[rows] + self._shift_ns, q, q, self._v[rows]
        )

    @property
    def finished(self) -> bool:
        return self._next >= len(self._time)

    def events(self) -> list[Event]:
        reached = int(self._time[min(self._next, len(self._time)) - 1]) if self._next else -1
        due = [event for event in self._events if event.host_time_ns <= reached]
        self._events = self._events[len(due) :]
        told, self._told = self._told, []
        return [
            Event(event.host_time_ns + self._shift_ns, event.event, event.details) for event in due
        ] + told

    def pause(self) -> bool:
        self._held_ns = self.time.now_ns() - self._shift_ns
        self._told.append(Event(self.time.now_ns(), "paused", {}))
        return True

    def resume(self) -> None:
        if self._held_ns is not None:
            self._shift_ns, self._held_ns = self.time.now_ns() - self._held_ns, None
            self._told.append(Event(self.time.now_ns(), "resumed", {}))

    def stop(self) -> None:
        self._stopped = True

    def close(self) -> None:
        """Nothing to let go of."""

    def describe(self) -> dict[str, Any]:
        return super().describe() | {"log": self.log.name}


def replay_arm(plan: Plan, wanted: WantedArm, time: SessionTime) -> ReplayArm:
    """The recorded motion for a plan; it is not read yet.

    Raises:
        InputError: There is none.
    """
    if wanted.log is None:
        raise InputError("a replay needs a recorded motion")
    return ReplayArm(plan.robot, wanted.log, time)


def _read_log(path: Path) -> dict[str, np.ndarray]:
    if path.is_dir():
        Session(path)
        return read_parquet(path / table_file(ARM))
    if not path.is_file():
        raise InputError(f"the log {path} does not exist")
    if path.suffix == ".parquet":
        return read_parquet(path)
    if path.stat().st_size > LARGEST_LOG:
        raise InputError(f"the log {path} is larger than {LARGEST_LOG // 1_000_000} MB")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            header = [name.strip() for name in next(reader, [])]
            rows = [[float(cell) for cell in row] for row in reader if row]
    except (ValueError, UnicodeDecodeError, csv.Error, OSError) as error:
        raise InputError(f"the log {path} cannot be read: {error}") from None
    if any(len(row) != len(header) for row in rows):
        raise InputError(f"the log {path} has rows of another length than its header")
    array = np.array(rows).reshape(-1, len(header))
    return {name: array[:, i] for i, name in enumerate(header)}


def _times(table: dict[str, np.ndarray], path: Path) -> np.ndarray:
    """Times from the beginning of the log, shape (n,), int64 [ns]."""
    if "host_time_ns" in table:
        times = table["host_time_ns"].astype(np.int64)
    elif "time_s" in table:
        times = np.round((table["time_s"] - table["time_s"][0]) * NANOSECONDS).astype(np.int64)
    else:
        raise InputError(
            f"the log {path} has neither time_s nor host_time_ns; it has {', '.join(table)}"
        )
    return np.asarray(times - times[0])


def _joint(table: dict[str, np.ndarray], joint: str, path: Path) -> np.ndarray:
    for name, factor in (
        (f"q_measured_{joint}_rad", 1.0),
        (f"q_{joint}_rad", 1.0),
        (f"q_{joint}_deg", np.pi / 180),
    ):
        if name in table:
            return np.asarray(table[name], float) * factor
    raise InputError(
        f"the log {path} has no column q_{joint}_rad or q_{joint}_deg; it has {', '.join(table)}"
    )
