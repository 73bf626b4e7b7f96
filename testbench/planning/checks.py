"""What must hold of a timed motion before it starts: joint limits, clearance, sensor ranges."""

from __future__ import annotations

import math

import numpy as np

from testbench.exceptions import (
    CollisionError,
    Contact,
    Excess,
    LimitError,
    PlanError,
    SensorRangeError,
)
from testbench.frames import NANOSECONDS
from testbench.model.collision import CollisionModel
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.session.plan import Clearance, JointUse, PlanCheck, PlannedStep, SensorUse
from testbench.records.session.trajectory import Trajectory
from testbench.records.specs.protocol import Protocol, Sensor
from testbench.records.specs.robot import Robot

SWEPT_STEP_RAD = math.radians(1.0)
"""Joint motion, summed over the joints, between two configurations at which clearance is
computed.
"""
TOLERANCE = 1e-6
"""Relative excess over a limit that is put down to rounding."""
CHUNK = 50_000
"""Configurations looked at together; bounds the memory."""
MOST_KNOWN = 200_000
"""Configurations remembered as looked at; bounds the memory."""


def check_plan(
    robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]
) -> PlanCheck:
    """Check a motion, or refuse it.

    Raises:
        LimitError: A joint exceeds its limit of position, velocity or acceleration.
        CollisionError: Two links, or a link and the floor, come too near.
        SensorRangeError: A sensor would saturate.
    """
    locate = _Locator(steps)
    kinematics = Kinematics(robot)
    limits, clearance = _Limits(robot, locate), _Clearance(kinematics, locate)
    sensors = [
        _SensorRange(name, sensor, kinematics, locate)
        for name, sensor in protocol.spec.sensors.items()
    ]
    count = 0
    for chunk in trajectory.sample_moving(round(NANOSECONDS / robot.spec.rates.control_hz), CHUNK):
        count += len(chunk)
        q, v, a = trajectory.at(chunk)
        if clearance.contact is None:
            limits.look(chunk, q, v, a)
        clearance.look(chunk, q)
        for sensor in (
            sensors if clearance.contact is None else []
        ):  # after a contact only the worst one is looked for
            sensor.look(chunk, q, v, a)
    clearance.refuse_contact()
    uses = [sensor.use() for sensor in sensors]
    return PlanCheck(
        trajectory.duration, len(steps), limits.uses(), uses, clearance.smallest, count
    )


class _Locator:
    """Finds the step of a moment, and puts its place into errors."""

    def __init__(self, steps: list[PlannedStep]):
        self.steps = steps
        self.starts = np.array([step.start_ns for step in steps])

    def step(self, time_ns: int) -> PlannedStep:
        return self.steps[max(int(np.searchsorted(self.starts, time_ns, side="left")) - 1, 0)]

    def placed(self, error: PlanError, time_ns: int) -> PlanError:
        error.place = self.step(time_ns).place
        return error


