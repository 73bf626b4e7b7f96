"""A gyroscope that warms up: its bias's drift with temperature, taken out before a method runs.

At rest raw = b + D (T - reference) + G f, linear in all; over a recording in which the part warms,
a response to force fitted without D takes the drift for itself. What is not known of D widens the
parameters that the method finds with it: the method runs again with D off by its uncertainty along
each axis, and the changes are added (JCGM 100:2008, 5.1.3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.gyroscope import AXES, BIAS_SIZE, G_SIZE, IN_RUN
from testbench.estimation.calibration.triad_model import LEAST_WARMING_K
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest
from testbench.model.statistics.least_squares import FitParameter, PoorExcitation
from testbench.model.statistics.linear import axis_by_axis, solve_linear
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit

DRIFT_SIZE = np.radians(0.3)
"""What is known of a drift beforehand [rad/s/K]: +-20 deg/s over 125 K of consumer MEMS data sheets
(PS-MPU-6000A), doubled.
"""

Function = Callable[[GyroscopeRecording], TriadCalibration]


def with_drift(function: Function) -> Function:
    """A method that finds the drift of the bias too, where the part warms by 2 K or more."""

    def run(recording: GyroscopeRecording) -> TriadCalibration:
        warm = [
            rest
            for rest in recording.rests
            if rest.temperature is not None and rest.force is not None
        ]
        means = np.array(
            [float(np.mean(rest.temperature)) for rest in warm if rest.temperature is not None]
        )
        if len(warm) < max(len(recording.rests), 2) or np.ptp(means) < LEAST_WARMING_K:
            return function(recording)
        reference = float(means.mean())
        try:
            fit = _drift(warm, means - reference)
        except PoorExcitation as error:
            found = function(recording)
            return replace(
                found,
                remarks=(*found.remarks, f"it warmed up, and its drift is not known: {error}"),
            )
        drift = fit.block("gyr_drift_")
        found = function(recording.without_drift(drift, reference))
        fits = found.fits
        for axis, sd in enumerate(fit.sd):
            again = function(recording.without_drift(drift + sd * np.eye(3)[axis], reference)).fits
            changes = [new.values - old.values for old, new in zip(found.fits, again, strict=True)]
            fits = tuple(
                replace(f, covariance=f.covariance + np.outer(d, d))
                for f, d in zip(fits, changes, strict=True)
            )
        remark = f"its bias holds at {reference:.1f} deg C; the drift was found at the rests"
        return replace(
            found,
            drift=drift,
            reference=reference,
            fits=(*fits, fit),
            remarks=(*found.remarks, remark),
        )

    return run


def _drift(rests: list[Rest], above: np.ndarray) -> Fit:
    """Drift of each axis, fitted with bias and response to force, of which nothing is kept.

    Args:
        rests: With their force, m of them.
        above: Mean temperature of each above the reference, shape (m,) [K].
    """
    # raw = b + D (T - reference) + G f, axis by axis
    means = np.array([rest.gyr.mean(axis=0) for rest in rests])
    force = np.array([rest.force for rest in rests])
    sizes = {"bias": BIAS_SIZE, "drift": DRIFT_SIZE} | {f"g_{a}": G_SIZE for a in AXES}
    parameters = [
        FitParameter(f"gyr_{kind}_{axis}", "", 0.0, float(size))
        for axis in AXES
        for kind, size in sizes.items()
    ]
    design = axis_by_axis(np.column_stack([np.ones(len(rests)), above, force]), 3)
    whole = solve_linear(
        design, means.reshape(-1), parameters, residual_unit="rad/s", advice="more rests are needed"
    )
    kept = [i for i, name in enumerate(whole.names) if name.startswith("gyr_drift_")]
    # in-run bias that happens to go with the temperature
    along = IN_RUN / float(np.sqrt(np.mean(above**2)))
    return replace(
        whole,
        names=tuple(whole.names[i] for i in kept),
        units=("rad/s/K",) * 3,
        values=whole.values[kept],
        covariance=whole.covariance[np.ix_(kept, kept)] + along**2 * np.eye(3),
    )
