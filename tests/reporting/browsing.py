"""Pages as Chromium draws them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S

CHROMIUM = shutil.which("chromium")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--hide-scrollbars",
    "--enable-logging=stderr",
)
DRAWN_MS = 15_000
"""Of the page's own clock, which stands still while it works; with 3 s and less Chromium 156 was
seen never to end.
"""


def browse(page: Path, profile: Path, *flags: str) -> str:
    """What Chromium prints once it has drawn a page without a complaint.

    Args:
        page: The file.
        profile: Folder of the browser's own, which is removed.
        flags: Further ones, such as `--dump-dom` or `--screenshot=FILE`.
    """
    own = (f"--user-data-dir={profile}", f"--virtual-time-budget={DRAWN_MS}")
    result = subprocess.run(
        [str(CHROMIUM), *FLAGS, *own, *flags, page.as_uri()],
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    shutil.rmtree(profile, ignore_errors=True)
    assert "CONSOLE" not in result.stderr, result.stderr
    return result.stdout
