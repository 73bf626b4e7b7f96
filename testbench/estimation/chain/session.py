"""The chain filter on a session: rest, samples and noise of each section that it runs over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from testbench.estimation.chain.period import base_frequency
from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.placement_check import (
    PlacementCheck,
    check_placement,
    doubted,
    placement_findings,
)
from testbench.estimation.chain.prefit import PlacementFit, fit_placement
from testbench.estimation.chain.run import ChainMotion, ChainSamples, most_likely, run_filter
from testbench.estimation.chain.sensors import ChainSensors, chain_sensors
from testbench.estimation.chain.settings import (
    AMPLITUDE_SD,
    PART_OF_RANGE,
    FilterSettings,
    SensorNoise,
)
from testbench.estimation.chain.smoother import run_smoother
from testbench.estimation.chain.state import motion_size
from testbench.estimation.signals.recording import RunFacts
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.tables import read_parquet
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, told_once
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import CalibrationFit, ClockFit, SensorEstimate
from testbench.records.session.layout import PLAN
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ImuSamples
from testbench.records.session.sensor_file import SensorFile
from testbench.records.session.session import Session
from testbench.records.specs.protocol_chain import ChainEstimation, ChainState
from testbench.records.specs.robot import Robot
from testbench.records.specs.sensor import ImuParameters, TriadParameters

SETTLED_NS = NANOSECONDS * 3 // 10
"""After a move the arm still swings in; this long is left out of a rest."""
LEAST_REST_NS = NANOSECONDS // 2
LONGEST_REST_NS = 10 * NANOSECONDS
"""Shortest rest that a start can be read from, and how much of a long one is used [ns]."""
LEAST_SAMPLES = 10
GYR_SD_FLOOR, ACC_SD_FLOOR = np.radians(0.02), 0.005
"""A sensor is not believed better than this, however quiet at rest: jitter of its clock and what is
left of its scale [rad/s], [m/s^2].
"""
CALIBRATED_SD = (2e-4, 2e-4)
"""What a calibration by static poses leaves of the accelerometer's scale and axes, as a standard
deviation [1]: the arm's own angles are good to 0.01 deg.
"""
CALIBRATED_BIAS_SD = 0.02
"""A calibration whose biases are less certain than this saw too few poses, and the data sheet is
believed instead [m/s^2].
"""
FITTED_S = 30.0
"""The placement is fitted to this much of a section's motion, from its beginning on [s]."""
LOOSER = 2.0
"""The placement is fitted with this times the most likely jerk [1]: limbs' jerk is not white, and
innovations are then correlated. In gait, constants err by 1.3 to 2 times their standard deviations
with the most likely one, and by 0.7 to 1.3 with twice that.
"""
SEARCHED_S = 10.0
"""The process noise is sought over this much of a section, from the beginning of its motion and
`settling_s` on [s].
"""


@dataclass(frozen=True)
class ChainRecording:
    """A run of a protocol, as far as a chain is estimated from it; what the arm measured is not in
    it.

    Attributes:
        robot: The arm.
        run: What is known of the run beside its samples.
        plan: Columns of the planned motion, shape (n,) each.
        raw: Samples of the sensors, by name.
    """

    robot: Robot
    run: RunFacts
    plan: Mapping[str, np.ndarray]
    raw: Mapping[str, SensorFile]

    @staticmethod
    def of(session: Session, run: RunFacts) -> ChainRecording | None:
        """That of a session; None where it has no arm or no plan."""
        if session.robot is None or not (session.path / PLAN).is_file():
            return None
        columns = ["host_time_ns", *(f"q_{joint}_rad" for joint in session.robot.joint_names)]
        raw = {name: session.sensor(name) for name in session.sensor_names}
        return ChainRecording(session.robot, run, read_parquet(session.path / PLAN, columns), raw)


def estimate_chain(
    recording: ChainRecording | None,
    sensors: Mapping[str, SensorEstimate],
    wanted: ChainEstimation,
) -> tuple[list[ChainEstimate], list[Finding]]:
    """Joints of the arm over every section asked for, by every state asked for.

    Args:
        recording: With an arm and a plan, or None.
        sensors: With clocks, calibrations and gates.
        wanted: The protocol's wishes.

    Returns:
        The estimates, and what is to be said of sections that could not be estimated.
    """
    if recording is None:
        return [], [finding("chain.no_arm")]
    names = wanted.sensors or list(sensors)
    evaluated = [step.section for step in recording.run.steps if step.role == "evaluation"]
    estimates, findings = [], []
    for section in wanted.sections or list(dict.fromkeys(evaluated)):
        try:
            part = _Section(recording, sensors, names, wanted, section)
            for state in wanted.states:
                estimated, told = part.estimate(state)
                estimates.append(estimated)
                findings += told
        except InputError as error:
            where = f"chain, section {section}"
            findings.append(finding("chain.not_estimated", where, why=str(error)))
    return estimates, told_once(findings)


