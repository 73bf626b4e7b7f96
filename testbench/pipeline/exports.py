"""Write a session in the formats that other programs read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, OrientationFilter, plugins
from testbench.evaluation import evaluate
from testbench.evaluation.differences import DEVICE
from testbench.exceptions import InputError, NotFoundError
from testbench.formats.exporters import (
    TRUTH,
    Exported,
    ExportSource,
    check_options,
    prepare_export,
    write_export,
)
from testbench.pipeline.kept_estimate import is_as_asked, load_or_estimate, stored_estimate
from testbench.pipeline.loaded_analysis import load_analysis, sound
from testbench.pipeline.request import AnalysisRequest, ExportRequest
from testbench.records.results.estimate import Estimate
from testbench.records.session.layout import CHAIN
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked


@session_locked
def export(session: Session, asked: ExportRequest) -> Exported:
    """Write a session in a format that other programs read.

    What the session keeps of its estimate stays as it is, but that one is kept where there is none.

    Args:
        session: The recording.
        asked: In which format, and whose orientation.

    Raises:
        NotFoundError: No such format, filter or parameter.
        InputError: The place is taken, or the session lacks what the format needs; nothing is
            written then.
    """
    own = None if asked.filter is None else _own_filter(asked.filter)
    wanted = asked.filter if own is None else own.name
    path = _place(session, asked, wanted)
    stored = stored_estimate(session)
    if own is not None:
        estimated = estimate(session, [own], parameters=asked.parameters)
    else:
        if stored is None and wanted is not None and wanted.startswith(CHAIN):
            stored = load_or_estimate(session)  # which chains there are follows from it
        known = list(dict.fromkeys([TRUTH, *FILTERS, *_filters_of(stored)]))
        if wanted is not None and wanted not in known:
            raise NotFoundError("filter", wanted, known)
        estimated = _estimate_with(session, asked, stored)
    estimated = _with_some_orientation(session, estimated, wanted)
    return _write(ExportSource(session, estimated, wanted, asked.frame, asked.model), asked, path)


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
    refuse_export(asked, _filters_of(estimated))
    path = _place(session, asked, asked.filter)
    estimated = _with_some_orientation(session, estimated, asked.filter)
    return _write(
        ExportSource(session, estimated, asked.filter, asked.frame, asked.model), asked, path
    )


def _with_some_orientation(session: Session, estimated: Estimate, wanted: str | None) -> Estimate:
    """The estimate, or one by the devices' own orientation where no filter ran and they have one.

    An export without any orientation would look whole.
    """
    if wanted is not None or any(sensor.orientation for sensor in estimated.sensors.values()):
        return estimated
    own = estimate(session, [DEVICE])
    return own if any(sensor.orientation for sensor in own.sensors.values()) else estimated


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
    check_options(asked.format, asked.filter, asked.frame, asked.model)
    if asked.parameters:
        raise InputError("the parameters of an export beside an analysis are those of the analysis")
    known = [TRUTH, *filters]
    if asked.filter is not None and asked.filter not in known:
        raise NotFoundError("filter", asked.filter, known)


def _filters_of(estimated: Estimate | None) -> list[str]:
    """Names of the filters that ran, or were skipped, for any sensor, and of chains."""
    sensors = [] if estimated is None else estimated.sensors.values()
    keys = [key for sensor in sensors for key in (*sensor.orientation, *sensor.skipped)]
    chains = [] if estimated is None else [one.key for one in estimated.chain]
    return list(dict.fromkeys([*keys, *chains]))


def _place(session: Session, asked: ExportRequest, wanted: str | None) -> Path:
    """Where an export goes, once it is known that it can be written there."""
    check_options(asked.format, wanted, asked.frame, asked.model)
    out = None if asked.out is None else Path(asked.out)
    return prepare_export(asked.format, session, out, asked.force)


def _write(source: ExportSource, asked: ExportRequest, path: Path) -> Exported:
    """Write an export to a place that `_place` gave."""
    writer = _write_recording if asked.format == "rrd" else None
    return write_export(asked.format, source, path, writer)


def _write_recording(source: ExportSource, path: Path) -> list[str]:
    import testbench.reporting.viewer as viewer

    viewer.write_recording(
        source.session, path, source.estimate, evaluate(source.session, source.estimate)
    )
    return []


def _own_filter(text: str) -> OrientationFilter | None:
    """A user's filter from a file or an installed package, once it has passed the self-test.

    None for a name that is neither: an estimate may hold it.
    """
    own = text.rpartition(":")[0].endswith(".py") or (
        text not in FILTERS and text in plugins.installed_filters()
    )
    return sound(plugins.find_filter(text)) if own else None


def _estimate_with(session: Session, asked: ExportRequest, stored: Estimate | None) -> Estimate:
    """The stored estimate if it holds what is asked for, else one that does."""
    if asked.parameters:
        if asked.filter == TRUTH:
            raise InputError("parameters are set of a filter, and the true orientation has none")
        filters = None if asked.filter is None else (asked.filter,)
        analysis = AnalysisRequest(filters=filters, parameters=asked.parameters)
        loaded = load_analysis(analysis)
        if stored is not None and is_as_asked(stored, session, loaded):
            return stored
        return loaded.estimate(session)
    estimated = stored or load_or_estimate(session)
    if asked.filter is not None and asked.filter not in {TRUTH, *_filters_of(estimated)}:
        return estimate(session, [asked.filter])
    return estimated
