"""How the filters of a sensor are brought to the frames of its truth, by the method that is asked.

What does not depend on the filter is found once: the truth at the samples, and the mounting where
rates and gravity give it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.alignment.frame_alignment import (
    findings_on,
    fit_frames,
    fit_frames_by_motion,
    fit_frames_by_vectors,
)
from testbench.estimation.alignment.mounting_by_rates import mounting_by_rates
from testbench.estimation.alignment.vector_mounting import VectorMounting
from testbench.estimation.filters import UniformSamples
from testbench.estimation.signals.access import Correct
from testbench.estimation.signals.recording import RunFacts
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.reference_step import aligning_part, before_judging, reference_step
from testbench.model.statistics.intervals import median_interval
from testbench.model.truth import truth_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import FrameFit
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth

MOST_COMPARED = 200_000
"""Longer recordings are aligned by some of their samples, evenly spread."""
FEWEST_COMPARED = 10
"""Samples at which the truth is known, for an alignment by motion."""

Aligned = tuple[FrameFit, list[Finding]]


@dataclass(frozen=True)
class FilterAlignment:
    """What the filters of a sensor are aligned by.

    Attributes:
        run: What is known of the recording.
        truth: What the sensor went through; None where nothing is to be aligned to.
        time_ns: Instants of the samples on the host's clock, shape (n,) [ns].
        sound: Samples that no gate refuses, shape (n,), bool.
        up_stated: Whether the z axis of the truth's world is said to point up.
        every: One of how many samples is compared.
        q_true: q_world_from_sensor at those, shape (m, 4); None where a dwell aligns.
        mounting: As rates and gravity gave it, or None.
    """

    run: RunFacts
    truth: Truth | None
    time_ns: np.ndarray
    sound: np.ndarray
    up_stated: bool
    every: int = 1
    q_true: np.ndarray | None = None
    mounting: VectorMounting | None = None

    def prepared(
        self, correct: Correct, uniform: UniformSamples, rows: np.ndarray, static: np.ndarray
    ) -> FilterAlignment:
        """The same with what the method needs and no filter changes.

        Args:
            correct: Calibration of what the filters get.
            uniform: The samples on a regular grid.
            rows: The row of each of them in it, shape (n,).
            static: Whether each is at rest, shape (n,), bool.
        """
        method, step = self.run.settings.align, reference_step(self.run.steps)
        if self.truth is None or method == "none":
            return self
        if method in {"heading", "reference_pose"}:
            return self if step is None else replace(self, truth=_within(self.truth, step))
        every = max(len(self.time_ns) // MOST_COMPARED, 1) if method == "motion" else 1
        q_true = truth_at(self.truth, self.time_ns[::every])
        mounting = None
        if method == "rates":
            given, quiet = correct(uniform), static & self.sound
            read = given.gyr[rows], given.acc[rows]
            mounting = mounting_by_rates(self.run, read, self.time_ns, quiet, self.truth, q_true)
        return replace(self, every=every, q_true=q_true, mounting=mounting)

    def align(self, name: str, q: np.ndarray) -> Aligned:
        """The alignment of one filter, and what is to be said of it.

        Args:
            name: Of the filter.
            q: q_earth_from_sensor by it, shape (n, 4).
        """
        method = self.run.settings.align
        if method == "none" or self.truth is None:
            return FrameFit(up_known=self.up_stated), []
        if self.q_true is not None:
            return self._by_pairs(name, q, self.q_true)
        if method == "heading" and reference_step(self.run.steps) is None:
            return self._by_mean_heading(name, q, self.truth)
        return self._by_dwell(name, q, self.truth)

    def _by_pairs(self, name: str, q: np.ndarray, q_true: np.ndarray) -> Aligned:
        """By all that comes before the first judged step."""
        time, sound = self.time_ns[:: self.every], self.sound[:: self.every]
        q = q[:: self.every]
        known = sound & before_judging(self.run.steps, time) & _both_known(q, q_true)
        q, q_true = q[known], q_true[known]
        if self.run.settings.align == "motion":
            if len(q) < FEWEST_COMPARED:
                return _refused(name, "the truth is known too seldom to align it by motion")
            seconds = float(len(q)) * median_interval(time) / NANOSECONDS
            fit = fit_frames_by_motion(q, q_true, seconds, self.up_stated)
            return fit, findings_on(fit, name)
        if self.mounting is None or not len(q):
            return _refused(name, "the truth is known too seldom to align it by rates and gravity")
        fit, doubt = fit_frames_by_vectors(q, q_true, self.mounting)
        return fit, [] if doubt is None else [finding("frames.doubt", filter=name, doubt=doubt)]

    def _by_dwell(self, name: str, q: np.ndarray, truth: Truth) -> Aligned:
        """By the reference pose."""
        step = reference_step(self.run.steps)
        if step is None:
            return _refused(name, "there is no dwell to align it in")
        begin, end = aligning_part(step)
        mine = self.sound & (self.time_ns >= begin) & (self.time_ns <= end)
        q_true = truth.q_world_from_sensor[np.isfinite(truth.q_world_from_sensor[:, 0])]
        if not mine.any() or not len(q_true):
            return _refused(name, "neither it nor the truth is known in the reference pose")
        return fit_frames(q[mine], q_true, self.run.settings.align), []

    def _by_mean_heading(self, name: str, q: np.ndarray, truth: Truth) -> Aligned:
        """The heading of a recording without a dwell: the mean over all of it."""
        q_true = truth_at(truth, self.time_ns)
        known = self.sound & _both_known(q, q_true)
        if not known.any():
            return _refused(name, "the truth is not known where it is")
        error = rotation.multiply(q_true[known], rotation.conjugate(q[known]))
        heading = float(np.degrees(rotation.heading_angle(rotation.mean(error))))
        doubt = "there is no dwell to align it in: its heading is the mean of the recording's"
        told = finding("frames.doubt", filter=name, doubt=doubt)
        return FrameFit(heading, method="heading"), [told]


def _within(truth: Truth, step: PlannedStep) -> Truth:
    """The orientations of a truth in the part of a dwell that aligns."""
    begin, end = aligning_part(step)
    rows = (truth.host_time_ns >= begin) & (truth.host_time_ns <= end)
    return Truth(truth.host_time_ns[rows], truth.q_world_from_sensor[rows])


def _both_known(q: np.ndarray, q_true: np.ndarray) -> np.ndarray:
    """Where both of two orientations are known, shape (n,), bool.

    Args:
        q: By a filter, shape (n, 4).
        q_true: The truth, shape (n, 4).
    """
    return np.asarray(np.isfinite(q[:, 0]) & np.isfinite(q_true[:, 0]))


def _refused(name: str, why: str) -> Aligned:
    """No alignment, so that nothing is judged by it."""
    return FrameFit(refused=why), [finding("frames.refused", filter=name, why=why)]
