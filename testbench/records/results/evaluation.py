"""Evaluation: errors against the truth, and the verdict; docs/session_format.md documents it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter, with_config

from testbench.exceptions import NotFoundError, SessionError
from testbench.records.disk.html_table import html_table
from testbench.records.disk.json_file import plain_values, read_json, write_json
from testbench.records.disk.json_record import AS_WRITTEN, Number, read_record
from testbench.records.disk.replacing import replaced_folder, stored
from testbench.records.disk.tables import read_parquet, rows_to_arrow, write_parquet
from testbench.records.findings.earlier import sentences_to_findings
from testbench.records.findings.finding import Finding
from testbench.records.results.evaluation_rows import (
    AngleErrorRow,
    Comparison,
    CycleRow,
    FieldErrorRow,
    FieldFollowingRow,
    FieldRow,
    GyroscopeBiasRow,
    Interval,
    JointSummary,
    OrientationSummary,
    OrientationSweepRow,
    OutlierRow,
    RankRow,
    RepeatedMetric,
    RepeatedSession,
    TunedRow,
)
from testbench.records.results.recording_rows import (
    AngleRangeRow,
    DifferenceRow,
    FoundCycleRow,
    OrientationChangeRow,
    RestRow,
)
from testbench.records.results.uncertainty import UncertaintyBudget
from testbench.records.session.layout import EVALUATION, EVALUATION_SUMMARY, table_file
from testbench.records.session.session_lock import session_lock

if TYPE_CHECKING:
    import pyarrow as pa

SCHEMA_VERSION = 2
MOST_SHOWN = 12
"""Metrics without a limit that a notebook shows."""


class Outcome(StrEnum):
    """The verdict on the sensor; says nothing of the bench."""

    PASS = "pass"
    MARGINAL = "marginal"
    FAIL = "fail"
    NOT_MEASURED = "not_measured"

    @property
    def words(self) -> str:
        """For people."""
        return self.value.replace("_", " ")


NO_LIMITS = "no limits were stated"
"""What people are told where nothing was limited: `not_measured` would read as if the bench had
failed to measure.
"""


SEVERITY = [Outcome.PASS, Outcome.MARGINAL, Outcome.NOT_MEASURED, Outcome.FAIL]


@dataclass(frozen=True)
class JointRow:
    """Errors of a flexion angle over one commanded pose, or one sweep; degrees.

    Attributes:
        joint: Of the protocol.
        filter: That gave the orientations.
        sequence: Label of the joint's definition.
        section: Name of the section.
        step: Index of the step.
        kind: Of the step: "move", "sweep" or "hold".
        misalignment_deg: As commanded; None where the protocol has no such variable.
        flexion_deg: As commanded, or None likewise.
        variables: All loop variables.
        n: Samples.
        flexion_mean_error_deg: Mean of the signed errors of the flexion.
        flexion_mean_abs_error_deg: Mean of their magnitudes.
        flexion_sd_deg: Their standard deviation.
        flexion_rmse_deg: Their root mean square.
        flexion_max_abs_error_deg: The largest magnitude.
        other_mean_abs_error_deg: Mean magnitudes of the errors of the two other angles, in their
            order, against the same definition of the true orientations; None in gimbal lock.
        flexion_median_error_deg: Median of the signed errors.
        flexion_iqr_deg: Upper less lower quartile of the signed errors.
        flexion_p95_abs_error_deg: 95th percentile of the magnitudes.
        flexion_correlation: Of estimated and true flexion; None but for sweeps.
        amplitude_deg: Of the true flexion; None but for sweeps.
        frequency_hz: Of the true flexion, likewise.
        latency_ms: Delay of the estimated flexion behind the true one; None but for sweeps.
        latency_sd_ms: Standard uncertainty of the delay; None but for sweeps.
        convergence_s: Until the error stays near its settled value; None where it did not settle,
            and but for poses.
    """

    joint: str
    filter: str
    sequence: str
    section: str
    step: int
    kind: str
    misalignment_deg: float | None
    flexion_deg: float | None
    variables: dict[str, float]
    n: int
    flexion_mean_error_deg: Number
    flexion_mean_abs_error_deg: Number
    flexion_sd_deg: Number
    flexion_rmse_deg: Number
    flexion_max_abs_error_deg: Number
    other_mean_abs_error_deg: list[float | None]
    flexion_median_error_deg: float | None = None
    flexion_iqr_deg: float | None = None
    flexion_p95_abs_error_deg: float | None = None
    flexion_correlation: float | None = None
    amplitude_deg: float | None = None
    frequency_hz: float | None = None
    latency_ms: float | None = None
    latency_sd_ms: float | None = None
    convergence_s: float | None = None


@dataclass(frozen=True)
class OrientationRow:
    """Errors of a sensor's orientation by one filter over all judged samples; degrees."""

    sensor: str
    filter: str
    n: int
    total_rmse_deg: Number
    heading_rmse_deg: Number
    inclination_rmse_deg: Number
    total_max_deg: Number