class _Section:
    """One section: the chain, the rest before it and its samples.

    Raises:
        InputError: There is no rest to start from, a sensor is silent, or a joint carries no
            sensor.
    """

    def __init__(
        self,
        recording: ChainRecording,
        sensors: Mapping[str, SensorEstimate],
        names: list[str],
        wanted: ChainEstimation,
        section: str,
    ):
        self.wanted, self.section = wanted, section
        kinematics = Kinematics(recording.robot)
        begin, end, begins, ends = _rest(recording.run.steps, section)
        pose = _planned_pose(recording, end)
        placed = recording.run.placed
        places = {
            name: (placed[name].link, Pose.from_placement(placed[name].mounting)) for name in names
        }
        self.chain: ChainSensors = chain_sensors(kinematics, places, wanted.joints or None, pose)
        self.start = pose[[recording.robot.joint_names.index(name) for name in self.chain.joints]]
        times, owners, readings, means, counts, self.noise = [], [], [], [], [], []
        self.start_s, self.begins_s = end / NANOSECONDS, begins / NANOSECONDS
        for i, name in enumerate(names):
            sheet = placed[name].imu()
            time, rate, force = _calibrated(recording.raw[name].read(), name, sensors[name], sheet)
            rest = (time >= begin / NANOSECONDS) & (time <= self.start_s)
            if rest.sum() < LEAST_SAMPLES:
                raise InputError(
                    f"{name} has {rest.sum()} samples at rest before it; {LEAST_SAMPLES} are needed"
                )
            means.append(np.concatenate([rate[rest].mean(axis=0), force[rest].mean(axis=0)]))
            counts.append(rest.sum())
            own = _noise(sheet, sensors[name].calibration, rate[rest], force[rest], wanted.scales)
            self.noise.append(_with_clock(own, sensors[name].clock, (ends - end) / NANOSECONDS))
            moving = (time > self.start_s) & (time <= ends / NANOSECONDS)
            times.append(time[moving])
            readings.append(np.hstack([rate, force])[moving])
            owners.append(np.full(moving.sum(), i))
        order = np.argsort(np.concatenate(times), kind="stable")
        self.samples = ChainSamples(
            self.start_s,
            np.array(means),
            np.array(counts),
            np.concatenate(times)[order],
            np.concatenate(owners)[order],
            np.concatenate(readings)[order],
        )

    def estimate(self, state: ChainState) -> tuple[ChainEstimate, list[Finding]]:
        """By one state of the filter, and what is to be said of it."""
        wanted, fit = self.wanted, self.placement
        sensors = self.chain if fit is None else fit.sensors
        constants = doubted(self.chain) if fit is None else fit.constants
        settings, stated = self._settings(state), self._stated(state) is not None
        if not stated:
            settings = self._sought(sensors, settings)
        run = run_smoother if wanted.smooth else run_filter
        motion = run(sensors, settings, self.samples, constants)
        check = check_placement(motion, constants)
        record = self._record(state, settings, motion, check)
        return record, placement_findings(record, check, fit)

    @cached_property
    def placement(self) -> PlacementFit | None:
        """Where the sensors sit by their readings, or None where it is not asked for."""
        asked = self.wanted.placement
        if asked is None:
            return None
        constants = Constants.of(
            self.chain,
            np.radians(asked.rotation_sd_deg),
            asked.position_sd_mm / 1000,
            asked.length_sd_percent / 100,
        )
        # the kinematic state holds for any motion
        settings = self._settings("kinematic")
        if self.wanted.jerk_deg_s3_sqrthz is None:
            settings = self._sought(self.chain, settings)
        return fit_placement(
            self.chain,
            settings,
            self.samples.until(self.begins_s - self.samples.start + FITTED_S),
            constants,
            lambda sensors: _looser(self._sought(sensors, settings)),
        )

    def _sought(self, sensors: ChainSensors, settings: FilterSettings) -> FilterSettings:
        """With the process noise that the readings make most likely."""
        since = self.begins_s + self.wanted.settling_s
        part = self.samples.until(since - self.samples.start + SEARCHED_S)
        return most_likely(sensors, settings, part, since)

    def _stated(self, state: ChainState) -> float | None:
        """The process noise that was stated for a state, if it was."""
        fourier = state == "fourier"
        return self.wanted.walk_deg_sqrts if fourier else self.wanted.jerk_deg_s3_sqrthz

    def _settings(self, state: ChainState) -> FilterSettings:
        """Of one state, with the process noise that was stated or one to begin the search with."""
        wanted = self.wanted
        fourier = state == "fourier"
        frequency = 1.0
        if fourier:
            frequency = wanted.frequency_hz or base_frequency(self.samples, self.begins_s)
        reach = PART_OF_RANGE * np.ptp(self.chain.limits, axis=1)
        return FilterSettings(
            wanted.harmonics if fourier else 0,
            self.noise,
            self.start,
            float(np.radians(wanted.start_sd_deg)),
            float(np.radians(self._stated(state) or 1.0)),
            biases=wanted.biases,
            scales=wanted.scales,
            amplitude=np.minimum(AMPLITUDE_SD, reach),
            frequency=frequency,
            limits=wanted.limits,
        )

    def _record(
        self,
        state: ChainState,
        settings: FilterSettings,
        motion: ChainMotion,
        check: PlacementCheck,
    ) -> ChainEstimate:
        own = self.samples.sensor == 0
        unit = "walk_deg_sqrts" if state == "fourier" else "jerk_deg_s3_sqrthz"
        facts = {
            unit: float(np.degrees(settings.process_noise)),
            "normalised_innovation_squared": float(motion.nis.mean()),
            "smoothed": self.wanted.smooth,
            **check.facts(self.chain.joints),
        }
        if self.placement is not None:
            facts["placement"] = self.placement.facts()
        if state == "fourier":
            omega = motion_size(len(self.chain.joints), settings.harmonics) - 1
            facts["frequency_hz"] = float(motion.last[0][omega] / (2 * np.pi))
            facts["frequency_sd_hz"] = float(np.sqrt(motion.last[1][omega, omega]) / (2 * np.pi))
        return ChainEstimate(
            section=self.section,
            state=state,
            sensors=self.chain.sensors,
            joints=self.chain.joints,
            facts=facts,
            host_time_ns=np.round(self.samples.time[own] * NANOSECONDS).astype(np.int64),
            mean=motion.mean[own],
            sd=motion.sd[own],
        )


