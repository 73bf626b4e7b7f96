"""Errors of each sensor's orientation by each filter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.evaluation.confidence import with_intervals
from testbench.evaluation.dynamics import (
    TrueTurning,
    amplitude_and_frequency,
    convergence_times,
    orientation_delay,
)
from testbench.evaluation.judged import rows_by_step
from testbench.evaluation.metrics import (
    OrientationErrors,
    correlation,
    orientation_errors,
    rms,
    summarise,
    unwrapped_pair,
)
from testbench.evaluation.ranking import rank_filters
from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.model.frame_fit import moved_to_frames
from testbench.model.statistics.memory import ErrorSeries, Layout, error_series, layout
from testbench.model.truth import truth_at
from testbench.records.results.estimate import FrameFit, SensorEstimate
from testbench.records.results.evaluation import OrientationRow
from testbench.records.results.evaluation_rows import (
    MEAN_SQUARE,
    Comparison,
    ErrorSummary,
    OrientationSummary,
    OrientationSweepRow,
    RankRow,
)
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import Truth


@dataclass(frozen=True)
class SensorErrors:
    """Orientation errors of one sensor, and where they count.

    Attributes:
        name: Of the sensor.
        estimate: What was judged.
        q_true: q_world_from_sensor at its instants, shape (n, 4).
        judged: Which samples count, shape (n,).
        steps: Judged steps with their rows; None for a recording without a protocol.
        errors: By filter.
    """

    name: str
    estimate: SensorEstimate
    q_true: np.ndarray
    judged: np.ndarray
    steps: list[tuple[PlannedStep, np.ndarray]] | None
    errors: dict[str, OrientationErrors]

    def series(self) -> dict[str, np.ndarray]:
        """Columns for figures and the viewer."""
        columns = {"host_time_ns": self.estimate.host_time_ns, "judged": self.judged}
        for key, errors in self.errors.items():
            for part in ("total", "heading", "inclination"):
                values = getattr(errors, part)
                if part == "total" or np.isfinite(values).any():
                    columns[f"{key}_{part}_rad"] = values.astype(np.float32)
        return columns

    def by_motion(self) -> dict[str, np.ndarray]:
        """Judged samples: all, those in motion, and where there are both, those at rest, shape
        (n,), bool.
        """
        static = self.judged & self.estimate.static
        dynamic = self.judged & ~self.estimate.static
        if not self.judged.any():
            return {}
        moving = {"dynamic": dynamic} if dynamic.sum() > 10 else {}
        resting = {"static": static} if moving and static.sum() > 10 else {}
        return {"all": self.judged} | resting | moving


def judged_rows(
    steps: list[PlannedStep] | None, truth: Truth, time_ns: np.ndarray, static: np.ndarray
) -> np.ndarray:
    """Which of a sensor's samples are evaluated.

    Args:
        steps: Of the protocol; None without one, where the truth's own marks say it.
        truth: Of the sensor.
        time_ns: Of its samples, increasing, shape (n,) [ns].
        static: Where it is at rest, shape (n,), bool.

    Returns:
        Shape (n,), bool.
    """
    if steps is not None:
        judged = np.zeros(len(time_ns), dtype=bool)
        for _, rows in rows_by_step(steps, time_ns, static):
            judged[rows] = True
        return judged
    if truth.judged is None:
        return np.ones(len(time_ns), dtype=bool)
    nearest = np.clip(np.searchsorted(truth.host_time_ns, time_ns), 0, len(truth.host_time_ns) - 1)
    return np.asarray(truth.judged[nearest])


def sensor_errors(
    name: str, estimate: SensorEstimate, truth: Truth, steps: list[PlannedStep] | None
) -> SensorErrors:
    """Errors of one sensor by every filter."""
    time = estimate.host_time_ns
    q_true = truth_at(truth, time)
    judged = (
        judged_rows(steps, truth, time, estimate.static)
        & np.isfinite(q_true[:, 0])
        & ~estimate.left_out
    )
    by_step = None
    if steps is not None:
        counted = [
            (step, rows[judged[rows]]) for step, rows in rows_by_step(steps, time, estimate.static)
        ]
        by_step = [(step, rows) for step, rows in counted if len(rows)]
    errors = {key: _errors(q, q_true, estimate, key) for key, q in estimate.orientation.items()}
    return SensorErrors(name, estimate, q_true, judged, by_step, errors)


def _errors(
    q_estimated: np.ndarray, q_true: np.ndarray, estimate: SensorEstimate, key: str
) -> OrientationErrors:
    """Errors of a filter, each in the frames that the truth has there.

    Args:
        q_estimated: q_world_from_sensor by the filter, shape (n, 4).
        q_true: The truth, shape (n, 4).
        estimate: Of the sensor.
        key: Name of the filter.
    """
    usual = estimate.frames.get(key, FrameFit())
    errors = aligned_errors(q_estimated, q_true, usual)
    for number, frames in enumerate(estimate.frames_apart, 1):
        rows = np.flatnonzero(estimate.apart == number)
        q = moved_to_frames(q_estimated[rows], usual, frames[key])
        own = aligned_errors(q, q_true[rows], frames[key])
        for part in ("total", "heading", "inclination"):
            getattr(errors, part)[rows] = getattr(own, part)
    return errors


def aligned_errors(
    q_estimated: np.ndarray, q_true: np.ndarray, frames: FrameFit
) -> OrientationErrors:
    """Errors, with heading and inclination about the vertical of the truth's world.

    NaN for both where nobody knows that vertical.

    Args:
        q_estimated: q_world_from_sensor by a filter, shape (n, 4).
        q_true: The truth, shape (n, 4).
        frames: The filter's alignment.
    """
    if frames.leans:
        level_from_world = rotation.conjugate(
            rotation.from_rotation_vector(np.radians(np.array(frames.tilt_deg)))
        )
        q_estimated = rotation.multiply(level_from_world, q_estimated)
        q_true = rotation.multiply(level_from_world, q_true)
    errors = orientation_errors(q_estimated, q_true)
    if frames.up_known:
        return errors
    unknown = np.full(len(errors.total), np.nan)
    return OrientationErrors(errors.total, unknown, unknown)


def lost_truth(sensor: SensorErrors, truth: Truth) -> tuple[int, int] | None:
    """How many samples from the first to the last row of a truth, known or not, have none, and
    how many there are; None where all have.

    Args:
        sensor: Its errors.
        truth: Of the sensor.
    """
    if not np.isfinite(truth.q_world_from_sensor[:, 0]).any():
        return None
    time = sensor.estimate.host_time_ns
    within = (time >= truth.host_time_ns[0]) & (time <= truth.host_time_ns[-1])
    lost = int(np.sum(within & ~np.isfinite(sensor.q_true[:, 0])))
    return (lost, int(within.sum())) if lost else None


def sensor_rows(sensor: SensorErrors) -> list[OrientationRow]:
    """One row for each filter, over all judged samples."""
    rows = []
    for key, errors in sensor.errors.items():
        if sensor.judged.any():
            total, heading, inclination = (
                np.degrees(e[sensor.judged])
                for e in (errors.total, errors.heading, errors.inclination)
            )
            rows.append(
                OrientationRow(
                    sensor.name,
                    key,
                    len(total),
                    rms(total),
                    rms(heading),
                    rms(inclination),
                    float(total.max()),
                )
            )
    return rows


ANGLES = {"heading": rotation.heading_angle, "inclination": rotation.inclination_angle}
"""Parts of an error that are differences of angles."""


def summarise_sensor(
    sensor: SensorErrors, budgets: list[UncertaintyBudget], true: TrueTurning, time_sd: float
) -> list[OrientationSummary]:
    """Every part of the error by every filter: over all judged samples, at rest and in motion.

    Args:
        sensor: Its errors.
        budgets: Of the session.
        true: How the truth turns at the same instants.
        time_sd: Standard uncertainty of the sensor's time [s].
    """
    motions = sensor.by_motion()
    result: dict[str, list[OrientationSummary]] = {motion: [] for motion in motions}
    stated = {budget.quantity: budget for budget in budgets if budget.owner == sensor.name}
    of_the_rest = ~sensor.estimate.is_apart  # elsewhere the truth has frames of its own
    true_angles = {part: angle(sensor.q_true) for part, angle in ANGLES.items()}
    steps = {motion: _steps_within(sensor, mask) for motion, mask in motions.items()}
    layouts = {motion: _layout(sensor, mask, steps[motion]) for motion, mask in motions.items()}
    for key, errors in sensor.errors.items():
        own = sensor.estimate.orientation[key]
        for part, error in (
            ("total", errors.total),
            ("heading", errors.heading),
            ("inclination", errors.inclination),
        ):
            if not np.isfinite(error).any():  # nobody knows where up is
                continue
            level = not sensor.estimate.frames.get(key, FrameFit()).leans
            estimated = ANGLES[part](own) if part in ANGLES and level else None
            budget = stated.get(part)
            expanded = (
                (None, None)
                if budget is None
                else (budget.expanded_deg, budget.expanded_magnitude_deg)
            )
            degrees = np.degrees(error)
            for motion, mask in motions.items():
                series = _series(layouts[motion], error, errors)
                found = _summary(degrees, mask, steps[motion], series)
                usual = mask & of_the_rest
                if estimated is not None:
                    pair = estimated[usual], true_angles[part][usual]
                    found = replace(found, correlation=_correlation(*pair, part))
                if part == "total" and motion == "dynamic":
                    delay = orientation_delay(own, true, usual)
                    if delay is not None:
                        found = replace(
                            found,
                            latency_ms=1e3 * delay[0],
                            latency_sd_ms=1e3 * float(np.hypot(delay[1], time_sd)),
                        )
                if part == "total" and motion == "all":
                    found = _with_settling(found, sensor, error)
                result[motion].append(
                    OrientationSummary(sensor.name, key, motion, part, found, *expanded)
                )
    return [row for rows in result.values() for row in rows]


def rank_sensor(sensor: SensorErrors) -> tuple[list[RankRow], list[Comparison]]:
    """The filters by their RMS total error over all judged samples."""
    series = {}
    when = _layout(sensor, sensor.judged, _steps_within(sensor, sensor.judged))
    for key, errors in sensor.errors.items():
        own = _series(when, errors.total, errors)
        if own is not None:
            series[key] = own
    return (
        rank_filters(sensor.name, None, None, MEAN_SQUARE, series) if len(series) > 1 else ([], [])
    )


def sweep_rows(sensor: SensorErrors) -> list[OrientationSweepRow]:
    """One row for each filter and sweep."""
    rows = []
    for step, counted in sensor.steps or []:
        if step.kind != "sweep":
            continue
        turned = rotation.multiply(
            rotation.conjugate(rotation.mean(sensor.q_true[counted]))[None], sensor.q_true[counted]
        )
        vectors = rotation.to_rotation_vector(turned)
        main = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)[2][0]
        measured = amplitude_and_frequency(sensor.estimate.host_time_ns[counted], vectors @ main)
        for key, errors in sensor.errors.items():
            total, heading, inclination = (
                rms(np.degrees(e[counted]))
                for e in (errors.total, errors.heading, errors.inclination)
            )
            amplitude = None if measured is None else float(np.degrees(measured[0]))
            frequency = None if measured is None else measured[1]
            rows.append(
                OrientationSweepRow(
                    sensor.name,
                    key,
                    step.section,
                    step.index,
                    step.variables,
                    len(counted),
                    total,
                    heading,
                    inclination,
                    amplitude,
                    frequency,
                )
            )
    return rows


def _steps_within(
    sensor: SensorErrors, mask: np.ndarray
) -> list[tuple[PlannedStep, np.ndarray]] | None:
    """Steps with those of their rows that a mask, shape (n,), leaves; steps without any are left
    out. None for a recording without a protocol.
    """
    if sensor.steps is None:
        return None
    kept = [(step, rows[mask[rows]]) for step, rows in sensor.steps]
    return [(step, rows) for step, rows in kept if len(rows)]


def _layout(
    sensor: SensorErrors, mask: np.ndarray, steps: list[tuple[PlannedStep, np.ndarray]] | None
) -> Layout | None:
    """When the errors that a mask, shape (n,), leaves count, every sample alike.

    Args:
        sensor: Its errors.
        mask: Which count.
        steps: As `_steps_within` gives them for the mask.
    """
    rows = [np.flatnonzero(mask)] if steps is None else [rows for _, rows in steps]
    return layout(sensor.estimate.host_time_ns / NANOSECONDS, rows, equally=False)


def _series(
    when: Layout | None, error: np.ndarray, behind: OrientationErrors
) -> ErrorSeries | None:
    """The series of a part of the errors, shape (n,) [rad], in degrees.

    The magnitudes among them are remembered as long as the heading, the one part with a sign.
    """
    if when is None:
        return None
    signed = [] if np.isnan(behind.heading[when.rows]).any() else [np.degrees(behind.heading)]
    return error_series(when, np.degrees(error), *signed)


def _summary(
    error: np.ndarray,
    mask: np.ndarray,
    steps: list[tuple[PlannedStep, np.ndarray]] | None,
    series: ErrorSeries | None,
) -> ErrorSummary:
    """Summary of the errors, shape (n,), that a mask leaves.

    Args:
        error: Of every sample, shape (n,) [deg].
        mask: Which count, shape (n,); at least one.
        steps: As `_steps_within` gives them for the mask.
        series: The same in time; None for too few.
    """
    found = summarise(error[mask])
    result = ErrorSummary(
        found.n,
        0 if steps is None else len(steps),
        found.mean,
        found.mean_abs,
        found.rmse,
        found.median,
        found.iqr,
        found.p95_abs,
        found.max_abs,
    )
    return with_intervals(result, series)


def _with_settling(summary: ErrorSummary, sensor: SensorErrors, error: np.ndarray) -> ErrorSummary:
    poses = [step for step, _ in sensor.steps or [] if step.kind != "sweep"]
    times = convergence_times(sensor.estimate.host_time_ns, error, poses)
    settled = times[np.isfinite(times)]
    if not len(settled):
        return replace(summary, unsettled=len(poses))
    return replace(
        summary,
        convergence_s=float(np.median(settled)),
        convergence_max_s=float(settled.max()),
        unsettled=len(poses) - len(settled),
    )


def _correlation(estimated: np.ndarray, true: np.ndarray, part: str) -> float | None:
    if part == "heading":
        estimated, true = unwrapped_pair(estimated, true)
    return correlation(estimated, true)
