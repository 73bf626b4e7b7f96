"""Calibration files: dated corrections of one sensor as YAML, and the folder of many."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import yaml
from pydantic import Field, ValidationError

from testbench.clock import utc_text
from testbench.exceptions import InputError
from testbench.records.disk.json_record import first_problem
from testbench.records.disk.replacing import stored_where_asked, write_text
from testbench.records.disk.yaml_file import YamlDocument, load_yaml
from testbench.records.findings.earlier import read_again
from testbench.records.findings.finding import Finding, Severity
from testbench.records.results.calibration import MountingCalibration, TriadCalibration
from testbench.records.results.fit import Fit
from testbench.records.specs.strict import Angles3, Name, StrictModel, UtcText

SCHEMA_VERSION: Final = 1
SUFFIXES = (".yaml", ".yml")
TRIADS = ("accelerometer", "gyroscope", "magnetometer")
MOST_SCALE = 2.0
"""A correction beyond this, or below its inverse, is no calibration but a wrong unit or a slip of
the pen.
"""
UNITS = {"accelerometer": "m_s2", "gyroscope": "rad_s", "magnetometer": "uT"}

Rows = Annotated[list[Angles3], Field(min_length=3, max_length=3)]


def _known(value: float) -> float | None:
    """Null for what is infinite or not known."""
    return float(value) if np.isfinite(value) else None


class FitEntry(StrictModel):
    """Parameters as a method states them."""

    names: list[str] = Field(min_length=1, max_length=200, description="Of the parameters.")
    units: list[str] = Field(description="Of each.")
    values: list[float] = Field(description="In its unit.")
    sd: list[float] = Field(
        description="Standard uncertainty of each; the root of the diagonal of the covariance."
    )
    covariance: list[list[float]] = Field(description="In the product of the units.")
    dof: float | None = Field(
        default=None, description="Degrees of freedom of the uncertainties; null: infinite."
    )
    condition: float | None = Field(default=None, description="Condition number of the design.")
    residual_rms: float | None = Field(default=None, description="What the fit leaves.")
    residual_unit: str = Field(default="", description="Its unit.")

    @staticmethod
    def of(fit: Fit) -> FitEntry:
        """What is kept of a fit."""
        return FitEntry(
            names=list(fit.names),
            units=list(fit.units),
            values=fit.values.tolist(),
            sd=fit.sd.tolist(),
            covariance=fit.covariance.tolist(),
            dof=_known(fit.dof),
            condition=_known(fit.condition),
            residual_rms=_known(fit.residual_rms),
            residual_unit=fit.residual_unit,
        )

    def fit(self) -> Fit:
        """The fit; of its residuals only the RMS was kept."""
        residuals = np.zeros(0) if self.residual_rms is None else np.array([self.residual_rms])
        return Fit(
            tuple(self.names),
            tuple(self.units),
            np.array(self.values),
            np.array(self.covariance),
            float("inf") if self.dof is None else self.dof,
            float("nan") if self.condition is None else self.condition,
            residuals,
            self.residual_unit,
        )


class _Corrections(StrictModel):
    """Corrections of three axes: corrected = matrix (raw - bias - drift (T - reference) - g_matrix
    force).
    """

    method: str = Field(min_length=1, description="As `testbench calibrate` spells it.")
    matrix: Rows = Field(description="3 by 3, rows.")


class _Evidence(StrictModel):
    """What the corrections of three axes rest on; the last keys of their entry."""

    reference_deg_c: float | None = Field(
        default=None, description="Temperature that the bias holds at [deg C]."
    )
    fits: list[FitEntry] = Field(default=[], description="What was fitted, in steps.")
    validation: dict[str, float] = Field(
        default={}, description="Held-out figures, with the unit in the name."
    )
    remarks: list[str] = Field(default=[], description="What a user must know.")


class _Force(_Corrections):
    bias_m_s2: Angles3 = Field(description="[m/s^2].")
    drift_m_s2_k: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="Change of the bias with temperature [m/s^2/K]."
    )


class _Rate(_Corrections):
    bias_rad_s: Angles3 = Field(description="[rad/s].")
    g_matrix_rad_s_per_m_s2: Rows | None = Field(
        default=None, description="Response to specific force; null: none."
    )
    drift_rad_s_k: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="Change of the bias with temperature [rad/s/K]."
    )


class _Field(_Corrections):
    bias_uT: Angles3 = Field(description="Hard iron [uT].")
    drift_uT_k: Angles3 = Field(
        default=[0.0, 0.0, 0.0], description="Change of the bias with temperature [uT/K]."
    )


class AccelerometerEntry(_Evidence, _Force):
    """Corrections of an accelerometer."""


class GyroscopeEntry(_Evidence, _Rate):
    """Corrections of a gyroscope."""


class MagnetometerEntry(_Evidence, _Field):
    """Corrections of a magnetometer."""


ENTRIES: dict[str, type[AccelerometerEntry | GyroscopeEntry | MagnetometerEntry]] = {
    "accelerometer": AccelerometerEntry,
    "gyroscope": GyroscopeEntry,
    "magnetometer": MagnetometerEntry,
}


class MountingEntry(StrictModel):
    """How the sensor really sits against its mounting as believed."""

    method: str = Field(
        min_length=1,
        description="As `testbench calibrate` spells it, or from which method of a triad.",
    )
    matrix: Rows = Field(description="R_believed_from_sensor, 3 by 3, rows; a rotation.")
    rotation_deg: Angles3 = Field(description="The same as a rotation vector, for people [deg].")
    fit: FitEntry = Field(description="The same in rad, with its covariance.")
    remarks: list[str] = Field(default=[], description="What a user must know.")


class FindingEntry(StrictModel):
    """What was noticed, as `testbench calibrate` says it."""

    code: str = Field(min_length=1, description="Which sentence it is.")
    severity: Severity = Field(strict=False, description="note or warning.")
    where: str = Field(default="", description="The triad.")
    sentence: str = Field(description="What is seen, and what it means.")
    values: dict[str, Any] = Field(default={}, description="What the sentence names.")
    remedy: str = Field(default="", description="What to do.")


class CalibrationEntry(StrictModel):
    """The content of a calibration file."""

    schema_version: Literal[1] = Field(description="1.")
    sensor: Name = Field(description="Name of the sensor in the session it was made from.")
    device: str | None = Field(
        default=None, description="The device's own tag or serial number, where it has one."
    )
    calibrated_utc: UtcText = Field(description="When that session was recorded, ISO 8601.")
    session: str = Field(description="Name of that session.")
    fingerprint: str = Field(description="SHA-256 of its manifest.")
    software: str = Field(description="Version that made it.")
    temperature_deg_c: float | None = Field(
        default=None, description="Mean temperature of the part; null: not recorded."
    )
    simulated: bool = Field(default=False, description="Whether the part is a model of one.")
    accelerometer: AccelerometerEntry | None = Field(
        default=None, description="null: not calibrated."
    )
    gyroscope: GyroscopeEntry | None = Field(default=None, description="null: not calibrated.")
    magnetometer: MagnetometerEntry | None = Field(
        default=None, description="null: not calibrated."
    )
    mounting: MountingEntry | None = Field(default=None, description="null: as believed.")
    findings: list[FindingEntry] = Field(
        default=[], description="What a user must know of them, or of a triad that was refused."
    )


@dataclass(frozen=True)
class SensorCalibration:
    """The corrections of one sensor.

    Attributes:
        sensor: Name of the sensor in the session that they were made from.
        device: The part itself, as its maker numbers it, or None.
        calibrated: When, with its zone.
        session: Name of the session that they were made from.
        fingerprint: SHA-256 of that session's manifest.
        software: Version that made them.
        temperature: Of the part [deg C], or None.
        triads: By "accelerometer", "gyroscope", "magnetometer"; those calibrated.
        file: Where they were read from, or None.
        mounting: Of the corrected triads, or None for as believed.
        findings: What a user must know of them, or of a triad that was refused; where is a triad.
        simulated: Whether the part is a model of one.
    """

    sensor: str
    device: str | None
    calibrated: datetime
    session: str
    fingerprint: str
    software: str
    temperature: float | None
    triads: dict[str, TriadCalibration]
    file: Path | None = None
    mounting: MountingCalibration | None = None
    findings: tuple[Finding, ...] = ()
    simulated: bool = False

    def apply(
        self,
        gyr: np.ndarray,
        acc: np.ndarray,
        mag: np.ndarray | None,
        temperature: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Corrected readings.

        The response of the gyroscope to force is that to the corrected force.

        Args:
            gyr: Angular rate as read, shape (n, 3) [rad/s].
            acc: Specific force as read, shape (n, 3) [m/s^2].
            mag: Field as read, shape (n, 3) [uT], or None.
            temperature: Of the part, shape (n,) [deg C]; without it, drifts with temperature are
                left in.

        Returns:
            Angular rate [rad/s], specific force [m/s^2] and field [uT] or None, each of shape
            (n, 3).
        """
        accelerometer, gyroscope, magnetometer = (self.triads.get(triad) for triad in TRIADS)
        force = acc if accelerometer is None else accelerometer.apply(acc, temperature=temperature)
        rate = gyr if gyroscope is None else gyroscope.apply(gyr, force, temperature)
        field = (
            mag
            if magnetometer is None or mag is None
            else magnetometer.apply(mag, temperature=temperature)
        )
        if self.mounting is None:
            return rate, force, field
        R = self.mounting.R_believed_from_sensor
        return rate @ R.T, force @ R.T, None if field is None else field @ R.T

    def summary(self) -> dict[str, Any]:
        """For the record of an estimate."""
        methods = {triad: found.method for triad, found in self.triads.items()}
        methods |= {} if self.mounting is None else {"mounting": self.mounting.method}
        file = str(self.file) if self.file else None
        return {
            "file": file,
            "calibrated_utc": utc_text(self.calibrated),
            "session": self.session,
            "methods": methods,
        }


