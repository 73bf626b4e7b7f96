"""The chain filter on a session: rest, samples and noise of each section that it runs over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np

from testbench.estimation.chain.anatomy import anatomy_variance
from testbench.estimation.chain.blur import BODY_SHIFT_SD, BODY_TURN_SD, blurred
from testbench.estimation.chain.period import base_frequency
from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.placement_check import (
    PlacementCheck,
    check_placement,
    doubted,
    placement_findings,
)
from testbench.estimation.chain.prefit import PlacementFit, fit_placement, looser_than
from testbench.estimation.chain.readings import (
    LEAST_SAMPLES,
    calibrated,
    rest_noise,
    with_clock,
)
from testbench.estimation.chain.recording import ChainRecording, lengths_of
from testbench.estimation.chain.run import ChainMotion, ChainSamples, most_likely, run_filter
from testbench.estimation.chain.sensors import ChainSensors, chain_sensors
from testbench.estimation.chain.settings import (
    AMPLITUDE_SD,
    PART_OF_RANGE,
    FilterSettings,
)
from testbench.estimation.chain.smoother import run_smoother
from testbench.estimation.chain.state import motion_size
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.kinematics import Kinematics
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, told_once
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import SensorEstimate
from testbench.records.specs.protocol_chain import ASSUMED_SHEET, ChainEstimation, ChainState

FITTED_S = 30.0
"""The placement is fitted to this much of a section's motion, from its beginning on [s]."""
LOOSER = 2.0
"""What a fit of the placement leaves uncertain is by this times the most likely jerk [1]: limbs'
jerk is not white, and innovations are then correlated. In gait, constants err by 1.3 to 2 times the
standard deviations of the most likely one, and by 0.7 to 1.3 of those with twice that.
"""
UNCERTAIN_DEG = 2.5
"""Angles of which the filter knows less than this are named: their errors may pass 5 deg [deg]."""
OF_LIMBS = 5.0
"""An import runs with this times the most likely jerk [1], as `gait` does: with that itself the
pelvis is too sure by far (NEES of its tilt 25), since what limbs do is smooth between jolts.
"""
PLANNED_SD = np.radians(0.5)
"""Of a planned angle at the rest before a section, where nothing is stated [rad]."""
STATED_POSITION_SD = 0.01
"""Of where a sensor sits on a body along each axis, where no fit says otherwise [m]."""
SEARCHED_S = 10.0
"""The process noise is sought over this much of a section, from the beginning of its motion and
`settling_s` on [s].
"""


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
    names = wanted.sensors or [name for name in sensors if name in recording.carried]
    estimates, findings = [], []
    for section in wanted.sections or recording.sections:
        where = f"chain, section {section}"
        try:
            part = ChainSection(recording, sensors, names, wanted, section)
            findings += part.told(where)
            for state in wanted.states:
                estimated, told = part.estimate(state)
                estimates.append(estimated)
                findings += told
        except InputError as error:
            findings.append(finding("chain.not_estimated", where, why=str(error)))
    return estimates, told_once(findings)


