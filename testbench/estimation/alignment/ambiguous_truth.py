"""Where a body turns by nearly half a turn between two orientations of its truth.

Which way it went, and how often, such a truth does not say: what lies between them is guessed the
shorter way round, and may be wrong by half a turn.
"""

from __future__ import annotations

import numpy as np

from testbench.estimation.signals.truth_turning import ANY_TURN, Turning
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.model.truth import WIDEST_GAP_NS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

MOST_TURN = np.radians(150.0)
"""Between neighbours of a truth [rad]: half a turn, less what a gyroscope and its clock are off."""
ENOUGH = 3
"""So many in a recording are worth saying; a clipped or disturbed reading is one."""

HOLE = 2.5
"""Readings farther apart than so many of their usual intervals have a hole between them."""


def find_ambiguous(
    samples: ImuSamples, time_ns: np.ndarray, truth: Truth
) -> tuple[np.ndarray, Finding] | None:
    """Samples between orientations that lie too far apart; None where there are none.

    Args:
        samples: Of the sensor, with mean rates.
        time_ns: Their instants on the host's clock, increasing, shape (n,) [ns].
        truth: On that clock.
    """
    rows = truth.host_time_ns[np.isfinite(truth.q_world_from_sensor).all(axis=1)]
    read = np.isfinite(samples.gyr).all(axis=1)
    if len(rows) < 2 or read.sum() < 2 or (np.diff(time_ns) <= 0).any():
        return None
    turned = np.diff(Turning.of(samples.gyr[read], time_ns[read]).path_at(rows))
    gaps = np.diff(rows)
    far = (turned > MOST_TURN) & (turned < ANY_TURN / 2) & (gaps <= WIDEST_GAP_NS)
    far &= _read_throughout(time_ns[read], rows)
    if far.sum() < ENOUGH:
        return None
    after = np.searchsorted(rows, time_ns, side="right")
    inside = (after > 0) & (after < len(rows))
    lost = np.zeros(len(time_ns), dtype=bool)
    lost[inside] = far[after[inside] - 1]
    first = int(np.argmax(far))
    told = finding(
        "truth.ambiguous",
        times=int(far.sum()),
        turn_deg=float(np.degrees(turned[far].max())),
        rate_hz=NANOSECONDS / float(np.median(gaps)),
        at_s=float(rows[first]) / NANOSECONDS,
    )
    return lost, told


def _read_throughout(time_ns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Between which neighbouring orientations the gyroscope was read all along: what it turned over
    a hole nobody knows.

    Args:
        time_ns: Instants of its readings, increasing, shape (n,) [ns].
        rows: Instants of the orientations, increasing, shape (m,) [ns].

    Returns:
        Shape (m - 1,), bool.
    """
    holes = np.flatnonzero(np.diff(time_ns) > HOLE * median_interval(time_ns))
    begins, ends = time_ns[holes], time_ns[holes + 1]
    # holes do not overlap: those that end after an interval begins, less those that begin after it
    touching = np.searchsorted(begins, rows[1:], side="left")
    touching -= np.searchsorted(ends, rows[:-1], side="right")
    return touching <= 0
