"""Kill simulated runs at random moments: what is lost, and whether the resumed run is the
undisturbed one.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.conftest import TINY
from tests.system.crashes import Outcome, crash, moments, undisturbed

COUNT = 100


def bench_crashes(count: int = COUNT) -> bool:
    """Print the figures; whether every run could be resumed without a trace."""
    outcomes = [Outcome(**found) for found in resumed("crashes", count, _crashes)]
    rows: list[list[str | Text]] = [
        [
            Text("killed before it was a session"),
            str(sum(not outcome.was_session for outcome in outcomes)),
        ],
        [Text("sessions that open"), str(sum(outcome.opened for outcome in outcomes))],
        [Text("most that was lost [s]"), f"{max(outcome.lost for outcome in outcomes):.3f}"],
        [Text("same files after resuming"), str(sum(outcome.same_files for outcome in outcomes))],
        [
            Text("same evaluation after resuming"),
            str(sum(outcome.same_evaluation for outcome in outcomes)),
        ],
    ]
    show(f"{count} simulated runs, killed with SIGKILL at random moments", ["", "runs"], rows)
    return all(o.opened and o.same_files and o.same_evaluation and o.lost <= 1 for o in outcomes)


def _crashes(numbers: range) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        protocol = folder / "tiny.yaml"
        protocol.write_text(TINY, encoding="utf-8")
        whole = undisturbed(protocol, folder / "whole")
        chosen = moments(numbers.stop, seed=1)
        for number in numbers:
            yield asdict(crash(protocol, folder / f"run{number}", *chosen[number], whole))


if __name__ == "__main__":
    sys.exit(not bench_crashes(count_of(COUNT, __doc__)))
