"""The errors of two sessions of one protocol, instant by instant, and what they differ by.

What a part gets wrong by the pose is the same in both and cancels; what is left is the noise of two
sessions, whose memory is estimated as that of one is (docs/decisions/0038).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.evaluation.joint_summary import one_short_sweep
from testbench.evaluation.judged import window_rows
from testbench.evaluation.ranking import Difference
from testbench.frames import NANOSECONDS
from testbench.model.reference_step import aligning_part, reference_step
from testbench.model.statistics.memory import (
    FEWEST_MEMORIES,
    Layout,
    layout,
    means,
    variance_elsewhere,
)
from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.session.layout import joint_table, orientation_table
from testbench.records.session.plan import PlannedStep, judged_steps
from testbench.records.session.session import Session

MAGNITUDE, SQUARE = "magnitude", "square"
OF_JOINTS = {"flexion_mean_abs_error_deg": MAGNITUDE, "flexion_rmse_deg": SQUARE}
OF_SENSORS = {
    "total_rmse_deg": "total",
    "heading_rmse_deg": "heading",
    "inclination_rmse_deg": "inclination",
}
"""Metrics whose errors over time are kept, of a joint's section and of a sensor: what is averaged,
and the part of the orientation error.
"""
BY_ERRORS = (*OF_JOINTS, *OF_SENSORS)
ALIGNED_IN_A_POSE = ("heading", "reference_pose")
"""Methods of alignment that freeze the errors of one dwell."""
SHORT_SWEEP = (
    "one sweep of less than 30 s: an offset that is there throughout shows in no scatter of it"
)
LASTING = (
    "errors may hang together for more than a fifth of what was evaluated; longer sections, or "
    "several sessions a side, would tell"
)
"""Fewer than `FEWEST_MEMORIES` of them."""
LEAST_TRUE = 1e-12
"""A smaller error has no direction [deg]."""


@dataclass(frozen=True)
class Judged:
    """A session with what its errors come to."""

    session: Session
    evaluation: Evaluation


@dataclass(frozen=True)
class ErrorSignal:
    """The errors behind a metric over a session.

    Attributes:
        time_ns: Increasing, shape (n,) [ns].
        error: That the metric is of, shape (n,) [deg]; NaN where nothing is evaluated.
        signed: The same with a sign, or for an orientation the part of it that has one, shape (n,)
            [deg].
        steps: That count, in the order of time; None for a recording without a protocol.
        square: The metric is a root mean square; else a mean magnitude.
        equally: Every step counts alike, else every sample.
    """

    time_ns: np.ndarray
    error: np.ndarray
    signed: np.ndarray
    steps: list[PlannedStep] | None
    square: bool
    equally: bool

    @staticmethod
    def of(judged: Judged, metric: Metric) -> ErrorSignal | None:
        """Of a metric; None where its errors over time are not kept."""
        owner, _, kind = metric.name.rpartition(".")
        of_joint = kind in OF_JOINTS
        table = joint_table(owner) if of_joint else orientation_table(owner)
        series = judged.evaluation.series.get(table)
        if series is None or kind not in BY_ERRORS:
            return None
        part = f"{metric.sequence}_error" if of_joint else OF_SENSORS[kind]
        error = series.get(f"{metric.filter}_{part}_rad")
        if error is None:
            return None
        heading = error if of_joint else series.get(f"{metric.filter}_heading_rad", error)
        if not np.isfinite(heading).any():  # nobody knows where up is
            heading = error
        counts = np.asarray(series["judged"], dtype=bool)
        whole, signed = (np.degrees(own.astype(float)) for own in (error, heading))
        return ErrorSignal(
            series["host_time_ns"],
            np.where(counts, whole, np.nan),
            signed,
            _steps(judged.session, metric.section if of_joint else None),
            not of_joint or OF_JOINTS[kind] == SQUARE,
            of_joint,
        )

    def rows(self) -> list[np.ndarray]:
        """Rows of each step, shape (rows of the step,) each; all as one without a protocol."""
        if self.steps is None:
            return [np.flatnonzero(np.isfinite(self.error))]
        begins, ends = window_rows(self.steps, self.time_ns, "right")
        return [np.arange(begin, end) for begin, end in zip(begins, ends, strict=True)]


def _steps(session: Session, section: str | None) -> list[PlannedStep] | None:
    """The judged steps of a section, or of all."""
    if not session.steps:
        return None
    return [step for step in judged_steps(session.steps) if section in (None, step.section)]


@dataclass(frozen=True)
class Pair:
    """Errors of two sessions at the instants of the first.

    Attributes:
        when: Where both count.
        first: Errors of the first, shape (n,) [deg].
        second: Those of the second, shape (n,) [deg].
        signed: Both with their signs, shape (n,) each [deg].
        square: The metric is a root mean square.
    """

    when: Layout
    first: np.ndarray
    second: np.ndarray
    signed: tuple[np.ndarray, np.ndarray]
    square: bool


def paired(base: ErrorSignal, new: ErrorSignal) -> Pair | None:
    """Errors of two sessions that did the same steps, brought to the same instants.

    Each step of the second is laid on that of the first from where it begins, and its errors are
    taken between its samples (linearly). A recording without a protocol is its own only step.

    Returns:
        None where too little counts in both.
    """
    own, other = base.rows(), new.rows()
    begins = [_begin(signal, rows) for signal, rows in ((base, own), (new, other))]
    second, signed = np.full_like(base.error, np.nan), np.full_like(base.error, np.nan)
    for rows, others, begin, other_begin in zip(own, other, *begins, strict=True):
        known = others[np.isfinite(new.error[others])]
        if not len(rows) or len(known) < 2:
            continue
        at, have = base.time_ns[rows] - begin, new.time_ns[known] - other_begin
        for target, source in ((second, new.error), (signed, new.signed)):
            target[rows] = np.interp(at, have, source[known], left=np.nan, right=np.nan)
    counts = np.isfinite(base.error) & np.isfinite(second) & np.isfinite(base.signed)
    kept = [rows[counts[rows]] for rows in own]
    kept = [rows for rows in kept if len(rows)]
    when = layout(base.time_ns / NANOSECONDS, kept, base.equally) if kept else None
    if when is None:
        return None
    return Pair(when, base.error, second, (base.signed, signed), base.square)


def _begin(signal: ErrorSignal, rows: Sequence[np.ndarray]) -> list[int]:
    """When each step begins [ns]."""
    if signal.steps is None:
        return [int(signal.time_ns[own[0]]) if len(own) else 0 for own in rows]
    return [step.start_ns for step in signal.steps]


def difference_of_pair(pair: Pair, aligned_s: float | None) -> Difference | str:
    """How much larger the second session's metric is than the first's, or why nobody can tell.

    Of mean magnitudes the mean of |e2| - |e1|; of RMS r the mean of (e2² - e1²) / (r1 + r2), which
    is r2 - r1. Both sessions froze the mean of their own errors over the pose in which they were
    aligned; what that adds follows from the same law of memory, as far as errors keep their sign.

    Args:
        pair: Errors of both.
        aligned_s: How long the dwell was that aligned them [s]; None where none did.
    """
    first, second = pair.first, pair.second
    if pair.square:
        whole = _rms(pair.when, first) + _rms(pair.when, second)
        apart = (second**2 - first**2) / max(whole, LEAST_TRUE)
        direction = (pair.signed[0] + pair.signed[1]) / max(whole, LEAST_TRUE)
    else:
        apart = np.abs(second) - np.abs(first)
        direction = (np.sign(first) + np.sign(second)) / 2
    moved = pair.signed[1] - pair.signed[0]
    found = means(pair.when, np.array([pair.when.pieces(own) for own in (apart, moved)]))
    held = float(found.memories.min())
    if held < FEWEST_MEMORIES:
        return LASTING
    variance = float(found.error[0]) ** 2
    if aligned_s is not None:
        frozen = variance_elsewhere(pair.when, pair.when.pieces(moved), aligned_s)
        variance += frozen * float(pair.when.pieces(direction) @ pair.when.weight) ** 2
    blocks = int(min(held, len(pair.when.rows)))
    return Difference(
        float(found.mean[0]), float(np.sqrt(variance)), int(found.freedom[0]), held, blocks
    )


def _rms(when: Layout, errors: np.ndarray) -> float:
    return float(np.sqrt(when.pieces(errors**2) @ when.weight))


def paired_difference(base: Judged, new: Judged, metric: Metric) -> tuple[Difference | str, str]:
    """The difference of a metric between two sessions of the same part, and what was paired.

    Args:
        base: One session.
        new: The other, of the same steps.
        metric: Of both.
    """
    one, other = ErrorSignal.of(base, metric), ErrorSignal.of(new, metric)
    if one is None or other is None:
        return "one session a side does not show it: its errors over time are not kept", "nothing"
    steps = one.steps
    by = "sample" if steps is None else pairing(steps)
    if steps is not None and one_short_sweep(steps):
        return SHORT_SWEEP, by
    if steps is None and not _same_instants(one, other):
        return _alone(one, other), "nothing"
    pair = paired(one, other)
    if pair is None:
        return "too few samples count in both sessions", by
    return difference_of_pair(pair, _aligned_s(base.session)), by


def pairing(steps: Sequence[PlannedStep]) -> str:
    """What is paired: poses by step, periodic sweeps by cycle, others by sample."""
    if all(step.kind != "sweep" for step in steps):
        return "step"
    sweeps = [step for step in steps if step.kind == "sweep"]
    return "cycle" if all(step.cycles is not None for step in sweeps) else "sample"


def _aligned_s(session: Session) -> float | None:
    """How long the dwell is whose mean aligns a session [s]; None where none does."""
    if session.analysis.estimate.align not in ALIGNED_IN_A_POSE:
        return None
    step = reference_step(session.steps)
    if step is None:
        return None
    begin, end = aligning_part(step)
    return (end - begin) / NANOSECONDS


def _same_instants(one: ErrorSignal, other: ErrorSignal) -> bool:
    """Whether two recordings without a protocol are of the same samples."""
    return np.array_equal(one.time_ns, other.time_ns)


def _alone(one: ErrorSignal, other: ErrorSignal) -> Difference | str:
    """Of two recordings that did not do the same: each mean with an error of its own.

    The degrees of freedom are Welch's (Biometrika 34, 1947).
    """
    values, errors, freedom, held = [], [], [], []
    for signal in (one, other):
        when = layout(signal.time_ns / NANOSECONDS, signal.rows(), signal.equally)
        if when is None:
            return "too few samples were evaluated"
        whole = signal.error**2 if signal.square else np.abs(signal.error)
        found = means(when, np.array([when.pieces(own) for own in (whole, signal.signed)]))
        if found.memories.min() < FEWEST_MEMORIES:
            return LASTING
        value, error = float(found.mean[0]), float(found.error[0])
        if signal.square:  # of the root, by the delta method
            value = np.sqrt(value)
            error = error / (2 * max(value, LEAST_TRUE))
        values.append(value)
        errors.append(error)
        freedom.append(int(found.freedom[0]))
        held.append(float(found.memories.min()))
    variance = errors[0] ** 2 + errors[1] ** 2
    parts = sum(e**4 / f for e, f in zip(errors, freedom, strict=True))
    whole_freedom = int(variance**2 / max(parts, LEAST_TRUE**4)) if parts else min(freedom)
    fewest = min(held)
    return Difference(
        float(values[1] - values[0]),
        float(np.sqrt(variance)),
        max(whole_freedom, 1),
        fewest,
        int(min(fewest, 10**6)),
    )
