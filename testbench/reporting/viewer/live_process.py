"""Where what is drawn of a running session goes: a window, a page, or a file."""

from __future__ import annotations

import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr

from testbench.records.disk.replacing import replaced_file, stored_where_asked
from testbench.reporting.viewer.process import (
    START_TIMEOUT,
    ViewerError,
    Where,
    doors,
    running_viewer,
)
from testbench.reporting.viewer.recording import drained

APPLICATION = "testbench"
MOST_MEMORY = "1GB"
"""Of a viewer, and of what is kept for pages that are opened late; the oldest is dropped."""


@dataclass(frozen=True)
class Shown:
    """A drawing that somebody may look at.

    Attributes:
        recording: To draw into.
        page: To open in a browser; empty where there is none.
        is_open: Whether there still is anybody to draw for.
    """

    recording: rr.RecordingStream
    page: str
    is_open: Callable[[], bool]


@contextmanager
def shown_live(name: str, where: Where) -> Iterator[Shown]:
    """A viewer of its own process that waits for what is drawn; it is ended with the block.

    Args:
        name: Of the session.
        where: In a window, or on a page.

    Yields:
        What to draw into.

    Raises:
        ViewerError: The viewer is not installed, or did not start.
    """
    found = doors(where)
    options = [*found.options, "--memory-limit", MOST_MEMORY]
    options += ["--server-memory-limit", MOST_MEMORY] if found.page else ["--expect-data-soon"]
    with running_viewer(options, quiet=True) as process:
        _wait_for(process, found.listens)
        recording = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
        with recording:
            recording.connect_grpc(found.proxy)
            try:
                yield Shown(recording, found.page, lambda: process.poll() is None)
            finally:
                recording.disconnect()


@contextmanager
def saved_live(name: str, path: Path) -> Iterator[Shown]:
    """A file that what is drawn is written to; it has its name once the block ends.

    Args:
        name: Of the session.
        path: The .rrd file to write.

    Yields:
        What to draw into.

    Raises:
        InputError: There is no such place.
        StorageError: The disk does not take it.
    """
    with (
        stored_where_asked(path),
        replaced_file(path) as partial,
        drained(partial) as pipe,
        rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False) as recording,
    ):
        try:
            recording.save(pipe)
            yield Shown(recording, "", lambda: True)
        finally:
            recording.disconnect()  # who drains waits for the end


def _wait_for(process: subprocess.Popen[bytes], address: tuple[str, int]) -> None:
    """Wait until a viewer listens, for it would miss what is sent before.

    Raises:
        ViewerError: It ended, or is not there in time.
    """
    pause, waited = threading.Event(), 0.0
    while waited < START_TIMEOUT:
        if process.poll() is not None:
            raise ViewerError(
                f"the viewer ended with code {process.returncode}; without a screen use a page "
                "(--web, --view web), and of a page a port that is free"
            )
        with socket.socket(socket.AF_INET6 if ":" in address[0] else socket.AF_INET) as probe:
            if probe.connect_ex(address) == 0:
                return
        pause.wait(0.1)
        waited += 0.1
    raise ViewerError(f"the viewer did not answer within {START_TIMEOUT:.0f} s")
