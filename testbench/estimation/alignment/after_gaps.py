"""Stretches between gaps over which nobody knows how a sensor turned.

Filters begin anew after each. One stretch is aligned as the recording asks; in the others mounting
and level of the world are the same, and only the heading of a filter without a magnetometer is not:
it is found by the mean over the stretch, as in a recording without a dwell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.filters import OrientationFilter, UniformSamples
from testbench.estimation.signals.access import SampleAccess
from testbench.estimation.signals.quality import AFTER_GAP
from testbench.estimation.signals.recording import RunFacts
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.reference_step import aligning_part, before_judging, reference_step
from testbench.model.truth import truth_at
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.estimate import FrameFit, SensorEstimate
from testbench.records.session.samples import Truth

LEAST_S = 10.0
"""Of a shorter stretch the mean heading takes too much of the error along [s]."""


@dataclass(frozen=True)
class OtherStretches:
    """The stretches beside the one that is aligned as the recording asks.

    Attributes:
        elsewhere: Samples that are in none but them, shape (n,), bool.
        rows: Sound samples of each, shape (n,), bool.
        time_ns: Instants of the samples on the host's clock, shape (n,) [ns].
        truth: Of the sensor; None where nothing is to be aligned to.
    """

    elsewhere: np.ndarray
    rows: Sequence[np.ndarray]
    time_ns: np.ndarray
    truth: Truth | None

    @staticmethod
    def of(
        run: RunFacts,
        stretch: np.ndarray,
        time_ns: np.ndarray,
        sound: np.ndarray,
        truth: Truth | None,
    ) -> OtherStretches:
        """Those of a sensor.

        Args:
            run: What is known of the recording.
            stretch: In which each sample is, from 0, shape (n,).
            time_ns: Instants of the samples on the host's clock, shape (n,) [ns].
            sound: Samples that no gate refuses, shape (n,), bool.
            truth: Of the sensor; None where nothing is to be aligned to.
        """
        usable = sound & _aligning(run, time_ns)
        if truth is not None:
            usable &= np.isfinite(truth_at(truth, time_ns)[:, 0])
        counts = np.bincount(stretch[usable], minlength=int(stretch[-1]) + 1)
        # joints begin with a pose that is known, or that all their headings are told by
        first = truth is None or run.has_joints
        main = int(np.argmax(counts > 0)) if first else int(np.argmax(counts))
        others = [number for number in range(len(counts)) if number != main]
        rows = [sound & (stretch == number) for number in others]
        return OtherStretches(stretch != main, rows, time_ns, truth if others else None)

    def aligned(
        self,
        estimate: SensorEstimate,
        filters: Mapping[str, OrientationFilter],
        given: UniformSamples,
    ) -> SensorEstimate:
        """An estimate with those stretches aligned whose heading is known of every filter.

        Args:
            estimate: In the frames of the stretch that was aligned as asked.
            filters: That ran, by name.
            given: What they got.
        """
        lasting = [rows for rows in self.rows if _seconds(rows, self.time_ns) >= LEAST_S]
        if self.truth is None or not lasting or not filters:
            return estimate
        q_true = truth_at(self.truth, self.time_ns)
        apart = estimate.is_apart * np.int16(0) if estimate.apart is None else estimate.apart.copy()
        frames = list(estimate.frames_apart)
        for rows in lasting:
            known = rows & np.isfinite(q_true[:, 0]) & (apart == 0)
            if _seconds(known, self.time_ns) < LEAST_S:
                continue
            fits = {
                key: _fit(
                    kind,
                    given,
                    estimate.frames[key],
                    estimate.orientation[key][known],
                    q_true[known],
                )
                for key, kind in filters.items()
            }
            sound = {key: fit for key, fit in fits.items() if fit is not None}
            if len(sound) == len(fits):
                frames.append(sound)
                apart[known] = len(frames)
        added = apart > len(estimate.frames_apart)
        if not added.any():
            return estimate
        left = estimate.quality[AFTER_GAP] - estimate.every * int(added.sum())
        apart_s = _seconds(added, self.time_ns)
        told = finding(
            "gap.aligned_anew", apart_s=apart_s, stretches=len(frames) - len(estimate.frames_apart)
        )
        return replace(
            estimate,
            apart=apart,
            frames_apart=frames,
            quality=estimate.quality | {AFTER_GAP: max(left, 0)},
            findings=[*estimate.findings, told],
        )


def restart_findings(access: SampleAccess) -> list[Finding]:
    """That filters begin anew, if any does.

    Args:
        access: To the samples of the sensor.
    """
    stretch = access.stretch
    if not len(access.lost):
        return []
    first = int(np.searchsorted(stretch, 1))
    time = access.samples.host_time_ns
    at_s = float(time[min(first, len(time) - 1)]) / NANOSECONDS
    return [finding("gap.restarted", gaps=len(access.lost), at_s=at_s)]


def _aligning(run: RunFacts, time_ns: np.ndarray) -> np.ndarray:
    """Samples that an alignment goes by, shape (n,), bool."""
    method, step = run.settings.align, reference_step(run.steps)
    if method in {"heading", "reference_pose"} and step is not None:
        begin, end = aligning_part(step)
        return np.asarray((time_ns >= begin) & (time_ns <= end))
    return before_judging(run.steps, time_ns)


def _seconds(rows: np.ndarray, time_ns: np.ndarray) -> float:
    """How long some samples last [s]."""
    interval = float(np.median(np.diff(time_ns))) if len(time_ns) > 1 else 0.0
    return float(rows.sum()) * interval / NANOSECONDS


def _fit(
    kind: OrientationFilter,
    given: UniformSamples,
    usual: FrameFit,
    estimated: np.ndarray,
    true: np.ndarray,
) -> FrameFit | None:
    """The frames of a filter in a stretch, or None where nobody knows its heading.

    Args:
        kind: The filter.
        given: What it got.
        usual: Its frames in the stretch that was aligned as asked.
        estimated: q_world_from_sensor by the filter in these frames, shape (n, 4).
        true: The truth at the same instants, shape (n, 4).
    """
    if kind.knows_heading(given):
        return usual
    if usual.method == "none":
        return None
    # the heading turns about the vertical of the filter's earth: the world's, but for the tilt
    level = rotation.conjugate(rotation.from_rotation_vector(np.radians(np.array(usual.tilt_deg))))
    error = rotation.multiply(true, rotation.conjugate(estimated))
    error = rotation.multiply(rotation.multiply(level, error), rotation.conjugate(level))
    turn = float(np.degrees(rotation.heading_angle(rotation.mean(error))))
    return replace(usual, heading_deg=usual.heading_deg + turn)
