"""The stage `estimate`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial

import numpy as np

from testbench.consistency import check_samples
from testbench.estimation.alignment.axes import findings_on as axes_findings
from testbench.estimation.alignment.axes import identify_axes, true_rates
from testbench.estimation.alignment.frame_alignment import (
    apply_frames,
    findings_on,
    fit_frames,
    fit_frames_by_motion,
    fit_frames_by_vectors,
)
from testbench.estimation.alignment.resting_heading import drift_finding
from testbench.estimation.alignment.true_motion import TrueMotion, name_confused, true_motion
from testbench.estimation.alignment.vector_mounting import VectorMounting, mounting_from_vectors
from testbench.estimation.calibration.static_poses import fit_static_poses
from testbench.estimation.chain.session import ChainRecording, estimate_chain
from testbench.estimation.filters import OrientationFilter, UniformSamples
from testbench.estimation.filters.tuned import Parameters, choose_tuned
from testbench.estimation.joints.joints import estimate_joint
from testbench.estimation.signals.access import Correct, SampleAccess
from testbench.estimation.signals.recording import RunFacts, SensorRecording
from testbench.estimation.signals.segmentation import detect_static, detect_static_by_force
from testbench.exceptions import InputError, SessionError
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.reference_step import aligning_part, before_judging, reference_step
from testbench.model.truth import truth_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration_file import SensorCalibration, find_calibration
from testbench.records.results.estimate import (
    CalibrationFit,
    Estimate,
    FrameFit,
    SensorEstimate,
    as_kept,
)
from testbench.records.results.tuning import Tuning
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import Session

LEAST_SAMPLES = 10
"""Of a sensor, for anything to be estimated."""
MOST_COMPARED = 200_000
"""Longer recordings are aligned by some of their samples, evenly spread."""


def estimate(
    session: Session,
    filters: Sequence[str | OrientationFilter] | None = None,
    calibrations: list[SensorCalibration] | None = None,
    tunings: Sequence[Tuning] = (),
    parameters: Parameters | None = None,
) -> Estimate:
    """Compute what the sensors, filters and joint angles say.

    Args:
        session: A recording.
        filters: Those to run, by name (with the parameters that the protocol gives them) or as they
            are; those of the protocol, and those that were tuned or set, if None.
        calibrations: To correct the raw samples with first; each sensor takes its own that is
            nearest in time.
        tunings: Whose parameters to use in place of the protocol's, at most one a filter.
        parameters: Single ones to set, by filter and name, whatever protocol or tuning say.

    Raises:
        NotFoundError: An unknown filter or parameter.
        InputError: A parameter's value is not allowed, or a filter that was tuned or set is not
            among those to run.
        SessionError: The session holds no samples.
    """
    settings = session.analysis.estimate
    chosen = choose_tuned(
        filters, settings.filters, settings.filter_parameters, tunings, parameters
    )
    _check_calibrations(session, calibrations or [])
    run = RunFacts.of(session)
    prepared = _together(
        {name: _prepared(session, name, run, calibrations) for name in session.sensor_names}
    )
    sensors = {name: sensor.run(chosen) for name, sensor in prepared.items()}
    joints = {
        name: estimate_joint(joint, run, sensors, chosen)
        for name, joint in session.analysis.joints.items()
    }
    chain, chain_findings = (
        estimate_chain(ChainRecording.of(session, run), sensors, settings.chain)
        if settings.chain is not None
        else ([], [])
    )
    used = {kind.name: kind.parameters for kind in chosen}
    given = {name: list(own) for name, own in (parameters or {}).items()}
    tuned = {tuning.filter: tuning.used_on(session, given.get(tuning.filter)) for tuning in tunings}
    known = {kind.name: kind.behaviour for kind in chosen if kind.behaviour}
    return Estimate(
        session.name,
        session.fingerprint,
        sensors,
        joints,
        used,
        {name: entry for name, entry in tuned.items() if entry.tuned},
        chain,
        chain_findings,
        known,
        given,
    )


class PreparedSession:
    """A recording made ready for filters that run over it many times: only what depends on them is
    computed each time.

    Args:
        session: The recording.
        calibrations: As for `estimate`.
        joints: Those wanted, and only their sensors; all sensors and no joint if None.
    """

    def __init__(
        self,
        session: Session,
        calibrations: list[SensorCalibration] | None = None,
        joints: Sequence[str] | None = None,
    ):
        self._session, self._facts = session.name, RunFacts.of(session)
        self._fingerprint = session.fingerprint
        self._joints = {name: session.analysis.joints[name] for name in joints or []}
        wanted = set(session.sensor_names)
        if joints is not None:
            defined = self._joints.values()
            wanted = {sensor for joint in defined for sensor in (joint.proximal, joint.distal)}
        self.sensors = _together(
            {
                name: _prepared(session, name, self._facts, calibrations)
                for name in session.sensor_names
                if name in wanted
            }
        )

    def run(self, filters: Sequence[OrientationFilter]) -> Estimate:
        """The estimate by some filters, of the sensors and joints that were prepared."""
        sensors = {name: sensor.run(filters) for name, sensor in self.sensors.items()}
        joints = {
            name: estimate_joint(joint, self._facts, sensors, filters)
            for name, joint in self._joints.items()
        }
        used = {kind.name: kind.parameters for kind in filters}
        return Estimate(self._session, self._fingerprint, sensors, joints, used)


@dataclass(frozen=True)
class PreparedSensor:
    """What of a sensor's estimate does not depend on the filters, and what is needed to run them.

    Attributes:
        facts: What is known of the recording.
        described: What is known of the sensor.
        access: To its samples.
        motion: Its clock and its truth, which may be None.
        aligned_every: Where motion aligns it: one of how many samples does so.
        aligned_to: q_world_from_sensor at those samples, shape (m, 4), or None.
        uniform: The kept samples on a regular grid.
        correct: Calibration of what the filters get.
        mounting: As rates and gravity gave it, or None.
        estimate: Without any filter.
    """

    facts: RunFacts
    described: SensorRecord
    access: SampleAccess
    motion: TrueMotion
    aligned_every: int
    aligned_to: np.ndarray | None
    uniform: UniformSamples
    correct: Correct
    mounting: VectorMounting | None
    estimate: SensorEstimate

    def unaligned(self, why: Finding) -> PreparedSensor:
        """The same, of a sensor whose truth cannot be compared with it."""
        kept = [found for found in self.estimate.findings if found.code not in BY_A_WRONG_TRUTH]
        estimate = replace(
            self.estimate, unaligned=why.code, axes={}, findings=[*_not_axes(kept), why]
        )
        return replace(self, motion=replace(self.motion, unaligned=why.code), estimate=estimate)

    def run(self, filters: Sequence[OrientationFilter]) -> SensorEstimate:
        """The sensor's orientation by every filter, aligned."""
        orientation: dict[str, np.ndarray] = {}
        frames: dict[str, FrameFit] = {}
        skipped: dict[str, str] = {}
        findings = list(self.estimate.findings)
        running: dict[str, OrientationFilter] = {}
        resting = self.estimate.static & ~self.estimate.flagged
        for kind in filters:
            key, missing, refusal = kind.name, kind.missing(self.uniform), self.access.refuses(kind)
            if missing:
                skipped[key] = f"the sensor gives no {' and no '.join(missing)}"
            elif refusal:
                skipped[key] = refusal
            else:
                running[key] = kind
        for key, q_earth_from_sensor in self.access.orientations(
            running, self.estimate.clock, self.correct
        ):
            q = rotation.normalise(q_earth_from_sensor)
            frames[key], told = _align(self, key, q)
            orientation[key] = as_kept(apply_frames(q, frames[key]))
            # of an axis that the motion does not show it is enough to say it once
            codes = {own.code for own in findings}
            findings += [own for own in told if own.code not in ONCE or own.code not in codes]
            drift = drift_finding(
                running[key], orientation[key], self.estimate.host_time_ns, resting
            )
            if drift is not None:
                findings.append(drift)
        return replace(
            self.estimate,
            orientation={key: orientation[key] for key in running},
            frames={key: frames[key] for key in running},
            skipped=skipped,
            findings=findings,
        )


