"""Kinematic truth: what each sensor went through, from what the arm measured, the URDF and the mounting as believed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.signal import savgol_filter

from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.pieces import overlapping
from testbench.records.protocol import Sensor
from testbench.records.robot import Robot
from testbench.records.samples import ArmSamples, Truth
from testbench.records.session import ARM
from testbench.records.storage import read_parquet, read_parquet_batches, to_table, write_parquet_batches

SMOOTHING_S = 0.1
"""Width of the cubic Savitzky-Golay window that differentiates the measured joint rates [s]."""
BLOCK = 200_000
"""Rows of the arm that are looked at together; bounds the memory."""

TRUTH_NOTES = {
    "content": "what the sensor went through, by the arm's measured joint angles and the mounting as believed",
    "q_world_from_sensor": "w x y z, Hamilton",
    "rate": "angular rate in the sensor frame",
    "force": "specific force in the sensor frame, +9.81 upwards at rest",
}


def write_truth(folder: Path, robot: Robot, sensors: Mapping[str, Sensor]) -> None:
    """Write truth_<sensor>.parquet of every sensor into a session's folder, from its arm.parquet.

    The recording is gone through in pieces that overlap by the smoothing window: the memory does not grow with its length.

    Raises:
        SessionError: The arm's recording is missing or damaged.
    """
    kinematics = Kinematics(robot)
    recorded = folder / f"{ARM}.parquet"
    times = read_parquet(recorded, ["host_time_ns"])["host_time_ns"]
    smoothing = Smoothing.of(times)
    for name, sensor in sensors.items():

        def batches(sensor: Sensor = sensor) -> Iterator[pa.Table]:
            for columns, counted in overlapping(read_parquet_batches(recorded), BLOCK, smoothing.window):
                samples = ArmSamples.from_columns(columns, robot.joint_names)
                truth = kinematic_truth(kinematics, samples, sensor, smoothing).to_columns()
                yield to_table({key: values[counted] for key, values in truth.items()}, TRUTH_NOTES)

        pieces = batches()
        first = next(pieces)
        write_parquet_batches(folder / f"truth_{name}.parquet", first.schema, chain([first], pieces))


def kinematic_truth(kinematics: Kinematics, samples: ArmSamples, sensor: Sensor, smoothing: Smoothing | None = None) -> Truth:
    """What a sensor went through.

    Orientation and angular rate come from the measured joint angles and rates; the specific force needs joint accelerations,
    which are the smoothed derivative of the rates.

    Args:
        kinematics, samples, sensor: Arm, recording and mounting. smoothing: Of the whole, where this is a piece of it.
    """
    acceleration = (smoothing or Smoothing.of(samples.host_time_ns)).acceleration(samples.v_measured)
    offset = Pose.from_placement(sensor.mounting)
    motion = kinematics.frame_motion(sensor.link, samples.q_measured, samples.v_measured, acceleration, offset)
    return Truth(
        samples.host_time_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(kinematics.robot.gravity),
    )


@dataclass(frozen=True)
class Smoothing:
    """How joint rates become accelerations: a cubic Savitzky-Golay filter.

    Attributes:
        window: Samples. interval: [s].
    """

    window: int
    interval: float

    @staticmethod
    def of(time_ns: np.ndarray) -> Smoothing:
        """What suits a recording at a regular interval, from its times, shape (n,)."""
        n = len(time_ns)
        if n < 5:
            return Smoothing(0, 0.0)
        interval = float(np.median(np.diff(time_ns))) / NANOSECONDS
        return Smoothing(min(max(2 * round(SMOOTHING_S / interval / 2) + 1, 5), n - 1 + n % 2), interval)

    def acceleration(self, v_measured: np.ndarray) -> np.ndarray:
        """Joint accelerations [rad/s^2] of measured rates [rad/s], shape (n, n_joints); zeros where there are too few."""
        if self.window == 0:
            return np.zeros_like(v_measured)
        return np.asarray(savgol_filter(v_measured, self.window, 3, deriv=1, delta=self.interval, axis=0))
