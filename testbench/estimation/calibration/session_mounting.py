"""How a sensor really sits against its mounting as believed, from a session: by rates, by
orientations, or by a hinge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from testbench.estimation.alignment.axes import true_rates
from testbench.estimation.alignment.vector_mounting import mounting_from_vectors
from testbench.estimation.calibration.hinge_axis import axis_of_turn
from testbench.estimation.calibration.prepared import Prepared
from testbench.estimation.calibration.sensor_to_segment import (
    SegmentMounting,
    from_arm_kinematics,
    from_directions,
)
from testbench.estimation.filters import get_filter
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.results.calibration import MountingCalibration, TriadCalibration
from testbench.records.results.calibration_file import SensorCalibration
from testbench.records.results.fit import Fit
from testbench.records.session.plan import PlannedStep

GRAVITY_SD = np.radians(0.1)
"""Of gravity's direction in a rest, by a calibrated accelerometer and the arm [rad]."""
NAMES = ("rotation_x", "rotation_y", "rotation_z")


def find_mounting(
    name: str,
    function: Callable[[Prepared, np.ndarray, list[PlannedStep]], MountingCalibration],
    prepared: Prepared,
    calibration: SensorCalibration,
    sweeps: list[PlannedStep],
) -> MountingCalibration:
    """The mounting that is left once the triads are corrected.

    Args:
        name: Of the method.
        function: The method: from the recording with corrected triads, which of its samples are at
            rest, shape (n,), and the sweeps.
        prepared: The recording.
        calibration: Of the triads.
        sweeps: Of the session, for a hinge.

    Raises:
        InputError: Nobody knows how the sensor moved.
        PoorExcitation: The motion does not determine the mounting.
    """
    if prepared.truth is None:
        raise InputError(
            f"the method {name} compares the sensor with the arm; this recording has no truth"
        )
    samples = prepared.samples
    gyr, acc, mag = calibration.apply(samples.gyr, samples.acc, samples.mag, prepared.temperatures)
    rest = np.zeros(len(gyr), bool)
    for begin, end in prepared.rests:
        rest[begin:end] = True
    if "gyroscope" not in calibration.triads:
        gyr = gyr - gyr[rest].mean(axis=0)
    corrected = replace(prepared, samples=replace(samples, gyr=gyr, acc=acc, mag=mag))
    found = function(corrected, rest, sweeps)
    sd = [
        axes_sd(calibration.triads[triad])
        for triad in ("accelerometer", "gyroscope")
        if triad in calibration.triads
    ]
    if not sd:
        return found
    covariance = found.fit.covariance + np.eye(3) * float(np.sum(np.square(sd)))
    return replace(found, fit=replace(found.fit, covariance=covariance))


def axes_sd(triad: TriadCalibration) -> float:
    """How far the corrected axes of a triad may be turned as a whole, by its fit [rad].

    Two entries across the diagonal, m_ij and m_ji, turn the axes by half their difference; the RMS
    of what such entries are known to is taken for either, and roughly for the turn about each axis,
    as they need not be independent.
    """
    across = [
        variance
        for fit in triad.fits
        for name, variance in zip(fit.names, np.diag(fit.covariance), strict=True)
        if _across(name)
    ]
    return float(np.sqrt(np.mean(across))) if across else 0.0


def _across(name: str) -> bool:
    kind, _, entry = name.removeprefix("gyr_").partition("_")
    return kind == "misalignment" or (kind in {"response", "map"} and entry[0] != entry[1])