@dataclass(frozen=True)
class NoiseRow:
    """One axis over the longest rest; every number in the unit that stands behind it.

    Attributes:
        sensor: Its name.
        quantity: "acc", "gyr" or "mag".
        axis: "x", "y" or "z".
        samples: In the rest.
        span_s: Length of the rest.
        mean: Of the readings.
        sd: Standard deviation of the readings.
        unit: Of mean and standard deviation.
        noise_density: One-sided, as data sheets state it.
        noise_density_sd: Its standard uncertainty.
        noise_density_unit: Of both.
        random_walk: The same noise as angle or velocity random walk.
        random_walk_unit: Of that.
        bias_instability: By the Allan deviation; None where lost among the other noises.
        bias_instability_sd: Its standard uncertainty.
        bias_instability_unit: Of both.
        rate_random_walk: By the Allan deviation; None where lost among the other noises.
        rate_random_walk_sd: Its standard uncertainty.
        rate_random_walk_unit: Of both.
        noise_bandwidth_hz: Of the low pass that the noise went through; None where it shows none.
    """

    sensor: str
    quantity: str
    axis: str
    samples: int
    span_s: Number
    mean: Number
    sd: Number
    unit: str
    noise_density: float | None
    noise_density_sd: float | None
    noise_density_unit: str
    random_walk: float | None
    random_walk_unit: str
    bias_instability: float | None
    bias_instability_sd: float | None
    bias_instability_unit: str
    rate_random_walk: float | None
    rate_random_walk_sd: float | None
    rate_random_walk_unit: str
    noise_bandwidth_hz: float | None = None


@dataclass(frozen=True)
class EulerRangeRow:
    """How far each of a sensor's own Euler angles went over one section; degrees.

    These are the limit tests of an axis identification.

    Attributes:
        sensor: Its name.
        section: Name of the section.
        filter: That gave the orientations.
        sequence: Of the Euler angles.
        true_deg: Largest less smallest of the three true angles, the outer ones unwrapped between
            passages of gimbal lock and on the circle across them; None for the outer ones of a
            section that was in gimbal lock.
        estimated_deg: The same of the estimated angles.
        locked_percent: Part of the samples in gimbal lock, where only the sum (or difference) of
            the outer angles is defined.
        outer_true_deg: Range of that sum by the truth in a locked section, else None.
        outer_estimated_deg: Range of that sum by the estimate in a locked section, else None.
    """

    sensor: str
    section: str
    filter: str
    sequence: str
    true_deg: list[float | None]
    estimated_deg: list[float | None]
    locked_percent: Number
    outer_true_deg: float | None
    outer_estimated_deg: float | None


@dataclass(frozen=True)
class ChainRow:
    """Errors of one joint of the arm by the chain filter, over one section; degrees and seconds.

    Attributes:
        section: Name of the section.
        state: What the filter estimated.
        joint: Of the arm, or all together.
        n: Samples.
        mean_error_deg: Signed; it hides what it averages.
        median_error_deg: Of the signed errors.
        mean_abs_error_deg: Mean of the magnitudes.
        rmse_deg: Root mean square of the errors.
        iqr_deg: Distance of the quartiles of the error.
        outliers_percent: Errors beyond the quartiles by 1.5 times that.
        largest_error_deg: The error of largest magnitude, with its sign.
        smallest_error_deg: The error of smallest magnitude, with its sign.
        relative_percent: Mean of |error| / |true angle| where that exceeds 1 deg; None where it
            never does.
        correlation: Of estimate and truth; None where the joint stands still.
        rate_rmse_deg_s: Of the joint's rate.
        acceleration_rmse_deg_s2: Of the joint's acceleration.
        uncertainty_deg: RMS of the standard uncertainty stated.
        normalised_error: RMS of error over uncertainty, 1 where it is honest.
        covered_percent: Errors within 1.96 of it.
        expanded_uncertainty_deg: Of the truth (95 %), for the signed mean; None where not known.
        expanded_uncertainty_magnitude_deg: Of the truth (95 %), for magnitudes; None where not
            known.
    """

    section: str
    state: str
    joint: str
    n: int
    mean_error_deg: Number
    median_error_deg: Number
    mean_abs_error_deg: Number
    rmse_deg: Number
    iqr_deg: Number
    outliers_percent: Number
    largest_error_deg: Number
    smallest_error_deg: Number
    relative_percent: float | None
    correlation: float | None
    rate_rmse_deg_s: Number
    acceleration_rmse_deg_s2: Number
    uncertainty_deg: Number
    normalised_error: Number
    covered_percent: Number
    expanded_uncertainty_deg: float | None = None
    expanded_uncertainty_magnitude_deg: float | None = None