def save_calibration(file: Path, calibration: SensorCalibration) -> None:
    """Write a calibration file.

    Raises:
        InputError: The file exists already, or cannot be written, or a figure is no number.
    """
    if file.suffix not in SUFFIXES:
        raise InputError(f"{file}: a calibration is a .yaml file")
    try:
        entry = _entry(calibration)
    except ValidationError as error:
        raise InputError(
            f"{file}: nothing was written, for the calibration is none: {first_problem(error)}"
        ) from None
    data = entry.model_dump(mode="json", exclude_unset=True)
    text = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
    with stored_where_asked(file):
        write_text(file, text, anew=True)


def load_calibration(file: Path) -> SensorCalibration:
    """Read a calibration file.

    Raises:
        FileProblems: It is missing or malformed; every problem at once.
    """
    document = load_yaml(file, CalibrationEntry)
    entry = document.value
    _check_sizes(document)
    _check_matrices(document)
    return SensorCalibration(
        entry.sensor,
        entry.device,
        datetime.fromisoformat(entry.calibrated_utc),
        entry.session,
        entry.fingerprint,
        entry.software,
        entry.temperature_deg_c,
        {
            triad: _triad(triad, found)
            for triad in TRIADS
            if (found := getattr(entry, triad)) is not None
        },
        file,
        None if entry.mounting is None else _mounting(entry.mounting),
        tuple(read_again(own.model_dump()) for own in entry.findings),
        entry.simulated,
    )


