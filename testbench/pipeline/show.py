"""Look at a session, or write it for other programs."""

from __future__ import annotations

from pathlib import Path

from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, OrientationFilter, plugins
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
from testbench.pipeline.analyse import (
    is_as_asked,
    load_analysis,
    load_or_estimate,
    sound,
    stored_estimate,
)
from testbench.pipeline.request import AnalysisRequest, ExportRequest, ViewRequest
from testbench.records.estimate import Estimate
from testbench.records.session import Session


def show(session: Session, asked: ViewRequest | None = None) -> list[Path]:
    """Open a session in the viewer, or write what it would show.

    Args:
        session: The recording.
        asked: Where it is shown; in a window if None.

    Returns:
        The files that were written.
    """
    import testbench.reporting.viewer as viewer

    asked = asked or ViewRequest()
    save, screenshot = (
        None if name is None else Path(name) for name in (asked.save, asked.screenshot)
    )
    for target in (save, screenshot):
        if target is not None and not target.parent.is_dir():
            raise InputError(f"{target} cannot be written: there is no folder {target.parent}")
    estimated = load_or_estimate(session)
    evaluated = evaluate(session, estimated)
    if save is not None:
        viewer.save_recording(session, save, estimated, evaluated)
    if screenshot is not None:
        viewer.screenshot(session, screenshot, estimated, evaluated)
    written = [path for path in (save, screenshot) if path is not None]
    if not written:
        viewer.view(session, web=asked.web, estimate=estimated, evaluation=evaluated)
    return written


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
        known = list(dict.fromkeys([TRUTH, *FILTERS, *_filters_of(stored)]))
        if wanted is not None and wanted not in known:
            raise NotFoundError("filter", wanted, known)
        estimated = _estimate_with(session, asked, stored)
    return _write(ExportSource(session, estimated, wanted, asked.frame), asked, path)


def export_estimate(session: Session, asked: ExportRequest, estimated: Estimate) -> Exported:
    """Write a session with an estimate that was just made.

    Args:
        session: The recording.
        asked: In which format, and whose orientation of those in the estimate.
        estimated: Of the recording.

    Raises:
        InputError: As for `export`, or parameters are set: those of the analysis hold.
        NotFoundError: The filter is not in the estimate.
    """
    if asked.parameters:
        raise InputError("the parameters of an export beside an analysis are those of the analysis")
    known = [TRUTH, *_filters_of(estimated)]
    if asked.filter is not None and asked.filter not in known:
        raise NotFoundError("filter", asked.filter, known)
    path = _place(session, asked, asked.filter)
    return _write(ExportSource(session, estimated, asked.filter, asked.frame), asked, path)


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


def _filters_of(estimated: Estimate | None) -> list[str]:
    """Names of the filters that ran, or were skipped, for any sensor."""
    sensors = [] if estimated is None else estimated.sensors.values()
    return list(
        dict.fromkeys(key for sensor in sensors for key in (*sensor.orientation, *sensor.skipped))
    )


def _place(session: Session, asked: ExportRequest, wanted: str | None) -> Path:
    """Where an export goes, once it is known that it can be written there."""
    check_options(asked.format, wanted, asked.frame)
    out = None if asked.out is None else Path(asked.out)
    return prepare_export(asked.format, session, out, asked.force)


def _write(source: ExportSource, asked: ExportRequest, path: Path) -> Exported:
    writer = _write_recording if asked.format == "rrd" else None
    return write_export(asked.format, source, path, writer)


def _write_recording(source: ExportSource, path: Path) -> list[str]:
    import testbench.reporting.viewer as viewer

    viewer.save_recording(
        source.session, path, source.estimate, evaluate(source.session, source.estimate)
    )
    return []
