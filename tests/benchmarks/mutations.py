"""Ten thousand mutated protocols, robots, sessions and calibrations."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.records.shipped import shipped_folder
from tests.benchmarks.timing import Text, show
from tests.conftest import TINY
from tests.system.mutations import Campaign
from tests.system.test_security import CALIBRATION


def bench_mutations(count: int = 10_000) -> bool:
    """Print the figures; whether every file was read or refused in a sentence, in time, with
    nothing written elsewhere.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "inside").mkdir()
        protocol = folder / "tiny.yaml"
        protocol.write_text(TINY, encoding="utf-8")
        session = execute(plan(protocol), folder, 1, RunOptions(session_name="session"))
        campaign = Campaign(
            folder / "inside",
            protocol,
            shipped_folder("robots") / "ur3e",
            session.path,
            CALIBRATION,
        )
        here = Path.cwd()
        try:
            for number in range(count):
                campaign.one(number)
        finally:
            os.chdir(here)
    found = campaign.found
    rows: list[list[str | Text]] = [
        [Text("tried"), str(found.tried)],
        [Text("refused in a sentence"), str(found.refused)],
        [Text("tracebacks, hangs, files elsewhere"), str(len(found.failures))],
        [Text("slowest [s]"), f"{found.slowest_s:.2f}"],
    ]
    show("Mutated files", ["", "files"], rows)
    for failure in found.failures[:20]:
        print(f"  {failure}")
    return not found.failures


if __name__ == "__main__":
    sys.exit(not bench_mutations(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000))
