"""Estimate: sensors, filters and joint angles on the host's clock and in the world frame.

It is derived, and may be rebuilt.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, with_config

from testbench.records.disk.json_file import write_json
from testbench.records.disk.json_record import AS_WRITTEN, Array, Number, read_record
from testbench.records.disk.replacing import remove, replaced_folder, stored
from testbench.records.disk.tables import read_parquet, read_stacked, write_parquet
from testbench.records.findings.earlier import sentences_to_findings
from testbench.records.findings.finding import Finding
from testbench.records.results.chain import ChainEstimate, ChainFacts
from testbench.records.results.tuning import UsedTuning
from testbench.records.session.layout import (
    ESTIMATE,
    ESTIMATE_SUMMARY,
    OF_AN_ESTIMATE,
    joint_table,
    orientation_table,
    table_file,
)
from testbench.records.session.samples import QUATERNION, join, names, split
from testbench.records.session.session_lock import session_lock

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class ClockFit:
    """A sensor's clock against the host's: device time = host time * (1 + drift) + offset.

    Attributes:
        offset_s: The offset.
        drift_ppm: The drift.
        offset_sd_s: Standard uncertainty of the offset.
        drift_sd_ppm: Standard uncertainty of the drift.
        residual_deg_s: RMS difference of the angular-rate magnitudes after the fit.
        angle_error_deg: Angle that the uncertainty of the time means at the peak rate.
        method: "angular_rate"; "arrival" where nothing could be fitted to; "none" where the sensor
            is on the host's clock.
        correlation: Of the angular-rate magnitudes after the fit, or at the best shift that was
            found [1].
        refused: Why the motion gave no fit; "" where it did, or was not asked.
        candidates_s: Shifts of the truth's times that fit alike, where the motion repeats itself.
        unit_factor: What the truth's times would have to be multiplied by to fit.
        shift_s: What the fit added to the truth's times as they were read, where each record had a
            zero of its own.
    """

    offset_s: Number = 0.0
    drift_ppm: Number = 0.0
    offset_sd_s: Number = float("nan")
    drift_sd_ppm: Number = float("nan")
    residual_deg_s: Number = float("nan")
    angle_error_deg: Number = float("nan")
    method: str = "none"
    correlation: Number = float("nan")
    refused: str = ""
    candidates_s: list[float] = field(default_factory=list)
    unit_factor: float | None = None
    shift_s: float | None = None

    def to_host(self, device_time_ns: np.ndarray) -> np.ndarray:
        """Host times of device times.

        Args:
            device_time_ns: By the sensor's own clock, shape (n,).

        Returns:
            Shape (n,), int64 [ns].
        """
        host = (device_time_ns - 1e9 * self.offset_s) / (1 + 1e-6 * self.drift_ppm)
        return np.asarray(np.round(host).astype(np.int64))


def as_kept(values: np.ndarray) -> np.ndarray:
    """Orientations or angles as an estimate keeps them: 7 digits (float32), about 1e-5 deg.

    Whoever makes an estimate evaluates what others will read.

    Args:
        values: Shape (...), parts of quaternions or angles [rad].

    Returns:
        Shape (...), doubles.
    """
    return np.asarray(values, np.float32).astype(float)


@dataclass(frozen=True)
class FrameFit:
    """How a filter's earth frame and a sensor's mounting were brought to the world and the segment.

    Attributes:
        heading_deg: Heading of the filter's earth frame seen from the world: q_world_from_earth
            turns by it about the vertical.
        mounting_deg: How the sensor sits against its mounting as believed, as the rotation vector
            of q_believed_from_sensor.
        method: Of the alignment, as a protocol spells it.
        tilt_deg: Remaining rotation of the levelled earth against the world, as a rotation vector;
            only "motion" solves for it.
        mounting_sd_deg: Standard uncertainty of the mounting about each axis.
        observability: RMS sine of the motion about the least moved axis.
        residual_deg: RMS angle between filter and truth that the alignment left.
        covariance_deg2: Of small rotations of the mounting (about the axes of the sensor) and of
            the world (about those of the filter's earth), 6 rows of 6, without what is
            undetermined.
        undetermined: Directions in those six that the motion does not show, unit vectors: turning
            mounting and world along one changes nothing that was seen. They are held at `held_by`.
        held_by: What holds them: "mounting" (nearest to the one that is believed), "vertical" (the
            truth's z axis is up), or "".
        up_known: Whether the vertical of the truth's world is known, so that errors can be parted
            into heading and inclination.
        leans: Whether that vertical is not the world's z axis but what `tilt_deg` makes of it.
        refused: Why it could not be aligned, so that nothing is judged by it; "" where it was.
    """

    heading_deg: Number = 0.0
    mounting_deg: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    method: str = "none"
    tilt_deg: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    mounting_sd_deg: tuple[Number, Number, Number] | None = None
    observability: float | None = None
    residual_deg: float | None = None
    covariance_deg2: list[list[float]] = field(default_factory=list)
    undetermined: list[list[float]] = field(default_factory=list)
    held_by: str = ""
    up_known: bool = True
    leans: bool = False
    refused: str = ""


@dataclass(frozen=True)
class CalibrationFit:
    """Corrections of a sensor, in the axes of the mounting as believed.

    acc = acc_matrix (acc_raw - acc_bias); gyr = R (gyr_raw - gyr_bias - gyr_g_matrix acc_raw); mag
    = R mag_raw, with R = R_believed_from_sensor: what turns one triad of a part turns them all.

    Attributes:
        acc_matrix: Shape (3, 3) [1].
        acc_bias: Shape (3,) [m/s^2].
        acc_bias_sd: Standard uncertainty of it, shape (3,) [m/s^2].
        gyr_bias: Shape (3,) [rad/s].
        gyr_bias_sd: Standard uncertainty of it, shape (3,) [rad/s].
        gyr_g_matrix: Response of the gyroscope to specific force, shape (3, 3) [rad/s/(m/s^2)].
        R_believed_from_sensor: How the sensor really sits against the mounting as believed, shape
            (3, 3).
        poses: Number of static poses used.
        residual_m_s2: RMS over the poses.
        method: Of the calibration, as a protocol spells it.
    """

    acc_matrix: Array = field(default_factory=lambda: np.eye(3))
    acc_bias: Array = field(default_factory=lambda: np.zeros(3))
    acc_bias_sd: Array = field(default_factory=lambda: np.full(3, np.nan))
    gyr_bias: Array = field(default_factory=lambda: np.zeros(3))
    gyr_bias_sd: Array = field(default_factory=lambda: np.full(3, np.nan))
    gyr_g_matrix: Array = field(default_factory=lambda: np.zeros((3, 3)))
    R_believed_from_sensor: Array = field(default_factory=lambda: np.eye(3))
    poses: int = 0
    residual_m_s2: Number = float("nan")
    method: str = "none"

    def apply(
        self, gyr: np.ndarray, acc: np.ndarray, mag: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Corrected readings.

        Args:
            gyr: Angular rate as read, shape (n, 3) [rad/s].
            acc: Specific force as read, shape (n, 3) [m/s^2].
            mag: Field as read, shape (n, 3) [uT], or None.

        Returns:
            Angular rate [rad/s], specific force [m/s^2] and field [uT] or None, each of shape
            (n, 3).
        """
        if self.method == "none":
            return gyr, acc, mag
        corrected = (acc - self.acc_bias) @ self.acc_matrix.T
        rate = (gyr - self.gyr_bias - acc @ self.gyr_g_matrix.T) @ self.R_believed_from_sensor.T
        return rate, corrected, None if mag is None else self.apply_to_field(mag)

    def apply_to_field(self, mag: np.ndarray) -> np.ndarray:
        """A corrected field.

        Args:
            mag: As read, shape (n, 3) [uT].

        Returns:
            Shape (n, 3) [uT].
        """
        return mag if self.method == "none" else mag @ self.R_believed_from_sensor.T


@dataclass(frozen=True)
class TimingAudit:
    """What the time stamps of a recording say; rates in Hz, times in ms, by the sensor's own clock.

    Attributes:
        effective_rate_hz: Samples that arrived over the time they took.
        sampling_rate_hz: Of the intervals that are no gaps.
        jitter_ms: Standard deviation of those.
        gaps: Intervals over 1.5 median ones.
        lost_packets: By the counter.
        arrival_jitter_ms: Standard deviation of the arrival at the host about a straight line.
        acc_after_gyr_ms: How much later the accelerometer sees a turn than the gyroscope; NaN where
            the motion does not tell.
        acc_after_gyr_sd_ms: Standard uncertainty of that.
    """

    samples: int = 0
    nominal_rate_hz: float | None = None
    effective_rate_hz: Number = float("nan")
    sampling_rate_hz: Number = float("nan")
    interval_median_ms: Number = float("nan")
    jitter_ms: Number = float("nan")
    repeated_stamps: int = 0
    backward_stamps: int = 0
    gaps: int = 0
    longest_gap_ms: Number = 0.0
    lost_packets: int = 0
    lost_percent: Number = 0.0
    arrival_jitter_ms: Number = float("nan")
    acc_after_gyr_ms: Number = float("nan")
    acc_after_gyr_sd_ms: Number = float("nan")


@dataclass(frozen=True)
class AxisFinding:
    """The axes of one triad, found from the motion.

    Attributes:
        axes: Which axis of the recording is each of the sensor's, e.g. "x: -z, y: -y, z: -x"; for a
            quaternion how it is to be read; None where the motion does not tell.
        right_handed: Whether the map keeps the hand; None where only two axes moved.
        gain: Reading over truth [1].
        crooked_deg: Angle between the map and the mounting as found.
        agreement: Part of the variance that the motion explains [1].
        unseen: Axes about which too little happened.
        field_dip_deg: Of a magnetometer, dip of the field below the horizon if the map holds; all
            signs reversed reverse it.
    """

    axes: str | None = None
    right_handed: bool | None = None
    gain: float | None = None
    crooked_deg: float | None = None
    agreement: float | None = None
    unseen: list[str] = field(default_factory=list)
    field_dip_deg: float | None = None


@dataclass(frozen=True, kw_only=True)
class SensorFits:
    """What was found of one sensor, but for its samples: its entry in estimate.json.

    Attributes:
        clock: The sensor's clock against the host's.
        calibration: What the readings were corrected by.
        frames: The alignment of each filter.
        skipped: Filters that could not run, and why.
        quality: Number of samples by reason.
        findings: What else is odd.
        timing: Audit of the time stamps.
        every: The estimate holds one of so many samples of the recording, the last of them; 1 but
            for recordings of hours.
        axes: By triad, and "device_q".
        stored_calibration: Which stored calibration corrected the raw samples first
            (`calibrated_utc`, `session`, `methods`).
        unaligned: Code of the finding that says why its truth cannot be compared with it, so that
            nothing of it is judged; "" where it can.
        frames_apart: The alignment of each filter in pieces of the truth that do not fit the rest,
            one entry a kind of pieces.
    """

    clock: ClockFit = field(default_factory=ClockFit)
    calibration: CalibrationFit = field(default_factory=CalibrationFit)
    frames: dict[str, FrameFit] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    quality: dict[str, int] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    timing: TimingAudit = field(default_factory=TimingAudit)
    every: int = 1
    axes: dict[str, AxisFinding] = field(default_factory=dict)
    stored_calibration: dict[str, Any] | None = None
    unaligned: str = ""
    frames_apart: list[dict[str, FrameFit]] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class SensorEstimate(SensorFits):
    """One sensor's orientation by every filter.

    Attributes:
        host_time_ns: Sampling instants on the host's clock, shape (n,), int64.
        static: At rest by its own signals, shape (n,), bool.
        orientation: q_world_from_sensor by filter, each of shape (n, 4), aligned.
        flagged: Samples that the quality gates refuse, shape (n,), bool; they are not evaluated,
            but for those that are aligned apart.
        apart: Of each sample, which entry of `frames_apart`, from 1, brings its orientation to the
            truth there; 0 where `frames` did. Shape (n,); None for 0 everywhere. The orientations
            themselves are all in the frames of the rest, and do not step.
    """

    host_time_ns: np.ndarray
    static: np.ndarray
    orientation: dict[str, np.ndarray]
    flagged: np.ndarray
    apart: np.ndarray | None = None

    @property
    def is_apart(self) -> np.ndarray:
        """Samples that are aligned apart from the rest, shape (n,), bool."""
        if self.apart is None:
            return np.zeros(len(self.host_time_ns), dtype=bool)
        return self.apart > 0

    @property
    def left_out(self) -> np.ndarray:
        """Samples that are not evaluated, shape (n,), bool."""
        return self.flagged & ~self.is_apart

    def can_be_judged(self, key: str) -> bool:
        """Whether a filter's orientation was brought to the truth's frames and clock."""
        return not self.unaligned and not self.frames.get(key, FrameFit()).refused


@dataclass(frozen=True)
class RelativeHeading:
    """By how much the world of a joint's distal sensor was turned to be that of the proximal one.

    Attributes:
        heading: About the vertical, anticlockwise from above, shape (n,) [rad].
        sd: Its standard uncertainty, shape (n,) [rad].
    """

    heading: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class JointEstimate:
    """One joint's angles.

    Attributes:
        host_time_ns: Shape (n,), int64.
        angles: The three intrinsic Euler angles of the distal segment against the proximal one by
            (filter, sequence), shape (n, 3) [rad].
        headings: What the joint's axes took out, by filter.
        findings: What is doubtful.
        sd: Standard uncertainty of the angles, where it is known, shape (n, 3) [rad].
        placements: By filter, how each sensor was placed on its segment, in words; empty on an arm,
            where the protocol states it.
        true_clock: The joint's time against that of angles that another system gave of it; None
            where it has none.
    """

    host_time_ns: np.ndarray
    angles: dict[tuple[str, str], np.ndarray]
    headings: dict[str, RelativeHeading] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    sd: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)
    placements: dict[str, dict[str, str]] = field(default_factory=dict)
    true_clock: ClockFit | None = None

    def heading_series(self) -> dict[str, np.ndarray]:
        """Columns of what the joint's axes took out."""
        return {
            column: values
            for key, found in self.headings.items()
            for column, values in zip(_heading_columns(key), (found.heading, found.sd), strict=True)
        }


@dataclass(frozen=True, repr=False)
class Estimate:
    """All estimates of a session.

    Attributes:
        session: Its name.
        fingerprint: Of the recording they were made from.
        sensors: Orientations by sensor.
        joints: Angles by joint of the protocol.
        filter_parameters: Those each filter ran with.
        tuned: Where they came from, of filters that were tuned.
        chain: Joints of the arm by the chain filter, by section and state.
        findings: What is doubtful about the whole.
        behaviour: What the catalogue says of each filter that ran, in a sentence.
        set_parameters: Names of those that a person set for this estimate, by filter.
    """

    session: str
    fingerprint: str
    sensors: dict[str, SensorEstimate]
    joints: dict[str, JointEstimate]
    filter_parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    tuned: dict[str, UsedTuning] = field(default_factory=dict)
    chain: list[ChainEstimate] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    behaviour: dict[str, str] = field(default_factory=dict)
    set_parameters: dict[str, list[str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        filters = dict.fromkeys(name for own in self.sensors.values() for name in own.orientation)
        return f"<Estimate of {self.session}: {', '.join(self.sensors)} by {', '.join(filters)}>"

    def save(self, session_folder: Path) -> None:
        """Write the folder `estimate` of a session, in place of an earlier one.

        What follows from the earlier one, its evaluation and report, is removed: nobody shall take
        it for that of the new one. A kill in between leaves the earlier estimate without them.
        """
        target = session_folder / ESTIMATE
        with session_lock(session_folder), stored(target), replaced_folder(target) as folder:
            for name, sensor in self.sensors.items():
                _write_sensor(folder / table_file(orientation_table(name)), sensor)
            for name, joint in self.joints.items():
                _write_joint(folder / table_file(joint_table(name)), joint)
            for chain in self.chain:
                chain.write(folder)
            write_json(folder / ESTIMATE_SUMMARY, self._summary())
            for name in OF_AN_ESTIMATE:
                remove(session_folder / name)

    def _summary(self) -> dict[str, Any]:
        """The content of estimate.json."""
        own = {name: getattr(self, name) for name in _field_names(_EstimateHead)}
        return (
            {"schema_version": SCHEMA_VERSION}
            | own
            | {
                "sensors": {
                    name: {"filters": list(sensor.orientation)}
                    | {key: getattr(sensor, key) for key in _field_names(SensorFits)}
                    for name, sensor in self.sensors.items()
                },
                "joints": {
                    name: {
                        "angles": [
                            {"filter": key, "sequence": label, "sd": (key, label) in joint.sd}
                            for key, label in joint.angles
                        ],
                        "placements": joint.placements,
                        "headings": list(joint.headings),
                        "findings": joint.findings,
                        "true_clock": joint.true_clock,
                    }
                    for name, joint in self.joints.items()
                },
                "chain": [
                    {key: getattr(chain, key) for key in _field_names(ChainFacts)}
                    for chain in self.chain
                ],
            }
        )

    @staticmethod
    def lies_in(session_folder: Path) -> bool:
        """Whether a session has an estimate."""
        return (session_folder / ESTIMATE / ESTIMATE_SUMMARY).is_file()

    @staticmethod
    def load(session_folder: Path) -> Estimate:
        """Read the folder `estimate` of a session.

        Raises:
            SessionError: It is missing or damaged.
        """
        with session_lock(session_folder):
            return Estimate._load(session_folder / ESTIMATE)

    @staticmethod
    def _load(folder: Path) -> Estimate:
        summary = read_record(
            folder / ESTIMATE_SUMMARY,
            _as_written(),
            SCHEMA_VERSION,
            "run `testbench estimate` again",
            _upgrade,
        )
        return Estimate(
            sensors={
                name: _read_sensor(folder / table_file(orientation_table(name)), sensor)
                for name, sensor in summary.sensors.items()
            },
            joints={
                name: _read_joint(folder / table_file(joint_table(name)), joint)
                for name, joint in summary.joints.items()
            },
            chain=[ChainEstimate.read(folder, facts) for facts in summary.chain],
            **{name: getattr(summary, name) for name in _field_names(_EstimateHead)},
        )


@dataclass(frozen=True, kw_only=True)
class _EstimateHead:
    """What an estimate and its summary share."""

    session: str
    fingerprint: str
    filter_parameters: dict[str, dict[str, float]]
    tuned: dict[str, UsedTuning] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    behaviour: dict[str, str] = field(default_factory=dict)
    set_parameters: dict[str, list[str]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _SensorSummary(SensorFits):
    filters: list[str]


@dataclass(frozen=True)
class _Angle:
    filter: str
    sequence: str
    sd: bool = False


@dataclass(frozen=True)
class _JointSummary:
    angles: list[_Angle]
    headings: list[str]
    findings: list[Finding]
    placements: dict[str, dict[str, str]] = field(default_factory=dict)
    true_clock: ClockFit | None = None


@with_config(AS_WRITTEN)
@dataclass(frozen=True, kw_only=True)
class _Summary(_EstimateHead):
    """The content of estimate.json."""

    sensors: dict[str, _SensorSummary]
    joints: dict[str, _JointSummary]
    chain: list[ChainFacts]


def _upgrade(data: dict[str, Any]) -> None:
    """Findings in the place of the remarks of earlier versions."""
    parts = [part for key in ("sensors", "joints") for part in _values(data.get(key))]
    for part in [data, *parts]:
        if isinstance(part, dict):
            sentences_to_findings(part, "remarks")


def _values(mapping: Any) -> list[Any]:
    return list(mapping.values()) if isinstance(mapping, dict) else []


@cache
def _as_written() -> TypeAdapter[_Summary]:
    return TypeAdapter(_Summary)


def _field_names(kind: type[Any]) -> list[str]:
    return [own.name for own in fields(kind)]


def _write_sensor(file: Path, sensor: SensorEstimate) -> None:
    columns = {
        "host_time_ns": sensor.host_time_ns,
        "static": sensor.static,
        "flagged": sensor.flagged,
    }
    if sensor.apart is not None:
        columns["apart"] = sensor.apart
    for key, q in sensor.orientation.items():
        columns |= split(_orientation_columns(key), q.astype(np.float32))
    write_parquet(file, columns, {"content": "estimated orientation, w x y z"})


def _read_sensor(file: Path, summary: _SensorSummary) -> SensorEstimate:
    columns = {key: _orientation_columns(key) for key in summary.filters}
    apart = ["apart"] if summary.frames_apart else []
    single = {key: key for key in ["host_time_ns", "static", "flagged", *apart]}
    table = read_stacked(file, {**single, **columns})
    return SensorEstimate(
        **{key: getattr(summary, key) for key in _field_names(SensorFits)},
        host_time_ns=table["host_time_ns"],
        static=table["static"],
        flagged=table["flagged"],
        apart=table.get("apart"),
        orientation={key: table[key].astype(float) for key in summary.filters},
    )


def _write_joint(file: Path, joint: JointEstimate) -> None:
    columns = {"host_time_ns": joint.host_time_ns}
    for (key, sequence), angles in joint.angles.items():
        columns |= split(_angle_columns(key, sequence), angles.astype(np.float32))
    for (key, sequence), sd in joint.sd.items():
        columns |= split(angle_sd_columns(key, sequence), sd.astype(np.float32))
    columns |= joint.heading_series()
    write_parquet(file, columns, {"content": "intrinsic Euler angles"})


def _read_joint(file: Path, summary: _JointSummary) -> JointEstimate:
    table = read_parquet(file)
    angles = {
        (row.filter, row.sequence): join(table, _angle_columns(row.filter, row.sequence)).astype(
            float
        )
        for row in summary.angles
    }
    headings = {
        key: RelativeHeading(*(table[column] for column in _heading_columns(key)))
        for key in summary.headings
    }
    sd = {
        (row.filter, row.sequence): join(table, angle_sd_columns(row.filter, row.sequence)).astype(
            float
        )
        for row in summary.angles
        if row.sd
    }
    return JointEstimate(
        table["host_time_ns"],
        angles,
        headings,
        summary.findings,
        sd,
        summary.placements,
        summary.true_clock,
    )


def _orientation_columns(key: str) -> list[str]:
    return names(f"{key}_q_world_from_sensor", "", QUATERNION)


def _angle_columns(key: str, sequence: str) -> list[str]:
    return [f"{key}_{sequence}_{which}_rad" for which in ("first", "second", "third")]


def angle_sd_columns(key: str, sequence: str) -> list[str]:
    """Titles of the standard uncertainties of the three angles of a joint."""
    return [f"{key}_{sequence}_{which}_sd_rad" for which in ("first", "second", "third")]


def _heading_columns(key: str) -> list[str]:
    return [f"{key}_relative_heading_rad", f"{key}_relative_heading_sd_rad"]