def _looser(settings: FilterSettings) -> FilterSettings:
    """With more process noise than is most likely."""
    return replace(settings, process_noise=LOOSER * settings.process_noise)


def _rest(steps: list[PlannedStep], section: str) -> tuple[int, int, int, int]:
    """Begin and end of the rest before a section, and begin and end of its motion [ns]."""
    own = [i for i, step in enumerate(steps) if step.section == section]
    if not own:
        raise InputError("the recording has no finished step of it")
    first, last = own[0], own[-1]
    if first > 0:
        before = steps[first - 1]
        begin, end = (
            before.settled_ns + (SETTLED_NS if before.settled_ns > before.start_ns else 0),
            steps[first].start_ns,
        )
        begins = steps[first].start_ns
    elif steps[first].kind == "hold":  # the arm starts at rest
        begin, end = steps[first].start_ns, steps[first].end_ns
        begins = end
    else:
        raise InputError("no rest comes before it; put a dwell in front, which gives the start")
    begin = max(begin, end - LONGEST_REST_NS)
    if end - begin < LEAST_REST_NS:
        raise InputError(
            f"the rest before it lasts {max(end - begin, 0) / NANOSECONDS:.2f} s; 0.5 s are needed"
        )
    return begin, end, begins, steps[last].end_ns


def _planned_pose(recording: ChainRecording, time_ns: int) -> np.ndarray:
    """The pose that the plan states at a rest, shape (n_joints,) [rad]; not the measured one."""
    table = recording.plan
    planned_end = np.searchsorted(table["host_time_ns"], time_ns, side="right") - 1
    row = int(np.clip(planned_end, 0, len(table["host_time_ns"]) - 1))
    return np.array([table[f"q_{joint}_rad"][row] for joint in recording.robot.joint_names])


