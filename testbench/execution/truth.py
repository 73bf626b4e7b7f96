"""Kinematic truth: what each sensor went through, from what the arm measured, the URDF and the mounting as believed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from testbench.model.joint_motion import joint_acceleration
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.protocol import Sensor
from testbench.records.robot import Robot
from testbench.records.samples import ArmSamples, Truth
from testbench.records.storage import write_parquet

TRUTH_NOTES = {
    "content": "what the sensor went through, by the arm's measured joint angles and the mounting as believed",
    "q_world_from_sensor": "w x y z, Hamilton",
    "rate": "angular rate in the sensor frame",
    "force": "specific force in the sensor frame, +9.81 upwards at rest",
}


def write_truth(folder: Path, robot: Robot, samples: ArmSamples, sensors: Mapping[str, Sensor]) -> None:
    """Write truth_<sensor>.parquet of every sensor into a session's folder."""
    kinematics = Kinematics(robot)
    for name, sensor in sensors.items():
        write_parquet(folder / f"truth_{name}.parquet", kinematic_truth(kinematics, samples, sensor).to_columns(), TRUTH_NOTES)


def kinematic_truth(kinematics: Kinematics, samples: ArmSamples, sensor: Sensor) -> Truth:
    """What a sensor went through.

    Orientation and angular rate come from the measured joint angles and rates; the specific force needs joint accelerations,
    which are the smoothed derivative of the rates.
    """
    acceleration = joint_acceleration(samples)
    offset = Pose.from_placement(sensor.mounting)
    motion = kinematics.frame_motion(sensor.link, samples.q_measured, samples.v_measured, acceleration, offset)
    return Truth(
        samples.host_time_ns,
        motion.q_world_from_frame,
        motion.angular_velocity_in_frame,
        motion.specific_force_in_frame(kinematics.robot.gravity),
    )
