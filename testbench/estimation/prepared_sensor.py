"""One sensor's estimate: what does not depend on the filters is prepared once, then they run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from testbench.consistency.looked import Up
from testbench.estimation.alignment.after_gaps import OtherStretches, restart_findings
from testbench.estimation.alignment.apart import PieceAlignment, aligned_apart, long_enough
from testbench.estimation.alignment.axes import findings_on as axes_findings
from testbench.estimation.alignment.axes import identify_axes
from testbench.estimation.alignment.confused_sensors import (
    in_place_of_comparison,
    is_suspect,
    name_confused,
)
from testbench.estimation.alignment.filter_alignment import FilterAlignment
from testbench.estimation.alignment.resting_heading import drift_finding
from testbench.estimation.alignment.true_motion import IMPORTED, TrueMotion, true_motion
from testbench.estimation.calibration.calibration_sections import corrected, fit_sections
from testbench.estimation.calibration.stored_calibration import corrector
from testbench.estimation.filters import OrientationFilter, UniformSamples
from testbench.estimation.joints.body_recording import Read
from testbench.estimation.signals.access import Correct, SampleAccess
from testbench.estimation.signals.quality import AFTER_GAP
from testbench.estimation.signals.recording import RunFacts, SensorRecording
from testbench.estimation.signals.segmentation import detect_static, detect_static_by_force
from testbench.model import rotation
from testbench.model.frame_fit import apply_frames
from testbench.records.disk.free_memory import give_back
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.estimate import (
    CalibrationFit,
    FrameFit,
    SensorEstimate,
    as_kept,
)
from testbench.records.session.manifest import SensorRecord

ONCE = {
    "frames.undetermined",
    "frames.still",
    "frames.not_level",
    "frames.up_undetermined",
    "frames.up_unknown",
}
"""Findings that are those of the motion, whichever filter shows them."""


@dataclass(frozen=True)
class PreparedSensor:
    """What of a sensor's estimate does not depend on the filters, and what is needed to run them.

    Attributes:
        described: What is known of the sensor.
        access: To its samples.
        motion: Its clock and its truth, which may be None.
        alignment: What its filters are aligned by.
        apart: Likewise in pieces of the truth that do not fit the rest.
        uniform: The kept samples on a regular grid.
        correct: Calibration of what the filters get.
        estimate: Without any filter.
        others: Stretches beyond gaps over which its orientation was lost.
    """

    described: SensorRecord
    access: SampleAccess
    motion: TrueMotion
    alignment: FilterAlignment
    uniform: UniformSamples
    correct: Correct
    estimate: SensorEstimate
    others: OtherStretches
    apart: list[PieceAlignment] = field(default_factory=list)

    @property
    def read(self) -> Read:
        """What the joints of a body are computed from beside the orientations."""
        turned = self.access.turned
        return Read(
            self.access.samples.acc,
            self.estimate.calibration.apply(turned.gyr, turned.acc, None)[0],
        )

    @property
    def is_suspect(self) -> bool:
        """Whether it may have moved as the truth of another says: see `told_apart`."""
        return is_suspect(self.motion, self.access, self.described)

    def light(self) -> PreparedSensor:
        """The same for its filters to be run once: without the samples, of which they get theirs
        from the file, and without the truth but where they are aligned to it.
        """
        self.access.let_go()
        motion, having = replace(self.motion, truth=None), self.uniform.having()
        return replace(self, motion=motion, uniform=having)

    def unaligned(self, why: Finding) -> PreparedSensor:
        """The same, of a sensor whose truth cannot be compared with it.

        Args:
            why: Says so.
        """
        findings = in_place_of_comparison(self.estimate.findings, why)
        return replace(
            self,
            motion=replace(self.motion, unaligned=why.code),
            alignment=replace(self.alignment, truth=None),
            others=replace(self.others, truth=None),
            apart=[],
            estimate=replace(self.estimate, unaligned=why.code, axes={}, findings=findings),
        )

    def run(self, filters: Sequence[OrientationFilter]) -> SensorEstimate:
        """The sensor's orientation by every filter, aligned."""
        running, skipped = self._able(filters)
        orientation, frames = {}, {}
        in_pieces: list[dict[str, FrameFit]] = [{} for _ in self.apart]
        findings = list(self.estimate.findings)
        resting = self.estimate.static & ~self.estimate.flagged
        for key, q_earth_from_sensor in self.access.orientations(
            running, self.estimate.clock, self.correct
        ):
            q = rotation.normalise(q_earth_from_sensor)
            frames[key], told = self.alignment.align(key, q)
            for fits, piece in zip(in_pieces, self.apart, strict=True):
                fits[key], _ = piece.alignment.align(key, q)
            orientation[key] = as_kept(apply_frames(q, frames[key]))
            # of an axis that the motion does not show it is enough to say it once
            codes = {own.code for own in findings}
            findings += [own for own in told if own.code not in ONCE or own.code not in codes]
            drift = drift_finding(
                running[key], orientation[key], self.estimate.host_time_ns, resting
            )
            if drift is not None:
                findings.append(drift)
        found = replace(
            self.estimate,
            orientation={key: orientation[key] for key in running},
            frames={key: frames[key] for key in running},
            skipped=skipped,
            findings=findings,
        )
        found = aligned_apart(found, self.apart, in_pieces)
        return self.others.aligned(found, running, self.uniform)

    def _able(
        self, filters: Sequence[OrientationFilter]
    ) -> tuple[dict[str, OrientationFilter], dict[str, str]]:
        """Filters that can run over these samples, and why the others cannot, by name."""
        running: dict[str, OrientationFilter] = {}
        skipped: dict[str, str] = {}
        for kind in filters:
            missing, refusal = kind.missing(self.uniform), self.access.refuses(kind)
            if missing:
                skipped[kind.name] = f"the sensor gives no {' and no '.join(missing)}"
            elif refusal:
                skipped[kind.name] = refusal
            else:
                running[kind.name] = kind
        return running, skipped


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
    access = recording.samples(None if stored is None else corrector(stored))
    give_back()
    samples = access.samples
    motion = true_motion(access, recording.truth, description, settings.align_clock)
    clock = motion.clock
    time = clock.to_host(samples.device_time_ns)
    truth = None if motion.unaligned else motion.truth
    uniform, rows = access.regular(clock)
    measured = access.measured
    resting = _resting(uniform, rows[measured])
    static = resting[rows] & measured
    gates = access.quality(static)
    sound = ~gates.with_flags(motion.lost).flagged
    others = OtherStretches.of(run, access.stretch, time, sound, truth)
    gates = gates.without_rows(AFTER_GAP, others.elsewhere & sound, access.every)
    quality = gates.with_flags(motion.lost)
    quiet = static & ~quality.flagged
    by_truth = truth is not None or description.driver != IMPORTED
    up = Up(description.hemisphere, by_truth=by_truth)
    findings = [*findings, *access.contradictions(up), *quality.findings, *motion.findings]
    findings += restart_findings(access)
    calibration = CalibrationFit()
    if settings.calibrate == "static_poses" and truth is not None:
        calibration, told = fit_sections(run, samples, time, quiet, truth)
        findings += told
    correct = partial(corrected, calibration=calibration, sampling=description.sampling)
    known = description.driver != IMPORTED
    axes = (
        {}
        if truth is None
        else identify_axes(samples, time, quiet, truth, run.gravity, mounting_known=known)
    )
    findings += axes_findings(axes, mounting_known=known)
    up_stated = description.truth_world == "z_up"
    alignment = FilterAlignment(run, truth, time, ~quality.flagged, up_stated)
    alignment = alignment.prepared(correct, uniform, rows, static)
    if access.every > 1:
        findings.append(finding("recording.long", every=access.every))
    estimate = SensorEstimate(
        host_time_ns=time,
        static=static,
        orientation={},
        flagged=quality.flagged,
        clock=clock,
        calibration=calibration,
        quality=quality.numbers,
        findings=findings,
        timing=access.timing(description.rate_hz, _rate_age(description)),
        every=access.every,
        axes=axes,
        stored_calibration=None if stored is None else stored.summary(),
        unaligned=motion.unaligned,
    )
    pieces = []
    if settings.align == "motion" and truth is not None:
        for own in motion.apart:
            sound = own.rows & ~gates.flagged
            piece = FilterAlignment(run, own.truth, time, sound, up_stated)
            pieces.append(
                PieceAlignment(piece.prepared(correct, uniform, rows, static), sound, own.reason)
            )
    return PreparedSensor(
        description,
        access,
        motion,
        alignment,
        uniform,
        correct,
        estimate,
        others,
        long_enough(pieces),
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


def told_apart(sensors: dict[str, PreparedSensor], align_clock: bool) -> dict[str, PreparedSensor]:
    """The same, of which those that moved as the truth of another says are not judged.

    Args:
        sensors: All of a recording, by name.
        align_clock: Whether clocks are to be fitted.
    """
    if len(sensors) < 2:
        return sensors
    confused = name_confused(
        {name: sensor.motion for name, sensor in sensors.items()},
        {name: sensor.access for name, sensor in sensors.items()},
        {name: sensor.described for name, sensor in sensors.items()},
        align_clock,
    )
    return {
        name: sensor if name not in confused else sensor.unaligned(confused[name])
        for name, sensor in sensors.items()
    }
