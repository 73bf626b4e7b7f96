"""A page on paper: printed to PDF by a browser of this machine, so that there is no second set of
figures.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from testbench.exceptions import BenchError
from testbench.records.disk.replacing import replaced_file, stored

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "brave-browser",
    "chrome",
    "msedge",
)
"""Programs that print without a window, as they are called on a path; Chrome and Edge of macOS and
Windows are looked for where they are installed.
"""
INSTALLED = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
DRAWN_MS = 30_000
"""How long a page may draw, of its own clock, which stands still while it works."""
TIMEOUT_S = 300.0
"""A browser that has not printed by then is ended [s]."""


class PrintingError(BenchError):
    """There is no browser, or it did not print."""


def browser() -> str | None:
    """The first browser that is found, None where there is none."""
    found = (shutil.which(name) for name in BROWSERS)
    installed = (path for path in INSTALLED if Path(path).is_file())
    return next((path for path in (*found, *installed) if path), None)


def print_page(page: Path, path: Path) -> Path:
    """Print a page of ours to PDF.

    Args:
        page: The HTML file.
        path: Of the PDF, which is replaced.

    Returns:
        The same path.

    Raises:
        PrintingError: There is no browser, or it wrote nothing.
        StorageError: The disk does not take it.
    """
    program = browser()
    if program is None:
        raise PrintingError(
            "no browser was found that prints: install Chromium, Chrome or Edge, or open "
            f"{page} in any browser and print it from there"
        )
    with tempfile.TemporaryDirectory(prefix="testbench_print_") as folder:
        printed = Path(folder) / "page.pdf"
        _print(program, page, printed, Path(folder) / "profile")
        with stored(path), replaced_file(path) as partial:
            shutil.copyfile(printed, partial)
    return path


def _print(program: str, page: Path, printed: Path, profile: Path) -> None:
    command = [
        program,
        "--headless",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--no-first-run",
        "--no-pdf-header-footer",
        f"--user-data-dir={profile}",
        f"--virtual-time-budget={DRAWN_MS}",
        f"--print-to-pdf={printed}",
    ]
    if hasattr(os, "geteuid") and os.geteuid() == 0:  # its sandbox refuses to run as root
        command.append("--no-sandbox")
    try:
        result = subprocess.run(
            [*command, page.resolve().as_uri()],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=TIMEOUT_S,
        )
    except subprocess.TimeoutExpired:
        raise PrintingError(f"{program} did not print {page} within {TIMEOUT_S:.0f} s") from None
    except OSError as error:
        raise PrintingError(f"{program} could not be started: {error.strerror}") from None
    if not printed.is_file() or not printed.stat().st_size:
        raise PrintingError(
            f"{program} printed nothing of {page} and ended with code {result.returncode}"
        )
