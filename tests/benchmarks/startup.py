"""How long the command line takes to say anything, and a whole short run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from tests.benchmarks.timing import Text, duration, seconds, show

COMMAND = Path(sys.executable).with_name("testbench")
LIBRARIES = "import numpy, pyarrow, numba"
"""What no run does without: the measure of a machine's imports."""
TARGET_TIMES, TARGET_MORE_S = 4.0, 0.8
"""A short run is meant to take so many times the libraries' import, and so much more [s]."""
TARGET_HELP_S = 0.25


def bench_startup() -> None:
    """Time the help and a short run as whole processes, and Python and its imports beside them."""

    def run(*command: str) -> float:
        return seconds(lambda: subprocess.run(command, check=True, capture_output=True), 5)

    with tempfile.TemporaryDirectory() as folder:
        python = run(sys.executable, "-c", "pass")
        imports = run(sys.executable, "-c", LIBRARIES)
        calls = {
            "python -c pass": python,
            f'python -c "{LIBRARIES}"': imports,
            "testbench --help": run(str(COMMAND), "--help"),
            "testbench protocols": run(str(COMMAND), "protocols"),
            "testbench run quick": (quick := run(str(COMMAND), "run", "quick", "--logs", folder)),
        }
    rows: list[list[str | Text]] = [
        [Text(name), duration(time), f"{time / python:.1f} x", f"{time / imports:.2f} x"]
        for name, time in calls.items()
    ]
    most = TARGET_TIMES * imports + TARGET_MORE_S
    show(
        "Start-up of the command line, whole processes",
        ["call", "time", "of Python alone", "of its imports"],
        rows,
        f"target: --help below {TARGET_HELP_S:g} s\n"
        f"  target: run quick at most {TARGET_TIMES:g} x its imports and {TARGET_MORE_S:g} s, that "
        f"is {most:.2f} s: it takes {quick / most:.2f} of that",
    )
