"""Rows of an evaluation that sum up poses, sweeps or samples, or compare filters."""

from __future__ import annotations

from dataclasses import dataclass, field

from testbench.records.disk.json_record import Number

Interval = list[Number] | None
"""Lower and upper end of a 95 % confidence interval, or None where it is not known from the
session.
"""


@dataclass(frozen=True)
class ErrorSummary:
    """What a set of errors comes to; degrees.

    For a joint every pose or sweep counts alike in the means and the RMS, for a sensor every
    sample; median, quartiles, percentile and largest are of all samples together.

    Attributes:
        n: Samples.
        steps: Poses or sweeps; 0 for a recording without a protocol.
        mean_error_deg: Of the signed errors.
        mean_abs_error_deg: Of their magnitudes.
        rmse_deg: Their root mean square.
        median_error_deg: Of the signed errors.
        iqr_deg: Upper less lower quartile of the signed errors.
        p95_abs_error_deg: 95th percentile of the magnitudes.
        max_abs_error_deg: The largest magnitude.
        correlation: Of estimated and true angle (Pearson); None where the true one hardly changes.
        mean_error_ci95_deg: 95 % confidence interval of the mean error: where it would lie if this
            session were repeated on the same part, mounted and switched on as it is.
        mean_abs_error_ci95_deg: That of the mean magnitude.
        rmse_ci95_deg: That of the root mean square.
        blocks: Whole memories of the errors that the section holds.
        block_length: Length of one in equal runs of samples.
        memory_s: The same in seconds: the longest that the errors do not speak against. None where
            too few were judged.
        no_interval: Why an interval is missing; None where none is.
        latency_ms: Delay behind the truth by least squares; None without motion.
        latency_sd_ms: Its standard uncertainty, with that of the clock; None without motion.
        convergence_s: Time from the end of a move until the error stays near its settled value:
            median over the poses; None where none settled.
        convergence_max_s: The longest of these times; None where no pose settled.
        convergence_sd_s: Standard uncertainty of their median; None where none settled.
        unsettled: Poses in which the error did not settle.
    """

    n: int
    steps: int
    mean_error_deg: Number
    mean_abs_error_deg: Number
    rmse_deg: Number
    median_error_deg: Number
    iqr_deg: Number
    p95_abs_error_deg: Number
    max_abs_error_deg: Number
    correlation: float | None = None
    mean_error_ci95_deg: Interval = None
    mean_abs_error_ci95_deg: Interval = None
    rmse_ci95_deg: Interval = None
    blocks: int = 0
    block_length: int = 0
    memory_s: float | None = None
    no_interval: str | None = None
    latency_ms: float | None = None
    latency_sd_ms: float | None = None
    convergence_s: float | None = None
    convergence_max_s: float | None = None
    convergence_sd_s: float | None = None
    unsettled: int = 0


@dataclass(frozen=True)
class JointSummary:
    """Flexion errors of one joint, filter and definition in one section.

    Attributes:
        joint: Of the protocol.
        filter: That gave the orientations.
        sequence: Label of the joint's definition.
        section: Name of the section.
        motion: "static", "dynamic" or, of both, "all".
        errors: What they come to.
        expanded_uncertainty_deg: Of the truth (95 %), for the signed mean.
        expanded_uncertainty_magnitude_deg: Of the truth (95 %), for magnitudes and RMS.
    """

    joint: str
    filter: str
    sequence: str
    section: str
    motion: str
    errors: ErrorSummary
    expanded_uncertainty_deg: float | None = None
    expanded_uncertainty_magnitude_deg: float | None = None


