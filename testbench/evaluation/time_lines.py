"""Lines of the budget that come from time: when the samples of a sensor were really taken, and when
the arm was where it said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.evaluation.arm_time import UNSURE_S
from testbench.evaluation.uncertainty import Stated
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import ClockFit, Estimate
from testbench.records.results.uncertainty import UncertaintySource
from testbench.records.session.manifest import SensorRecord
from testbench.records.session.session import Session

STILL_DEG = 0.1
"""Where a sensor makes the truth move by less than this while it is judged, an unknown time does no
more harm [deg]; the noise of an arm that stands still is a tenth of it.
"""

NYQUIST_DELAY = 1 / np.pi
"""Delay of a low pass of first order that leaves half the sampling rate, 1 / (2 pi B) at B = f / 2
[1 / f]. Who samples at f wants no narrower one, so that an unknown one delays by at most this; with
all delays up to it alike, the root mean square is that of a rectangle of this half-width.
"""


@dataclass(frozen=True)
class JudgedMotion:
    """How a true angle moves where it is judged.

    Attributes:
        mean_rate: Mean of the signed rate [deg/s].
        rms_rate: Root mean square of the rate [deg/s].
        swing: Largest less smallest angle within one step, of the step where that is most [deg].
    """

    mean_rate: float
    rms_rate: float
    swing: float


@dataclass(frozen=True)
class TimeDoubt:
    """What is not known of a session's times beside the fits of its clocks; half-widths.

    Attributes:
        gyroscope_s: By how much the group delay of each sensor's gyroscope may be off [s]. A clock
            is fitted to angular rates, so that their delay is taken for a part of its offset.
        unknown: Sensors of which nobody states it, so that it is half an interval by itself.
        filtered: Sensors of which it is said when they sample, and not what low pass lies before.
        arm_s: By how much the arm's own times were found to be doubtful within the session [s]; 0
            where they were not. A lasting offset is in the clocks, which are fitted to its motion.
    """

    gyroscope_s: dict[str, float]
    unknown: tuple[str, ...]
    filtered: tuple[str, ...]
    arm_s: float

    @staticmethod
    def of(session: Session, estimate: Estimate) -> TimeDoubt:
        """Of a session.

        Args:
            session: The recording.
            estimate: With the fits of its clocks.
        """
        gyroscope, unknown, filtered = {}, [], []
        for name, sensor in estimate.sensors.items():
            described = session.manifest.sensors.get(name)
            if sensor.clock.method != "angular_rate" or described is None:
                continue
            gyroscope[name] = 0.0
            interval = _interval(sensor.host_time_ns) / sensor.every
            if _lacks_its_low_pass(described):
                gyroscope[name] = interval * NYQUIST_DELAY
                filtered.append(name)
            elif described.rate_delay_s is None:
                gyroscope[name] = interval / 2
                unknown.append(name)
        return TimeDoubt(gyroscope, tuple(unknown), tuple(filtered), _arm_doubt(session))

    def notes(self, sensors: list[str]) -> list[str]:
        """What was assumed of some sensors.

        Args:
            sensors: Their names.
        """
        return [
            f"the group delay of the gyroscope of '{name}' is not stated: half an interval "
            f"({1e3 * self.gyroscope_s[name]:.3g} ms) is taken, and may be off by as much"
            for name in sensors
            if name in self.unknown
        ] + [
            f"when a rate of '{name}' was sampled is stated, not the delay of a low pass before "
            "that: none is taken off, and one that leaves half the rate delays by "
            f"{1e3 * self.gyroscope_s[name]:.3g} ms"
            for name in sensors
            if name in self.filtered
        ]

    def findings(self, sensor: str) -> list[Finding]:
        """What must be known of a sensor's time.

        Args:
            sensor: Its name.
        """
        half_ms = 1e3 * self.gyroscope_s.get(sensor, 0.0)
        if sensor in self.filtered:
            return [finding("judged.low_pass_unstated", sensor, half_ms=half_ms)]
        if sensor not in self.unknown:
            return []
        return [finding("judged.delay_unstated", sensor, half_ms=half_ms)]

    def sd(self, estimate: Estimate, sensor: str) -> float:
        """Standard uncertainty of a sensor's time [s]: of its clock, and of its gyroscope's delay.

        Args:
            estimate: With the fits of the clocks.
            sensor: Its name.
        """
        clock = float(np.nan_to_num(estimate.sensors[sensor].clock.offset_sd_s))
        return float(np.hypot(clock, self.gyroscope_s.get(sensor, 0.0) / np.sqrt(3.0)))


def _lacks_its_low_pass(described: SensorRecord) -> bool:
    """Whether the delay that is taken is that of an import's sampling alone.

    Args:
        described: What is known of the sensor.
    """
    if described.driver != "imported" or described.sampling is None:
        return False
    taken, rate = described.rate_delay_s, described.rate_hz
    if described.sampling == "instantaneous":
        return taken is None
    # `sampling: integrated` puts half an interval there, unless the delay itself is stated
    return taken is not None and rate is not None and bool(np.isclose(taken, 0.5 / rate))


def _interval(time_ns: np.ndarray) -> float:
    """Median interval [s]; 0 without two samples."""
    return median_interval(time_ns) / NANOSECONDS if len(time_ns) > 1 else 0.0


def _arm_doubt(session: Session) -> float:
    """The largest doubt that the driver told of [s]."""
    unsure = session.manifest.arm.timing.clock_unsure_s
    arm = session.manifest.arm.record
    if session.robot is None or arm is None or arm.simulated:
        return 0.0
    told = [
        event.details.get({"arm_time_step": "by_s", "arm_time_doubtful": "lead_s"}[event.event])
        for event in session.events
        if event.event in ("arm_time_step", "arm_time_doubtful")
    ]
    doubts = [abs(value) for value in told if isinstance(value, int | float)]
    return max([*doubts, unsure if unsure > UNSURE_S else 0.0])


def clock_source(sensor: str, clock: ClockFit, motion: JudgedMotion) -> UncertaintySource | None:
    """What a sensor's time contributes to the uncertainty of the truth.

    It is the time's uncertainty times the rate at which the sensor's own motion moves the true
    angle. A time that could not be fitted shifts an angle by no more than that angle changes while
    it is judged.

    Args:
        sensor: Its name.
        clock: The fit.
        motion: Of that part of the true angle which the sensor makes.

    Returns:
        None where the time is unknown and the sensor moves the truth.
    """
    name = f"clock alignment, {sensor}"
    if np.isfinite(clock.offset_sd_s):
        return Stated(
            name,
            "A",
            1e3 * clock.offset_sd_s,
            "ms",
            "the clock's fit; the sensitivity is the true angular rate that this sensor makes "
            "while it is evaluated",
        ).source(abs(motion.mean_rate) * 1e-3, motion.rms_rate * 1e-3)
    if clock.method == "none":
        rates = motion.mean_rate * 1e-3, motion.rms_rate * 1e-3
        return Stated(name, "B", 0.0, "ms", "taken to be on the host's clock").source(*rates)
    if not motion.swing <= STILL_DEG:
        return None
    return Stated(
        name,
        "A",
        motion.swing / 2,
        "deg",
        "not known, but the sensor stands still while it is evaluated: half of what it moves by",
        distribution="rectangular",
    ).source(1.0, 1.0)


def group_delay_source(
    sensor: str, doubt: TimeDoubt, motion: JudgedMotion
) -> UncertaintySource | None:
    """What the delay of a sensor's gyroscope contributes, which its clock was fitted through.

    Args:
        sensor: Its name.
        doubt: About the session's times.
        motion: Of that part of the true angle which the sensor makes.

    Returns:
        None where the clock was not fitted to its rates.
    """
    if sensor not in doubt.gyroscope_s:
        return None
    why = "the manifest states the delay (rate_delay_s)"
    if sensor in doubt.filtered:
        why = "the low pass before the sampling is not stated: at most that of half the rate"
    if sensor in doubt.unknown:
        why = "nobody states the delay (rate_delay_s): half an interval, give or take as much"
    return Stated(
        f"group delay of the gyroscope, {sensor}",
        "B",
        1e3 * doubt.gyroscope_s[sensor],
        "ms",
        why,
        distribution="rectangular",
    ).source(abs(motion.mean_rate) * 1e-3, motion.rms_rate * 1e-3)


def arm_time_source(doubt: TimeDoubt, motion: JudgedMotion) -> UncertaintySource | None:
    """What the arm's own times contribute.

    Args:
        doubt: About the session's times.
        motion: Of the whole true angle.

    Returns:
        None where they were never doubtful.
    """
    if doubt.arm_s <= 0:
        return None
    return Stated(
        "time of the arm",
        "B",
        1e3 * doubt.arm_s,
        "ms",
        "the largest step or lead of the controller's clock that the driver told of, or how late "
        "its samples came",
        distribution="rectangular",
    ).source(abs(motion.mean_rate) * 1e-3, motion.rms_rate * 1e-3)
