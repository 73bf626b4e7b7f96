"""How late a follower is: from the time of a sample in the loop to when it was handed to a viewer.

Each trial runs `quick` in real time, with sensors at 60 and then at 1,000 Hz, and follows it from
another process into a file. The bars are 300 ms (median) and 1 s (99 %).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import yaml

from testbench.execution import RunOptions, execute
from testbench.pipeline.follow import follow
from testbench.pipeline.request import FollowRequest, ViewRequest
from testbench.planning import plan
from testbench.records.specs.shipped import shipped_folder
from tests.benchmarks.resuming import count_of, resumed

MODULE = "tests.benchmarks.following"
RATES = (60, 1000)
MEDIAN_MS, LATE_MS = 300.0, 1000.0
SAMPLES = 200
"""Instants of the loop that each handing over is asked of, at most."""


def main() -> int:
    """Run trials, print what they come to; the exit code."""
    count, failed = count_of(2, __doc__), False
    for rate in RATES:
        found = resumed(f"following_{rate}", count, partial(trials, rate=rate))
        median, most = np.percentile(np.concatenate(found), [50, 99])
        failed |= bool(median > MEDIAN_MS or most > LATE_MS)
        print(f"{count} runs of sensors at {rate} Hz: {median:.0f} ms late, 99 % {most:.0f} ms")
    return int(failed)


def trials(numbers: range, rate: int) -> Iterator[list[float]]:
    """Latencies [ms] of each trial."""
    for _ in numbers:
        with tempfile.TemporaryDirectory() as name:
            yield latencies(Path(name), rate)


def latencies(folder: Path, rate: int) -> list[float]:
    """How late instants of a run were handed on [ms], a few of each handing over."""
    file = shipped_folder("protocols") / "quick.yaml"
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    for sensor in content["sensors"].values():
        sensor["parameters"] = {"rate_hz": rate}
    protocol = folder / "quick.yaml"
    protocol.write_text(yaml.safe_dump(content), encoding="utf-8")
    origins: list[int] = []
    followers: list[subprocess.Popen[bytes]] = []
    log = folder / "told.json"

    def opened(path: Path) -> None:
        command = [sys.executable, "-m", MODULE, "--follow", str(path), str(log)]
        followers.append(subprocess.Popen(command))

    def tell(progress) -> None:
        origins.append(time.monotonic_ns() - round(progress.time * 1e9))

    options = RunOptions(speed="realtime", opened=opened, progress=tell)
    execute(plan(protocol), folder / "logs", 1, options)
    followers[0].wait()
    origin, found = min(origins), []
    before = 0
    for until, at in json.loads(log.read_text(encoding="utf-8")):
        own = np.linspace(before, until, min(SAMPLES, max(2, (until - before) * rate // 10**9)))
        found += ((at - origin - own) * 1e-6).tolist() if before else []
        before = until
    return found


def record_following(session: str, log: str) -> None:
    """Follow a session, and keep when which instant was handed on, both in nanoseconds."""
    told: list[tuple[int, int]] = []
    asked = FollowRequest(session=session, view=ViewRequest(save=f"{log}.rrd"))
    follow(asked, told=lambda ns: told.append((ns, time.monotonic_ns())))
    Path(log).write_text(json.dumps(told), encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--follow"]:
        record_following(*sys.argv[2:])
    else:
        sys.exit(main())
