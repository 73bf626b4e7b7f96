"""Print how fast the bench is on this machine; ends with exit code 1 where it misses a bar."""

from __future__ import annotations

import os
import platform
import sys
import time

from tests.benchmarks.bars import show_bars
from tests.benchmarks.filters import bench_filters
from tests.benchmarks.gyroscopes import bench_gyroscopes
from tests.benchmarks.long_campaign import bench_long_campaign
from tests.benchmarks.physics import bench_physics
from tests.benchmarks.pipeline import bench_pipeline
from tests.benchmarks.startup import bench_startup
from tests.benchmarks.static_calibration import bench_static_calibration
from tests.benchmarks.verification import bench_verification


def main() -> int:
    """Run every benchmark; the exit code."""
    begin = time.perf_counter()
    print(
        f"Python {platform.python_version()} on {platform.system()} {platform.machine()}, "
        f"{os.cpu_count()} cores"
    )
    print(
        "Times are the shortest of a few repeats after one that does not count, unless a title "
        "says otherwise."
    )
    bars = bench_pipeline()
    bench_filters()
    bench_gyroscopes()
    bench_static_calibration()
    bench_physics()
    bars += bench_startup()
    bench_verification()
    bench_long_campaign()
    kept = show_bars(bars)
    print(f"\n{time.perf_counter() - begin:.0f} s in all")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
