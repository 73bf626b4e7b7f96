"""Calibrate a sensor from a session."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from testbench.clock import utc_name
from testbench.estimation.calibration.session_calibration import calibrate as calibrate_sensor
from testbench.estimation.calibration.turns import TurnSettings
from testbench.exceptions import InputError
from testbench.pipeline.request import CalibrationRequest
from testbench.records.results.calibration_file import SUFFIXES, save_calibration
from testbench.records.results.calibration_result import CalibrationResult
from testbench.records.session.raw_files import open_for_analysis
from testbench.records.session.session import Session


@dataclass(frozen=True)
class MadeCalibration:
    """A calibration, the file that keeps it, and its report, or None where none was asked for."""

    result: CalibrationResult
    file: Path
    report: Path | None


def calibrate(session: Session, asked: CalibrationRequest) -> MadeCalibration:
    """Calibrate a sensor and keep the result.

    Args:
        session: The recording.
        asked: Which sensor, how, and where it is kept.

    Raises:
        NotFoundError: No such sensor or method.
        InputError: The file exists, or nothing can be calibrated; nothing is written then.
    """
    sensor, out = only_sensor(session, asked.sensor), Path(asked.out)
    file = out
    if out.suffix not in SUFFIXES:
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is neither a .yaml file nor a folder")
        moment = session.recorded_at or session.started
        file = out / f"{utc_name(moment)}_{sensor}.yaml"
    page = file.with_suffix(".html")
    for target in (file, page) if asked.report else (file,):
        if target.exists():
            raise InputError(f"{target} exists already; {_why_kept(file, page, asked.report)}")
    result = calibrate_sensor(
        session,
        sensor,
        asked.methods,
        asked.segmentation,
        [open_for_analysis(path, asked.verify) for path in asked.held_out],
        None if asked.field_ut is None else np.array(asked.field_ut),
        TurnSettings(
            None if asked.turn_deg is None else float(np.radians(asked.turn_deg)),
            asked.integrator,
            asked.stages,
            asked.g_sensitivity,
            asked.every,
        ),
    )
    software = f"testbench {version('imu-testbench')}"
    result = replace(result, calibration=replace(result.calibration, software=software))
    if out.suffix not in SUFFIXES:
        out.mkdir(parents=True, exist_ok=True)
    save_calibration(file, result.calibration)
    if asked.report:
        from testbench.reporting.calibration_report import calibration_report

        calibration_report(result, page)
    return MadeCalibration(result, file, page if asked.report else None)


def _why_kept(file: Path, page: Path, report: bool) -> str:
    """Why an earlier calibration stays, and what to do where its report was never written."""
    kept = "calibrations are kept, not replaced"
    if report and file.exists() and not page.exists():
        return f"{kept}. It is whole, but has no report: move it away to have both made again"
    return kept


def only_sensor(session: Session, name: str | None) -> str:
    """The sensor that is named, or the one that the session has.

    Raises:
        InputError: None is named and there are several.
    """
    names = session.sensor_names
    if name is None and len(names) != 1:
        raise InputError(
            f"the session has several sensors ({', '.join(names)}); say which with --sensor"
        )
    return name or names[0]