class _Limits:
    """Position, velocity and acceleration of every joint."""

    def __init__(self, robot: Robot, locate: _Locator):
        self.robot, self.locate = robot, locate
        n = len(robot.joint_names)
        self.lowest, self.highest = np.full(n, np.inf), np.full(n, -np.inf)
        self.speed, self.acceleration = np.zeros(n), np.zeros(n)

    def look(self, times: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        low, high = self.robot.position_limits.T
        self._compare("position", "deg", times, q, low, high)
        self._compare(
            "velocity", "deg/s", times, v, -self.robot.velocity_limits, self.robot.velocity_limits
        )
        self._compare(
            "acceleration",
            "deg/s^2",
            times,
            a,
            -self.robot.acceleration_limits,
            self.robot.acceleration_limits,
        )
        self.lowest, self.highest = (
            np.minimum(self.lowest, q.min(axis=0)),
            np.maximum(self.highest, q.max(axis=0)),
        )
        self.speed = np.maximum(self.speed, np.abs(v).max(axis=0))
        self.acceleration = np.maximum(self.acceleration, np.abs(a).max(axis=0))

    def _compare(
        self,
        quantity: str,
        unit: str,
        times: np.ndarray,
        values: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
    ) -> None:
        broken = (values > high + TOLERANCE * np.abs(high)) | (
            values < low - TOLERANCE * np.abs(low)
        )
        if not broken.any():
            return
        row = int(np.argmax(broken.any(axis=1)))
        column = int(np.argmax(broken[row]))
        value, time = values[row, column], int(times[row])
        joint, step = self.robot.joint_names[column], self.locate.step(time)
        above, end = (
            value > high[column],
            max(int(np.searchsorted(times, step.end_ns, side="right")), row + 1),
        )
        limit, farthest = (high[column], np.max) if above else (low[column], np.min)
        first, bound, onwards = np.degrees(
            [value, limit, farthest(values[row:end, column])]
        ).tolist()
        excess = Excess(joint, quantity, first, bound, unit, time / NANOSECONDS, step.name, onwards)
        raise self.locate.placed(LimitError(excess), time)

    def uses(self) -> list[JointUse]:
        low, high, speed, acceleration = np.degrees(
            [self.lowest, self.highest, self.speed, self.acceleration]
        ).tolist()
        return [
            JointUse(
                j.name,
                low[i],
                high[i],
                speed[i],
                j.velocity_deg_s,
                acceleration[i],
                j.acceleration_deg_s2,
            )
            for i, j in enumerate(self.robot.spec.joints)
        ]


class _Clearance:
    """Clearance along the swept path, at every degree of joint motion."""

    def __init__(self, kinematics: Kinematics, locate: _Locator):
        self.model, self.locate = CollisionModel(kinematics), locate
        self.margin = kinematics.robot.spec.collision.margin_mm / 1000
        self.smallest: Clearance | None = None
        self.contact: Contact | None = None
        self._contact_ns = 0
        self._travelled = 0.0
        self._last: np.ndarray | None = None
        self._known: set[bytes] = set()

    def look(self, times: np.ndarray, q: np.ndarray) -> None:
        before = q[:1] if self._last is None else self._last
        travelled = self._travelled + np.cumsum(
            np.abs(np.diff(q, axis=0, prepend=before)).sum(axis=1)
        )
        marks = np.floor(travelled / SWEPT_STEP_RAD)
        due = np.diff(marks, prepend=np.floor(self._travelled / SWEPT_STEP_RAD)) > 0
        due[0] = due[-1] = True
        self._travelled, self._last = float(travelled[-1]), q[-1:]
        rows = np.flatnonzero(due)
        for row, rounded in zip(rows, np.round(q[rows], 4), strict=True):
            key = rounded.tobytes()
            if key not in self._known:
                if len(self._known) >= MOST_KNOWN:
                    self._known.clear()
                self._known.add(key)
                self._look_at(int(times[row]), q[row])

    def _look_at(self, time: int, q: np.ndarray) -> None:
        nearest = self.model.nearest(q)
        if nearest is None:
            return
        near = nearest.distance <= self.margin and self.contact is None
        nearer = self.smallest is None or nearest.distance * 1000 < self.smallest.distance_mm
        if not near and not nearer:
            return
        seconds, step = time / NANOSECONDS, self.locate.step(time).name
        if near:
            self.contact = Contact(nearest.first, nearest.second, nearest.distance, seconds, step)
            self._contact_ns = time
        if nearer:
            self.smallest = Clearance(
                nearest.first, nearest.second, nearest.distance * 1000, seconds, step
            )

    def refuse_contact(self) -> None:
        """Refuse a motion in which bodies come too near: where they do so first, and where most."""
        if self.contact is None or self.smallest is None:
            return
        worst = self.smallest
        nearest = Contact(
            worst.first, worst.second, worst.distance_mm / 1000, worst.time_s, worst.step
        )
        raise self.locate.placed(
            CollisionError(self.contact, self.margin, nearest), self._contact_ns
        )


class _SensorRange:
    """Largest angular rate and specific force on any axis of a sensor."""

    def __init__(self, name: str, sensor: Sensor, kinematics: Kinematics, locate: _Locator):
        self.name, self.sensor, self.kinematics, self.locate = name, sensor, kinematics, locate
        self.offset = Pose.from_placement(sensor.mounting)
        parameters = sensor.imu()
        self.rate_range, self.force_range = (
            parameters.gyroscope.triad().range,
            parameters.accelerometer.triad().range,
        )
        self.rate = self.force = 0.0

    def look(self, times: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
        motion = self.kinematics.frame_motion(self.sensor.link, q, v, a, self.offset)
        rate = np.abs(motion.angular_velocity_in_frame).max(axis=1)
        force = np.abs(motion.specific_force_in_frame(self.kinematics.robot.gravity)).max(axis=1)
        self._compare("angular rate", "deg/s", math.degrees(1), times, rate, self.rate_range)
        self._compare("specific force", "m/s^2", 1.0, times, force, self.force_range)
        self.rate, self.force = (
            max(self.rate, float(rate.max())),
            max(self.force, float(force.max())),
        )

    def _compare(
        self,
        quantity: str,
        unit: str,
        scale: float,
        times: np.ndarray,
        values: np.ndarray,
        limit: float,
    ) -> None:
        beyond = np.flatnonzero(values > limit)
        if not len(beyond):
            return
        time = int(times[beyond[0]])
        peak, step = float(values.max()) * scale, self.locate.step(time).name
        error = SensorRangeError(
            self.name, quantity, peak, limit * scale, unit, time / NANOSECONDS, step
        )
        raise self.locate.placed(error, time)

    def use(self) -> SensorUse:
        return SensorUse(
            self.name,
            math.degrees(self.rate),
            math.degrees(self.rate_range),
            self.force,
            self.force_range,
        )
