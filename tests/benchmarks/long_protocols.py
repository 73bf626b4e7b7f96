"""Protocols of hours with two sensors, by the command line: the largest memory of a run with its
analysis and report, of `evaluate` and of `report`, at 100 and at 500 Hz.

    python -m tests.benchmarks.long_protocols [--hours 8]
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from testbench.records.specs.shipped import shipped_folder
from tests.benchmarks.long_campaign import PROTOCOL, ROUND_S
from tests.benchmarks.timing import Text, duration, show

HOURS, RATES = 8.0, (100, 500)
MOST_MB = 1000.0
"""None of the commands may take more, whatever the length of the recording [MB]."""
COMMANDS = ("run", "evaluate", "report")
PROGRAM = """
import json, sys, time
from testbench.cli import main
sys.argv[0] = "testbench"
begun = time.perf_counter()
try:
    main()
except SystemExit as end:
    if end.code:
        raise
took = time.perf_counter() - begun
# of this program alone: `ru_maxrss` begins with what whoever started it had
status = open("/proc/self/status").read()
peak = int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6
print(json.dumps({"took_s": took, "cpu_s": time.process_time(), "peak_mb": peak}))
"""


@dataclass(frozen=True)
class Measured:
    """One command: wall-clock and processor time [s], largest resident memory [MB]."""

    took_s: float
    cpu_s: float
    peak_mb: float


def write_protocol(folder: Path, hours: float, rate: int) -> None:
    """A protocol of elbow sweeps, `long.yaml`, whose sensors have this rate [Hz], and its arm the
    next that it can have.
    """
    shutil.copytree(shipped_folder("robots") / "ur3e", folder / "robot")
    robot = folder / "robot" / "robot.yaml"
    text = robot.read_text(encoding="utf-8")
    assert "record_hz: 125" in text
    recorded = 125 if rate <= 125 else 500
    robot.write_text(text.replace("record_hz: 125", f"record_hz: {recorded}"), encoding="utf-8")
    rounds = max(round(hours * 3600 / ROUND_S), 1)
    preset = "preset: xsens_dot"
    faster = f"{preset}\n    parameters: {{rate_hz: {rate}}}"
    own = PROTOCOL.format(rounds=rounds).replace(preset, faster)
    (folder / "long.yaml").write_text(own, encoding="utf-8")


def measure(folder: Path, command: str) -> Measured:
    """Run one of the commands in a folder, in a process of its own."""
    of = ["long.yaml", "--logs", "logs"] if command == "run" else [*folder.glob("logs/*")]
    words = [sys.executable, "-c", PROGRAM, command, *map(str, of)]
    result = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{command} failed:\n{result.stderr}")
    return Measured(**json.loads(result.stdout.splitlines()[-1]))


def bench_long_protocols(hours: float = HOURS) -> bool:
    """Print the figures; whether none is too large."""
    rows: list[list[str | Text]] = []
    peaks: list[float] = []
    for rate in RATES:
        with tempfile.TemporaryDirectory() as name:
            write_protocol(Path(name), hours, rate)
            for command in COMMANDS:
                found = measure(Path(name), command)
                peaks.append(found.peak_mb)
                times = [duration(found.took_s), duration(found.cpu_s)]
                rows.append([Text(f"{rate} Hz, {command}"), *times, f"{found.peak_mb:.0f} MB"])
                print(f"{rate} Hz, {command}: {found.peak_mb:.0f} MB", flush=True)
    show(
        f"A protocol of {hours:g} h with two sensors",
        ["", "time", "processor", "peak memory"],
        rows,
        f"target: below {MOST_MB:.0f} MB each",
    )
    return max(peaks) < MOST_MB


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=HOURS, help="of the protocol (%(default)s)")
    sys.exit(not bench_long_protocols(parser.parse_args().hours))