def _check_sizes(document: YamlDocument[CalibrationEntry]) -> None:
    """Refuse a fit whose lists are not all as long as its parameters are many."""
    entry = document.value
    placed = [
        ((triad, "fits", i), fit)
        for triad in TRIADS
        for i, fit in enumerate(getattr(getattr(entry, triad), "fits", []))
    ]
    placed += [] if entry.mounting is None else [(("mounting", "fit", 0), entry.mounting.fit)]
    for place, fit in placed:
        p = len(fit.names)
        sizes: list[int] = [
            len(part) for part in (fit.units, fit.values, fit.sd, fit.covariance, *fit.covariance)
        ]
        if any(size != p for size in sizes):
            raise document.problem(
                f"names, units, values, sd and covariance must all be of size {p}", *place
            )


def _check_matrices(document: YamlDocument[CalibrationEntry]) -> None:
    """Refuse corrections that no sensor needs, and a mounting that is no rotation."""
    entry = document.value
    for triad in TRIADS:
        found = getattr(entry, triad)
        if found is not None:
            strength = np.linalg.svd(np.array(found.matrix), compute_uv=False)
            if (
                np.linalg.det(np.array(found.matrix)) <= 0
                or strength[0] > MOST_SCALE
                or strength[-1] < 1 / MOST_SCALE
            ):
                sentence = (
                    "no sensor's correction mirrors its axes or scales them by more than "
                    f"{MOST_SCALE:g}"
                )
                raise document.problem(
                    f"this matrix scales by {strength[-1]:.3g} to {strength[0]:.3g}; {sentence}",
                    triad,
                    "matrix",
                )
    if entry.mounting is not None:
        R = np.array(entry.mounting.matrix)
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
            raise document.problem("the matrix is no rotation", "mounting", "matrix")


