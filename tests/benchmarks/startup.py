"""How long the command line takes to say anything, and a whole short run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from tests.benchmarks.bars import Bar
from tests.benchmarks.timing import Text, duration, seconds, show

COMMAND = Path(sys.executable).with_name("testbench")
LIBRARIES = "import numpy, pyarrow, numba"
"""What no run does without: the measure of a machine's imports."""
TARGET_TIMES, TARGET_MORE_S = 4.0, 0.8
"""A short run is meant to take so many times the libraries' import, and so much more [s]."""
TARGET_HELP_S = 0.25


def bench_startup() -> list[Bar]:
    """Time the help and a short run as whole processes, and Python and its imports beside them."""

    def run(*command: str) -> float:
        return seconds(lambda: subprocess.run(command, check=True, capture_output=True), 5)

    with tempfile.TemporaryDirectory() as folder:
        python = run(sys.executable, "-c", "pass")
        imports = run(sys.executable, "-c", LIBRARIES)
        calls = {
            "python -c pass": python,
            f'python -c "{LIBRARIES}"': imports,
            "testbench --help": (help_s := run(str(COMMAND), "--help")),
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
    )
    return [
        Bar("testbench --help, whole process", help_s, TARGET_HELP_S, "s"),
        Bar(
            f"testbench run quick, whole process; {TARGET_TIMES:g} x its imports + "
            f"{TARGET_MORE_S:g} s",
            quick,
            most,
            "s",
        ),
    ]
