"""Joint angles of a session: the orientations of both sensors, put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.joint_constraint import track_heading
from testbench.estimation.signals.recording import RunFacts
from testbench.model import rotation
from testbench.model.joint_angle import joint_angle_series, segment_orientation
from testbench.model.reference_step import aligned_instant
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import JointEstimate, SensorEstimate, as_kept
from testbench.records.specs.protocol import JointDefinition

VAGUE_DEG = 10.0
"""A heading that is known no better for half of the time is remarked on."""


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
        if _is_constrained(joint, kind):
            aligned = proximal.frames[key].method != "none" and distal.frames[key].method != "none"
            start = aligned_instant(run.steps, run.settings.align, time) if aligned else None
            world_from_distal = _constrained(
                found, joint, key, world_from_proximal, world_from_distal, start
            )
        for definition in joint.definitions():
            angles = joint_angle_series(world_from_proximal, world_from_distal, definition)
            found.angles[key, definition.label] = as_kept(angles)
    return found


def _is_constrained(joint: JointDefinition, kind: OrientationFilter) -> bool:
    """Whether the joint's axes correct a filter's heading, which must know up and not north."""
    if joint.constraint is None:
        return False
    if joint.constraint.filters is not None:
        return kind.name in joint.constraint.filters
    return {"gyr", "acc"} <= set(kind.needs) and "mag" not in kind.needs


def _constrained(
    found: JointEstimate,
    joint: JointDefinition,
    key: str,
    q_proximal: np.ndarray,
    q_distal: np.ndarray,
    start_ns: int | None,
) -> np.ndarray:
    """The distal orientation turned by the heading that the joint's axes tell, kept in `found`."""
    assert joint.constraint is not None
    try:
        track = track_heading(found.host_time_ns, q_proximal, q_distal, joint.constraint, start_ns)
    except PoorExcitation as error:
        found.findings.append(finding("joint.axes_do_not_tell", filter=key, why=str(error)))
        return q_distal
    sd_deg = float(np.degrees(np.median(track.sd)))
    if sd_deg > VAGUE_DEG:
        found.findings.append(finding("joint.axes_hardly_tell", filter=key, sd_deg=sd_deg))
    found.headings[key] = track
    return rotation.multiply(rotation.from_heading(track.heading), q_distal)