class ChainSection:
    """One section: the chain, the rest before it and its samples.

    Args:
        recording: That it is a part of.
        sensors: With clocks, calibrations and gates.
        names: Of the sensors to use.
        wanted: What is asked of the chain.
        section: Its name.

    Attributes:
        chain: The sensors, where they are stated to be.
        samples: Calibrated ones of all sensors.
        start: Angles at the rest before it, shape (m,) [rad].
        begins_s: When its motion begins [s].

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
        # Longer than a screen: what each sensor gives goes into arrays of all samples together.
        self.wanted, self.section, self.model = wanted, section, recording.model
        self.alignment = recording.alignment
        part = recording.part(section, {name: sensors[name] for name in names})
        (begin, end), (begins, ends) = part.rest, part.motion
        carried = {name: recording.carried[name] for name in names}
        self.chain: ChainSensors = chain_sensors(
            Kinematics(recording.robot),
            {name: (one.link, one.mounting) for name, one in carried.items()},
            wanted.joints or None,
            part.pose,
            None if recording.model is None else lengths_of(recording.robot, recording.model),
        )
        robot = recording.robot
        self.start = part.pose[[robot.joint_names.index(name) for name in self.chain.joints]]
        self.standing_deg = {
            name: float(np.degrees(angle))
            for name, angle in zip(robot.joint_names, part.pose, strict=True)
            if name not in self.chain.joints
        }
        self.rest_s = begin / NANOSECONDS, end / NANOSECONDS
        self.begins_s = begins / NANOSECONDS
        times, owners, readings, means, counts, self.noise = [], [], [], [], [], []
        for i, name in enumerate(names):
            sheet = carried[name].sheet
            time, rate, force = calibrated(recording.raw[name], name, sensors[name], sheet)
            rest = (time >= self.rest_s[0]) & (time <= self.rest_s[1])
            if rest.sum() < LEAST_SAMPLES:
                raise InputError(
                    f"{name} has {rest.sum()} samples at rest before it; {LEAST_SAMPLES} are needed"
                )
            means.append(np.concatenate([rate[rest].mean(axis=0), force[rest].mean(axis=0)]))
            counts.append(rest.sum())
            own = rest_noise(
                sheet, sensors[name].calibration, rate[rest], force[rest], wanted.scales
            )
            self.noise.append(with_clock(own, sensors[name].clock, (ends - end) / NANOSECONDS))
            moving = (time > self.rest_s[1]) & (time <= ends / NANOSECONDS)
            times.append(time[moving])
            readings.append(np.hstack([rate, force])[moving])
            owners.append(np.full(moving.sum(), i))
        order = np.argsort(np.concatenate(times), kind="stable")
        self.samples = ChainSamples(
            self.rest_s[1],
            np.array(means),
            np.array(counts),
            np.concatenate(times)[order],
            np.concatenate(owners)[order],
            np.concatenate(readings)[order],
        )
        if self.model is not None:
            loose = (np.full(len(names), sd) for sd in (BODY_TURN_SD, BODY_SHIFT_SD))
            self.noise = blurred(self.noise, self.samples, *loose)

    def told(self, where: str) -> list[Finding]:
        """What is to be said of an import: what was taken for its start."""
        if self.model is None:
            return []
        begin, end = self.rest_s
        assumed = [name for name, one in self.model.sensors.items() if one.preset is None]
        found = [finding("chain.start", where, from_s=begin, to_s=end)]
        if assumed:
            found.append(
                finding("chain.sheet_assumed", where, sensors=assumed, sheet=ASSUMED_SHEET)
            )
        return found

    def estimate(self, state: ChainState) -> tuple[ChainEstimate, list[Finding]]:
        """By one state of the filter, and what is to be said of it."""
        wanted, fit = self.wanted, self.placement
        sensors = self.chain if fit is None else fit.sensors
        constants = self._doubted() if fit is None else fit.constants
        settings, stated = self._settings(state), self._stated(state) is not None
        if not stated:
            settings = self._sought(sensors, settings)
            if self.model is not None and state == "kinematic":
                settings = looser_than(settings, OF_LIMBS)
        run = run_smoother if wanted.smooth else run_filter
        motion = run(sensors, settings, self.samples, constants)
        check = check_placement(motion, constants, fit is None or fit.settled)
        record = self._record(state, settings, motion, check)
        return record, [*placement_findings(record, check, fit), *_uncertain(record)]

    def _doubted(self) -> Constants:
        """To check a placement that was stated; on a body its uncertainty is that of its joints."""
        found = doubted(self.chain)
        if self.model is None:
            return found
        stated = Constants.of(
            self.chain, np.radians(self.alignment.stated_sd_deg), STATED_POSITION_SD
        )
        return replace(found, covariance=np.diag(stated.sd**2))

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
        return fit_placement(
            self.chain,
            self._settings("kinematic"),  # which holds for any motion
            self.samples.until(self.begins_s - self.samples.start + FITTED_S),
            constants,
            self._sought,
            LOOSER,
            self.model is None,
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
            self._start_sd(),
            float(np.radians(self._stated(state) or 1.0)),
            biases=wanted.biases,
            scales=wanted.scales,
            amplitude=np.minimum(AMPLITUDE_SD, reach),
            frequency=frequency,
            limits=wanted.limits,
            pose_sd=self._axes_sd() if self.model is not None else 0.0,
        )

    def _axes_sd(self) -> float:
        """How far a body's segments may be from what the pose says, about each axis [rad]."""
        return float(np.radians(self.alignment.axes_sd_deg))

    def _start_sd(self) -> float:
        """Of each joint's angle at the rest that it starts from [rad]."""
        if self.wanted.start_sd_deg is not None:
            return float(np.radians(self.wanted.start_sd_deg))
        if self.model is None:
            return float(PLANNED_SD)
        return max(np.sqrt(2) * self._axes_sd(), float(PLANNED_SD))  # of two segments

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
            "standing_deg": self.standing_deg,
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
            sd=self._with_anatomy(motion.mean[own], motion.sd[own]),
        )

    def _with_anatomy(self, mean: np.ndarray, sd: np.ndarray) -> np.ndarray:
        """With what the axes of a body add to the uncertainty of its angles, shape (n, 3, m)."""
        if self.model is None:
            return sd
        sd = sd.copy()
        variance = anatomy_variance(self.chain, mean[:, 0], self._axes_sd())
        sd[:, 0] = np.sqrt(sd[:, 0] ** 2 + variance)
        return sd


def _uncertain(estimate: ChainEstimate) -> list[Finding]:
    """That angles are known to some degrees only, by the filter's own uncertainty."""
    sd = np.degrees(np.sqrt(np.mean(estimate.sd[:, 0] ** 2, axis=0)))
    joints = [name for name, own in zip(estimate.joints, sd, strict=True) if own > UNCERTAIN_DEG]
    if not joints:
        return []
    where = f"chain, section {estimate.section}, {estimate.state}"
    return [finding("chain.uncertain", where, joints=joints, sd_deg=float(sd.max()))]