BY_A_WRONG_TRUTH = {"clock.no_common_motion", "clock.periodic", "truth.foreign"}
"""What is found where a sensor is compared with what another one went through."""


def _not_axes(findings: list[Finding]) -> list[Finding]:
    return [found for found in findings if not found.code.startswith("axes.")]


ONCE = {
    "frames.undetermined",
    "frames.still",
    "frames.not_level",
    "frames.up_undetermined",
    "frames.up_unknown",
}
"""Findings that are those of the motion, whichever filter shows them."""


def _together(sensors: dict[str, PreparedSensor]) -> dict[str, PreparedSensor]:
    """The same, of which those that moved as the truth of another says are not judged."""
    if len(sensors) < 2:
        return sensors
    confused = name_confused(
        {name: sensor.motion for name, sensor in sensors.items()},
        {name: sensor.access.samples for name, sensor in sensors.items()},
        {name: sensor.described for name, sensor in sensors.items()},
        next(iter(sensors.values())).facts.settings.align_clock,
    )
    return {
        name: sensor if name not in confused else sensor.unaligned(confused[name])
        for name, sensor in sensors.items()
    }


def _stored(
    session: Session, name: str, calibrations: list[SensorCalibration]
) -> SensorCalibration | None:
    """The stored calibration of a sensor that is nearest in time."""
    tag = session.manifest.sensors[name].device_tag
    return find_calibration(calibrations, name, tag, session.recorded_at)


