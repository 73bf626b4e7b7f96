"""Kinematic truth of each sensor, from the arm's measured angles, the URDF and the mounting."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa

from testbench.exceptions import SessionError
from testbench.frames import NANOSECONDS
from testbench.model.joint_motion import Smoothing
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.chunks import overlapping
from testbench.records.disk.tables import (
    parquet_shape,
    read_parquet_batches,
    to_table,
    write_parquet_batches,
)
from testbench.records.session.layout import ARM, table_file, truth_stream
from testbench.records.session.samples import ArmSamples, Truth
from testbench.records.specs.protocol import Sensor
from testbench.records.specs.robot import Robot

BLOCK = 200_000
"""Rows of the arm that are looked at together; bounds the memory."""

TRUTH_NOTES = {
    "content": "what the sensor went through, by the arm's measured joint angles and the mounting "
    "as believed",
    "q_world_from_sensor": "w x y z, Hamilton",
    "rate": "angular rate in the sensor frame",
    "force": "specific force in the sensor frame, +9.81 upwards at rest",
}


def write_truth(folder: Path, robot: Robot, sensors: Mapping[str, Sensor]) -> None:
    """Write truth_<sensor>.parquet of every sensor into a session's folder, from its arm.parquet.

    The recording is gone through in pieces that overlap by the smoothing window: the memory does
    not grow with its length.

    Raises:
        SessionError: The arm's recording is missing or damaged.
    """
    kinematics = Kinematics(robot)
    recorded = folder / table_file(ARM)
    wanted = list(ArmSamples.columns(robot.joint_names))
    present = parquet_shape(recorded)[1]
    missing = [name for name in wanted if name not in present]
    if missing:
        raise SessionError(
            f"{recorded} lacks the column {missing[0]}; it has {', '.join(present)[:300]}"
        )
    smoothing = Smoothing.at(*_count_and_interval(recorded))
    for name, sensor in sensors.items():

        def batches(sensor: Sensor = sensor) -> Iterator[pa.Table]:
            for columns, counted in overlapping(
                read_parquet_batches(recorded, wanted), BLOCK, smoothing.window
            ):
                samples = ArmSamples.from_columns(columns, robot.joint_names)
                begins = counted.start == 0
                truth = kinematic_truth(kinematics, samples, sensor, smoothing, begins).to_columns()
                yield to_table({key: values[counted] for key, values in truth.items()}, TRUTH_NOTES)

        pieces = batches()
        first = next(pieces)
        write_parquet_batches(
            folder / table_file(truth_stream(name)), first.schema, chain([first], pieces)
        )


def _count_and_interval(recorded: Path) -> tuple[int, float]:
    """Number of rows, and their median interval [s]; in the least memory, since this alone needs
    something of every row.
    """
    count = parquet_shape(recorded)[0]
    steps, last, done = np.empty(max(count - 1, 0), dtype=np.uint32), np.zeros(0, dtype=np.int64), 0
    for columns in read_parquet_batches(recorded, ["host_time_ns"]):
        step = np.diff(np.concatenate([last, columns["host_time_ns"]]))
        steps[done : done + len(step)] = np.clip(step, 0, np.iinfo(np.uint32).max)
        last, done = columns["host_time_ns"][-1:], done + len(step)
    return count, float(np.median(steps, overwrite_input=True)) / NANOSECONDS if len(steps) else 0.0


def kinematic_truth(
    kinematics: Kinematics,
    samples: ArmSamples,
    sensor: Sensor,
    smoothing: Smoothing | None = None,
    begins: bool = True,
) -> Truth:
    """What a sensor went through.

    Orientation and angular rate come from the measured joint angles and rates; the specific force
    needs joint accelerations, which are the smoothed derivative of the rates.

    Args:
        kinematics: Of the arm.
        samples: What it reported.
        sensor: Whose mounting on it is believed.
        smoothing: Of the whole, where this is a piece of it.
        begins: Whether the recording begins with the first row. An arm stands at its start then,
            unless it is already faster than it can have become since.
    """
    smoothing = smoothing or Smoothing.of(samples.host_time_ns)
    reached = kinematics.robot.acceleration_limits * smoothing.interval
    rested = begins and bool((np.abs(samples.v_measured[:1]) <= reached).all())
    acceleration = smoothing.acceleration(samples.v_measured, rested)
    offset = Pose.from_placement(sensor.mounting)
    motion = kinematics.frame_motion(
        sensor.link, samples.q_measured, samples.v_measured, acceleration, offset
    )
    return Truth(
        samples.host_time_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(kinematics.robot.gravity),
    )