@dataclass(frozen=True)
class AngleErrorRow:
    """Errors of one angle of a joint of a body by one filter, over all that is judged; degrees.

    Attributes:
        joint: Its name.
        filter: That gave the orientations.
        sequence: Label of the joint's definition.
        angle: "first", "second" or "third" of it.
        name: What the definition calls it.
        flexion: Whether the definition takes it for the flexion, whose sign it then has.
        n: Samples.
        mean_error_deg: Of the signed errors: a constant offset shows in it.
        rmse_deg: Root mean square of the errors, with all that is constant in them.
        rmse_without_mean_deg: The same of the errors less their mean.
        max_abs_error_deg: The largest magnitude.
        correlation: Of estimated and true angle (Pearson); None where one of them stands still.
        true_range_deg: Largest less smallest true angle.
    """

    joint: str
    filter: str
    sequence: str
    angle: str
    name: str
    flexion: bool
    n: int
    mean_error_deg: Number
    rmse_deg: Number
    rmse_without_mean_deg: Number
    max_abs_error_deg: Number
    correlation: float | None
    true_range_deg: Number


@dataclass(frozen=True)
class OrientationSummary:
    """Orientation errors of one sensor and filter over the session.

    Attributes:
        motion: "all", "static" or "dynamic".
        part: "total", "heading" (signed) or "inclination".
        expanded_uncertainty_deg: Of the signed mean heading error.
        expanded_uncertainty_magnitude_deg: Of magnitudes and RMS.
    """

    sensor: str
    filter: str
    motion: str
    part: str
    errors: ErrorSummary
    expanded_uncertainty_deg: float | None = None
    expanded_uncertainty_magnitude_deg: float | None = None


@dataclass(frozen=True)
class OrientationSweepRow:
    """Orientation errors of one sensor and filter in one sweep; degrees.

    Attributes:
        sensor: Its name.
        filter: That gave the orientations.
        section: Name of the section.
        step: Index of the step.
        variables: All loop variables.
        n: Samples.
        total_rmse_deg: Of the whole error.
        heading_rmse_deg: Of its part about the vertical.
        inclination_rmse_deg: Of the rest.
        amplitude_deg: Of the sensor's true rotation: half the largest angle between two
            orientations about the mean.
        frequency_hz: Of a sine of the same RMS angle and rate as the true rotation.
    """

    sensor: str
    filter: str
    section: str
    step: int
    variables: dict[str, float]
    n: int
    total_rmse_deg: Number
    heading_rmse_deg: Number
    inclination_rmse_deg: Number
    amplitude_deg: float | None
    frequency_hz: float | None


@dataclass(frozen=True)
class Comparison:
    """Two filters on the same blocks.

    Attributes:
        owner: Joint or sensor.
        section: Of a joint, else None.
        sequence: Label of a joint's definition, else None.
        criterion: What is compared.
        first: One filter.
        second: The other.
        difference: Mean of the criterion by `first` less that by `second`; negative where `first`
            is better.
        p: Of a paired test over blocks, by itself.
        p_holm: The same after Holm's correction for all pairs.
        blocks: Independent ones.
    """

    owner: str
    section: str | None
    sequence: str | None
    criterion: str
    first: str
    second: str
    difference: Number
    p: Number
    p_holm: Number
    blocks: int


@dataclass(frozen=True)
class RankRow:
    """The place of a filter among those of a joint or sensor.

    Attributes:
        owner: Joint or sensor.
        section: Of a joint, else None.
        sequence: Label of a joint's definition, else None.
        criterion: What is compared.
        filter: That has the place.
        value: Of the criterion [deg].
        best_rank: The best place that the comparisons leave open.
        worst_rank: The worst place that the comparisons leave open.
        group: Letters; filters that share a letter were not shown to differ.
        no_difference: Those it was not shown to differ from.
    """

    owner: str
    section: str | None
    sequence: str | None
    criterion: str
    filter: str
    value: Number
    best_rank: int
    worst_rank: int
    group: str
    no_difference: list[str] = field(default_factory=list)


MEAN_MAGNITUDE, MEAN_SQUARE = "mean |flexion error|", "RMS total error"
"""What filters are ranked by: one angle, whose error may be small because two errors cancel in it,
and all of a rotation's error.
"""
RANKED_METRICS = ("flexion_mean_abs_error_deg", "total_rmse_deg")
"""Metrics that filters are compared by, of a joint and of a sensor."""


