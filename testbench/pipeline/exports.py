"""Write a session with an estimate that is there, in the formats that other programs read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from testbench.evaluation import evaluate
from testbench.exceptions import InputError, NotFoundError
from testbench.formats.exporters import (
    TRUTH,
    Exported,
    ExportSource,
    check_options,
    prepare_export,
    write_export,
)
from testbench.pipeline.request import ExportRequest
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session


def export_estimate(session: Session, asked: ExportRequest, estimated: Estimate) -> Exported:
    """Write a session with an estimate that was just made.

    Args:
        session: The recording.
        asked: In which format, and whose orientation of those in the estimate.
        estimated: Of the recording.

    Raises:
        InputError: As for `refuse_export`, or the place is taken.
        NotFoundError: No such format, or the filter is not in the estimate.
    """
    refuse_export(asked, filters_of(estimated))
    path = place(session, asked, asked.filter)
    return write(ExportSource(session, estimated, asked.filter, asked.frame), asked, path)


def refuse_export(asked: ExportRequest, filters: Sequence[str]) -> None:
    """Refuse an export that an analysis cannot come to.

    Args:
        asked: In which format, and whose orientation.
        filters: Names of those that the analysis runs.

    Raises:
        InputError: An option is of no use to the format, or parameters are set: those of the
            analysis hold.
        NotFoundError: No such format, or the filter is not among those that run.
    """
    check_options(asked.format, asked.filter, asked.frame)
    if asked.parameters:
        raise InputError("the parameters of an export beside an analysis are those of the analysis")
    known = [TRUTH, *filters]
    if asked.filter is not None and asked.filter not in known:
        raise NotFoundError("filter", asked.filter, known)


def filters_of(estimated: Estimate | None) -> list[str]:
    """Names of the filters that ran, or were skipped, for any sensor."""
    sensors = [] if estimated is None else estimated.sensors.values()
    return list(
        dict.fromkeys(key for sensor in sensors for key in (*sensor.orientation, *sensor.skipped))
    )


def place(session: Session, asked: ExportRequest, wanted: str | None) -> Path:
    """Where an export goes, once it is known that it can be written there."""
    check_options(asked.format, wanted, asked.frame)
    out = None if asked.out is None else Path(asked.out)
    return prepare_export(asked.format, session, out, asked.force)


def write(source: ExportSource, asked: ExportRequest, path: Path) -> Exported:
    """Write an export to a place that `place` gave."""
    writer = _write_recording if asked.format == "rrd" else None
    return write_export(asked.format, source, path, writer)


def _write_recording(source: ExportSource, path: Path) -> list[str]:
    import testbench.reporting.viewer as viewer

    viewer.save_recording(
        source.session, path, source.estimate, evaluate(source.session, source.estimate)
    )
    return []