def find_calibration(
    calibrations: list[SensorCalibration], sensor: str, device: str | None, at: datetime | None
) -> SensorCalibration | None:
    """The calibration nearest in time, or None.

    It is of the same device where both name theirs, else of the same sensor name.

    Args:
        calibrations: To choose from.
        sensor: Name in the session.
        device: The part itself, where the session names it.
        at: When the session was recorded; None where nobody knows.

    Raises:
        InputError: Several fit, and without a date none is nearest.
    """
    same = [
        c
        for c in calibrations
        if (c.device == device if c.device and device else c.sensor == sensor)
    ]
    if at is None:
        if len(same) > 1:
            raise InputError(
                f"the date of this recording is unknown, so that none of the {len(same)} stored "
                "calibrations of sensor "
                f"'{sensor}' is the nearest in time; name one file of them with --calibration, or "
                "import the recording again "
                "with --recorded-at"
            )
        return same[0] if same else None
    return min(same, key=lambda c: abs((c.calibrated - at).total_seconds()), default=None)


def load_calibrations(path: Path) -> list[SensorCalibration]:
    """One file, or every calibration of a folder.

    Raises:
        InputError: Nothing there.
        FileProblems: A file is malformed.
    """
    if path.is_dir():
        files = sorted(
            file for file in path.iterdir() if file.suffix in SUFFIXES and file.is_file()
        )
        if not files:
            raise InputError(f"{path} holds no calibration (*.yaml)")
        return [load_calibration(file) for file in files]
    if not path.is_file():
        raise InputError(f"{path}: no such calibration file or folder")
    return [load_calibration(path)]


def _entry(calibration: SensorCalibration) -> CalibrationEntry:
    """What a file holds of a calibration; what it has none of is left away."""
    parts: dict[str, Any] = {
        triad: _triad_entry(triad, found) for triad, found in calibration.triads.items()
    }
    if calibration.simulated:
        parts["simulated"] = True
    if calibration.mounting is not None:
        parts["mounting"] = MountingEntry(
            method=calibration.mounting.method,
            matrix=calibration.mounting.R_believed_from_sensor.tolist(),
            rotation_deg=np.degrees(calibration.mounting.fit.values).tolist(),
            fit=FitEntry.of(calibration.mounting.fit),
            remarks=list(calibration.mounting.remarks),
        )
    return CalibrationEntry(
        schema_version=SCHEMA_VERSION,
        sensor=calibration.sensor,
        device=calibration.device,
        calibrated_utc=utc_text(calibration.calibrated),
        session=calibration.session,
        fingerprint=calibration.fingerprint,
        software=calibration.software,
        temperature_deg_c=calibration.temperature,
        **parts,
        findings=[FindingEntry.model_validate(asdict(own)) for own in calibration.findings],
    )


def _triad_entry(triad: str, found: TriadCalibration) -> StrictModel:
    """The corrections of a triad, in its unit."""
    unit = UNITS[triad]
    given: dict[str, Any] = {f"bias_{unit}": found.bias.tolist()}
    if found.g_matrix.any():
        given["g_matrix_rad_s_per_m_s2"] = found.g_matrix.tolist()
    if found.drift.any():
        given |= {f"drift_{unit}_k": found.drift.tolist(), "reference_deg_c": found.reference}
    return ENTRIES[triad](
        method=found.method,
        matrix=found.matrix.tolist(),
        fits=[FitEntry.of(fit) for fit in found.fits],
        validation={key: float(value) for key, value in found.validation.items()},
        remarks=list(found.remarks),
        **given,
    )


def _triad(triad: str, entry: Any) -> TriadCalibration:
    unit = UNITS[triad]
    g_matrix = getattr(entry, "g_matrix_rad_s_per_m_s2", None)
    return TriadCalibration(
        entry.method,
        np.array(entry.matrix),
        np.array(getattr(entry, f"bias_{unit}")),
        np.zeros((3, 3)) if g_matrix is None else np.array(g_matrix),
        np.array(getattr(entry, f"drift_{unit}_k")),
        entry.reference_deg_c,
        tuple(fit.fit() for fit in entry.fits),
        dict(entry.validation),
        tuple(entry.remarks),
    )


def _mounting(entry: MountingEntry) -> MountingCalibration:
    return MountingCalibration(
        entry.method, np.array(entry.matrix), entry.fit.fit(), tuple(entry.remarks)
    )


class _Dumper(yaml.SafeDumper):
    """Lists of numbers on one line, as a person would write them."""


def _represent_list(dumper: yaml.SafeDumper, data: list[Any]) -> yaml.Node:
    flat = all(isinstance(item, int | float | str) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)


_Dumper.add_representer(list, _represent_list)
