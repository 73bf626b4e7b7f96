"""The command `view`, and what `run` and `record` show while they record."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbench.cli.options import (
    JsonOption,
    NoVerifyOption,
    SessionArgument,
    optional,
    session_of,
)
from testbench.cli.output import say, say_json

if TYPE_CHECKING:
    from testbench.pipeline.request import ViewRequest


class Viewing(StrEnum):
    """Where a session is looked at while it is recorded."""

    native = "native"
    web = "web"


ViewOption = Annotated[
    Viewing | None,
    typer.Option(
        "--view",
        metavar="(native|web)",
        help="Show it while it is recorded, in a window (native, also where nothing is said) or on "
        "a page. Closing either changes nothing.",
    ),
]


# Long by its options, one parameter each.
def view(
    session: SessionArgument,
    follow: Annotated[
        bool,
        typer.Option("--follow", help="Of a session that is being recorded: what comes of it."),
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Serve to browsers; prints the address to open.")
    ] = False,
    port: Annotated[
        int | None,
        typer.Option("--port", min=1, max=65535, help="Of the page; else 9090, or a free one."),
    ] = None,
    bind: Annotated[
        str,
        typer.Option("--bind", help="Address to listen at; 0.0.0.0 for other machines, too."),
    ] = "127.0.0.1",
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Write a .rrd recording instead of opening the viewer."),
    ] = None,
    screenshot: Annotated[
        Path | None, typer.Option("--screenshot", help="Write a .png instead, without a screen.")
    ] = None,
    time: Annotated[
        float | None,
        typer.Option("--time", metavar="S", help="Of the picture, from the start of the session."),
    ] = None,
    size: Annotated[
        str, typer.Option("--size", metavar="WxH", help="Of the picture, in pixels.")
    ] = "1920x1200",
    pane: Annotated[
        str | None,
        typer.Option(
            "--view",
            metavar="NAME",
            help="Only one pane, in picture and file: bench, orientations, or a tab by its name.",
        ),
    ] = None,
    with_run: Annotated[bool, typer.Option("--with-run", hidden=True)] = False,
    no_verify: NoVerifyOption = False,
    json: JsonOption = False,
) -> None:
    """Open a session in rerun: the arm, the sensors, their signals and errors."""
    from testbench.pipeline.request import ViewRequest

    asked = ViewRequest(
        web=web,
        port=port,
        bind=bind,
        save=optional(save),
        screenshot=optional(screenshot),
        time_s=time,
        size=_size(size),
        pane=pane,
    )
    if follow:
        return _follow(session, asked, with_run, json)
    from testbench.pipeline.show import opens_in, show
    from testbench.pipeline.watcher import Watcher

    opened = session_of(session, no_verify)
    written = show(opened, asked, Watcher() if json else Watcher(say=say))
    if json:
        say_json({"session": str(opened.path), "files": [str(path) for path in written]})
    else:
        for path in written:
            say(f"written: {path}{opens_in(path)}")
    return None


def _size(text: str) -> tuple[int, int]:
    """Width and height of `WxH`.

    Raises:
        InputError: It is not written so.
    """
    from testbench.exceptions import InputError

    found = re.fullmatch(r"(\d{3,4})x(\d{3,4})", text)
    if found is None or not all(200 <= int(side) <= 8000 for side in found.groups()):
        raise InputError(f"--size {text}: must be WxH, 200 to 8000 each, such as 1920x1200")
    return int(found[1]), int(found[2])


def _follow(session: Path, asked: ViewRequest, with_run: bool, json: bool) -> None:
    """Look at a session while it is recorded, and say to where that came."""
    from testbench.exceptions import InputError
    from testbench.pipeline.follow import follow
    from testbench.pipeline.request import FollowRequest
    from testbench.pipeline.show import opens_in
    from testbench.pipeline.watcher import Watcher

    if asked.screenshot is not None:
        raise InputError("--follow goes with --web and --save, not with --screenshot")
    wanted = FollowRequest(session=str(session), view=asked, with_run=with_run)
    found = follow(wanted, Watcher() if json else Watcher(say=say))
    if json:
        return say_json(asdict(found))
    if with_run:  # who recorded it has said more
        return None
    if found.written is not None:
        say(f"written: {found.written}{opens_in(found.written)}")
    if found.end == "cut off":
        return say(
            f"cut off: shown to its last sample, at {found.last_s:.1f} s; `testbench recover "
            f"{found.session}` makes the session readable"
        )
    return say(f"shown to {found.last_s:.1f} s")


def shown_beside(
    wanted: Viewing | None, tell: Callable[[str], None]
) -> Callable[[Path], object] | None:
    """Who is told of the folder of a session, and starts the viewer that was asked for.

    Args:
        wanted: Where it is shown; nobody is told if None.
        tell: Told where to look, or why there is nothing to see.
    """
    if wanted is None:
        return None
    from testbench.pipeline.beside import start_viewer

    return lambda path: start_viewer(path, wanted is Viewing.web, tell)
