"""Kill simulated runs at random moments: what is lost, and whether the resumed run is the
undisturbed one.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.benchmarks.timing import Text, show
from tests.conftest import TINY
from tests.system.crashes import crash, moments, undisturbed


def bench_crashes(count: int = 100) -> bool:
    """Print the figures; whether every run could be resumed without a trace."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        protocol = folder / "tiny.yaml"
        protocol.write_text(TINY, encoding="utf-8")
        whole, expected = undisturbed(protocol, folder / "whole")
        outcomes = [
            crash(protocol, folder / f"run{i}", speed, after, whole, expected)
            for i, (speed, after) in enumerate(moments(count, 6.0, seed=1))
        ]
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


if __name__ == "__main__":
    sys.exit(not bench_crashes(int(sys.argv[1]) if len(sys.argv) > 1 else 100))
