"""A recording made ready for calibration: on the arm's clock, cut into rests and turns.

A rest is a still interval. Of rests and turns it holds what the arm knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from testbench.consistency.doubtful import doubts_on, without
from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.alignment.true_motion import rate_delay, sensor_clock
from testbench.estimation.calibration.clipping import clipped_in_motion, clipped_triads
from testbench.estimation.calibration.gyroscope import gravity_direction_errors, turn_figures
from testbench.estimation.calibration.parted import Parted, parted
from testbench.estimation.calibration.poses import (
    DIRECTION_SD,
    SETTLING_M_S2,
    SETTLING_UT,
    StaticPoses,
    TrueVector,
    static_poses,
)
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.static_intervals import (
    between_peaks,
    by_events,
    by_gyroscope,
    by_variance,
    compare,
)
from testbench.estimation.calibration.turns import (
    GyroscopeRecording,
    Rest,
    Turn,
    TurnSettings,
)
from testbench.estimation.filters import UniformSamples
from testbench.estimation.signals.segmentation import intervals_of
from testbench.estimation.signals.uniform import MOST_FILLING, fill_gaps
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.model.truth import truth_at
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.calibration_result import Agreement, CalibrationPoses
from testbench.records.session.samples import ImuSamples, Truth

Segmentation = Literal["arm", "gyroscope", "peaks", "variance", "recorded"]
"""Who says where the rests are: the last is what was recorded, accelerations at rest alone."""
FOLDS = 3
BY_TURNS = (
    "accelerations were recorded at rest alone and rates in motion alone: the bias of the "
    "gyroscope is fitted to its turns"
)
AS_THE_METHOD = TurnSettings()
TURN_MARGIN_S = 0.1
"""A turn reaches so far into the rests at its ends [s]."""


@dataclass(frozen=True)
class Prepared:
    """A recording made ready.

    Attributes:
        samples: On a regular grid.
        time_ns: Of the grid on the host's clock, shape (n,), int64 [ns].
        rests: Begin and end (exclusive) of the still intervals used, in samples, shape (k, 2).
        truth: By the arm, or None.
        gravity: In the world, shape (3,) [m/s^2].
        rate_delay: How much older than its stamp a rate is [s].
        segmentation: Who said where the rests are.
        agreements: How far the witnesses agree.
        remarks: What is odd.
        temperatures: Of the part on the grid, shape (n,) [deg C], or None.
        integrated: Whether its rates are means over the interval before each sample.
        clipped: What is said of triads at the end of their range, by quantity.
        clipped_moving: What is said of those that are so between the rests.
        stated: The truth as the robot file has it; `truth` may be another.
        gravity_sd: Standard uncertainty of the length of `gravity` [m/s^2].
        nonlinearity: Of the accelerometer by its data sheet, what it adds at 1 g as a share of it
            [1]; None where none is named.
        settling: What a rest of the accelerometer differs by from others beside its noise, a
            standard deviation [m/s^2].
        shifted: That with the zero of a joint off by its standard uncertainty, joint by joint.
        parted: Rests and turns of a recording whose triads were recorded by turns; None of others.
    """

    samples: UniformSamples
    time_ns: np.ndarray
    rests: np.ndarray
    truth: Truth | None
    gravity: np.ndarray
    rate_delay: float
    segmentation: Segmentation
    agreements: list[Agreement]
    remarks: list[str]
    temperatures: np.ndarray | None = None
    integrated: bool = False
    clipped: dict[str, Finding] = field(default_factory=dict)
    clipped_moving: list[Finding] = field(default_factory=list)
    stated: Truth | None = None
    gravity_sd: float = 0.0
    nonlinearity: float | None = None
    settling: float = SETTLING_M_S2
    shifted: list[Truth] = field(default_factory=list)
    parted: Parted | None = None

    @property
    def has_gyroscope(self) -> bool:
        return self.samples.has("gyr")

    @property
    def has_magnetometer(self) -> bool:
        return self.samples.has("mag")

    @property
    def temperature(self) -> float | None:
        """Mean temperature of the part [deg C], or None."""
        return None if self.temperatures is None else float(np.nanmean(self.temperatures))

    @property
    def has_truth(self) -> bool:
        return self.truth is not None

    @cached_property
    def poses(self) -> StaticPoses:
        """Of the accelerometer."""
        expected = (
            None
            if self.truth is None
            else rotation.rotate(rotation.conjugate(self._attitudes), -self.gravity)
        )
        return static_poses(
            self.samples.acc,
            self.rests,
            times=self.time_ns / NANOSECONDS,
            true=TrueVector(
                float(np.linalg.norm(self.gravity)), expected, shared=self._shared(-self.gravity)
            ),
            floor=self.settling,
            temperature=self.temperatures,
        )

    @cached_property
    def _attitudes(self) -> np.ndarray:
        """q_world_from_sensor in the middle of each rest, shape (k, 4)."""
        assert self.truth is not None
        return truth_at(self.truth, self._middle_ns)

    @property
    def _middle_ns(self) -> np.ndarray:
        """Middle of each rest, shape (k,) [ns]."""
        return np.asarray(self.time_ns[self.rests.mean(axis=1).astype(int)])

    def _shared(self, vector: np.ndarray) -> np.ndarray | None:
        """How a vector of the world changes in the sensor by the zero of each joint, shape
        (k, q, 3); None where no joint's is known.
        """
        if self.stated is None or not self.shifted:
            return None
        seen = [
            rotation.rotate(rotation.conjugate(truth_at(truth, self._middle_ns)), vector)
            for truth in (self.stated, *self.shifted)
        ]
        return np.stack([moved - seen[0] for moved in seen[1:]], axis=1)

    def magnetometer_poses(
        self, accelerometer: TriadCalibration | None, field: np.ndarray | None = None
    ) -> StaticPoses:
        """Of the magnetometer, with the vertical by the accelerometer.

        Args:
            accelerometer: Its calibration.
            field: In the world, shape (3,) [uT]; None where nobody states it.
        """
        assert self.samples.mag is not None
        up = self.felt(accelerometer)
        known = field is not None and self.truth is not None
        expected = (
            rotation.rotate(rotation.conjugate(self._attitudes), field)
            if known and field is not None
            else None
        )
        return static_poses(
            self.samples.mag,
            self.rests,
            times=self.time_ns / NANOSECONDS,
            true=TrueVector(
                float("nan") if field is None else float(np.linalg.norm(field)),
                expected,
                up / np.linalg.norm(up, axis=1, keepdims=True),
                float(DIRECTION_SD),
                None if expected is None or field is None else self._shared(field),
            ),
            floor=SETTLING_UT,
        )

    def without_trend(self, key: Literal["acc", "gyr"], trend: np.ndarray) -> Prepared:
        """The recording with what a triad drifts by taken out.

        Args:
            key: Which triad.
            trend: At each sample, shape (n, 3) [m/s^2 or rad/s].
        """
        less = getattr(self.samples, key) - trend
        return replace(self, samples=replace(self.samples, **{key: less}))

    def calibration_poses(self, accelerometer: TriadCalibration | None) -> CalibrationPoses:
        """The poses before and after the correction, for people."""
        poses = self.poses
        inside = np.concatenate([np.arange(begin, end) for begin, end in self.rests])
        which = np.repeat(np.arange(len(self.rests)), self.rests[:, 1] - self.rests[:, 0])
        spread = []
        for readings in (
            self.samples.acc,
            self.samples.acc
            if accelerometer is None
            else accelerometer.apply(self.samples.acc, temperature=self.temperatures),
        ):
            within = readings[inside]
            means = np.array([within[which == i].mean(axis=0) for i in range(len(self.rests))])
            spread.append(np.sqrt(np.mean((within - means[which]) ** 2, axis=0)))
        start, end = (
            self.time_ns[np.clip(border, 0, len(self.time_ns) - 1)] / NANOSECONDS
            for border in self.rests.T
        )
        return CalibrationPoses(
            start, end, poses.mean, self.felt(accelerometer), poses.expected, np.array(spread)
        )

    def felt(self, accelerometer: TriadCalibration | None) -> np.ndarray:
        """Mean force of each rest by the calibrated accelerometer, shape (k, 3) [m/s^2]."""
        return (
            self.poses.mean
            if accelerometer is None
            else accelerometer.apply(self.poses.mean, temperature=self.poses.temperature)
        )

    def gyroscope_recording(self, accelerometer: TriadCalibration | None) -> GyroscopeRecording:
        """Rests, and the turns between them with what the arm, or gravity alone, knows of each."""
        # Longer than a screen: rests and turns are cut from the same arrays, column by column.
        force = self.felt(accelerometer)
        up = force / np.linalg.norm(force, axis=1, keepdims=True)
        up_sd = float(np.sqrt(self.poses.variance.mean()) / STANDARD_GRAVITY)
        if self.parted is not None:
            return self._parted_turns(self.parted, up, up_sd)
        temperatures, time = self.temperatures, self.time_ns / NANOSECONDS
        rests = [
            Rest(
                self.samples.gyr[begin:end],
                felt,
                None if temperatures is None else temperatures[begin:end],
                time[begin:end],
            )
            for (begin, end), felt in zip(self.rests, force, strict=True)
        ]
        reach = max(round(TURN_MARGIN_S / self.samples.interval), 1)
        felt_along = self.samples.acc
        if accelerometer is not None:
            felt_along = accelerometer.apply(felt_along, temperature=temperatures)
        attitude = rate = sound = None
        if self.truth is not None:
            at = self.time_ns - round(self.rate_delay * NANOSECONDS)
            attitude = truth_at(self.truth, at)
            rate, sound = true_rates(
                self.truth, at, self.samples.interval if self.integrated else 0.0
            )
        turns = []
        for i in range(len(self.rests) - 1):
            begin = max(
                self.rests[i, 1] - min(reach, (self.rests[i, 1] - self.rests[i, 0]) // 2), 0
            )
            end = self.rests[i + 1, 0] + min(
                reach, (self.rests[i + 1, 1] - self.rests[i + 1, 0]) // 2
            )
            span = slice(begin, end)
            known = (
                attitude is not None
                and bool(np.isfinite(attitude[span]).all())
                and end - begin >= 2
            )
            turns.append(
                Turn(
                    self.samples.gyr[span],
                    self.samples.interval,
                    up[i],
                    up[i + 1],
                    q_world_from_sensor=attitude[span] if known and attitude is not None else None,
                    rate=rate[span]
                    if known and rate is not None and sound is not None and sound[span].all()
                    else None,
                    force=felt_along[span],
                    up_sd=up_sd,
                    attitude_sd=float(DIRECTION_SD),
                    temperature=None if temperatures is None else temperatures[span],
                    time=time[span],
                )
            )
        return GyroscopeRecording(rests, turns)

    def _parted_turns(self, parted: Parted, up: np.ndarray, up_sd: float) -> GyroscopeRecording:
        """Turns without a rate at rest: no rest tells the bias.

        Args:
            parted: Where they are.
            up: Of each rest, shape (k, 3).
            up_sd: As `Turn` has it.
        """
        seconds = self.time_ns / NANOSECONDS
        turns = [
            Turn(
                self.samples.gyr[begin:end],
                self.samples.interval,
                up[before],
                up[after],
                up_sd=up_sd,
                time=seconds[begin:end],
            )
            for (begin, end), (before, after) in zip(parted.turns, parted.between, strict=True)
        ]
        return GyroscopeRecording([], turns)

    def with_held_out_turns(
        self,
        function: Callable[[GyroscopeRecording], TriadCalibration],
        recording: GyroscopeRecording,
        others: Sequence[GyroscopeRecording] = (),
        settings: TurnSettings = AS_THE_METHOD,
    ) -> TriadCalibration:
        """A calibration from all turns, with its errors on turns that the fit had not seen.

        Args:
            function: The method.
            recording: All rests and turns.
            others: Other recordings, whose turns are held out. Where there are none, a part of the
                turns is held out in each of some folds.
            settings: How turns are integrated, where somebody says so.
        """
        by = (settings.integrator or "rk4", settings.stages)
        found = function(recording)
        errors = [
            gravity_direction_errors(found, other.turns, *by) for other in others if other.turns
        ]
        turns = list(recording.turns)
        for k in range(0 if others else FOLDS):
            held = turns[k::FOLDS]
            if not held:
                continue
            try:
                fit = function(
                    GyroscopeRecording(
                        recording.rests, [t for i, t in enumerate(turns) if i % FOLDS != k]
                    )
                )
            except (PoorExcitation, InputError):
                continue
            errors.append(gravity_direction_errors(fit, held, *by))
        if not errors:
            return found
        return replace(found, validation=turn_figures(np.concatenate(errors)))


def prepare(recording: CalibrationRecording, segmentation: Segmentation | None) -> Prepared:
    """Make a sensor's recording ready.

    Args:
        recording: The sensor.
        segmentation: Who says where the rests are; the arm if None and it was there.

    Raises:
        InputError: No rest was found, or the arm is asked for and was not there.
    """
    # Longer than a screen: one step after another, each with what the ones before it found.
    raw, truth = recording.raw, recording.truth
    apart = parted(raw)
    if apart is not None:
        if segmentation is not None:
            raise InputError(
                f"{recording.place}: sensor '{recording.sensor}' was recorded by turns, "
                "accelerations at rest and rates in motion: that tells its rests; leave "
                "--segmentation out"
            )
        return _prepared_parts(recording, apart)
    doubts = doubts_on(raw, recording.belief)
    samples = without(raw, doubts.unknown)
    clock = sensor_clock(samples, truth, recording.described, recording.align_clock)
    given = without(raw, doubts.unknown, for_filters=True)
    everything = dict.fromkeys(("acc", "mag"), len(raw) * MOST_FILLING)
    uniform, rows = fill_gaps(given, clock, everything)  # rests are cut where it was filled
    sound = np.ones(len(uniform), dtype=bool)
    sound[rows[doubts.flagged]] = False
    host = clock.to_host(samples.device_time_ns)
    time = np.round(np.interp(np.arange(len(uniform.gyr)), rows, host.astype(float))).astype(
        np.int64
    )
    found: dict[str, np.ndarray] = {}
    remarks: list[str] = []
    steps = [
        step for step in recording.steps if step.kind != "sweep" and step.end_ns > step.settled_ns
    ]
    calibration_steps = [step for step in steps if step.role == "calibration"] or steps
    if calibration_steps:
        settled, ended = (
            np.array([getattr(s, key) for s in calibration_steps]) / NANOSECONDS
            for key in ("settled_ns", "end_ns")
        )
        found["arm"] = by_events(settled, ended, time / NANOSECONDS)
    rate = uniform.angular_rate()
    found["gyroscope"] = by_gyroscope(rate, uniform.interval)
    found["peaks"] = between_peaks(rate, uniform.interval)
    if np.isfinite(uniform.acc).all():
        found["variance"] = by_variance(uniform.acc, uniform.interval).intervals
    chosen: Segmentation = segmentation or ("arm" if "arm" in found else "gyroscope")
    if chosen not in found:
        raise InputError(
            f"{recording.place}: no arm said where sensor '{recording.sensor}' rested; other "
            "witnesses: "
            f"{', '.join(found)}"
        )
    rests = _sound_parts(found[chosen], sound)
    if chosen == "arm":
        rests, left_out = _confirmed(rests, found["gyroscope"])
        if left_out:
            remarks.append(
                f"{left_out} of {len(found['arm'])} dwells of the arm were not at rest by the "
                "gyroscope and left out"
            )
    if not len(rests):
        raise InputError(
            f"{recording.place}: sensor '{recording.sensor}' never rests by the {chosen}; "
            "calibration needs static poses"
        )
    if truth is not None:
        middle = truth_at(truth, time[rests.mean(axis=1).astype(int)])
        rests = rests[np.isfinite(middle[:, 0])]
        if not len(rests):
            truth = None
            rests = _sound_parts(found[chosen], sound)
            remarks.append("the truth is not known in any rest and is not used")
    at_rest = _inside(found[chosen], len(uniform))[rows]  # those of refused samples too
    agreements = compare(found, len(uniform.gyr), uniform.interval)
    temperatures = _temperatures(samples, host, time)
    integrated = recording.described.sampling == "integrated"
    return Prepared(
        uniform,
        time,
        rests,
        truth,
        recording.gravity,
        rate_delay(samples, recording.described),
        chosen,
        agreements,
        remarks,
        temperatures,
        integrated,
        clipped_triads(raw, doubts, at_rest),
        clipped_in_motion(raw, at_rest),
    )


def _prepared_parts(recording: CalibrationRecording, apart: Parted) -> Prepared:
    """A recording whose triads were recorded by turns, as it is: nothing is filled in."""
    raw = recording.raw
    begin, end = apart.turns[0]
    interval = float(np.median(np.diff(raw.device_time_ns[begin:end]))) / NANOSECONDS
    return Prepared(
        UniformSamples(interval, raw.gyr, raw.acc),
        raw.host_time_ns,
        apart.rests,
        None,
        recording.gravity,
        0.0,
        "recorded",
        [],
        [BY_TURNS],
        parted=apart,
    )


def _inside(rests: np.ndarray, count: int) -> np.ndarray:
    """Whether each of so many samples is of a rest, shape (count,), bool."""
    result = np.zeros(count, dtype=bool)
    for begin, end in rests:
        result[begin:end] = True
    return result


def _sound_parts(rests: np.ndarray, sound: np.ndarray) -> np.ndarray:
    """The longest part of each rest without a refused sample, where that is most of it.

    Args:
        rests: Begin and end (exclusive) of each, shape (k, 2).
        sound: Rows that no gate refuses, shape (n,), bool.
    """
    if sound.all():
        return rests
    kept = []
    for begin, end in rests:
        parts = begin + intervals_of(sound[begin:end])
        if len(parts):
            longest = parts[np.argmax(parts[:, 1] - parts[:, 0])]
            if longest[1] - longest[0] >= (end - begin) / 2:
                kept.append(longest)
    return np.array(kept, dtype=rests.dtype).reshape(-1, 2)


def _temperatures(
    samples: ImuSamples, host_ns: np.ndarray, time_ns: np.ndarray
) -> np.ndarray | None:
    """Temperature at the times of the grid, shape (n,) [deg C]; None where it was not recorded."""
    if samples.temperature is None or not np.isfinite(samples.temperature).any():
        return None
    known = np.isfinite(samples.temperature)
    return np.interp(
        time_ns.astype(float), host_ns[known].astype(float), samples.temperature[known]
    )


def _confirmed(rests: np.ndarray, by_gyroscope: np.ndarray) -> tuple[np.ndarray, int]:
    """Rests that the gyroscope confirms over half of their length, and the number of the others."""
    shared = np.minimum(rests[:, None, 1], by_gyroscope[None, :, 1]) - np.maximum(
        rests[:, None, 0], by_gyroscope[None, :, 0]
    )
    confirmed = np.maximum(shared, 0).sum(axis=1) > 0.5 * (rests[:, 1] - rests[:, 0])
    return rests[confirmed], int(np.sum(~confirmed))
