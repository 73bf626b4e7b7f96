"""Orientations of a reference system, made fit to be compared with.

They get unit length, one sign, and gaps that show.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import ImuSamples, Truth

NORM_WITHIN = 0.02
"""Quaternions further from unit length than this are counted as lost."""
GAP = 2.5
"""Known orientations further apart than this many median intervals have a gap between them."""


def reference_truth(
    where: str,
    time_ns: np.ndarray,
    q_world_from_body: np.ndarray,
    q_body_from_sensor: np.ndarray,
    judged: np.ndarray | None,
    findings: list[Finding],
) -> Truth:
    """A truth from orientations as recorded.

    Args:
        where: What findings speak of: the sensor, or the file that is the truth of all.
        time_ns: Host time, shape (n,), not decreasing.
        q_world_from_body: Shape (n, 4), of either sign, NaN or zero where lost.
        q_body_from_sensor: Shape (4,).
        judged: Whether errors count, shape (n,), bool, or None.
        findings: What was noticed; is added to.

    Returns:
        Rows with an orientation, and one of NaN in each gap.
    """
    norm = np.linalg.norm(q_world_from_body, axis=1)
    with np.errstate(invalid="ignore"):
        known = np.abs(norm - 1) <= NORM_WITHIN
        odd = int(np.sum((norm > 0) & ~known))
    if odd:
        findings.append(finding("truth.not_unit", where, count=odd))
    time, q = time_ns[known], q_world_from_body[known]
    fresh = np.concatenate([[True], np.diff(time) > 0]) if len(time) else np.zeros(0, dtype=bool)
    time, q = time[fresh], rotation.normalise(q[fresh])
    marks = None if judged is None else judged[known][fresh]
    flips = np.sum(q[1:] * q[:-1], axis=1) < 0
    if flips.any():
        findings.append(finding("truth.signs", where, count=int(flips.sum())))
        q[1:] *= np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]
    q = rotation.multiply(q, q_body_from_sensor)
    return _with_gaps(where, time, q, marks, findings)


def _with_gaps(
    where: str,
    time: np.ndarray,
    q: np.ndarray,
    judged: np.ndarray | None,
    findings: list[Finding],
) -> Truth:
    steps = np.diff(time)
    wide = np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.zeros(0, dtype=int)
    if len(wide):
        longest = float(steps[wide].max()) / NANOSECONDS
        findings.append(finding("truth.gaps", where, gaps=len(wide), longest_s=longest))
        middle = time[wide] + steps[wide] // 2
        time = np.insert(time, wide + 1, middle)
        q = np.insert(q, wide + 1, np.nan, axis=0)
        judged = None if judged is None else np.insert(judged, wide + 1, False)
    return Truth(time, q, judged=judged)


def collect(chunks: Iterable[ImuSamples]) -> tuple[np.ndarray, np.ndarray]:
    """Host times [ns] and orientations, shapes (n,) and (n, 4), of samples with nothing else."""
    times, orientations = [], []
    for chunk in chunks:
        assert chunk.device_q is not None
        times.append(chunk.host_time_ns)
        orientations.append(chunk.device_q)
    return np.concatenate(times), np.concatenate(orientations)
