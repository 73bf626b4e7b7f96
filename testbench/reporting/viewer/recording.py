"""Write a session as a rerun recording."""

from __future__ import annotations

from pathlib import Path

import rerun as rr

from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.replacing import replaced_file, stored_where_asked
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_lock
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.report import load_estimate, load_evaluation
from testbench.reporting.viewer.layout import layout, reach_of
from testbench.reporting.viewer.scene import (
    WORLD,
    log_arm,
    log_estimated_sensor,
    log_mounted_sensor,
    log_side_by_side,
)
from testbench.reporting.viewer.signals import (
    log_chain,
    log_errors,
    log_imu,
    log_joint_angles,
    log_steps,
    unjudged_joints,
)


def save_recording(
    session: Session,
    path: str | Path,
    estimate: Estimate | None = None,
    evaluation: Evaluation | None = None,
) -> Path:
    """Write what the viewer shows of a session.

    Args:
        session: The recording.
        path: The .rrd file to write.
        estimate: Of its orientations; read from the session's folder if None, and left out where
            the folder has none.
        evaluation: Of its errors; read from the session's folder if None, and left out where the
            folder has none.

    Returns:
        The path.
    """
    path = Path(path)
    with session_lock(session.path):
        estimate = estimate or load_estimate(session)
        evaluation = evaluation or load_evaluation(session)
    arm = session.arm()
    recording = rr.RecordingStream("testbench", recording_id=session.name, send_properties=False)
    with stored_where_asked(path), replaced_file(path) as partial, recording:
        recording.save(partial)
        _log(recording, session, estimate, evaluation, arm)
        recording.disconnect()
    return path


def _log(
    recording: rr.RecordingStream,
    session: Session,
    estimate: Estimate | None,
    evaluation: Evaluation | None,
    arm: ArmSamples | None,
) -> None:
    filters = (
        [key for sensor in estimate.sensors.values() for key in sensor.orientation]
        if estimate
        else []
    )
    filters += (
        [row.filter for row in evaluation.orientation]
        + [row.filter for row in evaluation.joint_angle]
        if evaluation
        else []
    )
    colours = filter_colours(
        [name for name in session.analysis.estimate.filters if name in filters] + filters
    )
    truths = {name: session.truth(name) for name in session.sensor_names}
    kept = {name: own.every for name, own in estimate.sensors.items()} if estimate else {}
    samples = {name: session.imu(name, every=kept.get(name, 1)) for name in session.sensor_names}
    columns = (
        max([1, *(1 + len(sensor.orientation) for sensor in estimate.sensors.values())])
        if estimate
        else 1
    )
    unjudged = unjudged_joints(session, estimate, evaluation)
    magnetometers = {name for name, own in samples.items() if own.mag is not None}
    recording.send_blueprint(
        layout(session, evaluation, columns, _reach(session, arm), magnetometers, unjudged)
    )
    recording.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("/", rr.CoordinateFrame(WORLD), static=True)
    if arm is not None and session.robot is not None:
        log_arm(recording, session.robot, arm)
        for name, sensor in session.analysis.sensors.items():
            log_mounted_sensor(recording, name, sensor)
            if estimate is not None:
                log_estimated_sensor(recording, session, name, estimate, arm, colours)
    log_side_by_side(recording, truths, estimate, colours, columns)
    for name, own in samples.items():
        log_imu(recording, name, own, estimate)
    log_joint_angles(recording, session, estimate, unjudged, colours)
    if evaluation is not None:
        log_errors(recording, evaluation, colours)
        log_chain(recording, evaluation)
    log_steps(recording, session, evaluation)


def _reach(session: Session, arm: ArmSamples | None) -> float | None:
    """How far the sensors come from the world's origin [m], or None without an arm."""
    if arm is None or session.robot is None:
        return None
    kinematics = Kinematics(session.robot)
    few = arm.q_measured[:: max(1, len(arm.q_measured) // 200)]
    sensors = session.analysis.sensors.values()
    return reach_of(
        [
            kinematics.frame_motion(s.link, few, offset=Pose.from_placement(s.mounting)).position
            for s in sensors
        ]
    )