def _check_calibrations(session: Session, calibrations: list[SensorCalibration]) -> None:
    """Refuse calibrations of which not one is of a sensor of this session.

    Raises:
        InputError: Names whose calibrations there are, and the session's sensors.
    """
    if calibrations and all(
        _stored(session, name, calibrations) is None for name in session.sensor_names
    ):
        whose = ", ".join(
            sorted({f"'{c.sensor}'" + (f" ({c.device})" if c.device else "") for c in calibrations})
        )
        names = ", ".join(session.sensor_names)
        raise InputError(
            f"{session.path}: none of its sensors ({names}) has a stored calibration; there are "
            f"those of {whose}"
        )


def _stored_findings(
    tag: str | None, recorded: datetime | None, stored: SensorCalibration | None, given: bool
) -> list[Finding]:
    """What a reader must know of the correction of the raw samples."""
    if stored is None:
        return [finding("calibration.none_of_this_sensor")] if given else []
    same = (
        f"of the same device, {tag}"
        if tag and stored.device == tag
        else "matched by the sensor's name alone"
    )
    methods = ", ".join(
        f"{triad} by {method}" for triad, method in stored.summary()["methods"].items()
    )
    origin = (
        f"{stored.file}, " if stored.file else ""
    ) + f"session {stored.session} of {stored.calibrated:%Y-%m-%d}"
    code = "calibration.stored" if recorded else "calibration.stored_undated"
    return [finding(code, origin=origin, methods=methods, match=same)]


def _corrector(stored: SensorCalibration) -> Callable[[ImuSamples], ImuSamples]:
    def correct(samples: ImuSamples) -> ImuSamples:
        gyr, acc, mag = stored.apply(samples.gyr, samples.acc, samples.mag, samples.temperature)
        q = samples.device_q
        if q is not None and stored.mounting is not None:
            q = rotation.multiply(q, rotation.from_matrix(stored.mounting.R_believed_from_sensor.T))
        return replace(samples, gyr=gyr, acc=acc, mag=mag, device_q=q)

    return correct


def _prepared(
    session: Session, name: str, run: RunFacts, calibrations: list[SensorCalibration] | None
) -> PreparedSensor:
    """A sensor of a session, opened and prepared.

    Raises:
        SessionError: It has too few samples.
    """
    recording = SensorRecording.of(session, name)
    if recording.raw.count < LEAST_SAMPLES:
        raise SessionError(
            f"{session.path}: sensor '{name}' has {recording.raw.count} samples; nothing can be "
            "estimated"
        )
    stored = _stored(session, name, calibrations or [])
    tag = recording.described.device_tag
    findings = _stored_findings(tag, run.recorded, stored, bool(calibrations))
    return prepare_sensor(recording, run, stored, findings)


