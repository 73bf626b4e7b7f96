"""Triads that are examined after they were calibrated: what their model lacks is said, and counts
in their uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, chdtri

from testbench.estimation.calibration.arm_uncertainty import residual_change
from testbench.estimation.calibration.attitude_aided import attitude_aided, sharpened
from testbench.estimation.calibration.force_scale import with_force_scale
from testbench.estimation.calibration.lack_of_fit import (
    NOT_ONE_FIELD,
    SURPRISING,
    Calibrate,
    LackOfFit,
    all_terms,
    findings_of,
    lack_of_fit,
    trend_at,
    trend_of,
    widened,
)
from testbench.estimation.calibration.methods import Method
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import SETTLING_UT, StaticPoses
from testbench.estimation.calibration.prepared import Prepared
from testbench.estimation.calibration.temperature import Function
from testbench.estimation.calibration.turns import GyroscopeRecording
from testbench.frames import NANOSECONDS
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.model.statistics.linear import SURPRISING as BIRGE_BEYOND
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.fit import Fit
from testbench.records.specs.sensor import ImuParameters

BIRGE_FROM = 1 - BIRGE_BEYOND
"""Chance of residuals from which on Birge's ratio widens."""
LEAST_RATIO = 1.2
"""Residuals of a gyroscope below so many times its noise are not remarked, however sure its
hundreds of chunks make them: Birge's ratio holds them, and is no more."""


@dataclass(frozen=True)
class AtRest:
    """What the rests of an accelerometer were found to be.

    Attributes:
        prepared: The recording, without the trend that was found.
        findings: What is said of it.
    """

    prepared: Prepared
    findings: list[Finding]


def examined_accelerometer(
    calibrate: Calibrate, prepared: Prepared
) -> tuple[TriadCalibration, AtRest]:
    """An accelerometer, with what its model lacks in its covariance.

    Args:
        calibrate: The method.
        prepared: The recording.

    Raises:
        PoorExcitation: The poses do not determine a parameter.
        InputError: The method does not fit the recording.
    """
    poses, said = prepared.poses, []
    found = calibrate(poses)
    lack = _lack(found, poses, prepared.settling)
    if lack is not None:
        trend = trend_of(lack)
        if trend is not None:
            at = prepared.time_ns / NANOSECONDS
            prepared = prepared.without_trend("acc", trend_at(trend, at, poses))
            poses = prepared.poses
            found = calibrate(poses)
        found = widened(found, lack, poses, calibrate)
        said = findings_of(lack, "accelerometer")
    bent = lack is not None and any(own.term.kind == "cubic" for own in lack.terms)
    found, scale = with_force_scale(
        found, poses, calibrate, prepared.gravity_sd, None if bent else prepared.nonlinearity
    )
    return found, AtRest(prepared, [*said, *scale])


def _lack(found: TriadCalibration, poses: StaticPoses, settling: float) -> LackOfFit | None:
    """What the linear model of the readings lacks, by the method or by one that says how much noise
    there is.
    """
    if found.evidence is None:
        try:
            found = norm_only(poses) if poses.expected is None else attitude_aided(poses)
        except PoorExcitation:
            return None
    sharp = None
    if poses.expected is not None and found.evidence is not None:
        sharp = sharpened(poses, all_terms(found, poses, "accelerometer"))
    return lack_of_fit(found, poses, "accelerometer", settling, sharp)


