"""Joint angles of a session: the orientations of both sensors, put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.body import estimate_body
from testbench.estimation.joints.body_recording import BodyRecording, Read
from testbench.estimation.joints.constrained import constrained, is_constrained
from testbench.estimation.joints.true_clock import with_true_clocks
from testbench.estimation.signals.recording import RunFacts
from testbench.model import rotation
from testbench.model.joint_angle import joint_angle_series, segment_orientation
from testbench.model.reference_step import aligned_instant
from testbench.records.results.estimate import JointEstimate, SensorEstimate, as_kept
from testbench.records.specs.protocol import BodyJoint, JointDefinition


def estimate_joints(
    joints: Mapping[str, JointDefinition],
    run: RunFacts,
    sensors: Mapping[str, SensorEstimate],
    read: Mapping[str, Read],
    filters: Sequence[OrientationFilter],
) -> dict[str, JointEstimate]:
    """All joints of a session: those of the arm's segments, and those of a body.

    Args:
        joints: As defined, by name.
        run: That the sensors recorded.
        sensors: Their estimates, by name.
        read: What the sensors read at the estimates' instants, by sensor.
        filters: Those that ran.
    """
    of_body = {name: joint for name, joint in joints.items() if isinstance(joint, BodyJoint)}
    begin = min(int(own.host_time_ns[0]) for own in sensors.values())
    recording = BodyRecording(run.body, sensors, read, run.true, begin)
    bodies = estimate_body(of_body, recording, filters)
    found = {
        name: bodies[name] if name in bodies else estimate_joint(joint, run, sensors, filters)
        for name, joint in joints.items()
    }
    return with_true_clocks(joints, found, run.true_angles)


def estimate_joint(
    joint: JointDefinition,
    run: RunFacts,
    sensors: Mapping[str, SensorEstimate],
    filters: Sequence[OrientationFilter],
) -> JointEstimate:
    """Joint angles at the proximal sensor's instants, with the distal one interpolated to them.

    Args:
        joint: As defined.
        run: That the sensors recorded.
        sensors: Their estimates, by name.
        filters: Those that ran.
    """
    proximal, distal = sensors[joint.proximal], sensors[joint.distal]
    placed, time = run.placed, proximal.host_time_ns
    found = JointEstimate(time, {})
    for kind in filters:
        key = kind.name
        if key not in proximal.orientation or key not in distal.orientation:
            continue
        q_distal = rotation.interpolate(distal.host_time_ns, distal.orientation[key], time)
        world_from_proximal = segment_orientation(proximal.orientation[key], placed[joint.proximal])
        world_from_distal = segment_orientation(q_distal, placed[joint.distal])
        if is_constrained(joint, kind):
            aligned = proximal.frames[key].method != "none" and distal.frames[key].method != "none"
            start = aligned_instant(run.steps, run.settings.align, time) if aligned else None
            world_from_distal = constrained(
                found, joint, key, world_from_proximal, world_from_distal, start
            )
        for definition in joint.definitions():
            angles = joint_angle_series(world_from_proximal, world_from_distal, definition)
            found.angles[key, definition.label] = as_kept(angles)
    return found
