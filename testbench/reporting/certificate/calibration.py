"""The certificate of a calibration: the parameters that were fitted, and how far they hold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import stdtrit

from testbench.exceptions import InputError
from testbench.frames import STANDARD_GRAVITY
from testbench.records.results.calibration import MountingCalibration, TriadCalibration
from testbench.records.results.calibration_file import TRIADS, SensorCalibration
from testbench.records.results.calibration_result import CalibrationPoses
from testbench.records.results.certificate import (
    Figure,
    FigureCurve,
    ResultRow,
    ResultTable,
)
from testbench.records.results.fit import Fit
from testbench.records.results.quantity import Quantity
from testbench.records.results.uncertainty import LEVEL
from testbench.records.session.session import Session
from testbench.reporting.certificate import words
from testbench.reporting.certificate.parts import Parts, shortened
from testbench.reporting.certificate.statements import ended_early, truth_references, weighty
from testbench.reporting.page.tables import unit_words
from testbench.reporting.sections.calibrated import figure_words, gravity_errors, sentence

UNSTATED = "no uncertainty is stated"


def calibration_parts(
    session: Session,
    calibration: SensorCalibration,
    poses: CalibrationPoses | None,
    source: str,
    remarks: list[str],
) -> Parts:
    """What a certificate of a calibration says of a sensor.

    Args:
        session: The recording that it was made from.
        calibration: Of the sensor.
        poses: The rests that its accelerometer was calibrated from; None where they were not kept.
        source: Whence the calibration is, a sentence.
        remarks: What was left out of it, and why, as sentences.

    Raises:
        InputError: It was made from another session.
    """
    if calibration.fingerprint != session.fingerprint:
        raise InputError(
            f"{calibration.file}: this calibration was made from session {calibration.session}, "
            f"not from {session.path} as it is now"
        )
    tables = [
        _parameters(f"{triad.capitalize()} by {found.method}", fit, i)
        for triad, found in calibration.triads.items()
        for i, fit in enumerate(found.fits)
    ]
    if calibration.mounting is not None:
        tables.append(_mounting(calibration.mounting))
    tables += _held_out(calibration.triads)
    others = [name for name in session.sensor_names if name != calibration.sensor]
    told = [*session.manifest.findings, *ended_early(session)]
    methods = [f"{triad} by {found.method}" for triad, found in calibration.triads.items()]
    methods += [] if calibration.mounting is None else [f"mounting {calibration.mounting.method}"]
    said = [text for found in calibration.triads.values() for text in found.remarks]
    return Parts(
        title=words.CALIBRATION_TITLE,
        summary=[words.CALIBRATED.format(sensor=calibration.sensor, methods="; ".join(methods))],
        procedure=[
            source,
            words.PARAMETERS,
            *(sentence(text) for text in [*remarks, *said]),
        ],
        results=tables,
        figures=[] if poses is None else _figures(poses),
        findings=weighty([*told, *calibration.findings], others),
        uncertainty=[words.CALIBRATION_UNCERTAINTY],
        references=_references(session, calibration),
        untraceable=words.UNKNOWN_TRUTH if _by_unknown_truth(session, calibration) else "",
        not_claimed=[
            *_not_calibrated(session, calibration),
            words.NOT_CALIBRATED,
        ],
    )


def _parameters(title: str, fit: Fit, step: int) -> ResultTable:
    """The parameters of a fit."""
    k = float(stdtrit(fit.dof, 0.5 + LEVEL / 2))
    rows = [
        ResultRow(
            of=[name],
            key=name,
            unit=unit_words(unit) or "1",
            quantities=[Quantity.of(float(value), float(half), k)],
            more=[f"{k:.2f}"],
        )
        for name, unit, value, half in zip(
            fit.names, fit.units, fit.values, fit.half_width(LEVEL), strict=True
        )
    ]
    dof = "known beforehand" if not np.isfinite(fit.dof) else f"{fit.dof:.0f} degrees of freedom"
    return ResultTable(
        title=title + (f", step {step + 1}" if step else ""),
        of=["parameter"],
        columns=["value ± U"],
        more=["k"],
        rows=rows,
        notes=[f"Scatter: {dof}."],
    )


def _mounting(found: MountingCalibration) -> ResultTable:
    """The rotation vector of a mounting, in degrees."""
    k = float(stdtrit(found.fit.dof, 0.5 + LEVEL / 2))
    half = np.degrees(found.fit.half_width(LEVEL))
    rows = [
        ResultRow(
            of=[f"about {axis}"],
            key="rotation_deg",
            unit="deg",
            quantities=[Quantity.of(float(value), float(own), k)],
            more=[f"{k:.2f}"],
        )
        for axis, value, own in zip("xyz", np.degrees(found.fit.values), half, strict=True)
    ]
    return ResultTable(
        title=f"Mounting {found.method}",
        of=["rotation vector"],
        columns=["value ± U"],
        more=["k"],
        rows=rows,
        notes=["It takes what the sensor reads into the axes in which it was believed to sit."],
    )


def _held_out(triads: Mapping[str, TriadCalibration]) -> list[ResultTable]:
    """Figures of poses and turns that no fit saw."""
    rows = []
    for triad, found in triads.items():
        for name, value in found.validation.items():
            words, unit = figure_words(name)
            rows.append(
                ResultRow(
                    of=[triad, words],
                    key=name,
                    unit=unit or "1",
                    quantities=[_held(value, unit)],
                )
            )
    if not rows:
        return []
    return [
        ResultTable(
            title="What is left, on poses and turns held out",
            of=["triad", "figure"],
            columns=["value"],
            rows=rows,
            notes=["To two digits, for no uncertainty is stated of them."],
        )
    ]


def _references(session: Session, calibration: SensorCalibration) -> list[str]:
    """What the readings were held against, as far as the session has it."""
    gravity = words.GRAVITY.format(gravity=STANDARD_GRAVITY)
    told = [gravity] if "accelerometer" in calibration.triads else []
    return [*told, *truth_references(session)]


def _by_unknown_truth(session: Session, calibration: SensorCalibration) -> bool:
    """Whether the truth came with a recording, and nobody states how far it may be off."""
    if session.has_protocol or session.truth_file(calibration.sensor) is None:
        return False
    return session.manifest.sensors[calibration.sensor].truth_sd_deg is None


def _held(value: float, unit: str) -> Quantity:
    """A held-out figure; what has no unit is a count."""
    return Quantity.of(value, None, None, UNSTATED) if unit else Quantity.count(round(value))


def _not_calibrated(session: Session, calibration: SensorCalibration) -> list[str]:
    """Triads that the certificate says nothing of."""
    record = session.manifest.sensors[calibration.sensor]
    told = []
    for triad in TRIADS:
        if triad in calibration.triads:
            continue
        why = "nothing was calibrated"
        if triad == "magnetometer" and not record.magnetometer:
            why = "nothing was observed; the recording holds none"
        told.append(f"{triad.capitalize()}: {why}.")
    if calibration.mounting is None:
        told.append("Mounting: as believed; it was not found.")
    return told


def _figures(poses: CalibrationPoses) -> list[Figure]:
    """How far the length of gravity is off in each pose, before and after."""
    if len(poses.start) < 2:
        return []
    numbers = [float(i + 1) for i in range(len(poses.start))]
    curves = [
        FigureCurve(name=name, x=numbers, y=shortened(gravity_errors(readings)))
        for name, readings in (("raw", poses.raw), ("corrected", poses.corrected))
    ]
    return [
        Figure(
            title="Error of the length of gravity in each pose, before and after the correction",
            kind="points",
            x_title="pose",
            y_title="|g| error [mg]",
            curves=curves,
        )
    ]