def examined_magnetometer(
    method: Method, poses: StaticPoses, named: bool
) -> tuple[TriadCalibration | None, list[Finding]]:
    """A magnetometer, with what its model lacks in its covariance; None where it is refused.

    Residuals of a field that is not the same everywhere are not drawn anew in each pose: they may
    all push a parameter the same way. By Cauchy and Schwarz none is then off by more than its
    standard uncertainty times the root of chi-square, which takes the place of Birge's ratio.

    Args:
        method: Which.
        poses: The rests.
        named: Whether it was asked for by its name; else it is refused where the field is not one.

    Raises:
        PoorExcitation: The poses do not determine a parameter.
        InputError: The method does not fit the recording.
    """
    found = method.function(poses)
    lack = lack_of_fit(found, poses, "magnetometer", SETTLING_UT)
    if lack is None or found.evidence is None:
        return found, []
    whole = LackOfFit((), found.evidence)
    if whole.unexplained and whole.ratio > NOT_ONE_FIELD:
        if not named:
            told = finding(
                "calibration.field_refused", "magnetometer", method=method.name, ratio=whole.ratio
            )
            return None, [told]
        lack = whole
    found = widened(found, lack, poses, method.function)
    if lack.unexplained:
        dof = lack.left.dof  # the covariance holds chi-square over these already
        found = replace(
            found,
            fits=tuple(replace(fit, covariance=fit.covariance * dof) for fit in found.fits),
        )
    return found, findings_of(lack, "magnetometer")


def gyroscope_cubic(sheet: ImuParameters | None) -> float:
    """What the data sheet's nonlinearity is as a factor of the third power of a rate
    [1/(rad/s)^2]; 0 without a sheet.
    """
    if sheet is None:
        return 0.0
    triad = sheet.gyroscope.triad()
    return float(triad.nonlinearity / triad.range**2)


def with_rate_nonlinearity(
    found: TriadCalibration,
    recording: GyroscopeRecording,
    cubic: float,
    function: Function,
) -> tuple[TriadCalibration, list[np.ndarray]]:
    """The gyroscope with its data sheet's nonlinearity in the covariance, and what that changes of
    its residuals, axis by axis.

    Args:
        found: By this recording.
        recording: Rests and turns.
        cubic: As `gyroscope_cubic` gives it [1/(rad/s)^2].
        function: The method that found it.
    """
    if not cubic:
        return found, []
    fits, left = found.fits, []
    for axis in range(3):
        again = function(recording.without_cubic(axis, cubic))
        changes = [new.values - old.values for old, new in zip(found.fits, again.fits, strict=True)]
        fits = tuple(
            replace(fit, covariance=fit.covariance + np.outer(change, change))
            for fit, change in zip(fits, changes, strict=True)
        )
        left.append(residual_change(found, again))
    return replace(found, fits=fits), left


def examined_gyroscope(
    found: TriadCalibration, bare: Fit, known: list[np.ndarray]
) -> tuple[TriadCalibration, list[Finding]]:
    """A gyroscope whose noise is known, its covariance no wider than its residuals ask, and what
    is said of these.

    Errors of known size, such as the zeros of the arm's joints, may be in the residuals, and are in
    the covariance already: Birge's ratio is that of the residuals with the likeliest sizes of these
    (generalised least squares).

    Args:
        found: The gyroscope, what such errors do to its parameters in its covariance.
        bare: Its fit without that, widened by all of its residuals.
        known: What each such error changes of the residuals, off by its standard uncertainty, shape
            (n,) each.
    """
    if bare.residual_unit != "standard deviations":
        return found, []
    left = bare.residuals
    all_squares, dof = float(left @ left), left.size - len(bare.names)
    squares = all_squares
    if known:
        changes = np.column_stack(known)
        inner = np.eye(len(known)) + changes.T @ changes
        squares -= float(left @ changes @ np.linalg.solve(inner, changes.T @ left))
    if dof < 1:
        return found, []
    surprising = squares > chdtri(dof, BIRGE_FROM)
    if np.isfinite(bare.dof) and found.reference is None:
        share = (squares / dof if surprising else 1.0) / (all_squares / dof)
        fit = found.fits[0]
        narrowed = replace(
            fit,
            covariance=fit.covariance - (1 - share) * bare.covariance,
            dof=bare.dof if surprising else float("inf"),
        )
        found = replace(found, fits=(narrowed, *found.fits[1:]))
    ratio = float(np.sqrt(squares / dof))
    if ratio < LEAST_RATIO or chdtrc(dof, squares) >= SURPRISING:
        return found, []
    return found, [finding("calibration.gyroscope", "gyroscope", ratio=ratio, dof=dof)]