@dataclass(frozen=True)
class Metric:
    """One number with its limits and verdict.

    Attributes:
        name: E.g. elbow.flexion_mean_abs_error_deg.
        value: None where it could not be measured.
        unit: Of the value and its limits.
        lower: The least that passes, or None.
        upper: The most that passes, or None.
        outcome: None where no limit is stated.
        meaning: A sentence for people.
        filter: That it belongs to, or None.
        sequence: Label of the joint's definition that it belongs to, or None.
        section: That it belongs to, or None.
        expanded_uncertainty: Of the truth it was held against, or of the delay or time itself
            (95 %), in the metric's unit; None where it is not known.
        ci95: 95 % confidence interval for this session repeated on the same part, mounted and
            switched on as it was, or None.
        no_uncertainty: What its budget lacks, in words, so that no uncertainty is stated and it
            cannot pass; None where the uncertainty is stated, or a metric of this kind has none.
        no_interval: Why there is no confidence interval, in words; None where there is one, or a
            metric of this kind has none.
        sessions: How many equal sessions its limit names; 0 where it names none.
        session_sd: Standard deviation between those, in the metric's unit; None for too few.
        otherwise_percent: How often an equal session would come out otherwise [%]; None where that
            is not known.
    """

    name: str
    value: float | None
    unit: str
    lower: float | None
    upper: float | None
    outcome: Outcome | None
    meaning: str
    filter: str | None = None
    sequence: str | None = None
    section: str | None = None
    expanded_uncertainty: float | None = None
    ci95: Interval = None
    no_uncertainty: str | None = None
    no_interval: str | None = None
    sessions: int = 0
    session_sd: float | None = None
    otherwise_percent: float | None = None


