"""Errors put into recorded orientations, and the joints that follow from them.

Castellanos Alonso 2023 asks what a wrong start pose (eqs 2.18, 2.20) and what a wrong sensor (eq.
2.21) do to a joint angle, by putting an error q' of eq. 2.19 in the place of a recorded q. What is
put in is known, so that the change of the joint's error is its effect on this very recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.joints.joints import estimate_joint
from testbench.estimation.signals.recording import RunFacts
from testbench.exceptions import InputError, NotFoundError
from testbench.model import rotation
from testbench.model.joint_angle import segment_from_sensor
from testbench.model.misalignment import with_errors
from testbench.model.reference_step import aligned_instant
from testbench.records.results.estimate import Estimate, SensorEstimate
from testbench.records.session.session import Session
from testbench.records.specs.injected_error import InjectedError
from testbench.records.specs.protocol import BodyJoint


def with_injected(
    session: Session,
    estimate: Estimate,
    errors: Sequence[InjectedError],
    filters: Sequence[OrientationFilter],
) -> Estimate:
    """The estimate of a recording with errors put into it.

    Args:
        session: The recording.
        estimate: Of it.
        errors: At most one of a kind a sensor.
        filters: That made the estimate.

    Raises:
        NotFoundError: No such sensor.
        InputError: An error is given twice, a start pose is asked of a sensor that has no segment
            on an arm, or a joint is one of a body, whose sensors are placed by the recording.
    """
    run = RunFacts.of(session)
    named = [(error.sensor, error.of) for error in errors]
    for name, kind in named:
        if name not in estimate.sensors:
            raise NotFoundError("sensor", name, list(estimate.sensors))
        if named.count((name, kind)) > 1:
            raise InputError(f"an error of the {kind} of sensor '{name}' is given twice")
    sensors = dict(estimate.sensors)
    for error in errors:
        change = _sensor_off if error.of == "sensor" else _start_off
        sensors[error.sensor] = change(session, run, error, sensors[error.sensor])
    joints = {}
    for name, joint in session.analysis.joints.items():
        changed = {joint.proximal, joint.distal} & {error.sensor for error in errors}
        if not changed:
            joints[name] = estimate.joints[name]
        elif isinstance(joint, BodyJoint):
            raise InputError(
                f"joint '{name}' is one of a body, whose sensors are placed by the recording: an "
                "error is put into joints of an arm alone"
            )
        else:
            joints[name] = estimate_joint(joint, run, sensors, filters)
    return replace(estimate, sensors=sensors, joints=joints)


def _sensor_off(
    session: Session, run: RunFacts, error: InjectedError, own: SensorEstimate
) -> SensorEstimate:
    """The sensor's orientation off throughout: q' of eq. 2.19 in the place of q (eq. 2.21)."""
    off = np.radians(error.yaw_pitch_roll_deg)
    turned = {name: with_errors(q, *off) for name, q in own.orientation.items()}
    return replace(own, orientation=turned)


def _start_off(
    session: Session, run: RunFacts, error: InjectedError, own: SensorEstimate
) -> SensorEstimate:
    """The segment believed to start in q' in the place of q (eqs 2.18, 2.20).

    The mounting follows from the start pose, conj(q_GS0) q'_GB0; with the stated mounting M behind
    it the sensor must have been q_GS conj(q_GS0) q'_GB0 conj(M).
    """
    placed = run.placed.get(error.sensor)
    if placed is None or placed.segment is None:
        raise InputError(
            f"sensor '{error.sensor}' stands for no segment of an arm, whose start could be wrong"
        )
    off = np.radians(error.yaw_pitch_roll_deg)
    sensor_from_segment = rotation.conjugate(segment_from_sensor(placed))
    at = np.array([aligned_instant(run.steps, run.settings.align, own.host_time_ns)])
    turned = {}
    for name, q in own.orientation.items():
        start = rotation.interpolate(own.host_time_ns, q, at)[0]
        wrong = with_errors(rotation.multiply(start, sensor_from_segment), *off)
        believed = rotation.multiply(rotation.conjugate(start), wrong)
        change = rotation.multiply(believed, rotation.conjugate(sensor_from_segment))
        turned[name] = rotation.multiply(q, change)
    return replace(own, orientation=turned)
