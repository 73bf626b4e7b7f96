"""Look at a session, or write it for other programs."""

from __future__ import annotations

from pathlib import Path

from testbench.estimation import estimate
from testbench.estimation.filters import FILTERS, OrientationFilter, plugins
from testbench.evaluation import evaluate
from testbench.exceptions import InputError, NotFoundError
from testbench.formats.exporters import TRUTH, Exported, ExportSource
from testbench.pipeline.analyse import (
    is_as_asked,
    load_analysis,
    load_or_estimate,
    sound,
    stored_estimate,
)
from testbench.pipeline.exports import filters_of, place, write
from testbench.pipeline.request import AnalysisRequest, ExportRequest, ViewRequest
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session
from testbench.records.session.session_lock import session_locked


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
    path = place(session, asked, wanted)
    stored = stored_estimate(session)
    if own is not None:
        estimated = estimate(session, [own], parameters=asked.parameters)
    else:
        known = list(dict.fromkeys([TRUTH, *FILTERS, *filters_of(stored)]))
        if wanted is not None and wanted not in known:
            raise NotFoundError("filter", wanted, known)
        estimated = _estimate_with(session, asked, stored)
    return write(ExportSource(session, estimated, wanted, asked.frame), asked, path)


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
    if asked.filter is not None and asked.filter not in {TRUTH, *filters_of(estimated)}:
        return estimate(session, [asked.filter])
    return estimated
