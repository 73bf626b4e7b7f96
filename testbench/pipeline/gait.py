"""Strides, events and path of a walk, judged by what is known of it, kept and reported."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from testbench.estimation.gait import PUBLISHED, GaitSettings, by_sensor, gait
from testbench.evaluation.gait import WalkTruth, judge_walk
from testbench.pipeline.request import GaitRequest
from testbench.records.results.calibration_file import load_calibrations
from testbench.records.results.gait import Gait
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked


@dataclass(frozen=True)
class MadeGait:
    """The gait of a session, which it keeps, and its report, or None where none was asked for."""

    result: Gait
    report: Path | None


@session_locked
def make_gait(session: Session, asked: GaitRequest | None = None) -> MadeGait:
    """Find the strides of a walk, and keep them with the session.

    Args:
        session: The recording.
        asked: What is known of it, and whether to report; everything is found if None.

    Raises:
        NotFoundError: It names what does not exist.
        InputError: It says what cannot be.
    """
    asked = asked or GaitRequest()
    names = session.sensor_names
    settings = GaitSettings(
        on=by_sensor("--on", asked.on, names),
        mounting=by_sensor("--mounting", asked.mounting, names),
        parameters=asked.parameters,
        filter=asked.filter,
        floor=asked.floor,
    )
    truth = WalkTruth(asked.cycles, asked.distance_m, asked.corners_m)
    truth.check()
    stored = None if asked.calibrations is None else load_calibrations(Path(asked.calibrations))
    result = judge_walk(gait(session, settings, stored), truth)
    result.save(session.path)
    if not asked.report:
        return MadeGait(result, None)
    from testbench.reporting.report import report

    return MadeGait(result, report(session))


def published_parameters() -> list[str]:
    """Names of the published parameters of the regression."""
    return list(PUBLISHED)