def prepare_sensor(
    recording: SensorRecording,
    run: RunFacts,
    stored: SensorCalibration | None = None,
    findings: Sequence[Finding] = (),
) -> PreparedSensor:
    """Fit a sensor's clock and calibration, and find what its alignment goes by.

    Args:
        recording: Of the sensor.
        run: What is known of it beside the samples.
        stored: Calibration to correct the raw samples with first.
        findings: On that.
    """
    # Longer than a screen: one step after another, each with what the ones before it found.
    settings, description = run.settings, recording.described
    access = recording.samples(None if stored is None else _corrector(stored))
    samples = access.samples
    truth = None if recording.truth is None else recording.truth.thinned()
    motion = true_motion(samples, truth, description, settings.align_clock, access.every)
    clock = motion.clock
    time = clock.to_host(samples.device_time_ns)
    if recording.truth is not None and recording.truth.is_long:
        motion = replace(motion, truth=recording.truth.near(time))
    truth = None if motion.unaligned else motion.truth
    uniform, rows = access.regular(clock)
    measured = access.measured
    resting = _resting(uniform, rows[measured])
    static = resting[rows] & measured
    quality = access.quality(static).with_flags(motion.lost)
    calibration = CalibrationFit()
    if settings.calibrate == "static_poses" and truth is not None:
        calibration = _calibrate(
            run, samples.acc, samples.gyr, time, static & ~quality.flagged, truth
        )
    plain = [samples] if stored is None and access.every == 1 else recording.raw.batches()
    findings = [*findings, *check_samples(plain), *quality.findings, *motion.findings]
    planned = sum(step.role == "calibration" and step.kind != "sweep" for step in run.steps)
    if calibration.method == "static_poses" and calibration.poses < planned:
        left_out = planned - calibration.poses
        findings.append(finding("calibration.poses_moving", left_out=left_out, planned=planned))
    correct = partial(_corrected, calibration=calibration, sampling=description.sampling)
    axes = (
        identify_axes(samples, time, static & ~quality.flagged, truth, run.gravity)
        if truth is not None
        else {}
    )
    findings += axes_findings(axes)
    every = max(len(time) // MOST_COMPARED, 1) if settings.align == "motion" else 1
    mounting = aligned_to = None
    if settings.align in {"rates", "motion"} and truth is not None:
        aligned_to = truth_at(truth, time[::every])
        if settings.align == "rates":
            quiet = static & ~quality.flagged
            mounting = _mounting(run, correct(uniform), rows, time, quiet, truth, aligned_to)
    if access.every > 1:
        findings.append(finding("recording.long", every=access.every))
    estimated = SensorEstimate(
        host_time_ns=time,
        static=static,
        orientation={},
        flagged=quality.flagged,
        clock=clock,
        calibration=calibration,
        quality=quality.counts(),
        findings=findings,
        timing=access.timing(description.rate_hz, _rate_age(description)),
        every=access.every,
        axes=axes,
        stored_calibration=None if stored is None else stored.summary(),
        unaligned=motion.unaligned,
    )
    return PreparedSensor(
        run, description, access, motion, every, aligned_to, uniform, correct, mounting, estimated
    )


def _resting(uniform: UniformSamples, real: np.ndarray) -> np.ndarray:
    """Rows at rest by what the sensor has: gyroscope, orientation, or accelerometer alone."""
    if uniform.has("gyr") or uniform.device_q is not None:
        return detect_static(uniform.angular_rate(), uniform.interval, real)
    return detect_static_by_force(uniform.acc, uniform.interval, real)


def _rate_age(description: SensorRecord) -> float:
    """Half an interval where rate and force are integrated over it: the force is seen in the axes
    at its end [s].
    """
    rate = description.rate_hz
    return 0.5 / rate if rate and description.sampling == "integrated" else 0.0


def _corrected(
    uniform: UniformSamples, calibration: CalibrationFit, sampling: str | None
) -> UniformSamples:
    """What the filters get: calibrated, and with rates that are means over the interval before each
    sample.

    Filters take a rate for the whole interval before its sample. A sensor known to sample instants
    would lead them by half an interval; the mean of both ends of the interval does not (trapezoidal
    rule).
    """
    gyr, acc, mag = calibration.apply(uniform.gyr, uniform.acc, uniform.mag)
    if sampling == "instantaneous":
        gyr = np.vstack([gyr[:1], (gyr[1:] + gyr[:-1]) / 2])
    device_q = uniform.device_q
    if device_q is not None:
        device_q = rotation.multiply(
            device_q, rotation.from_matrix(calibration.R_believed_from_sensor.T)
        )
    return replace(uniform, gyr=gyr, acc=acc, mag=mag, device_q=device_q)


def _calibrate(
    run: RunFacts,
    acc: np.ndarray,
    gyr: np.ndarray,
    time: np.ndarray,
    static: np.ndarray,
    truth: Truth,
) -> CalibrationFit:
    """Static poses of the calibration sections, as the gyroscope confirms them."""
    accs, gyrs, poses = [], [], []
    for step in run.steps:
        if step.role != "calibration" or step.kind == "sweep":
            continue
        rest = static & (time >= step.settled_ns) & (time <= step.end_ns)
        if rest.sum() >= 10:
            middle = np.array([time[rest].mean()])
            accs.append(acc[rest])
            gyrs.append(gyr[rest])
            poses.append(
                rotation.interpolate(truth.host_time_ns, truth.q_world_from_sensor, middle)[0]
            )
    return fit_static_poses(accs, gyrs, poses, run.gravity)


def _mounting(
    run: RunFacts,
    samples: UniformSamples,
    rows: np.ndarray,
    time: np.ndarray,
    static: np.ndarray,
    truth: Truth,
    q_true: np.ndarray,
) -> VectorMounting | None:
    """The mounting by rates while moving and by gravity at rest, over what comes before the first
    judged step.
    """
    usable = before_judging(run.steps, time)
    gyr, acc = samples.gyr[rows], samples.acc[rows]
    rate, sound = true_rates(truth, time)
    moving = usable & sound & ~static & np.isfinite(gyr).all(axis=1)
    rest = usable & static & np.isfinite(q_true[:, 0]) & np.isfinite(acc).all(axis=1)
    if moving.sum() + rest.sum() < 10:
        return None
    bias = (
        gyr[rest].mean(axis=0) if rest.any() else np.zeros(3)
    )  # what no calibration has taken away
    seconds = float(np.median(np.diff(time))) / NANOSECONDS
    force = rotation.rotate(rotation.conjugate(q_true[rest]), -run.gravity)
    return mounting_from_vectors(
        [
            (
                rate[moving],
                gyr[moving] - bias,
                max(moving.sum() * seconds, 1.0),
            ),  # a pair a second counts as independent
            (force, acc[rest], max(rest.sum() * seconds, 1.0)),
        ]
    )


# One piece: which alignment it is decides what must be known, and what is said.
def _align(sensor: PreparedSensor, key: str, q: np.ndarray) -> tuple[FrameFit, list[Finding]]:
    """The alignment of one filter, and what is to be said of it.

    Args:
        sensor: Prepared.
        key: Name of the filter.
        q: q_earth_from_sensor by it, shape (n, 4).
    """
    run, truth, time = sensor.facts, sensor.motion.truth, sensor.estimate.host_time_ns
    sound = ~sensor.estimate.flagged
    method, up_stated = run.settings.align, sensor.described.truth_world == "z_up"
    if method == "none" or truth is None or sensor.motion.unaligned:
        return FrameFit(up_known=up_stated), []
    if sensor.aligned_to is not None:
        every = sensor.aligned_every
        q, time, sound = q[::every], time[::every], sound[::every]
        known = (
            sound
            & before_judging(run.steps, time)
            & np.isfinite(sensor.aligned_to[:, 0])
            & np.isfinite(q[:, 0])
        )
        q, q_true = q[known], sensor.aligned_to[known]
        if method == "motion":
            if len(q) < 10:
                return _refused(key, "the truth is known too seldom to align it by motion")
            seconds = float(len(q)) * float(np.median(np.diff(time))) / NANOSECONDS
            fit = fit_frames_by_motion(q, q_true, seconds, up_stated)
            return fit, findings_on(fit, key)
        if sensor.mounting is None or not len(q):
            return _refused(key, "the truth is known too seldom to align it by rates and gravity")
        fit, doubt = fit_frames_by_vectors(q, q_true, sensor.mounting)
        return fit, [] if doubt is None else [finding("frames.doubt", filter=key, doubt=doubt)]
    step = reference_step(run.steps)
    if step is None and method == "heading":
        return _by_mean_heading(sensor, key, q)
    if step is None:
        return _refused(key, "there is no dwell to align it in")
    begin, end = aligning_part(step)
    mine = sound & (time >= begin) & (time <= end)
    known = (
        (truth.host_time_ns >= begin)
        & (truth.host_time_ns <= end)
        & np.isfinite(truth.q_world_from_sensor[:, 0])
    )
    if not mine.any() or not known.any():
        return _refused(key, "neither it nor the truth is known in the reference pose")
    return fit_frames(q[mine], truth.q_world_from_sensor[known], method), []


def _by_mean_heading(
    sensor: PreparedSensor, key: str, q: np.ndarray
) -> tuple[FrameFit, list[Finding]]:
    """The heading of a recording without a dwell: the mean over all of it; see `_align`."""
    assert sensor.motion.truth is not None
    q_true = truth_at(sensor.motion.truth, sensor.estimate.host_time_ns)
    known = ~sensor.estimate.flagged & np.isfinite(q_true[:, 0]) & np.isfinite(q[:, 0])
    if not known.any():
        return _refused(key, "the truth is not known where it is")
    error = rotation.multiply(q_true[known], rotation.conjugate(q[known]))
    heading = float(np.degrees(rotation.heading_angle(rotation.mean(error))))
    doubt = "there is no dwell to align it in: its heading is the mean of the recording's"
    return FrameFit(heading, method="heading"), [finding("frames.doubt", filter=key, doubt=doubt)]


def _refused(key: str, why: str) -> tuple[FrameFit, list[Finding]]:
    """No alignment, so that nothing is judged by it."""
    return FrameFit(refused=why), [finding("frames.refused", filter=key, why=why)]
