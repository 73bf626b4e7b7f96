"""Orientations of one sensor against one another: differences, no errors, for none is the truth."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from testbench.evaluation.metrics import OrientationErrors, orientation_errors, rms
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.evaluation import ResultTables
from testbench.records.results.recording_rows import DifferenceRow
from testbench.records.session.layout import difference_table

DEVICE = "device"
"""The orientation that a sensor computes itself: what others are held beside if nobody says."""
MOST_PAIRED = 4
"""Of more orientations not every pair is compared, but each with the first."""
LEAST_SAMPLES = 2


def difference_tables(name: str, sensor: SensorEstimate, compare: str | None) -> ResultTables:
    """Rows of the pairs of a sensor's orientations, and differences over time.

    Args:
        name: Of the sensor.
        sensor: Its estimate.
        compare: Filter that the others are compared with; every pair if None.
    """
    found = []
    if compare is not None and compare not in sensor.orientation:
        why = sensor.skipped.get(compare, "it was not run")
        found = [finding("comparison.none", name, filter=compare, why=why)]
    rows: list[DifferenceRow] = []
    columns: dict[str, np.ndarray] = {}
    reference = reference_of(sensor, compare)
    for first, second in pairs(sensor, compare):
        compared = compared_with(sensor, first, second)
        if compared is None:
            continue
        rows.append(_row(name, first, second, *compared))
        if second == reference:
            columns |= _columns(f"{first}_{second}", compared[1], compared[2])
    series = {difference_table(name): {"host_time_ns": sensor.host_time_ns} | columns}
    return ResultTables(comparison=rows, series=series if columns else {}, findings=found)


def reference_of(sensor: SensorEstimate, compare: str | None) -> str | None:
    """The orientation whose differences are kept over time."""
    if compare is not None:
        return compare
    keys = list(sensor.orientation)
    return DEVICE if DEVICE in keys else next(iter(keys), None)


def pairs(sensor: SensorEstimate, compare: str | None) -> list[tuple[str, str]]:
    """Which orientations are compared, the one that is compared with behind."""
    reference = reference_of(sensor, compare)
    if reference not in sensor.orientation:
        return []
    others = [key for key in sensor.orientation if key != reference]
    beside = [(key, reference) for key in others]
    if compare is not None or len(others) >= MOST_PAIRED:
        return beside
    return beside + [(second, first) for first, second in combinations(others, 2)]


def compared_with(
    sensor: SensorEstimate, first: str, second: str
) -> tuple[np.ndarray, np.ndarray, OrientationErrors] | None:
    """Difference of two orientations, the mean heading between their worlds taken off.

    Returns:
        Mean rotation of the world of `second` from that of `first`, shape (4,); which samples both
        know, shape (n,); the parts of the difference there. None where hardly any is known.
    """
    q, p = sensor.orientation[first], sensor.orientation[second]
    known = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1) & ~sensor.flagged
    if known.sum() < LEAST_SAMPLES:
        return None
    worlds = rotation.mean(rotation.multiply(q[known], rotation.conjugate(p[known])))
    level = rotation.from_heading(-float(rotation.heading_angle(worlds)))
    return worlds, known, orientation_errors(rotation.multiply(level, q[known]), p[known])


def _row(
    name: str,
    first: str,
    second: str,
    worlds: np.ndarray,
    known: np.ndarray,
    apart: OrientationErrors,
) -> DifferenceRow:
    total, heading, inclination = (
        np.degrees(part) for part in (apart.total, apart.heading, apart.inclination)
    )
    return DifferenceRow(
        sensor=name,
        first=first,
        second=second,
        n=int(known.sum()),
        heading_offset_deg=float(np.degrees(rotation.heading_angle(worlds))),
        tilt_offset_deg=float(np.degrees(rotation.inclination_angle(worlds))),
        mean_deg=float(total.mean()),
        rms_deg=rms(total),
        max_deg=float(total.max()),
        heading_rms_deg=rms(heading),
        inclination_rms_deg=rms(inclination),
        mean_quaternion_length=float(np.mean(2 * np.sin(apart.total / 4))),
    )


def _columns(pair: str, known: np.ndarray, apart: OrientationErrors) -> dict[str, np.ndarray]:
    columns = {}
    for part in ("total", "heading", "inclination"):
        whole = np.full(len(known), np.nan, dtype=np.float32)
        whole[known] = getattr(apart, part)
        columns[f"{pair}_{part}_rad"] = whole
    return columns
