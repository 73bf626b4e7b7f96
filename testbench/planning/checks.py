"""What must hold of a timed motion before anything moves: joint limits, clearance, sensor ranges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from testbench.exceptions import CollisionError, LimitError, PlanError, SensorRangeError
from testbench.frames import NANOSECONDS
from testbench.model.collision import CollisionModel
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.plan import Clearance, JointUse, PlanCheck, PlannedStep, SensorUse
from testbench.records.protocol import Protocol
from testbench.records.robot import Robot
from testbench.records.trajectory import Trajectory

SWEPT_STEP_RAD = math.radians(1.0)
"""Joint motion, summed over the joints, between two configurations at which clearance is computed."""
TOLERANCE = 1e-6
"""Relative excess over a limit that is put down to rounding."""


def check_plan(robot: Robot, protocol: Protocol, trajectory: Trajectory, steps: list[PlannedStep]) -> PlanCheck:
    """Check a motion, or refuse it.

    Raises:
        LimitError: A joint exceeds its limit of position, velocity or acceleration.
        CollisionError: Two links, or a link and the floor, come too near.
        SensorRangeError: A sensor would saturate.
    """
    times = trajectory.sample_moving(round(NANOSECONDS / robot.spec.rates.control_hz))
    q, v, a = trajectory.at(times)
    locate = _Locator(steps)
    joints = _check_limits(robot, times, q, v, a, locate)
    kinematics = Kinematics(robot)
    clearance = _check_clearance(kinematics, times, q, locate)
    sensors = [
        _check_sensor(name, sensor, kinematics, times, (q, v, a), locate) for name, sensor in protocol.spec.sensors.items()
    ]
    return PlanCheck(trajectory.duration, len(steps), joints, sensors, clearance, len(times))


class _Locator:
    """Finds the step of a moment, and raises errors that name it."""

    def __init__(self, steps: list[PlannedStep]):
        self.steps = steps
        self.starts = np.array([step.start_ns for step in steps])

    def step(self, time_ns: int) -> PlannedStep:
        return self.steps[max(int(np.searchsorted(self.starts, time_ns, side="left")) - 1, 0)]

    def placed(self, error: PlanError, time_ns: int) -> PlanError:
        error.place = self.step(time_ns).place
        return error


def _check_limits(
    robot: Robot, times: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, locate: _Locator
) -> list[JointUse]:
    lowest, highest = robot.position_limits.T
    quantities = (
        ("position", q, lowest, highest, "deg"),
        ("velocity", v, -robot.velocity_limits, robot.velocity_limits, "deg/s"),
        ("acceleration", a, -robot.acceleration_limits, robot.acceleration_limits, "deg/s^2"),
    )
    for quantity, values, low, high, unit in quantities:
        broken = (values > high + TOLERANCE * np.abs(high)) | (values < low - TOLERANCE * np.abs(low))
        if broken.any():
            row = int(np.argmax(broken.any(axis=1)))
            column = int(np.argmax(broken[row]))
            value = values[row, column]
            limit = high[column] if value > 0 else low[column]
            time = int(times[row])
            raise locate.placed(
                LimitError(
                    robot.joint_names[column], quantity, math.degrees(value), math.degrees(limit), unit,
                    time / NANOSECONDS, locate.step(time).name,
                ),
                time,
            )  # fmt: skip
    peak_v, peak_a = np.degrees(np.abs(v).max(axis=0)), np.degrees(np.abs(a).max(axis=0))
    low_q, high_q = np.degrees(q.min(axis=0)), np.degrees(q.max(axis=0))
    return [
        JointUse(
            name, float(low_q[i]), float(high_q[i]), float(peak_v[i]), robot.spec.joints[i].velocity_deg_s,
            float(peak_a[i]), robot.spec.joints[i].acceleration_deg_s2,
        )
        for i, name in enumerate(robot.joint_names)
    ]  # fmt: skip


def _check_clearance(kinematics: Kinematics, times: np.ndarray, q: np.ndarray, locate: _Locator) -> Clearance | None:
    """Clearance along the swept path, at every degree of joint motion."""
    model = CollisionModel(kinematics)
    margin = kinematics.robot.spec.collision.margin_mm / 1000
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).sum(axis=1))])
    marks = np.floor(travelled / SWEPT_STEP_RAD)
    rows = np.unique(np.concatenate([[0], np.flatnonzero(np.diff(marks) > 0) + 1, [len(q) - 1]]))
    smallest: Clearance | None = None
    known: dict[bytes, Any] = {}
    for row in rows:
        key = np.round(q[row], 4).tobytes()
        if key in known:
            continue
        nearest = known[key] = model.nearest(q[row])
        if nearest is None:
            return None
        time, step = int(times[row]), locate.step(int(times[row])).name
        if nearest.distance <= margin:
            error = CollisionError(nearest.first, nearest.second, nearest.distance, margin, time / NANOSECONDS, step)
            raise locate.placed(error, time)
        if smallest is None or nearest.distance * 1000 < smallest.distance_mm:
            smallest = Clearance(nearest.first, nearest.second, nearest.distance * 1000, time / NANOSECONDS, step)
    return smallest


def _check_sensor(
    name: str, sensor: Any, kinematics: Kinematics, times: np.ndarray, state: tuple[np.ndarray, ...], locate: _Locator
) -> SensorUse:
    parameters = sensor.imu()
    accelerometer, gyroscope = parameters.accelerometer.triad(), parameters.gyroscope.triad()
    q, v, a = state
    motion = kinematics.frame_motion(sensor.link, q, v, a, Pose.from_placement(sensor.mounting))
    rate = np.abs(motion.angular_velocity_in_frame).max(axis=1)
    force = np.abs(motion.specific_force_in_frame(kinematics.robot.gravity)).max(axis=1)
    for quantity, values, limit, scale, unit in (
        ("angular rate", rate, gyroscope.range, math.degrees(1), "deg/s"),
        ("specific force", force, accelerometer.range, 1.0, "m/s^2"),
    ):
        if values.max() > limit:
            time = int(times[int(np.argmax(values > limit))])
            error = SensorRangeError(
                name, quantity, float(values.max()) * scale, limit * scale, unit, time / NANOSECONDS, locate.step(time).name
            )
            raise locate.placed(error, time)
    return SensorUse(name, math.degrees(rate.max()), math.degrees(gyroscope.range), float(force.max()), accelerometer.range)
