"""What it costs to compare raw files with their hashes before a session is analysed."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.pipeline.analyse import analyse, judge_again
from testbench.records.session.raw_files import Memory, check_raw_files
from testbench.records.session.session import Session
from tests.asking import analysis
from tests.benchmarks.timing import Text, duration, seconds, show

PROTOCOL = "elbow_flexion"
LARGEST_SHARE = 0.03
LATER_NS = 10**11


def bench_verification() -> None:
    """Time the check alone, remembered and not, and an evaluation of what is estimated already."""
    with tempfile.TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", f"{name}/cache")
        session = execute(plan(PROTOCOL), Path(name), options=RunOptions(session_name="session"))
        analyse(session, analysis())
        size = check_raw_files(session, Memory.of(session)).hashed
        (file,) = Path(name, "cache").rglob("*.json")
        os.utime(file, ns=(file.stat().st_mtime_ns + LATER_NS,) * 2)
        evaluating = seconds(lambda: judge_again(Session(session.path)))
        remembered = seconds(lambda: check_raw_files(session, Memory.of(session)))
        anew = seconds(lambda: check_raw_files(session))
    rows: list[list[str | Text]] = [
        [Text(what), duration(took), f"{100 * took / evaluating:.2f} %"]
        for what, took in (
            ("evaluate, of what is estimated", evaluating),
            ("compare the raw files, remembered", remembered),
            ("compare the raw files, read anew", anew),
        )
    ]
    show(
        f"Verification of a session of {PROTOCOL}, {size / 1e6:.0f} MB of raw files",
        ["", "time", "share"],
        rows,
        f"target: remembered, below {100 * LARGEST_SHARE:g} % of an evaluation",
    )


if __name__ == "__main__":
    bench_verification()
