"""Look at a session."""

from __future__ import annotations

from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from testbench.evaluation import evaluate
from testbench.exceptions import InputError, SessionError
from testbench.pipeline.kept_estimate import load_or_estimate
from testbench.pipeline.request import ViewRequest
from testbench.pipeline.watcher import Watcher
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import EVALUATION_SUMMARY
from testbench.records.session.session import Session


def show(
    session: Session, asked: ViewRequest | None = None, watcher: Watcher | None = None
) -> list[Path]:
    """Open a session in the viewer, or write what it would show.

    Args:
        session: The recording.
        asked: Where it is shown; in a window if None.
        watcher: Told the address of a page.

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
    evaluated = _stored_evaluation(session) or evaluate(session, estimated)
    if save is not None:
        viewer.save_recording(session, save, estimated, evaluated, asked.pane)
    if screenshot is not None:
        picture = viewer.Picture(asked.time_s, asked.size, asked.pane)
        viewer.screenshot(session, screenshot, estimated, evaluated, picture)
    written = [path for path in (save, screenshot) if path is not None]
    if not written:
        where = viewer.Where(asked.web, asked.port, asked.bind)
        say = (watcher or Watcher()).say

        def announce(place: str) -> None:
            if asked.web:
                say(f"open {place}")

        viewer.view(session, where, estimated, evaluated, announce)
    return written


def opens_in(path: Path) -> str:
    """What opens a file that was written, for people; empty where anything does."""
    made = version("rerun-sdk")
    return f" (opens in rerun {made}: `rerun {path.name}`)" if path.suffix == ".rrd" else ""


def _stored_evaluation(session: Session) -> Evaluation | None:
    """That which the report shows, too; a new estimate has taken an earlier one away. None where
    there is none that can be read.
    """
    if not (session.path / EVALUATION_SUMMARY).is_file():
        return None
    with suppress(SessionError):
        return Evaluation.load(session.path)
    return None
