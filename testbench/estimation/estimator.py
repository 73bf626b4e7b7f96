"""The stage `estimate`."""

from __future__ import annotations

from typing import Any

import numpy as np

from testbench.estimation.axes import identify_axes, remarks_on, true_rates
from testbench.estimation.calibration.static_poses import fit_static_poses
from testbench.estimation.chain.session import estimate_chain
from testbench.estimation.filters import UniformSamples, get_filter
from testbench.estimation.frame_alignment import apply_frames, fit_frames, fit_frames_by_motion, fit_frames_by_vectors
from testbench.estimation.quality import assess
from testbench.estimation.segmentation import detect_static
from testbench.estimation.time_alignment import fit_clock
from testbench.estimation.timing import audit_timing
from testbench.estimation.uniform import fill_gaps
from testbench.estimation.vector_mounting import VectorMounting, mounting_from_vectors
from testbench.exceptions import SessionError
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.joint_angle import joint_angles, segment_orientation
from testbench.model.truth import truth_at
from testbench.records.estimate import CalibrationFit, ClockFit, Estimate, FrameFit, JointEstimate, SensorEstimate
from testbench.records.plan import PlannedStep
from testbench.records.protocol import Estimation
from testbench.records.samples import Truth
from testbench.records.session import Session

STANDARD_DOWN = np.array([0.0, 0.0, -STANDARD_GRAVITY])


def estimate(session: Session, filters: list[str] | None = None) -> Estimate:
    """Compute what the sensors, filters and joint angles say.

    Args:
        session: A recording. filters: Names of the filters to run; those of the protocol if None.

    Raises:
        NotFoundError: An unknown filter.
        SessionError: The session holds no samples.
    """
    settings = session.analysis.estimate
    names = list(filters or settings.filters)
    for name in names:
        get_filter(name)
    sensors = {name: _estimate_sensor(session, name, names, settings) for name in session.sensor_names}
    joints = {name: _estimate_joint(session, name, sensors) for name in session.analysis.joints}
    chain, remarks = estimate_chain(session, sensors, settings.chain) if settings.chain is not None else ([], [])
    return Estimate(session.name, session.fingerprint, sensors, joints, chain, remarks)


def _estimate_sensor(session: Session, name: str, filters: list[str], settings: Estimation) -> SensorEstimate:
    samples, truth = session.imu(name), session.truth(name)
    if len(samples) < 10:
        raise SessionError(f"{session.path}: sensor '{name}' has {len(samples)} samples; nothing can be estimated")
    description = session.manifest["sensors"][name]
    rate_delay = float(description.get("rate_delay_s") or 0.0)
    clock = fit_clock(samples, truth, rate_delay) if settings.align_clock else ClockFit()
    time = clock.to_host(samples.device_time_ns)
    uniform, rows = fill_gaps(samples, clock)
    static = detect_static(uniform.turning(), uniform.interval)[rows]
    quality = assess(samples, time, static)
    calibration = CalibrationFit()
    if settings.calibrate == "static_poses" and truth is not None:
        calibration = _calibrate(session, samples.acc, samples.gyr, time, static & ~quality.flagged, truth)
    corrected = _corrected(uniform, calibration, description.get("sampling"))
    orientation: dict[str, np.ndarray] = {}
    frames: dict[str, FrameFit] = {}
    skipped: dict[str, str] = {}
    remarks = list(quality.remarks)
    if settings.align_clock and truth is not None and clock.method == "arrival":
        remarks.append("its clock could not be fitted to the motion; it is late by the unknown latency of its samples")
    planned = sum(step.role == "calibration" and step.kind != "sweep" for step in session.steps)
    if calibration.method == "static_poses" and calibration.poses < planned:
        remarks.append(f"{planned - calibration.poses} of {planned} calibration poses were not at rest and were left out")
    gravity = session.robot.gravity if session.robot else STANDARD_DOWN
    axes = identify_axes(samples, time, static & ~quality.flagged, truth, gravity) if truth is not None else {}
    remarks += remarks_on(axes)
    mounting = None
    if settings.align == "rates" and truth is not None:
        mounting = _mounting(session, corrected, rows, time, static & ~quality.flagged, truth, gravity)
    for key in filters:
        kind = get_filter(key)
        missing = kind.missing(corrected)
        if missing:
            skipped[key] = f"the sensor gives no {' and no '.join(missing)}"
            continue
        q = rotation.normalise(kind.run(corrected)[rows])
        frames[key], warning = _align(session, q, time, truth, settings.align, mounting)
        orientation[key] = apply_frames(q, frames[key])
        if warning is not None:
            remarks.append(f"{key}: {warning}")
    return SensorEstimate(
        time, static, orientation, clock, calibration, frames, skipped, quality.flagged, quality.counts(), remarks,
        audit_timing(samples, description.get("rate_hz"), _rate_age(description)), axes,
    )  # fmt: skip


