"""Importing a CSV of 91 MB with all checks, beside what only reads and stores it: pyarrow.csv, and
Parquet in its own settings.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from tests.benchmarks.long_recordings import write_sensor
from tests.benchmarks.timing import Text, duration, show

HOURS, RATE_HZ = 1.0, 400.0
"""One sensor: 91 MB of CSV, 1.44 million rows of seven columns."""
REPEATS = 3
MOST_TIMES = 1.5
"""What importing may cost of reading and storing."""

PROGRAM = """
import json, sys, time
from pathlib import Path

import pyarrow.parquet as pq
from pyarrow import csv

from testbench.clock import SystemClock
from testbench.formats import import_recording
from testbench.formats.options import Options

folder, repeats = Path(sys.argv[1]), int(sys.argv[2])
file = folder / "sensor1.csv"


def plain(number):
    pq.write_table(csv.read_csv(file), folder / f"plain_{number}.parquet")


def ours(number):
    options = Options(str(folder / "map.yaml"))
    import_recording("generic", [file], folder / f"session_{number}", SystemClock(), options)


for number in range(repeats + 1):  # the first loads libraries and compiled kernels: cold
    found = {}
    for call in (plain, ours):
        wall, processor = time.perf_counter(), time.process_time()
        call(number)
        found[call.__name__] = [time.perf_counter() - wall, time.process_time() - processor]
    print(json.dumps(found))
"""

MAPPING = """\
description: one sensor
time: {column: time_us, unit: us}
sensors:
  imu1:
    gyr: {columns: [gyr_x, gyr_y, gyr_z], unit: deg/s}
    acc: {columns: [acc_x, acc_y, acc_z], unit: m/s^2}
"""


def measure(folder: Path) -> list[dict[str, list[float]]]:
    """Wall-clock and processor time [s] of "plain" and "ours" by turns, in a process of their own:
    first cold, then warm.

    Args:
        folder: To work in.
    """
    write_sensor(folder / "sensor1.csv", 3600 * HOURS, RATE_HZ, 1)
    (folder / "map.yaml").write_text(MAPPING)
    words = [sys.executable, "-c", PROGRAM, str(folder), str(REPEATS)]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return [json.loads(line) for line in told.splitlines()]


def bench_import_speed() -> None:
    """Cold and warm, by the clock on the wall and in processor time; of the warm ones the median of
    the ratios.
    """
    with tempfile.TemporaryDirectory() as name:
        runs = measure(Path(name))
        size = (Path(name) / "sensor1.csv").stat().st_size / 1e6
    rows: list[list[str | Text]] = []
    for title, some in (("cold", runs[:1]), ("warm", runs[1:])):
        for which, clock in enumerate(("wall clock", "processor")):
            own, other = ([run[key][which] for run in some] for key in ("ours", "plain"))
            times = median(a / b for a, b in zip(own, other, strict=True))
            rows.append(
                [
                    Text(f"{title}, {clock}"),
                    duration(median(own)),
                    duration(median(other)),
                    f"{times:.2f}",
                ]
            )
    show(
        f"Import of {size:.0f} MB of CSV with all checks, median of {REPEATS} by turns",
        ["", "import", "pyarrow.csv + Parquet", "times"],
        rows,
        f"target: at most {MOST_TIMES:g} times, warm",
    )


if __name__ == "__main__":
    bench_import_speed()
