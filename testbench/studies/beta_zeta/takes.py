"""Takes: what one sensor went through in one motion, ready for filters that begin anew with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.estimator import PreparedSession
from testbench.estimation.filters import OrientationFilter, UniformSamples, get_filter
from testbench.evaluation.metrics import orientation_errors
from testbench.frames import NANOSECONDS, STANDARD_GRAVITY
from testbench.model import rotation
from testbench.model.truth import truth_at
from testbench.records.session.plan import PlannedStep
from testbench.records.session.session import Session

WHOLE = "recording"
"""The motion of a session that has no sections."""


@dataclass(frozen=True, eq=False)
class Take:
    """One sensor in one motion.

    Attributes:
        part: Number of the session.
        sensor: Its name.
        motion: Name of the section.
        samples: What a filter gets, at one interval.
        seconds: Since the take began, shape (n,) [s].
        q_true: True orientations, shape (n, 4), NaN where unknown; None where there is no truth.
        headed: Whether the truth's world is the one that a magnetometer's heading is of.
    """

    part: int
    sensor: str
    motion: str
    samples: UniformSamples
    seconds: np.ndarray
    q_true: np.ndarray | None
    headed: bool

    def run(self, kind: OrientationFilter) -> np.ndarray:
        """Orientations of a filter that begins with the take, shape (n, 4)."""
        return kind.run(self.samples)

    def error(self, kind: OrientationFilter) -> float:
        """RMS error against the truth [deg]: total where filter and truth share a heading, else of
        the inclination.
        """
        q, true = self.run(kind), self.q_true
        assert true is not None
        known = np.isfinite(true).all(axis=1) & np.isfinite(q).all(axis=1)
        errors = orientation_errors(q[known], true[known])
        own = errors.total if self.headed and "mag" in kind.needs else errors.inclination
        return float(np.degrees(np.sqrt(np.mean(own**2))))

    def difference(self, kind: OrientationFilter) -> float:
        """Mean length of the difference of a filter's and the device's quaternions of equal sign;
        NaN where the device reports none.
        """
        q, device = self.run(kind), self.device
        known = np.isfinite(q).all(axis=1) & np.isfinite(device).all(axis=1)
        if not known.any():
            return float("nan")
        apart = same_sign(q[known], device[known]) - device[known]
        return float(np.linalg.norm(apart, axis=1).mean())

    @property
    def device(self) -> np.ndarray:
        """Orientations of the device's own filter, shape (n, 4); NaN where there are none."""
        if not self.samples.has("device_q"):
            return np.full((len(self.samples), 4), np.nan)
        return get_filter("device").run(self.samples)

    @property
    def linear_acceleration(self) -> float:
        """RMS of how far the size of the force is from gravity's [m/s^2]."""
        size = rotation.lengths(self.samples.acc)
        return float(np.sqrt(np.nanmean((size - STANDARD_GRAVITY) ** 2)))


def same_sign(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The first or its negative, whichever is nearer to the other, shape (n, 4).

    Args:
        q: Each may come with its negative, shape (n, 4).
        other: What they are to be near to, shape (n, 4).
    """
    return np.where(np.sum(q * other, axis=1, keepdims=True) < 0, -q, q)


def takes_of(sessions: Sequence[Session], needs: Sequence[str] = ("gyr", "acc")) -> list[Take]:
    """All takes of several sessions, of sensors that have what is needed.

    Args:
        sessions: One a part.
        needs: Quantities that a sensor must have.
    """
    found = []
    for part, session in enumerate(sessions):
        prepared = PreparedSession(session)
        for name, sensor in prepared.sensors.items():
            samples = replace(sensor.correct(sensor.uniform), intervals=None)
            if not all(samples.has(quantity) for quantity in needs):
                continue
            time = np.interp(  # the grid has rows for lost packets, too
                np.arange(len(samples)),
                sensor.access.regular(sensor.estimate.clock)[1],
                sensor.estimate.host_time_ns,
            )
            truth = session.truth(name)
            q_true = None if truth is None else truth_at(truth, time.astype(np.int64))
            headed = session.analysis.estimate.align == "none"
            for motion, rows in _motions(session, time).items():
                found.append(
                    Take(
                        part,
                        name,
                        motion,
                        samples.piece(rows),
                        (time[rows] - time[rows][0]) / NANOSECONDS,
                        None if q_true is None else q_true[rows],
                        headed,
                    )
                )
    return found


def _motions(session: Session, time_ns: np.ndarray) -> dict[str, slice]:
    """Rows of each evaluated section; all rows where there is none."""
    sections: dict[str, list[PlannedStep]] = {}
    for step in session.steps:
        if step.role == "evaluation":
            sections.setdefault(step.section, []).append(step)
    if not sections:
        return {WHOLE: slice(0, len(time_ns))}
    return {
        name: slice(
            int(np.searchsorted(time_ns, steps[0].start_ns)),
            int(np.searchsorted(time_ns, steps[-1].end_ns)),
        )
        for name, steps in sections.items()
    }


def rest_of(session: Session, sensor: str) -> tuple[np.ndarray, float]:
    """Rates in the rest before the takes, shape (n, 3) [rad/s], and the interval [s].

    Without a plan, of the first ten seconds.
    """
    own = PreparedSession(session).sensors[sensor]
    samples = own.correct(own.uniform)
    time = own.estimate.host_time_ns
    reference = [step for step in session.steps if step.role == "reference"]
    begin, end = (
        (reference[0].settled_ns, reference[0].end_ns)
        if reference
        else (int(time[0]), int(time[0]) + 10 * NANOSECONDS)
    )
    at = np.interp(np.arange(len(samples)), own.access.regular(own.estimate.clock)[1], time)
    rows = (at > begin) & (at < end)
    return samples.gyr[rows], samples.interval