def _rate_age(description: dict[str, Any]) -> float:
    """Half an interval where rate and force are integrated over it: the force is seen in the axes at its end [s]."""
    rate = description.get("rate_hz")
    return 0.5 / float(rate) if rate and description.get("sampling") == "integrated" else 0.0


def _corrected(uniform: UniformSamples, calibration: CalibrationFit, sampling: str | None) -> UniformSamples:
    """What the filters get: calibrated, and with rates that are means over the interval before each sample.

    Filters take a rate for the whole interval before its sample. A sensor known to sample instants would lead them by half an
    interval; the mean of both ends of the interval does not (trapezoidal rule).
    """
    gyr, acc, mag = calibration.apply(uniform.gyr, uniform.acc, uniform.mag)
    if sampling == "instantaneous":
        gyr = np.vstack([gyr[:1], (gyr[1:] + gyr[:-1]) / 2])
    device_q = uniform.device_q
    if device_q is not None:
        device_q = rotation.multiply(device_q, rotation.from_matrix(calibration.R_believed_from_sensor.T))
    return UniformSamples(uniform.interval, gyr, acc, mag, device_q)


def _calibrate(
    session: Session, acc: np.ndarray, gyr: np.ndarray, time: np.ndarray, static: np.ndarray, truth: Truth
) -> CalibrationFit:
    """Static poses of the calibration sections, as the gyroscope confirms them."""
    gravity = session.robot.gravity if session.robot else STANDARD_DOWN
    accs, gyrs, poses = [], [], []
    for step in session.steps:
        if step.role != "calibration" or step.kind == "sweep":
            continue
        rest = static & (time >= step.settled_ns) & (time <= step.end_ns)
        if rest.sum() >= 10:
            middle = np.array([time[rest].mean()])
            accs.append(acc[rest])
            gyrs.append(gyr[rest])
            poses.append(rotation.interpolate(truth.host_time_ns, truth.q_world_from_sensor, middle)[0])
    return fit_static_poses(accs, gyrs, poses, gravity)


def _mounting(
    session: Session,
    samples: UniformSamples,
    rows: np.ndarray,
    time: np.ndarray,
    static: np.ndarray,
    truth: Truth,
    gravity: np.ndarray,
) -> VectorMounting | None:
    """The mounting by rates while moving and by gravity at rest, over what comes before the first judged step."""
    usable = _before_judging(session, time)
    gyr, acc = samples.gyr[rows], samples.acc[rows]
    rate, sound = true_rates(truth, time)
    q_true = truth_at(truth, time)
    moving = usable & sound & ~static & np.isfinite(gyr).all(axis=1)
    rest = usable & static & np.isfinite(q_true[:, 0]) & np.isfinite(acc).all(axis=1)
    if moving.sum() + rest.sum() < 10:
        return None
    bias = gyr[rest].mean(axis=0) if rest.any() else np.zeros(3)  # what no calibration has taken away
    seconds = float(np.median(np.diff(time))) / NANOSECONDS
    force = rotation.rotate(rotation.conjugate(q_true[rest]), -gravity)
    return mounting_from_vectors(
        [
            (rate[moving], gyr[moving] - bias, max(moving.sum() * seconds, 1.0)),  # a pair a second counts as independent
            (force, acc[rest], max(rest.sum() * seconds, 1.0)),
        ]
    )


