"""A gyroscope that warms up without a thermometer: its bias at rest drifts through the recording.

At rest raw = b + G f + d w(t), linear in all, with w the warming of `lack_of_fit`. Where the rests
ask for d, it is taken out of rests and turns before a method runs; what is not known of it widens
what the method finds, as in `warming`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.calibration.gyroscope import AXES, BIAS_SIZE, G_SIZE, IN_RUN, read_rests
from testbench.estimation.calibration.lack_of_fit import (
    FoundTerm,
    sure_trend,
    told_sizes,
    trend_at,
    warming_words,
    with_bias,
)
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.temperature import Function
from testbench.estimation.calibration.triad_model import LEAST_WARMING_K
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest, Turn
from testbench.exceptions import InputError
from testbench.model.statistics.least_squares import FitParameter, PoorExcitation
from testbench.model.statistics.linear import axis_by_axis, solve_linear
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence


@dataclass(frozen=True)
class BiasTrend:
    """How a bias drifts through a recording.

    Attributes:
        rests: That it was found in, as poses [rad/s].
        term: What was found.
    """

    rests: StaticPoses
    term: FoundTerm

    def at(self, times: np.ndarray) -> np.ndarray:
        """What it adds, shape (n, 3) [rad/s].

        Args:
            times: On the clock of the recording, shape (n,) [s].
        """
        return trend_at(self.term, times, self.rests)

    def less(self, recording: GyroscopeRecording, size: np.ndarray) -> GyroscopeRecording:
        """The recording with less of it.

        Args:
            recording: Whose parts all know their times.
            size: By how much, shape (3,) [rad/s].
        """
        term = replace(self.term, size=size)

        def gyr(part: Rest | Turn) -> np.ndarray:
            assert part.time is not None
            return np.asarray(part.gyr - trend_at(term, part.time, self.rests))

        return GyroscopeRecording(
            [replace(rest, gyr=gyr(rest)) for rest in recording.rests],
            [replace(turn, gyr=gyr(turn)) for turn in recording.turns],
        )

    def told(self) -> Finding:
        """What is said of it."""
        sizes = told_sizes(np.degrees(self.term.size), np.degrees(self.term.sd))
        how = warming_words(self.term.term.time_constant)
        return finding("calibration.gyroscope_trend", "gyroscope", change=sizes, how=how)


def bias_trend(recording: GyroscopeRecording) -> BiasTrend | None:
    """The drift of a gyroscope's bias at its rests; None where there is none, or a thermometer saw
    it warm.
    """
    rests = [rest for rest in recording.rests if rest.force is not None and rest.time is not None]
    parts: list[Rest | Turn] = [*recording.rests, *recording.turns]
    if len(rests) < len(recording.rests) or any(part.time is None for part in parts):
        return None
    seen = [float(np.nanmean(rest.temperature)) for rest in rests if rest.temperature is not None]
    if seen and np.ptp(seen) >= LEAST_WARMING_K:
        return None
    try:
        noise = read_rests(rests).noise
        poses = StaticPoses(
            np.array([rest.gyr.mean(axis=0) for rest in rests]),
            np.array([[noise**2 / len(rest.gyr) + IN_RUN**2] * 3 for rest in rests]),
            start=np.array([rest.time[0] for rest in rests if rest.time is not None]),
            end=np.array([rest.time[-1] for rest in rests if rest.time is not None]),
        )
        evidence = _evidence(poses, np.array([rest.force for rest in rests]))
    except (InputError, PoorExcitation):
        return None
    term = sure_trend(evidence, poses, float(IN_RUN))
    return None if term is None else BiasTrend(poses, term)


def _evidence(rests: StaticPoses, force: np.ndarray) -> Evidence:
    """What bias and response to force leave of the rests.

    Args:
        rests: m of them.
        force: Shape (m, 3) [m/s^2].
    """
    sizes = {"bias": BIAS_SIZE} | {f"g_{axis}": G_SIZE for axis in AXES}
    parameters = [
        FitParameter(f"gyr_{kind}_{axis}", "", 0.0, float(size))
        for axis in AXES
        for kind, size in sizes.items()
    ]
    inverse = 1 / np.sqrt(rests.variance)
    design = axis_by_axis(np.column_stack([np.ones(len(rests)), force]), 3)
    rows = design * inverse.reshape(-1, 1)
    fit = solve_linear(rows, (rests.mean * inverse).reshape(-1), parameters, known_scatter=True)
    return Evidence(fit.residuals, rows, np.eye(3) * inverse[:, :, None])


def widened_by_trend(
    found: TriadCalibration, recording: GyroscopeRecording, trend: BiasTrend, function: Function
) -> TriadCalibration:
    """A gyroscope with what is not known of a trend that was taken out, and of which state of it a
    later session finds.

    Args:
        found: By the recording.
        recording: Without the trend.
        trend: That was taken out.
        function: The method.
    """
    fits = found.fits
    for axis, sd in enumerate(trend.term.sd):
        again = function(trend.less(recording, sd * np.eye(3)[axis])).fits
        changes = [new.values - old.values for old, new in zip(found.fits, again, strict=True)]
        fits = tuple(
            replace(fit, covariance=fit.covariance + np.outer(change, change))
            for fit, change in zip(fits, changes, strict=True)
        )
    spread = np.abs(trend.term.size) * float(trend.term.term.shape[:, 0].std())
    return replace(found, fits=tuple(with_bias(fit, spread) for fit in fits))
