"""Thousands of mutated protocols, robots, sessions, calibrations and foreign recordings."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.records.specs.shipped import shipped_folder
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.conftest import TINY
from tests.system.mutations import Campaign, Found
from tests.system.test_security import CALIBRATION

COUNT = 10_000


def bench_mutations(count: int = COUNT) -> bool:
    """Print the figures; whether every file was read or refused in a sentence, in time, with
    nothing written elsewhere.
    """
    found = [Found(**one) for one in resumed("mutations", count, _mutations)]
    failures = [failure for one in found for failure in one.failures]
    rows: list[list[str | Text]] = [
        [Text("tried"), str(sum(one.tried for one in found))],
        [Text("refused in a sentence"), str(sum(one.refused for one in found))],
        [Text("tracebacks, hangs, files elsewhere"), str(len(failures))],
        [Text("slowest [s]"), f"{max(one.slowest_s for one in found):.2f}"],
    ]
    show("Mutated files", ["", "files"], rows)
    for failure in failures[:20]:
        print(f"  {failure}")
    return not failures


def _mutations(numbers: range) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "inside").mkdir()
        protocol = folder / "tiny.yaml"
        protocol.write_text(TINY, encoding="utf-8")
        session = execute(plan(protocol), folder, 1, RunOptions(session_name="session"))
        robot = shipped_folder("robots") / "ur3e"
        campaign = Campaign(folder / "inside", protocol, robot, session.path, CALIBRATION)
        here = Path.cwd()
        try:
            for number in numbers:
                campaign.found = Found()
                campaign.one(number)
                yield asdict(campaign.found)
        finally:
            os.chdir(here)


if __name__ == "__main__":
    sys.exit(not bench_mutations(count_of(COUNT, __doc__)))