def _before_judging(session: Session, time: np.ndarray) -> np.ndarray:
    """Samples before the first judged step, or all of a recording that has no such part, shape (n,), bool."""
    judged = [step.start_ns for step in session.steps if step.role == "evaluation"]
    return time < min(judged) if judged and min(judged) > time[0] else np.ones(len(time), dtype=bool)


def _align(
    session: Session, q: np.ndarray, time: np.ndarray, truth: Truth | None, method: str, mounting: VectorMounting | None
) -> tuple[FrameFit, str | None]:
    """The alignment of one filter, and what is doubtful about it."""
    if method == "none" or truth is None:
        return FrameFit(), None
    if method == "rates":
        q_true = truth_at(truth, time)
        known = _before_judging(session, time) & np.isfinite(q_true[:, 0]) & np.isfinite(q[:, 0])
        if mounting is None or not known.any():
            return FrameFit(), "the truth is known too seldom to align it by rates and gravity"
        return fit_frames_by_vectors(q[known], q_true[known], mounting)
    if method == "motion":
        return _align_by_motion(session, q, time, truth)
    step = _reference_step(session)
    if step is None:
        return FrameFit(), "there is no dwell to align it in"
    begin = (step.settled_ns + step.end_ns) // 2  # the second half: filters have settled
    mine = (time >= begin) & (time <= step.end_ns)
    known = (truth.host_time_ns >= begin) & (truth.host_time_ns <= step.end_ns) & np.isfinite(truth.q_world_from_sensor[:, 0])
    if not mine.any() or not known.any():
        return FrameFit(), "neither it nor the truth is known in the reference pose"
    warning = None
    if step.role != "reference":
        warning = f"without a reference section it was aligned in '{step.name}', of section {step.section}"
    return fit_frames(q[mine], truth.q_world_from_sensor[known], method), warning


def _align_by_motion(session: Session, q: np.ndarray, time: np.ndarray, truth: Truth) -> tuple[FrameFit, str | None]:
    """Over everything before the first judged step, or over the whole of a recording that has no such part."""
    q_true = truth_at(truth, time)
    usable = _before_judging(session, time) & np.isfinite(q_true[:, 0]) & np.isfinite(q[:, 0])
    if usable.sum() < 10:
        return FrameFit(), "the truth is known too seldom to align it by motion"
    return fit_frames_by_motion(q[usable], q_true[usable], float(usable.sum()) * float(np.median(np.diff(time))) / NANOSECONDS)


def _reference_step(session: Session) -> PlannedStep | None:
    dwells = [step for step in session.steps if step.kind != "sweep" and step.end_ns - step.settled_ns >= NANOSECONDS // 5]
    return next((step for step in dwells if step.role == "reference"), dwells[0] if dwells else None)


def _estimate_joint(session: Session, name: str, sensors: dict[str, SensorEstimate]) -> JointEstimate:
    """Joint angles at the proximal sensor's instants; the distal orientation is interpolated to them."""
    joint = session.analysis.joints[name]
    proximal, distal = sensors[joint.proximal], sensors[joint.distal]
    placed = session.analysis.sensors
    angles: dict[tuple[str, str], np.ndarray] = {}
    for key, q_proximal in proximal.orientation.items():
        if key not in distal.orientation:
            continue
        q_distal = rotation.interpolate(distal.host_time_ns, distal.orientation[key], proximal.host_time_ns)
        world_from_proximal = segment_orientation(q_proximal, placed[joint.proximal])
        world_from_distal = segment_orientation(q_distal, placed[joint.distal])
        for definition in joint.definitions():
            angles[key, definition.sequence] = joint_angles(world_from_proximal, world_from_distal, definition.sequence)
    return JointEstimate(proximal.host_time_ns, angles)
