"""What the arm's own joints and links add to the uncertainty of a calibration by the arm.

Zeros of joints and twists of links are known to what the robot file states, and their errors last
all session: all poses share them. The calibration is made anew with each of them off by its
standard uncertainty, u_j; the change d_j of the parameters adds d_j d_j' to their covariance
(JCGM 100:2008, 5.1.3 and 5.1.4 with a numeric derivative). Methods that take them for further
unknowns (`Method.counts_shared`) hold that part already.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.estimation.calibration.methods import METHODS
from testbench.estimation.calibration.prepared import Prepared
from testbench.estimation.calibration.shared_frame import in_believed_axes
from testbench.estimation.calibration.temperature import with_drift
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
from testbench.records.results.calibration import TriadCalibration


def with_arm_uncertainty(
    prepared: Prepared,
    triads: dict[str, TriadCalibration],
    field: np.ndarray | None,
) -> tuple[dict[str, TriadCalibration], list[str], list[np.ndarray]]:
    """The triads with the joints' part in their covariances, a remark on its size, and what each
    zero changes of the gyroscope's residuals.

    Args:
        prepared: The recording, with a truth for each joint.
        triads: As the methods gave them.
        field: Of the earth in the world, shape (3,) [uT], as for `calibrate`.
    """
    # Longer than a screen: one loop over the joints gathers covariances, residuals and the turn.
    accelerometer = triads.get("accelerometer")
    by_arm = accelerometer is not None and in_believed_axes(accelerometer)
    concerned = {
        name: found
        for name, found in triads.items()
        # turns of a stated angle about the sensor's own faces: the arm has no part in them
        if (by_arm or in_believed_axes(found)) and "turn_angle" not in METHODS[found.method].asks
    }
    truths = prepared.shifted
    if not concerned or not truths:
        return triads, [], []
    added = {
        name: [np.zeros_like(fit.covariance) for fit in found.fits]
        for name, found in concerned.items()
    }
    turned, left = 0.0, []
    for truth in truths:
        moved = replace(prepared, truth=truth)
        try:
            again = _again(moved, triads, concerned, field)
        except PoorExcitation:
            continue
        for name, found in concerned.items():
            if METHODS[found.method].counts_shared:
                continue  # its covariance holds them
            for total, old, new in zip(added[name], found.fits, again[name].fits, strict=True):
                # JCGM 100:2008, 5.1.3 with a numeric derivative
                total += np.outer(new.values - old.values, new.values - old.values)
        if "gyroscope" in concerned:
            left.append(residual_change(concerned["gyroscope"], again["gyroscope"]))
        name = next(iter(concerned))
        nearest = [rotation.nearest_rotation(which[name].matrix) for which in (concerned, again)]
        turned += float(rotation.angle(rotation.from_matrix(nearest[0].T @ nearest[1]))) ** 2
    result = dict(triads)
    for name, found in concerned.items():
        fits = tuple(
            replace(fit, covariance=fit.covariance + more)
            for fit, more in zip(found.fits, added[name], strict=True)
        )
        result[name] = replace(found, fits=fits)
    angle = np.degrees(np.sqrt(turned))
    remark = (
        "the uncertainties hold those of the arm's joints and links as the robot file states them, "
        "which all poses share; they turn the "
        f"{next(iter(concerned))}'s axes by {angle:.3f} deg (standard uncertainty)"
    )
    return result, [remark], left


def residual_change(found: TriadCalibration, again: TriadCalibration) -> np.ndarray:
    """What the residuals of a triad's first fit change by, shape (n,) [as these]."""
    return np.asarray(again.fits[0].residuals - found.fits[0].residuals)


def _again(
    moved: Prepared,
    triads: dict[str, TriadCalibration],
    concerned: dict[str, TriadCalibration],
    field: np.ndarray | None,
) -> dict[str, TriadCalibration]:
    """The same methods on another truth."""
    found: dict[str, TriadCalibration] = {}
    accelerometer = triads.get("accelerometer")
    if "accelerometer" in concerned and accelerometer is not None:
        accelerometer = METHODS[accelerometer.method].function(moved.poses)
        found["accelerometer"] = accelerometer
    if "gyroscope" in concerned:
        method = METHODS[triads["gyroscope"].method]
        found["gyroscope"] = with_drift(method.function)(moved.gyroscope_recording(accelerometer))
    if "magnetometer" in concerned:
        method = METHODS[triads["magnetometer"].method]
        found["magnetometer"] = method.function(moved.magnetometer_poses(accelerometer, field))
    return found
