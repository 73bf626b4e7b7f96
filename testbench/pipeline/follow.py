"""Look at a session while another process records it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from testbench.clock import seconds
from testbench.exceptions import SessionError
from testbench.pipeline.live_session import LiveSession
from testbench.pipeline.request import FollowRequest
from testbench.pipeline.watcher import Watcher
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_tail import SessionTail

if TYPE_CHECKING:
    from testbench.reporting.viewer import Shown

LOOK_S = 0.1
"""How often the journals are looked at [s]: they are appended as often."""
AFTERWARDS_S = 5.0
"""A page that is not to outlive its run is served for so long after it, for what is on its way
[s].
"""


@dataclass(frozen=True)
class Followed:
    """What was looked at.

    Attributes:
        session: Its folder.
        last_s: The last instant that was shown [s].
        samples: How many of each sensor were read.
        end: Why it ended: "over" (the recording is), "cut off" (it was), or "closed" (the viewer
            was).
        written: The file that was asked for.
    """

    session: Path
    last_s: float
    samples: dict[str, int]
    end: str
    written: Path | None = None


def follow(
    asked: FollowRequest,
    watcher: Watcher | None = None,
    told: Callable[[int], None] | None = None,
) -> Followed:
    """Show a session until it is over, and the viewer is closed.

    The recording is read from its journals; whoever writes it notices nothing. One that is over, or
    was cut off, is shown to its last sample.

    Args:
        asked: What to look at, and where.
        watcher: Told the address of a page; gives the clock.
        told: Called with the host time [ns] of the latest sample after each time that something was
            handed on, for who measures how late that is.

    Raises:
        SessionError: There is no such session, or it is an import.
        ViewerError: The viewer did not start.
    """
    watcher = watcher or Watcher()
    session = Session(Path(asked.session))
    if session.manifest.kind == "import":
        raise SessionError(f"{session.path} is an import: `testbench view` shows it")
    tail = SessionTail(session)
    try:
        with _opened(asked, session) as shown:
            if shown.page:
                watcher.say(f"open {shown.page}")
            live = LiveSession(session, shown.recording)
            end = _until_over(tail, live, shown, watcher, told)
            with suppress(KeyboardInterrupt):
                _stay(asked, shown, watcher, end)
    finally:
        tail.close()
    written = None if asked.view.save is None else Path(asked.view.save)
    return Followed(session.path, live.last_ns * 1e-9, live.counts, end, written)


def _opened(asked: FollowRequest, session: Session) -> AbstractContextManager[Shown]:
    """A file, a window or a page to draw into."""
    from testbench.reporting.viewer import Where, saved_live, shown_live

    if asked.view.save is not None:
        return saved_live(session.name, Path(asked.view.save))
    return shown_live(session.name, Where(asked.view.web, asked.view.port, asked.view.bind))


def _until_over(
    tail: SessionTail,
    live: LiveSession,
    shown: Shown,
    watcher: Watcher,
    told: Callable[[int], None] | None,
) -> str:
    """Draw what comes, until nobody writes any more; Ctrl-C ends it, too."""
    over = False
    with suppress(KeyboardInterrupt):
        while shown.is_open():
            news = tail.read()
            if news:
                live.take(news)
                shown.recording.flush()
                if told is not None:
                    told(live.last_ns)
            elif over:
                closed = Session(tail.session.path)
                live.ended(closed)
                shown.recording.flush()
                return "cut off" if closed.status is RunStatus.RUNNING else "over"
            else:
                over = tail.is_over  # what was written until now is looked for once more
                watcher.clock.sleep(0.0 if over else LOOK_S)
    return "closed"


def _stay(asked: FollowRequest, shown: Shown, watcher: Watcher, end: str) -> None:
    """Leave a window open until a person closes it, and a page until Ctrl-C, or for a while."""
    if asked.view.save is not None or end == "closed":
        return
    begin = seconds(watcher.clock)
    while shown.is_open() and not (
        asked.with_run and shown.page and seconds(watcher.clock) - begin > AFTERWARDS_S
    ):
        watcher.clock.sleep(LOOK_S)