def by_rates(
    prepared: Prepared, rest: np.ndarray, sweeps: list[PlannedStep]
) -> MountingCalibration:
    """The turn that brings the sensor's rates and gravity nearest to the arm's.

    Args:
        prepared: The recording, its triads corrected.
        rest: Whether each sample of the grid is at rest, shape (n,), bool.
        sweeps: Sweeps of the session; not looked at.
    """
    assert prepared.truth is not None
    samples, seconds = prepared.samples, prepared.samples.interval
    rate, sound = true_rates(
        prepared.truth, prepared.time_ns - round(prepared.rate_delay * NANOSECONDS)
    )
    moving = sound & ~rest
    q = truth_at(prepared.truth, prepared.time_ns)
    still = rest & np.isfinite(q[:, 0])
    force = rotation.rotate(rotation.conjugate(q[still]), -prepared.gravity)
    found = mounting_from_vectors(
        [
            (rate[moving], samples.gyr[moving], max(moving.sum() * seconds, 1.0)),
            (force, samples.acc[still], float(len(prepared.rests))),  # a rest says one thing
        ]
    )
    if not found.trusted:
        raise InputError(f"mounting_rates: {found.warning()}")
    warning = found.warning()
    vector = rotation.to_rotation_vector(found.q_body_from_sensor)
    fit = Fit(NAMES, ("rad",) * 3, vector, np.diag(found.sd**2), condition=1 / found.observability)
    return MountingCalibration(
        "mounting_rates",
        rotation.to_matrix(found.q_body_from_sensor),
        fit,
        (warning,) if warning else (),
    )


def by_orientations(
    prepared: Prepared, rest: np.ndarray, sweeps: list[PlannedStep]
) -> MountingCalibration:
    """The turn between the orientations of a filter and the arm's.

    Args:
        prepared: The recording, its triads corrected.
        rest: Whether each sample of the grid is at rest, shape (n,), bool.
        sweeps: Sweeps of the session; not looked at.
    """
    assert prepared.truth is not None
    q_true = truth_at(prepared.truth, prepared.time_ns)
    q = get_filter("vqf_6d").run(prepared.samples)
    known = np.isfinite(q_true[:, 0])
    seconds = float(known.sum()) * prepared.samples.interval
    found = from_arm_kinematics(q_true[known], q[known], max(seconds, 3.0))
    return _calibration("mounting_orientations", found)


def by_hinge(
    prepared: Prepared, rest: np.ndarray, sweeps: list[PlannedStep]
) -> MountingCalibration:
    """Gravity at rest, and the axis of the sweep that turned most.

    Args:
        prepared: The recording, its triads corrected.
        rest: Whether each sample of the grid is at rest, shape (n,), bool.
        sweeps: Sweeps of the session.
    """
    assert prepared.truth is not None
    time = prepared.time_ns
    rate, sound = true_rates(prepared.truth, time - round(prepared.rate_delay * NANOSECONDS))
    best: tuple[float, np.ndarray] | None = None
    for step in sweeps:
        within = (time >= step.start_ns) & (time <= step.settled_ns) & sound
        power = float(np.sum(rate[within] ** 2))
        if within.sum() > 10 and (best is None or power > best[0]):
            best = power, within
    if best is None:
        raise InputError("mounting_hinge needs a sweep of one joint; the session has none")
    moving = best[1]
    seconds = max(float(moving.sum()) * prepared.samples.interval, 2.0)
    own, arms = (
        axis_of_turn(prepared.samples.gyr[moving], seconds),
        axis_of_turn(rate[moving], seconds),
    )
    same = float(np.sum(prepared.samples.gyr[moving] @ own.values * (rate[moving] @ arms.values)))
    axis = own.values * np.sign(same)
    q = truth_at(prepared.truth, time[prepared.rests.mean(axis=1).astype(int)])
    known = np.isfinite(q[:, 0])
    up = rotation.rotate(rotation.conjugate(q[known]), -prepared.gravity)
    felt = np.array(
        [prepared.samples.acc[begin:end].mean(axis=0) for begin, end in prepared.rests[known]]
    )
    axis_sd = float(np.sqrt(np.trace(own.covariance + arms.covariance) / 2))
    sd = np.append(np.full(len(up), GRAVITY_SD), axis_sd)
    found = from_directions(np.vstack([felt, axis]), np.vstack([up, arms.values]), sd)
    return _calibration("mounting_hinge", found)


def _calibration(name: str, found: SegmentMounting) -> MountingCalibration:
    return MountingCalibration(
        name, rotation.to_matrix(found.q_segment_from_sensor), found.fit, found.remarks
    )