@dataclass(frozen=True)
class ResultTables:
    """Results of a sensor, of a joint or of all, by table; a further table is a further field here.

    Attributes:
        joint_angle: Flexion errors by pose and sweep.
        orientation: Orientation errors by sensor and filter.
        findings: What a reader must know.
        noise: Of the sensors at rest.
        euler_ranges: How far the sensors' own Euler angles went.
        joint_summary: Flexion errors of whole sections, static and dynamic, with confidence.
        angle_errors: Errors of each angle of joints of a body, with and without their mean.
        orientation_summary: Orientation errors of the session, static and dynamic, with confidence.
        orientation_sweeps: Orientation errors sweep by sweep.
        ranking: Places of the filters.
        comparisons: Pairs of filters, with the significance of their difference.
        uncertainty: Budgets of the truth.
        gyroscope_bias: What the calibration left.
        tuned: Filters that ran with tuned parameters.
        series: Error signals for figures and the viewer, by table name and column; kept beside
            evaluation.json as Parquet. "orientation_<sensor>": host_time_ns, judged, and for each
            filter <filter>_total_rad, <filter>_heading_rad, <filter>_inclination_rad.
            "joint_<joint>": host_time_ns, judged, reference_rad (true flexion), and for each filter
            and sequence <filter>_<sequence>_flexion_rad and <filter>_<sequence>_error_rad; for each
            filter <filter>_total_error_rad. "magnetic_<sensor>": host_time_ns, judged, and
            deviations of the field: norm_percent, dip_rad, heading_rad. "chain_<section>_<state>":
            host_time_ns, judged, and for each joint <joint>_rad, <joint>_error_rad, <joint>_sd_rad.
            "cycles": row (its place in `cycles`), cycle_percent, and estimated_rad, true_rad,
            error_rad with their standard deviations over the cycles, <name>_sd_rad; 101 rows for
            each. Of what is not judged: "difference_<sensor>": host_time_ns, and for each row of
            `comparison` <first>_<second>_total_rad, ..._heading_rad, ..._inclination_rad;
            "euler_<sensor>" and "motion_<joint>": host_time_ns, and for each filter and sequence
            <filter>_<sequence>_first_rad and so on, unwrapped; "found_cycles": row (its place in
            `found_cycles`), cycle_percent, mean and sd in the row's unit.
        chain: Errors of the arm's joints by the chain filter.
        magnetic_field: How far the field was disturbed.
        magnetic_errors: Heading errors by how far the field was disturbed.
        outliers: Filters far from all others.
        magnetic_following: How much of the field's changes each filter follows.
        cycles: Average cycles of sweeps.
        comparison: Orientations of a sensor against one another, of which none is the truth.
        angle_ranges: How far the angles of sensors and joints went that nobody judges.
        found_cycles: Average cycles that were found in recordings without a plan.
        rests: How long each sensor rested.
        orientation_changes: How sensors lay in the last rest against the first.
        repeated_sessions: Sessions of the same protocol that were looked at together, this one
            first; none where nobody asked.
        repeats: Metrics over these.
        repeat_ranking: Places of the filters over these.
        repeat_comparisons: Pairs of filters over these.
    """

    joint_angle: list[JointRow] = field(default_factory=list)
    orientation: list[OrientationRow] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    noise: list[NoiseRow] = field(default_factory=list)
    euler_ranges: list[EulerRangeRow] = field(default_factory=list)
    joint_summary: list[JointSummary] = field(default_factory=list)
    angle_errors: list[AngleErrorRow] = field(default_factory=list)
    orientation_summary: list[OrientationSummary] = field(default_factory=list)
    orientation_sweeps: list[OrientationSweepRow] = field(default_factory=list)
    ranking: list[RankRow] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    uncertainty: list[UncertaintyBudget] = field(default_factory=list)
    gyroscope_bias: list[GyroscopeBiasRow] = field(default_factory=list)
    tuned: list[TunedRow] = field(default_factory=list)
    series: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    chain: list[ChainRow] = field(default_factory=list)
    magnetic_field: list[FieldRow] = field(default_factory=list)
    magnetic_errors: list[FieldErrorRow] = field(default_factory=list)
    outliers: list[OutlierRow] = field(default_factory=list)
    magnetic_following: list[FieldFollowingRow] = field(default_factory=list)
    cycles: list[CycleRow] = field(default_factory=list)
    comparison: list[DifferenceRow] = field(default_factory=list)
    angle_ranges: list[AngleRangeRow] = field(default_factory=list)
    found_cycles: list[FoundCycleRow] = field(default_factory=list)
    rests: list[RestRow] = field(default_factory=list)
    orientation_changes: list[OrientationChangeRow] = field(default_factory=list)
    repeated_sessions: list[RepeatedSession] = field(default_factory=list)
    repeats: list[RepeatedMetric] = field(default_factory=list)
    repeat_ranking: list[RankRow] = field(default_factory=list)
    repeat_comparisons: list[Comparison] = field(default_factory=list)

    @property
    def notes(self) -> list[str]:
        """The findings as sentences."""
        return [str(finding) for finding in self.findings]

    @staticmethod
    def joined(parts: Iterable[ResultTables]) -> ResultTables:
        """The rows and error signals of several parts, in their order."""
        parts = list(parts)
        series = {name: columns for part in parts for name, columns in part.series.items()}
        rows: dict[str, list[Any]] = {
            name: [row for part in parts for row in getattr(part, name)] for name in TABLES
        }
        return ResultTables(**rows, series=series)


TABLES = tuple(own.name for own in fields(ResultTables) if own.name != "series")


