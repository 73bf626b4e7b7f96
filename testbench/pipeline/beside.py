"""Start the viewer of a session that this process records, as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Thread


def start_viewer(session: Path, web: bool, tell: Callable[[str], None]) -> Thread:
    """Start a viewer that follows a session from its journals, and leave it alone.

    It reads the session and writes nothing in it, and nobody waits for it. A window stays until a
    person closes it; a page is served as long as the session is recorded.

    Args:
        session: Its folder, which is a session already.
        web: Serve a page instead of opening a window.
        tell: Told, a line at a time, where to look, or why there is nothing to see; from the
            thread that listens.

    Returns:
        Who listens to it, until it ends.
    """
    command = [sys.executable, "-m", "testbench", "view", str(session), "--follow", "--with-run"]
    # In a session of its own: Ctrl-C on the terminal stops the arm, and not who looks on.
    viewer = subprocess.Popen(
        [*command, "--web"] if web else command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    listener = Thread(target=_listen, args=(viewer, tell), daemon=True)
    listener.start()
    return listener


def _listen(viewer: subprocess.Popen[str], tell: Callable[[str], None]) -> None:
    """Hand on what the viewer says."""
    assert viewer.stdout is not None
    with viewer:
        for line in viewer.stdout:
            tell(f"viewer: {line.strip()}")
