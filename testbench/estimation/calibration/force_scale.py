"""What the scale of an accelerometer rests on: gravity as it is taken, and the force of 1 g.

Both are the same in all poses, so that no residual shows them: they are lines of the uncertainty.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.lack_of_fit import Calibrate, with_shift
from testbench.estimation.calibration.poses import SETTLING_M_S2, StaticPoses
from testbench.frames import STANDARD_GRAVITY
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.calibration import TriadCalibration
from testbench.records.specs.sensor import TriadParameters

UNSTATED_SD = 0.026 / np.sqrt(3)
"""Standard uncertainty of gravity where nobody states it [m/s^2]: normal gravity goes from 9.780 at
the equator to 9.832 at the poles (WGS 84, NIMA TR8350.2, 2000, eq. 4-1), rectangular (JCGM
100:2008, 4.3.7)."""
STATED_SD = 1e-3
"""Where a robot file states it [m/s^2]: a formula of latitude and height leaves out anomalies of
the order of 100 mGal (NIMA TR8350.2, 2000, section 4)."""


def gravity_sd(gravity: np.ndarray, simulated: bool) -> float:
    """Standard uncertainty of gravity's length [m/s^2]; 0 of what a sensor was simulated with.

    Args:
        gravity: In the world as it is taken, shape (3,) [m/s^2].
        simulated: Whether the sensor was.
    """
    if simulated:
        return 0.0
    size = float(np.linalg.norm(gravity))
    return STATED_SD if abs(size - STANDARD_GRAVITY) > 1e-6 else float(UNSTATED_SD)


def sheet_nonlinearity(sheet: TriadParameters | None) -> float | None:
    """What the data sheet's nonlinearity adds to 1 g, as a share of it; None without a sheet.

    Stated as a share of full scale, it is taken for a term of the third power, as large as stated
    at full scale.
    """
    if sheet is None:
        return None
    return float(sheet.nonlinearity * (STANDARD_GRAVITY / sheet.range) ** 2)


def sheet_settling(sheet: TriadParameters | None) -> float:
    """How far the bias of a rest is from that of others [m/s^2]: the in-run bias of the data sheet,
    and what is usual where it has none or less.
    """
    return SETTLING_M_S2 if sheet is None else max(SETTLING_M_S2, float(sheet.bias_instability))


def with_force_scale(
    found: TriadCalibration,
    poses: StaticPoses,
    calibrate: Calibrate,
    gravity_sd: float,
    nonlinearity: float | None,
) -> tuple[TriadCalibration, list[Finding]]:
    """The calibration with both in its covariance, and what is said of them.

    Args:
        found: By these poses.
        poses: The rests.
        calibrate: The method.
        gravity_sd: Standard uncertainty of gravity [m/s^2].
        nonlinearity: What it may add at 1 g, as a share of it, a standard deviation [1]; None
            where nobody says.
    """
    fits, g = found.fits, poses.magnitude
    share = gravity_sd / g
    if gravity_sd > 0:
        stronger = replace(
            poses,
            magnitude=g + gravity_sd,
            expected=None if poses.expected is None else poses.expected * (1 + share),
        )
        changes = [
            new.values - old.values
            for old, new in zip(found.fits, calibrate(stronger).fits, strict=True)
        ]
        fits = tuple(
            replace(fit, covariance=fit.covariance + np.outer(change, change))
            for fit, change in zip(fits, changes, strict=True)
        )
        told = finding(
            "calibration.gravity",
            "accelerometer",
            gravity_m_s2=g,
            sd_mm_s2=1e3 * gravity_sd,
            percent=100 * share,
        )
    else:
        told = finding("calibration.gravity_simulated", "accelerometer", gravity_m_s2=g)
    if nonlinearity is None:
        return replace(found, fits=fits), [finding("calibration.at_one_g", "accelerometer"), told]
    cube = ((poses.mean - found.bias) / g) ** 3 * g * nonlinearity
    for axis in range(3):
        fits = with_shift(fits, found, poses, cube * np.eye(3)[axis], calibrate)
    stated = finding("calibration.sheet", "accelerometer", percent=100 * nonlinearity)
    return replace(found, fits=fits), [stated, told]
