"""A truth cut where it and the gyroscope part: what does not fit the rest is left out.

After a body has slipped, or a reference has drifted, the truth goes on in other frames, as after a
step. The piece that lasts longest is kept; others may be aligned in frames of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from testbench.estimation.alignment.parting import Parting
from testbench.estimation.signals.truth_faults import PARTED, STEPPED, Apart, only_rows
from testbench.frames import NANOSECONDS
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.samples import Truth

LEAST_KEPT_S = 10.0
"""Where no piece lasts longer, nothing of the truth is known to be right [s]."""


def reason_of(partings: Sequence[Parting]) -> str:
    """Why samples are left out that lie beside partings: the truth has stepped, or both parted."""
    return STEPPED if all(own.sharp for own in partings) else PARTED


def cut_at(
    partings: Sequence[Parting], truth: Truth, time_ns: np.ndarray
) -> tuple[Truth, np.ndarray, list[Apart]] | None:
    """The truth of the piece that lasts longest, samples that are lost, and the other pieces.

    Args:
        partings: One or more, in the order of time.
        truth: On the host's clock.
        time_ns: Of the samples on the host's clock, shape (n,) [ns].

    Returns:
        None where no piece lasts.
    """
    known = np.flatnonzero(np.isfinite(truth.q_world_from_sensor).all(axis=1))
    times = truth.host_time_ns[known]
    ends = [int(times[0]), *(t for own in partings for t in (own.begin_ns, own.end_ns))]
    ends.append(int(times[-1]))
    pieces = [
        (begin, end)
        for begin, end in list(pairwise(ends))[::2]
        if end > begin and ((times >= begin) & (times <= end)).sum() > 1
    ]
    kept = max(pieces, key=lambda own: own[1] - own[0], default=(0, 0))
    if kept[1] - kept[0] < LEAST_KEPT_S * NANOSECONDS:
        return None

    def within(instants: np.ndarray, piece: tuple[int, int]) -> np.ndarray:
        return np.asarray((instants >= piece[0]) & (instants <= piece[1]))

    lost = within(time_ns, (int(times[0]), int(times[-1]))) & ~within(time_ns, kept)
    others = []
    for piece in pieces:
        if piece != kept:
            rows = known[within(times, piece)]
            own = Truth(truth.host_time_ns[rows], truth.q_world_from_sensor[rows])
            others.append(Apart(own, within(time_ns, piece), reason_of(partings)))
    return only_rows(truth, known[within(times, kept)]), lost, others


def told_of(
    partings: Sequence[Parting], time_ns: np.ndarray, as_read_ns: np.ndarray, lost: np.ndarray
) -> Finding:
    """The finding on stretches in which both part.

    Args:
        partings: One or more.
        time_ns: Instants of the rates on the host's clock, shape (n,) [ns].
        as_read_ns: Times of the samples as they were read, by which a person finds a stretch, shape
            (n,) [ns].
        lost: Samples that are left out, shape (n,), bool.
    """
    most = max(partings, key=lambda own: own.angle)
    begin_s, end_s = np.interp([most.begin_ns, most.end_ns], time_ns, as_read_ns) / NANOSECONDS
    usual = float(np.median(np.diff(as_read_ns))) / NANOSECONDS
    lost_s = float(lost.sum()) * usual
    if not lost.all() and reason_of(partings) == STEPPED:
        at_ns = np.interp(partings[0].begin_ns, time_ns, as_read_ns)
        return finding(
            "truth.stepped",
            steps=len(partings),
            angle_deg=float(np.degrees(most.angle)),
            at_s=float(at_ns) / NANOSECONDS,
            lost_s=lost_s,
        )
    code = "truth.parts_throughout" if lost.all() else "truth.parts"
    return finding(
        code,
        stretches=len(partings),
        angle_deg=float(np.degrees(most.angle)),
        begin_s=float(begin_s),
        end_s=float(end_s),
        lost_s=lost_s,
    )
