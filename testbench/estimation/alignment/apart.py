"""Pieces of a truth that do not fit the rest, each aligned in frames of its own.

A reference that takes one body for another, or begins anew, goes on in other frames. What it says
of the sensor's turning is as good as before; only its frames are others. A piece that lasts and
moves enough to find them is judged by them, and stands in no comparison with another sensor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.alignment.filter_alignment import FilterAlignment
from testbench.estimation.signals.truth_faults import PARTED, STEPPED
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import FrameFit, SensorEstimate

LEAST_S = 10.0
"""A piece that is known for less is left out: that is two or three turns of a hand-held motion, of
which a frame is fitted to some tenths of a degree [s].
"""
TELLS = {"truth.stepped": STEPPED, "truth.parts": PARTED}
"""Codes of findings that say for how long a truth was left out, and for which reason."""
MOST_PIECES = 10
"""So many kinds of pieces are aligned, those that last longest."""
WORSE, WORSE_DEG = 2.0, 1.0
"""A piece may fit worse than the rest by this factor, or by this angle [deg]."""


@dataclass(frozen=True)
class PieceAlignment:
    """What the filters are aligned by in one kind of pieces.

    Attributes:
        alignment: To the truth of these pieces.
        rows: Samples that it holds for, shape (n,), bool.
        reason: Why they were left out of the rest.
    """

    alignment: FilterAlignment
    rows: np.ndarray
    reason: str = STEPPED


def long_enough(pieces: Sequence[PieceAlignment]) -> list[PieceAlignment]:
    """Those pieces that last, the longest first.

    Args:
        pieces: All of a sensor.
    """
    lasting = [piece for piece in pieces if _seconds(piece) >= LEAST_S]
    return sorted(lasting, key=_seconds, reverse=True)[:MOST_PIECES]


def _seconds(piece: PieceAlignment) -> float:
    time = piece.alignment.time_ns
    interval = median_interval(time)
    return float(piece.rows.sum()) * interval / NANOSECONDS


def aligned_apart(
    estimate: SensorEstimate,
    pieces: Sequence[PieceAlignment],
    found: Sequence[Mapping[str, FrameFit]],
) -> SensorEstimate:
    """An estimate with those pieces aligned in which every filter could be.

    Args:
        estimate: With the alignment of the rest, by filter.
        pieces: As `long_enough` gives them.
        found: The alignment of each by filter, as `PieceAlignment.alignment` gives it.
    """
    accepted = [
        (piece, dict(fits))
        for piece, fits in zip(pieces, found, strict=True)
        if fits and all(_fits(fit, estimate.frames[key]) for key, fit in fits.items())
    ]
    if not accepted:
        return estimate
    apart = np.zeros(len(estimate.host_time_ns), dtype=np.int16)
    for number, (piece, _) in enumerate(accepted, 1):
        apart[piece.rows] = number
    quality, counted = dict(estimate.quality), dict.fromkeys(TELLS.values(), 0)
    for number, (piece, _) in enumerate(accepted, 1):
        counted[piece.reason] += int((apart == number).sum())
    for reason, count in counted.items():
        if count:
            quality[reason] = max(quality.get(reason, 0) - count, 0)
    return replace(
        estimate,
        apart=apart,
        frames_apart=[fits for _, fits in accepted],
        quality=quality,
        findings=_told(estimate, apart, counted),
    )


def _fits(fit: FrameFit, of_the_rest: FrameFit) -> bool:
    """Whether a piece was aligned as well as the rest, with its vertical as well known."""
    if fit.method != "motion" or len(fit.undetermined) > 1 or fit.residual_deg is None:
        return False
    if (fit.up_known, fit.leans) != (of_the_rest.up_known, of_the_rest.leans):
        return False
    rest = of_the_rest.residual_deg
    return rest is not None and fit.residual_deg <= max(WORSE * rest, rest + WORSE_DEG)


def _told(estimate: SensorEstimate, apart: np.ndarray, counted: Mapping[str, int]) -> list[Finding]:
    """Findings that say what was left out, and what was aligned apart.

    Args:
        estimate: With what was found so far.
        apart: As `SensorEstimate.apart`, shape (n,).
        counted: Samples of it, by the reason for which they were left out.
    """
    interval = median_interval(estimate.host_time_ns) / NANOSECONDS
    aligned_s = float((apart > 0).sum()) * interval
    begin_s = float(estimate.host_time_ns[int(np.argmax(apart > 0))]) / NANOSECONDS
    findings = []
    for own in estimate.findings:
        lost_s = own.values.get("lost_s")
        if own.code in TELLS and isinstance(lost_s, float):
            lost_s = max(lost_s - counted[TELLS[own.code]] * interval, 0.0)
            own = finding(own.code, own.where, **{**own.values, "lost_s": lost_s})
        findings.append(own)
    kinds = int(apart.max())
    told = finding("truth.aligned_apart", apart_s=aligned_s, at_s=begin_s, kinds=kinds)
    return [*findings, told]
