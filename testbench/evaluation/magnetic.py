"""How far the magnetic field was disturbed where the sensors were, and what that did to the heading
of each filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from testbench.evaluation.judged import rows_by_step
from testbench.evaluation.metrics import rms
from testbench.evaluation.orientation import SensorErrors
from testbench.model import rotation
from testbench.records.results.evaluation_rows import FieldErrorRow, FieldRow
from testbench.records.session.plan import PlannedStep

EDGES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, np.inf)
"""Of the classes of disturbance [%] of the norm, [deg] of dip and heading; VQF rejects a norm or
dip that is off by 10.
"""
FEWEST_SAMPLES = 30
"""Fewer in a class, or in the reference, say nothing."""


@dataclass(frozen=True)
class FieldDeviation:
    """The field at a sensor against that of the reference pose, by the sensor's true orientation.

    Attributes:
        norm: Of the reference [uT].
        dip: Of the reference, below the horizon [rad].
        norm_percent: Deviation of the norm, shape (n,) [%].
        dip_rad: Deviation of the dip, shape (n,) [rad].
        heading_rad: Deviation of the heading, anticlockwise from above, shape (n,) [rad]; a compass
            errs by as much the other way.
    """

    norm: float
    dip: float
    norm_percent: np.ndarray
    dip_rad: np.ndarray
    heading_rad: np.ndarray

    def series(self, sensor: SensorErrors) -> dict[str, np.ndarray]:
        """Columns for figures."""
        return {
            "host_time_ns": sensor.estimate.host_time_ns,
            "judged": sensor.judged,
            "norm_percent": self.norm_percent.astype(np.float32),
            "dip_rad": self.dip_rad.astype(np.float32),
            "heading_rad": self.heading_rad.astype(np.float32),
        }


def field_deviation(
    sensor: SensorErrors, mag: np.ndarray | None, steps: list[PlannedStep]
) -> FieldDeviation | None:
    """The field in the world, by the truth, against its mean over the reference section, or over
    all that is judged.

    Args:
        sensor: With the true orientation.
        mag: The field as read, on the same rows, shape (n, 3) [uT]; None without a magnetometer.
        steps: Of the session.

    Returns:
        None without a magnetometer, or where too little is known of the reference.
    """
    if mag is None:
        return None
    mag = sensor.estimate.calibration.apply_to_field(mag)
    known = (
        np.isfinite(sensor.q_true[:, 0]) & np.isfinite(mag).all(axis=1) & ~sensor.estimate.flagged
    )
    field = np.full((len(mag), 3), np.nan)
    field[known] = rotation.rotate(sensor.q_true[known], mag[known])
    dwells = [step for step in steps if step.role == "reference" and step.kind != "sweep"]
    rows = [
        rows
        for _, rows in rows_by_step(
            dwells, sensor.estimate.host_time_ns, sensor.estimate.static & known
        )
    ]
    reference = np.concatenate(rows) if rows else np.flatnonzero(known & sensor.judged)
    if len(reference) < FEWEST_SAMPLES:
        return None
    mean = field[reference].mean(axis=0)
    norm = np.linalg.norm(field, axis=1)
    usual = float(np.linalg.norm(mean))
    if not usual > 0:
        return None
    dip, heading = _direction(mean[None])
    dips, headings = _direction(field)
    return FieldDeviation(
        usual,
        float(dip[0]),
        100 * (norm / usual - 1),
        dips - dip[0],
        rotation.wrap(headings - heading[0]),
    )


def _direction(field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Dip below the horizon and heading anticlockwise from x of a field in the world, shape (n, 3),
    [rad].
    """
    return np.arctan2(-field[:, 2], np.hypot(field[:, 0], field[:, 1])), np.arctan2(
        field[:, 1], field[:, 0]
    )


def field_rows(sensor: SensorErrors, found: FieldDeviation) -> list[FieldRow]:
    """One row for all judged samples, and for those at rest and in motion where there are both."""
    rows = []
    for motion, mask in sensor.by_motion().items():
        counted = mask & np.isfinite(found.norm_percent)
        if counted.any():
            parts = (found.norm_percent, np.degrees(found.dip_rad), np.degrees(found.heading_rad))
            numbers = [
                value
                for part in parts
                for value in (rms(part[counted]), float(np.quantile(np.abs(part[counted]), 0.95)))
            ]
            rows.append(
                FieldRow(
                    sensor.name,
                    motion,
                    int(counted.sum()),
                    found.norm,
                    float(np.degrees(found.dip)),
                    *numbers,
                )
            )
    return rows


def field_error_rows(sensor: SensorErrors, found: FieldDeviation) -> list[FieldErrorRow]:
    """The heading error of each filter by classes of disturbance of the heading, the norm and the
    dip of the field.
    """
    rows = []
    sizes = {
        "heading": np.degrees(found.heading_rad),
        "norm": found.norm_percent,
        "dip": np.degrees(found.dip_rad),
    }
    for quantity, deviation in ((name, np.abs(size)) for name, size in sizes.items()):
        for low, high in pairwise(EDGES):
            counted = sensor.judged & (deviation >= low) & (deviation < high)
            if counted.sum() >= FEWEST_SAMPLES:
                middle = float(deviation[counted].mean())
                for key, errors in sensor.errors.items():
                    heading = rms(np.degrees(errors.heading[counted]))
                    rows.append(
                        FieldErrorRow(
                            sensor.name,
                            key,
                            quantity,
                            low,
                            None if np.isinf(high) else high,
                            middle,
                            int(counted.sum()),
                            heading,
                        )
                    )
    return rows