@dataclass(frozen=True)
class RepeatedSession:
    """A session that counts among the repetitions of a protocol.

    Attributes:
        session: Its name.
        part: What tells its sensors from those of another one: the seed that simulated parts were
            drawn with, or the tags of devices; None where nothing does.
        recorded: When, ISO 8601; None where nobody knows.
    """

    session: str
    part: str | None
    recorded: str | None


@dataclass(frozen=True)
class RepeatedMetric:
    """A metric over several sessions of one protocol.

    Attributes:
        name: E.g. elbow.flexion_mean_abs_error_deg.
        filter: That it belongs to, or None.
        sequence: Label of the joint's definition that it belongs to, or None.
        section: That it belongs to, or None.
        unit: Of all values.
        values: One a session, in the order of the sessions; None where it could not be measured.
        mean: Over all sessions.
        sd: From session to session.
        mean_ci95: Where the mean over all sessions of this kind lies, 95 %.
        another_95: Where one more session of this kind lies, 95 %.
    """

    name: str
    filter: str | None
    sequence: str | None
    section: str | None
    unit: str
    values: list[float | None]
    mean: Number
    sd: Number
    mean_ci95: Interval
    another_95: Interval


@dataclass(frozen=True)
class GyroscopeBiasRow:
    """What a calibrated gyroscope still reads at rest; deg/s, one axis.

    It is the error of the estimated bias.

    Attributes:
        estimated_deg_s: Bias by the calibration.
        estimated_sd_deg_s: Its standard uncertainty.
        error_deg_s: Mean of the calibrated rate at rest in the judged steps.
        error_sd_deg_s: Its standard uncertainty; None where the noise lasts too long to tell.
        samples: How many were taken at rest.
    """

    sensor: str
    axis: str
    estimated_deg_s: Number
    estimated_sd_deg_s: float | None
    error_deg_s: Number
    error_sd_deg_s: float | None
    samples: int


@dataclass(frozen=True)
class TunedRow:
    """A filter that ran with tuned parameters.

    Attributes:
        parameters: Those that were tuned.
        objective: What they were tuned for.
        tuned_utc: When.
        tuned_on: On which sessions.
        on_this_session: Whether this recording was one of them, so that its errors are those of a
            fit and not of a test.
        comparison: Filter that took the place of the truth; None where a truth judged.
    """

    filter: str
    parameters: dict[str, float]
    objective: str
    tuned_utc: str
    tuned_on: list[str]
    on_this_session: bool
    comparison: str | None = None


@dataclass(frozen=True)
class FieldRow:
    """The magnetic field at a sensor against that of the reference pose, by the true orientation.

    Attributes:
        sensor: Its name.
        motion: "all", "static" or "dynamic".
        n: Evaluated samples.
        norm_uT: Length of the field in the reference pose.
        dip_deg: Its angle below the horizontal.
        norm_rms_percent: Deviation of the norm, RMS.
        norm_p95_percent: Deviation of the norm, 95th percentile of magnitudes.
        field_dip_rms_deg: Deviation of the dip, RMS.
        field_dip_p95_deg: Deviation of the dip, 95th percentile of magnitudes.
        field_heading_rms_deg: Deviation of the heading, by which a compass errs, RMS.
        field_heading_p95_deg: Deviation of the heading, 95th percentile of magnitudes.
    """

    sensor: str
    motion: str
    n: int
    norm_uT: Number
    dip_deg: Number
    norm_rms_percent: Number
    norm_p95_percent: Number
    field_dip_rms_deg: Number
    field_dip_p95_deg: Number
    field_heading_rms_deg: Number
    field_heading_p95_deg: Number


@dataclass(frozen=True)
class FieldErrorRow:
    """Heading error of a filter where the field was disturbed by so much.

    Attributes:
        sensor: Its name.
        filter: That gave the orientations.
        quantity: "heading" [deg], "norm" [%] or "dip" [deg] of the field.
        low: Lower end of the class of disturbance.
        high: Upper end of the class; None for no end.
        mean: Disturbance in the class.
        n: Samples.
        heading_rmse_deg: Of the filter.
    """

    sensor: str
    filter: str
    quantity: str
    low: Number
    high: float | None
    mean: Number
    n: int
    heading_rmse_deg: Number


