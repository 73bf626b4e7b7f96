"""What a filter does to the heading while its sensor rests: it should do nothing."""

from __future__ import annotations

import numpy as np

from testbench.estimation.filters import OrientationFilter
from testbench.estimation.signals.segmentation import intervals_of
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

LEAST_REST_S, LONGEST_CHUNK_S = 1.0, 5.0
"""Shortest still interval that counts, and the longest chunk of one: a heading that turns once
round in a chunk is not seen to move [s].
"""
ENOUGH_REST_S = 10.0
"""Of less still time in all nothing is said: a filter still settles in its first seconds [s]."""
LEAST_DRIFT = np.radians(0.1)
"""A slower drift is not remarked on; an Xsens DOT's gyroscope is specified to 10 deg/h, 0.003 deg/s
[rad/s].
"""


def resting_drift(
    q_world_from_sensor: np.ndarray, time_ns: np.ndarray, resting: np.ndarray
) -> float | None:
    """Median speed of an orientation's heading while the sensor rests [rad/s].

    Args:
        q_world_from_sensor: Shape (n, 4).
        time_ns: Increasing, shape (n,) [ns].
        resting: Whether the sensor is at rest, shape (n,), bool.

    Returns:
        The speed; None where the sensor never rests for a second.
    """
    begins, ends = [], []
    for first, end in intervals_of(resting, 2):
        seconds = (time_ns[end - 1] - time_ns[first]) / NANOSECONDS
        if seconds >= LEAST_REST_S:
            edges = np.linspace(first, end - 1, int(np.ceil(seconds / LONGEST_CHUNK_S)) + 1).astype(
                int
            )
            begins.append(edges[:-1])
            ends.append(edges[1:])
    if not begins:
        return None
    i, j = np.concatenate(begins), np.concatenate(ends)
    turned = rotation.turn_between(q_world_from_sensor[i], q_world_from_sensor[j])[:, 2]
    return float(np.median(np.abs(turned) * NANOSECONDS / (time_ns[j] - time_ns[i])))


def drift_finding(
    kind: OrientationFilter, q: np.ndarray, time_ns: np.ndarray, resting: np.ndarray
) -> Finding | None:
    """Of a filter without magnetometer whose heading turns while the sensor rests.

    Args:
        kind: The filter.
        q: What it gave, q_world_from_sensor, shape (n, 4).
        time_ns: Increasing, shape (n,) [ns].
        resting: Whether the sensor is at rest, shape (n,), bool.

    Returns:
        What is seen; None where the heading stays.
    """
    if "mag" in kind.needs:
        return None
    rest = rest_seconds(time_ns, resting)
    drift = resting_drift(q, time_ns, resting) if rest >= ENOUGH_REST_S else None
    if drift is None or not drift > LEAST_DRIFT:
        return None
    return finding(
        "heading.drifts", filter=kind.name, rate_deg_s=float(np.degrees(drift)), rest_s=rest
    )


def rest_seconds(time_ns: np.ndarray, resting: np.ndarray) -> float:
    """How long a sensor rests, still intervals below a second left out [s].

    Args:
        time_ns: Increasing, shape (n,) [ns].
        resting: Whether the sensor is at rest, shape (n,), bool.
    """
    lengths = [
        (time_ns[end - 1] - time_ns[first]) / NANOSECONDS for first, end in intervals_of(resting, 2)
    ]
    return float(sum(length for length in lengths if length >= LEAST_REST_S))
