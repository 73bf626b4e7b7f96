"""A sensor's clock and its truth, brought together and looked at: may they be compared?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from testbench.estimation.alignment.ambiguous_truth import find_ambiguous
from testbench.estimation.alignment.parted_truth import cut_at, reason_of, told_of
from testbench.estimation.alignment.parting import find_partings
from testbench.estimation.alignment.truth_reading import BELONGS, RateFit, fit_rates, misread
from testbench.estimation.signals.access import SampleAccess
from testbench.estimation.signals.common_motion import MOST_DRIFT
from testbench.estimation.signals.time_alignment import fit_clock
from testbench.estimation.signals.truth_faults import (
    AMBIGUOUS,
    FROZEN,
    STEPPED,
    Apart,
    find_faults,
    without_repetitions,
)
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.statistics.intervals import median_interval
from testbench.model.windows import moving_mean
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.sensor_file import TruthFile

IMPORTED = "imported"
SHIFT_TOLD_S = 0.5
"""A shift between two logs that is worth saying [s]."""
STILL = np.radians(1.0)
"""A truth that stays within this needs no clock [rad]."""
TURNING, TURNING_S = np.radians(10.0), 0.25
"""A gyroscope turns that reads so much more than usual [rad/s], on the mean over so long [s]."""
LATE_S, LATE_SAMPLES = 0.02, 2.0
"""A truth on the samples' clock that moves so much later or earlier is not on it [s]: filters of a
sensor and of a reference delay less.
"""
LATE_TURN, LEAST_LATE = np.radians(1.0), 0.9
"""So is one in whose delay the body turns so far, RMS [rad], if that is more than what a sensor
that samples instants differs by from one that integrates, so many intervals [1].
"""
SURELY = 3.0
"""By so many standard deviations it must be more [1]."""
FOREIGN = 0.5
"""A truth whose rates explain less of the variance than this is remarked on [1]."""
ALIKE = 0.9
"""Magnitudes of rates that correlate by more are those of one motion [1]."""
LEFT_OVER = 1.3
"""A clock by which the rates differ by so much more is that of something else [1]."""
UNEVEN = 0.05
"""A drift that no oscillator has, and that is less sure than this part of itself, is none: that of
a rate which was stated wrongly is sure to 0.1 %, that fitted to a jump to 12 to 40 % [1].
"""
NOT_IN_THE_WAY = {"clock.shifted", "clock.unfitted", "clock.as_stated"}
"""Findings on a clock by which the truth can still be compared."""


@dataclass(frozen=True)
class TrueMotion:
    """What a sensor went through, on its clock.

    Attributes:
        clock: Of the sensor.
        truth: Its lost parts unknown; None where there is none.
        lost: Samples at which the truth was lost, by reason, each of shape (n,), bool.
        findings: What is odd.
        unaligned: Code of the finding by which the truth cannot be compared with it, or "".
        apart: Pieces of the truth that do not fit the rest.
        fit: Of the sensor's rates to those of the truth; None where it was not asked, or the
            motion tells nothing.
    """

    clock: ClockFit
    truth: Truth | None
    lost: dict[str, np.ndarray] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    unaligned: str = ""
    apart: list[Apart] = field(default_factory=list)
    fit: RateFit | None = None


def sensor_clock(
    samples: ImuSamples,
    truth: Truth | None,
    described: SensorRecord,
    align: bool,
    every: int = 1,
) -> ClockFit:
    """A sensor's clock against the host's.

    Args:
        samples: Of the sensor.
        truth: What it went through.
        described: What is known of it.
        align: Whether to fit it; else the sensor is on the host's clock, and an import's begins
            where its file does.
        every: One of how many samples of the recording these are.
    """
    imported = described.driver == IMPORTED
    if align:
        near = described.truth_offset_s is not None
        delay = rate_delay(samples, described, every)
        return fit_clock(samples, truth, delay, not imported, near)
    if not imported or not len(samples):
        return ClockFit()
    ahead = samples.device_time_ns - samples.host_time_ns
    return ClockFit(offset_s=float(np.median(ahead)) / NANOSECONDS)


def rate_delay(samples: ImuSamples, described: SensorRecord, every: int = 1) -> float:
    """How much older than its stamp a rate is [s].

    Half an interval where nobody says. Filters take a rate for the interval before its sample: of a
    sensor that samples instants they are half an interval ahead, and a clock that is fitted with
    this delay is late by the same.

    Args:
        samples: Of the sensor.
        described: What is known of it.
        every: One of how many samples of the recording these are.
    """
    if described.rate_delay_s is not None:
        return described.rate_delay_s
    if described.sampling == "instantaneous" or len(samples) < 2:
        return 0.0
    return median_interval(samples.device_time_ns) / NANOSECONDS / 2 / every


def true_motion(
    access: SampleAccess, file: TruthFile | None, described: SensorRecord, align: bool
) -> TrueMotion:
    """Bring a sensor and its truth together.

    Args:
        access: To the samples of the sensor.
        file: What it went through, or None.
        described: What is known of the sensor.
        align: Whether its clock is to be fitted.
    """
    samples, every = access.samples, access.every
    truth = None if file is None else file.thinned()
    clock = sensor_clock(samples, truth, described, align, every)
    if file is None or truth is None:
        return TrueMotion(clock, None)
    if align and clock.refused == "no common motion":
        moving = without_repetitions(truth)
        if moving is not None:
            clock = _surest([sensor_clock(samples, moving, described, align, every)], clock)
    if file.is_long:
        truth = file.near(clock.to_host(samples.device_time_ns))
    told = _clock_finding(clock, truth, described, samples)
    if told is not None and told.code not in NOT_IN_THE_WAY:
        return TrueMotion(clock, truth, findings=[told], unaligned=told.code)
    if described.driver != IMPORTED:
        return TrueMotion(clock, truth, findings=[] if told is None else [told])
    sound = _on_one_clock(_without_faults(access, TrueMotion(clock, truth), described, align))
    told = _clock_finding(sound.clock, truth, described, samples)
    read = turning_instants(access, sound.clock, described)
    assert sound.truth is not None
    fit = fit_rates(access.turned, read, sound.truth)
    doubt = None if fit is None else _doubt(access.turned, read, sound, fit, described)
    findings = [*sound.findings]
    late: list[Finding] = []
    if sound.clock.method == "none" and (doubt is None or doubt.code == "truth.foreign"):
        late = _late(access, sound.truth, described, sound.clock, doubt is None)
        doubt = late.pop() if doubt is not None and late else doubt
    if doubt is not None and doubt.code != sound.unaligned:
        findings.append(doubt)
    unaligned = sound.unaligned or ("" if doubt is None else doubt.code)
    if told is not None and unaligned != "clock.no_common_motion":
        findings.insert(0, told)
    motion = replace(sound, findings=[*findings, *late], unaligned=unaligned, fit=fit)
    return _without_ambiguous(access, _cut_where_both_part(access, read, motion))


def _without_ambiguous(access: SampleAccess, motion: TrueMotion) -> TrueMotion:
    """The same with samples lost at which a truth of too low a rate tells no turn.

    Args:
        access: To the samples of the sensor.
        motion: Its clock and truth.
    """
    if motion.unaligned or motion.truth is None or motion.clock.method == "arrival":
        return motion
    time = motion.clock.to_host(access.samples.device_time_ns)
    found = find_ambiguous(access.turned, time, motion.truth)
    if found is None:
        return motion
    lost, told = found
    return replace(motion, lost=motion.lost | {AMBIGUOUS: lost}, findings=[*motion.findings, told])


def _cut_where_both_part(access: SampleAccess, read: np.ndarray, motion: TrueMotion) -> TrueMotion:
    """The same without stretches in which truth and gyroscope part.

    Args:
        access: To the samples of the sensor.
        read: Instants that its mean rates are of, shape (n,) [ns].
        motion: Its clock and truth; as it is where they cannot be compared at all.
    """
    truth = motion.truth
    if motion.unaligned or truth is None or motion.clock.method == "arrival":
        return motion
    partings = find_partings(access.turned, read, truth)
    if not partings:
        return motion
    samples = access.samples
    cut = cut_at(partings, truth, motion.clock.to_host(samples.device_time_ns))
    lost = np.ones(len(samples), dtype=bool) if cut is None else cut[1]
    told = told_of(partings, read, samples.host_time_ns, lost)
    findings = [*motion.findings, told]
    if cut is None:
        return replace(motion, findings=findings, unaligned=told.code)
    reason = reason_of(partings)
    before = motion.lost.get(reason, np.zeros(len(samples), dtype=bool))
    return replace(
        motion,
        truth=cut[0],
        lost=motion.lost | {reason: before | lost},
        findings=findings,
        apart=[*motion.apart, *cut[2]],
    )


def _without_faults(
    access: SampleAccess, motion: TrueMotion, described: SensorRecord, align: bool
) -> TrueMotion:
    """The truth without its lost parts, and the clock that is fitted to the rest.

    A truth whose rest does not turn as the sensor does is another's: it is left as it is.
    """
    assert motion.truth is not None
    if motion.clock.method == "arrival":
        return motion
    clock, turned = motion.clock, access.turned
    faults = find_faults(turned, clock.to_host(turned.device_time_ns), motion.truth)
    if faults.findings and align:
        fits = [
            sensor_clock(access.samples, truth, described, align, access.every)
            for truth in (faults.truth, faults.rates)
        ]
        clock = _surest(fits, clock)
        faults = find_faults(turned, clock.to_host(turned.device_time_ns), motion.truth)
    if not faults.findings:
        return motion
    fit = fit_rates(turned, turning_instants(access, clock, described), faults.truth)
    if fit is not None and fit.magnitudes < ALIKE:
        return motion
    lost = {FROZEN: faults.frozen, STEPPED: faults.stepped}
    lost = {reason: flags for reason, flags in lost.items() if flags.any()}
    return TrueMotion(clock, faults.truth, lost, faults.findings, apart=faults.apart)


def _on_one_clock(motion: TrueMotion) -> TrueMotion:
    """The same, not to be compared where its clock is a compromise between times that jump.

    No oscillator drifts so much; a rate that was stated wrongly does, but evenly, so that all parts
    of a recording agree on it.
    """
    drift, sd = (1e-6 * value for value in (motion.clock.drift_ppm, motion.clock.drift_sd_ppm))
    if (
        motion.clock.method != "angular_rate"
        or abs(drift) <= MOST_DRIFT
        or sd <= UNEVEN * abs(drift)
    ):
        return motion
    told = finding("clock.no_common_motion", correlation=_known(motion.clock.correlation or 0.0))
    return replace(motion, findings=[told, *motion.findings], unaligned=told.code)


def _surest(fits: list[ClockFit], otherwise: ClockFit) -> ClockFit:
    """The clock that is known best, of those that leave hardly more than the others do.

    Too little may be left of a truth that steps to fit a clock to; and the pieces that do not fit
    the rest may be of another body, or of another time.

    Args:
        fits: To parts of a truth.
        otherwise: Taken where every fit was refused.
    """
    sound = [own for own in fits if own.method == "angular_rate"]
    least = min((own.residual_deg_s for own in sound), default=0.0)
    good = [own for own in sound if own.residual_deg_s <= LEFT_OVER * least]
    return min(good, key=lambda own: own.offset_sd_s, default=otherwise)


def _doubt(
    turned: ImuSamples,
    read: np.ndarray,
    motion: TrueMotion,
    fit: RateFit,
    described: SensorRecord,
) -> Finding | None:
    """Whether the truth, as it was read, is that of the sensor.

    Args:
        turned: Of the sensor, with mean rates.
        read: Instants that these are of, shape (n,) [ns].
        motion: Its clock and truth.
        fit: Of its rates to those of the truth.
        described: What is known of the sensor.
    """
    assert motion.truth is not None
    if described.truth_otherwise is not None and fit.explained < BELONGS:
        return finding(
            "truth.joints_not_judged",
            how=described.truth_otherwise,
            as_read_percent=100 * max(fit.explained, 0.0),
        )
    wrong = misread(turned, read, motion.truth, fit)
    if wrong is not None and described.truth_link is not None:
        # angles of joints have neither an order nor a direction of quaternions
        return finding(
            "truth.not_the_links",
            link=described.truth_link,
            as_read_percent=wrong.values["as_read_percent"],
            percent=wrong.values["percent"],
        )
    if wrong is not None or fit.explained >= FOREIGN or fit.magnitudes >= ALIKE:
        return wrong
    if motion.clock.method == "angular_rate":  # two logs that begin and rest alike
        return finding("clock.no_common_motion", correlation=fit.magnitudes)
    return finding("truth.foreign", percent=100 * max(fit.explained, 0.0))


def turning_instants(access: SampleAccess, clock: ClockFit, described: SensorRecord) -> np.ndarray:
    """Instants that the mean rates between kept samples are of, on the host's clock, shape (n,),
    int64 [ns].

    Args:
        access: To the samples of the sensor.
        clock: Against the host's.
        described: What is known of the sensor.
    """
    time, every = access.samples.device_time_ns, access.every
    late = rate_delay(access.samples, described, every)
    if every > 1:  # the middle of the samples that a mean is of
        late += median_interval(time) / NANOSECONDS * (1 - 1 / every) / 2
    return clock.to_host(time) - round(late * NANOSECONDS)


def _late(
    access: SampleAccess, truth: Truth, described: SensorRecord, clock: ClockFit, fits: bool
) -> list[Finding]:
    """That a truth which needs no clock, as is said, moves at other times than the samples.

    Args:
        access: To the samples of the sensor.
        truth: What it went through.
        described: What is known of the sensor.
        clock: As is said.
        fits: Whether the two can be compared by it all the same.
    """
    samples = access.samples
    fit = sensor_clock(samples, truth, described, True, access.every)
    if fit.method != "angular_rate" or not (fit.correlation or 0.0) > ALIKE:
        return []
    middle = samples.device_time_ns[len(samples) // 2 : len(samples) // 2 + 1]
    late_s = float((fit.to_host(middle) - clock.to_host(middle))[0]) / NANOSECONDS
    step_s = median_interval(samples.device_time_ns) / NANOSECONDS
    gyr = access.turned.gyr[np.isfinite(access.turned.gyr).all(axis=1)]
    speed = float(np.sqrt(np.mean(rotation.lengths(gyr - np.median(gyr, axis=0)) ** 2)))
    turn = abs(late_s) * speed
    least = max(LATE_S, LATE_SAMPLES * step_s)
    if turn > LATE_TURN:
        least = min(least, LEAST_LATE * step_s + SURELY * fit.offset_sd_s)
    if abs(late_s) <= least:
        return []
    if not fits:
        return [finding("clock.not_common", late_s=late_s, correlation=fit.correlation)]
    return [finding("clock.late", late_s=late_s, turn_deg=float(np.degrees(turn)))]


def _clock_finding(
    clock: ClockFit, truth: Truth, described: SensorRecord, samples: ImuSamples
) -> Finding | None:
    """What is to be said of a clock that was, or was not, fitted."""
    if clock.method == "none":
        return _apart(clock, truth, samples)
    if clock.method == "angular_rate":
        shift = clock.shift_s
        if shift is None or abs(shift) < SHIFT_TOLD_S:
            return None
        return finding("clock.shifted", shift_s=shift, correlation=clock.correlation)
    if described.driver != IMPORTED:
        return finding("clock.unfitted")
    if described.truth_offset_s is not None:
        return finding("clock.as_stated", offset_s=described.truth_offset_s)
    if clock.refused == "periodic":
        shifts = ", ".join(f"{shift:+.2f}" for shift in clock.candidates_s)
        return finding("clock.periodic", shifts_s=shifts)
    if clock.refused == "unit":
        assert clock.unit_factor is not None
        return finding("clock.truth_unit", factor=clock.unit_factor)
    if clock.refused == "no common motion":
        return finding("clock.no_common_motion", correlation=_known(clock.correlation))
    if not _stands_still(truth):
        return finding("clock.still")
    return finding("clock.truth_still") if _turns(samples) else finding("clock.unfitted")


def _apart(clock: ClockFit, truth: Truth, samples: ImuSamples) -> Finding | None:
    """Whether a truth on the same clock has nothing in common with the samples."""
    if not len(samples) or not len(truth.host_time_ns):
        return None
    begin, end = clock.to_host(samples.device_time_ns[[0, -1]])
    first, last = truth.host_time_ns[[0, -1]]
    if begin <= last and first <= end:
        return None
    begin_s, end_s, first_s, last_s = (
        float(time) / NANOSECONDS for time in (begin, end, first, last)
    )
    return finding(
        "clock.no_overlap", begin_s=begin_s, end_s=end_s, truth_begin_s=first_s, truth_end_s=last_s
    )


def _known(value: float) -> float:
    return value if np.isfinite(value) else 0.0


def _turns(samples: ImuSamples) -> bool:
    """Whether a gyroscope turns now and then, whatever it reads at rest."""
    gyr = samples.gyr[np.isfinite(samples.gyr).all(axis=1)]
    if len(gyr) < 2:
        return False
    steps = np.diff(samples.device_time_ns) / NANOSECONDS
    smooth = moving_mean(gyr, max(round(TURNING_S / max(float(np.median(steps)), 1e-6)), 1))
    speed = rotation.lengths(smooth - np.median(smooth, axis=0))
    return bool(np.quantile(speed, 0.95) > TURNING)


def _stands_still(truth: Truth) -> bool:
    q = truth.q_world_from_sensor[np.isfinite(truth.q_world_from_sensor).all(axis=1)]
    if len(q) < 2:
        return False
    turned = rotation.angle(rotation.multiply(rotation.conjugate(q[:1]), q))
    return float(turned.max()) < STILL
