"""Rests of a recording that nobody planned, and how a sensor lies in the last against the first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.evaluation.metrics import orientation_errors
from testbench.evaluation.noise import SHORTEST_S, runs_at_rest
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.recording_rows import OrientationChangeRow, RestRow
from testbench.records.session.samples import ImuSamples

LEAST_S = 0.5
"""A shorter rest is no rest: a swing stands still at its ends [s]."""
ACCELEROMETER = "accelerometer"
"""In place of a filter: gravity's direction alone."""


@dataclass(frozen=True)
class Rests:
    """When a sensor rested.

    Attributes:
        runs: Rows of each rest of half a second and more, in their order.
        lengths_s: Of each [s].
    """

    runs: list[slice]
    lengths_s: list[float]

    @staticmethod
    def of(sensor: SensorEstimate) -> Rests:
        """Those of a sensor."""
        time = sensor.host_time_ns
        found = [
            (run, float(time[run.stop - 1] - time[run.start]) / NANOSECONDS)
            for run in runs_at_rest(time, sensor.static & ~sensor.flagged)
        ]
        kept = [(run, length) for run, length in found if length >= LEAST_S]
        return Rests([run for run, _ in kept], [length for _, length in kept])


def rest_row(name: str, rests: Rests, samples: ImuSamples) -> RestRow:
    """How long a sensor rested."""
    if np.isfinite(samples.gyr).any():
        by = "gyr"
    else:
        by = "acc" if samples.device_q is None else "device"
    lengths = rests.lengths_s
    return RestRow(name, by, len(lengths), sum(lengths), max(lengths, default=0.0), SHORTEST_S)


def change_rows(
    name: str, sensor: SensorEstimate, rests: Rests, samples: ImuSamples, returned: bool
) -> list[OrientationChangeRow]:
    """How a sensor lies in its last rest against its first, by every filter and by gravity alone.

    Args:
        name: Of the sensor.
        sensor: Its estimate.
        rests: Its rests; fewer than two have no change.
        samples: At the instants of the estimate.
        returned: Whether the sensor was stated to have come back.
    """
    if len(rests.runs) < 2:
        return []
    first, last = rests.runs[0], rests.runs[-1]
    begin, end = (
        float(sensor.host_time_ns[run.start] + sensor.host_time_ns[run.stop - 1]) / 2 / NANOSECONDS
        for run in (first, last)
    )
    rows = []
    for key, q in sensor.orientation.items():
        ends = [q[run][np.isfinite(q[run]).all(axis=1)] for run in (first, last)]
        if not (len(ends[0]) and len(ends[1])):
            continue
        before, after = (rotation.mean(end)[None] for end in ends)
        change = orientation_errors(after, before)
        total, heading, inclination = (
            float(np.degrees(part[0]))
            for part in (change.total, change.heading, change.inclination)
        )
        rows.append(
            OrientationChangeRow(name, key, begin, end, total, heading, inclination, returned)
        )
    force = [samples.acc[run][np.isfinite(samples.acc[run]).all(axis=1)] for run in (first, last)]
    if len(force[0]) and len(force[1]):
        up, then = (part.mean(axis=0) for part in force)
        lean = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(up, then)), up @ then)))
        rows.append(
            OrientationChangeRow(name, ACCELEROMETER, begin, end, None, None, lean, returned)
        )
    return rows
