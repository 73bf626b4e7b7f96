"""What planning and simulation spend their time on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from testbench import plan
from testbench.drivers.arms.simulated import SimulatedArm
from testbench.drivers.imus.simulated import SimulatedImu
from testbench.frames import NANOSECONDS
from testbench.model.collision import CollisionModel
from testbench.model.kinematics import Kinematics
from tests.benchmarks.timing import Text, duration, ratio, seconds, show

LINK = "wrist_3_link"
CONFIGURATIONS, LOOPED, COLLISIONS = 100_000, 5_000, 300


def bench_physics() -> None:
    """Time each on the motion of the 315-pose protocol."""
    the_plan = plan("elbow_flexion")
    robot, spec = the_plan.robot, the_plan.protocol.spec
    kinematics = Kinematics(robot)
    times = np.linspace(0, the_plan.duration * NANOSECONDS, CONFIGURATIONS).astype(np.int64)
    q, v, a = the_plan.trajectory.at(times)

    ours = seconds(lambda: kinematics.frame_motion(LINK, q, v, a)) / CONFIGURATIONS
    loop = seconds(pinocchio_loop(kinematics, q[:LOOPED], v[:LOOPED], a[:LOOPED])) / LOOPED
    at = seconds(lambda: the_plan.trajectory.at(times)) / CONFIGURATIONS
    collision = CollisionModel(kinematics)
    some = q[:: CONFIGURATIONS // COLLISIONS][:COLLISIONS]
    clearance = seconds(lambda: [collision.nearest(row) for row in some], 1) / COLLISIONS

    end = int(the_plan.trajectory.time_ns[-1])
    sensor = spec.sensors["forearm"]

    def record_imu() -> int:
        imu = SimulatedImu(
            "forearm", sensor, kinematics, spec.environment, the_plan.trajectory.at, 0
        )
        return len(imu.read(end))

    def move_arm() -> int:
        arm = SimulatedArm(robot, 0)
        arm.prepare(the_plan)
        arm.kickoff()
        return len(arm.read(end).host_time_ns)

    imu = seconds(record_imu) / record_imu()
    arm = seconds(move_arm) / (end / NANOSECONDS * robot.spec.rates.control_hz)

    rows: list[list[str | Text]] = [
        [
            Text("pose, rates, classical acceleration of a frame"),
            duration(ours),
            Text("Pinocchio, loop in Python"),
            duration(loop),
            ratio(ours, loop),
        ],
        [Text("Trajectory.at"), duration(at), Text("-"), "-", "-"],
        [
            Text(f"nearest of {collision.pairs} pairs of bodies"),
            duration(clearance),
            Text("-"),
            "-",
            "-",
        ],
        [Text("simulated IMU, a sample"), duration(imu), Text("-"), "-", "-"],
        [Text("simulated arm, a control period"), duration(arm), Text("-"), "-", "-"],
    ]
    show(
        "Physics: ur3e, time for each configuration or sample",
        ["what", "time", "peer", "time", "ours : peer"],
        rows,
    )


def pinocchio_loop(
    kinematics: Kinematics, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> Callable[[], object]:
    """The same by Pinocchio, one configuration after the other; what it is given is put together
    beforehand.
    """
    model = kinematics.model
    data, frame, world = (
        model.createData(),
        model.getFrameId(LINK),
        pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    )
    columns = [kinematics.robot.joint_names.index(name) for name in list(model.names)[1:]]
    states = list(
        zip([kinematics.configuration(row) for row in q], v[:, columns], a[:, columns], strict=True)
    )

    def loop() -> list[tuple[np.ndarray, ...]]:
        results = []
        for state in states:
            pin.forwardKinematics(model, data, *state)
            pose = pin.updateFramePlacement(model, data, frame)
            velocity = pin.getFrameVelocity(model, data, frame, world)
            acceleration = pin.getFrameClassicalAcceleration(model, data, frame, world)
            results.append(
                (
                    pose.translation.copy(),
                    pose.rotation.copy(),
                    velocity.linear.copy(),
                    velocity.angular.copy(),
                    acceleration.linear.copy(),
                    acceleration.angular.copy(),
                )
            )
        return results

    return loop