@with_config(AS_WRITTEN)
@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation(ResultTables):
    """All results of a session.

    Each of its tables is a list of rows; `to_arrow("joint_angle")` and `to_pandas` give one as a
    data frame.

    Attributes:
        session: Its name.
        metrics: What limits are put on, with its verdict.
        outcome: Of all limits together.
        headline: The first sentence of what the session answers; empty where it answers nothing.
    """

    session: str
    metrics: list[Metric] = field(default_factory=list)
    outcome: Outcome = Outcome.NOT_MEASURED
    headline: str = ""

    def __repr__(self) -> str:
        rows = {"metrics": self.metrics} | {name: getattr(self, name) for name in TABLES}
        held = ", ".join(f"{len(own)} {name}" for name, own in rows.items() if own)
        return f"<Evaluation of {self.session}: {self.verdict}; {held or 'no rows'}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the verdict, and what has a limit; without any, what has none."""
        limited = [metric for metric in self.metrics if metric.outcome is not None]
        titles = ("metric", "filter", "sequence", "section", "value", "U", "unit", "outcome")
        rows = [
            (
                *(metric.name, metric.filter, metric.sequence, metric.section, metric.value),
                *(metric.expanded_uncertainty, metric.unit),
                metric.outcome.words if metric.outcome else None,
            )
            for metric in limited or self.metrics[:MOST_SHOWN]
        ]
        left = len(self.metrics) - len(rows)
        more = f"; {left} more in .metrics" if left else ""
        return html_table(f"Evaluation of {self.session}: {self.verdict}{more}", titles, rows)

    def to_arrow(self, table: str) -> pa.Table:
        """One of its tables, a column for each field; of nested ones with dots in the name.

        Args:
            table: "metrics" or a name of `TABLES`, such as "joint_angle".

        Raises:
            NotFoundError: There is no such table.
        """
        known = ["metrics", *TABLES]
        if table not in known:
            raise NotFoundError("table", table, known)
        return rows_to_arrow(plain_values(getattr(self, table)))

    def to_pandas(self, table: str) -> Any:
        """The same as a pandas DataFrame; needs pandas, which the bench itself does not.

        Args:
            table: As `to_arrow` takes it.

        Raises:
            NotFoundError: There is no such table.
            ImportError: pandas is not installed.
        """
        return self.to_arrow(table).to_pandas()

    @property
    def judged(self) -> bool:
        """Whether anything was held against a truth."""
        return bool(self.orientation or self.joint_angle or self.chain)

    @property
    def limited(self) -> bool:
        """Whether the protocol states a limit for anything."""
        return any(metric.outcome is not None for metric in self.metrics)

    @property
    def verdict(self) -> str:
        """The outcome in the words that terminal and report share."""
        return _words(self.outcome, self.limited)

    def to_dict(self) -> dict[str, Any]:
        """The content of evaluation.json."""
        result: dict[str, Any] = plain_values(self._document())
        return result

    def _document(self) -> dict[str, Any]:
        names = ("session", "outcome", "headline", "metrics", *TABLES)
        head = {"schema_version": SCHEMA_VERSION, "notes": self.notes}
        return head | {name: getattr(self, name) for name in names}

    def save(self, session_folder: Path) -> None:
        """Write evaluation.json and the error signals, in place of earlier ones."""
        target, summary = session_folder / EVALUATION, session_folder / EVALUATION_SUMMARY
        with (
            session_lock(session_folder),
            stored(target),
            replaced_folder(target, summary) as folder,
        ):
            for name, columns in self.series.items():
                write_parquet(
                    folder / table_file(name), columns, {"content": "errors against the truth"}
                )
            write_json(folder / EVALUATION_SUMMARY, self._document())

    @staticmethod
    def load(session_folder: Path) -> Evaluation:
        """Read it back.

        Raises:
            SessionError: It is missing or damaged.
        """
        with session_lock(session_folder):
            return Evaluation._load(session_folder)

    @staticmethod
    def _load(session_folder: Path) -> Evaluation:
        found = read_record(
            session_folder / EVALUATION_SUMMARY,
            _as_written(),
            SCHEMA_VERSION,
            "run `testbench evaluate` again",
            partial(sentences_to_findings, key="notes"),
        )
        tables = sorted((session_folder / EVALUATION).glob(table_file("*")))
        return replace(found, series={path.stem: read_parquet(path) for path in tables})


@cache
def _as_written() -> TypeAdapter[Evaluation]:
    return TypeAdapter(Evaluation)


class StoredVerdict(NamedTuple):
    """What a session's last evaluation came to.

    Attributes:
        outcome: Of all limits together.
        words: The same for people.
        headline: The first sentence of what the session answers; empty where it answers nothing,
            or was evaluated by an earlier version.
    """

    outcome: Outcome
    words: str
    headline: str


def stored_verdict(session_folder: Path) -> StoredVerdict | None:
    """What a session's last evaluation came to; None if there is none.

    Raises:
        SessionError: What was written of it is damaged.
    """
    file = session_folder / EVALUATION_SUMMARY
    if not file.is_file():
        return None
    data = read_json(file)
    outcome = data.get("outcome") if isinstance(data, dict) else None
    if outcome not in list(Outcome):
        raise SessionError(
            f"{file} is damaged: its outcome is {outcome!r:.50}; run `testbench evaluate` again"
        )
    metrics = data.get("metrics")
    limited = isinstance(metrics, list) and any(
        isinstance(m, dict) and m.get("outcome") for m in metrics
    )
    headline = data.get("headline")
    told = headline if isinstance(headline, str) else ""
    return StoredVerdict(Outcome(outcome), _words(Outcome(outcome), limited), told)


def _words(outcome: Outcome, limited: bool) -> str:
    return outcome.words if limited or outcome is not Outcome.NOT_MEASURED else NO_LIMITS
