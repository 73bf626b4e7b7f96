"""How long the command line takes to say anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.benchmarks.timing import Text, duration, ratio, seconds, show

COMMAND = Path(sys.executable).with_name("testbench")


def bench_startup() -> None:
    """Time the help, and Python alone beside it."""

    def run(*command: str) -> float:
        return seconds(lambda: subprocess.run(command, check=True, capture_output=True), 5)

    python = run(sys.executable, "-c", "pass")
    calls = {
        "testbench --help": [str(COMMAND), "--help"],
        "testbench protocols": [str(COMMAND), "protocols"],
    }
    rows: list[list[str | Text]] = [[Text("python -c pass"), duration(python), "1 x"]]
    for name, command in calls.items():
        time = run(*command)
        rows.append([Text(name), duration(time), ratio(python, time)])
    show(
        "Start-up of the command line",
        ["call", "time", "of Python alone"],
        rows,
        "target: --help below 0.5 s",
    )