def _calibrated(
    samples: ImuSamples, name: str, sensor: SensorEstimate, sheet: ImuParameters
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When samples that no gate refuses were true [s], their rates [rad/s] and forces [m/s^2].

    What the sensor's low pass took is put back: of a first-order one y of time constant T, the
    input is y + T dy/dt. A sensor that integrates gives means over the interval before its stamp,
    the force in the axes at its end.
    """
    rate, force, _ = sensor.calibration.apply(samples.gyr, samples.acc, None)
    sound = ~sensor.flagged & np.isfinite(rate).all(axis=1) & np.isfinite(force).all(axis=1)
    time, rate, force = sensor.host_time_ns[sound] / NANOSECONDS, rate[sound], force[sound]
    if len(time) < LEAST_SAMPLES:
        raise InputError(
            f"{name} has {len(time)} samples that no gate refuses; {LEAST_SAMPLES} are needed"
        )
    rate = _without_low_pass(time, rate, sheet.gyroscope.bandwidth_hz)
    force = _without_low_pass(time, force, sheet.accelerometer.bandwidth_hz)
    if sheet.sampling == "integrated":
        half = 0.5 / sheet.rate_hz
        force = rotation.rotate(rotation.from_rotation_vector(rate * half), force)
        time = time - half
    return time, rate, force


def _without_low_pass(time: np.ndarray, reading: np.ndarray, bandwidth: float | None) -> np.ndarray:
    if bandwidth is None:
        return reading
    return np.asarray(reading + np.gradient(reading, time, axis=0) / (2 * np.pi * bandwidth))


def _noise(
    sheet: ImuParameters,
    calibration: CalibrationFit,
    rate: np.ndarray,
    force: np.ndarray,
    scales: bool,
) -> SensorNoise:
    """White noise as measured at rest, biases by the calibration or else by the data sheet.

    A gyroscope's response to gravity acts like a bias, and so does an accelerometer's scale where
    it is no state of its own.
    """
    gyroscope, accelerometer = sheet.gyroscope.triad(), sheet.accelerometer.triad()
    calibrated = calibration.method != "none" and bool(
        (calibration.acc_bias_sd <= CALIBRATED_BIAS_SD).all()
    )
    gyr_bias = np.hypot(gyroscope.bias_sd, STANDARD_GRAVITY * gyroscope.g_sensitivity_sd)
    if calibrated:
        gyr_bias = _worst(calibration.gyr_bias_sd, gyr_bias)
    acc_bias = (
        _worst(calibration.acc_bias_sd, accelerometer.bias_sd)
        if calibrated
        else accelerometer.bias_sd
    )
    axes = CALIBRATED_SD if calibrated else (accelerometer.scale_sd, accelerometer.cross_axis_sd)
    if not scales:
        acc_bias = np.hypot(acc_bias, STANDARD_GRAVITY * np.hypot(*axes))
    return SensorNoise(
        gyr_sd=max(_white(rate), GYR_SD_FLOOR),
        acc_sd=max(_white(force), ACC_SD_FLOOR),
        gyr_bias_sd=float(np.hypot(gyr_bias, gyroscope.bias_instability)),
        acc_bias_sd=float(np.hypot(acc_bias, accelerometer.bias_instability)),
        gyr_bias_walk=_wandering(gyroscope),
        acc_bias_walk=_wandering(accelerometer),
        gyr_scale_sd=gyroscope.scale_sd,
        gyr_cross_sd=gyroscope.cross_axis_sd,
        acc_scale_sd=axes[0],
        acc_cross_sd=axes[1],
        g_sd=0.0 if calibrated else gyroscope.g_sensitivity_sd,
        gyr_cubic_sd=gyroscope.nonlinearity / gyroscope.range**2,
        acc_cubic_sd=accelerometer.nonlinearity / accelerometer.range**2,
    )


def _with_clock(noise: SensorNoise, clock: ClockFit, seconds: float) -> SensorNoise:
    """With what the fit of the sensor's clock leaves.

    Its offset, and its drift as a random walk that grows as far in a section of that length. A
    sensor on the host's clock, or one that no motion was found for, is taken at its word.
    """
    offset, drift = (
        value if np.isfinite(value) else 0.0
        for value in (clock.offset_sd_s, 1e-6 * clock.drift_sd_ppm)
    )
    return replace(noise, clock_sd=offset, clock_walk=drift * np.sqrt(seconds))


def _wandering(triad: TriadParameters) -> float:
    """Growth of the bias [unit/sqrt(s)]: random walk and the start of a Gauss-Markov process."""
    return float(
        np.hypot(
            triad.bias_instability * np.sqrt(2 / triad.bias_time_constant), triad.bias_random_walk
        )
    )


def _white(readings: np.ndarray) -> float:
    """Standard deviation of white noise in readings at rest, shape (n, 3), by differences."""
    return float(np.sqrt(np.mean(np.diff(readings, axis=0) ** 2) / 2))


def _worst(fitted: np.ndarray, otherwise: float) -> float:
    known = fitted[np.isfinite(fitted)]
    return float(known.max()) if len(known) else otherwise
