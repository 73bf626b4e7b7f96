"""The picture of the bench: the arm in its reference pose, and the sensors on it."""

from __future__ import annotations

import numpy as np

from testbench.exceptions import BenchError
from testbench.model.collision import solids
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.neighbouring_rows import Instants
from testbench.records.session.session import Session
from testbench.reporting.page.scene import Body, Placed, Scene


def bench_scene(session: Session) -> Scene | None:
    """The arm with its sensors in the reference pose.

    None where there is no arm, where it has no bodies, or where their meshes are gone.
    """
    found = _pose(session)
    if session.robot is None or found is None:
        return None
    q, when = found
    try:
        kinematics = Kinematics(session.robot)
        bodies = solids(kinematics, q)
        sensors = [
            _placed(kinematics, name, q, session)
            for name in session.sensor_names
            if name in session.analysis.sensors
        ]
    except BenchError:
        return None
    if not bodies:
        return None
    floor = session.robot.spec.floor
    names = ", ".join(sensor.name for sensor in sensors)
    words = f"{session.robot.name} {when}, with the axes of {names or 'no sensor'}"
    return Scene(
        [Body(own.corners, own.triangles) for own in bodies],
        sensors,
        None if floor is None else floor.height_mm / 1000,
        words,
    )


def _placed(kinematics: Kinematics, name: str, q: np.ndarray, session: Session) -> Placed:
    sensor = session.analysis.sensors[name]
    motion = kinematics.frame_motion(
        sensor.link, q[None], offset=Pose.from_placement(sensor.mounting)
    )
    return Placed(name, motion.position[0], motion.R_world_from_frame[0])


def _pose(session: Session) -> tuple[np.ndarray, str] | None:
    """Joint angles, shape (n_joints,) [rad], and which pose that is; None without an arm.

    The last of the pose that filters are aligned in; else where what is evaluated began.
    """
    reference = [step.end_ns for step in session.steps if step.role == "reference"]
    began = [step.start_ns for step in session.steps if step.role == "evaluation"]
    at = reference[-1] if reference else began[0] if began else 0
    arm = session.near(Instants({}, np.array([at], dtype=np.int64))).arm()
    if arm is None or not len(arm.host_time_ns):
        return None
    row = min(int(np.searchsorted(arm.host_time_ns, at)), len(arm.host_time_ns) - 1)
    return arm.q_measured[row], "in the reference pose" if reference else "where it began"