@dataclass(frozen=True)
class FieldFollowingRow:
    """How much of the changes of the field's heading a filter's heading follows.

    Attributes:
        n: Half seconds.
        field_change_deg: Standard deviation of the field's heading against its mean over the minute
            around.
        followed: Slope of the filter's heading error, changes likewise, on the error of a compass:
            1 follows wholly, 0 ignores the field; None where the field changes by less than 0.2 deg
            or for less than three minutes.
        followed_ci95: By blocks, and wider by what a gyroscope's errors may do in the pace of the
            field.
        blocks: Independent ones.
    """

    sensor: str
    filter: str
    n: int
    field_change_deg: Number
    followed: float | None
    followed_ci95: Interval
    blocks: int


@dataclass(frozen=True)
class OutlierRow:
    """A filter whose error is beyond the upper quartile of all others by three quartile ranges.

    Attributes:
        owner: Sensor or joint.
        section: Of a joint, else None.
        sequence: Label of a joint's definition, else None.
        motion: "all", "static" or "dynamic".
        quantity: "heading" or "inclination" (RMS, of a sensor), "flexion" (mean magnitude) or
            "total" (RMS, of a joint).
        filter: That is far off.
        value_deg: Of this filter.
        fence_deg: Where the others end.
        known: What is known of this filter; empty if nothing.
    """

    owner: str
    section: str | None
    sequence: str | None
    motion: str
    quantity: str
    filter: str
    value_deg: Number
    fence_deg: Number
    known: str


@dataclass(frozen=True)
class CycleRow:
    """The average cycle of a joint's angle in one periodic sweep, estimated against true; degrees.

    Attributes:
        joint: Of the protocol, or of the arm where a chain filter estimates it.
        filter: Or state of the chain.
        sequence: Label of the joint's definition; None for a chain.
        section: Name of the sweep's section.
        step: Index of the sweep's step.
        variables: All loop variables.
        frequency_hz: Of the sweep's cycles.
        cycles: How many are averaged.
        left_out: How many are not, for gaps.
        rom_deg: Estimated range of motion, mean over the cycles.
        true_rom_deg: True range of motion, mean over the cycles.
        rom_error_deg: Estimated less true range of motion.
        rom_error_sd_deg: Standard deviation of that of a single cycle.
        mean_error_deg: Signed.
        rmse_deg: Root mean square difference of the average cycles.
        error_sd_deg: Standard deviation of the error over the cycles, RMS over the cycle.
        true_sd_deg: Standard deviation of the true angle over the cycles, RMS over the cycle.
        cmc: Coefficient of multiple correlation; None where it is no real number.
    """

    joint: str
    filter: str
    sequence: str | None
    section: str
    step: int
    variables: dict[str, float]
    frequency_hz: Number
    cycles: int
    left_out: int
    rom_deg: Number
    true_rom_deg: Number
    rom_error_deg: Number
    rom_error_sd_deg: Number
    mean_error_deg: Number
    rmse_deg: Number
    error_sd_deg: Number
    true_sd_deg: Number
    cmc: float | None


@dataclass(frozen=True)
class PlateauRow:
    """One filter in one plateau.

    Attributes:
        joint: Its name.
        filter: That gave the orientations.
        sequence: Label of the joint's definition.
        plateau: From 1, in the order of time.
        begin_s: Since the first sample.
        end_s: Likewise.
        typed_deg: What the person read.
        mean_deg: Of the flexion.
        sd_deg: Of its samples.
        error_deg: Mean less typed.
    """

    joint: str
    filter: str
    sequence: str
    plateau: int
    begin_s: float
    end_s: float
    typed_deg: float
    mean_deg: float
    sd_deg: float
    error_deg: float
