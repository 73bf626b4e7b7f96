"""Long protocols by the command line: by how much the memory of a run with its analysis and report
grows an hour; tests/benchmarks/long_protocols.py has eight hours, above which it does not grow.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.long_protocols import MOST_MB, Measured, measure, write_protocol

MINUTES, RATE = (8, 20), 100
MOST_MB_AN_HOUR = 600.0
"""Of two sensors at 100 Hz, 720,000 samples an hour, as long as each of them has so few that all
are kept; 500 were measured.
"""


@pytest.mark.slow
def test_the_memory_of_a_run_grows_by_no_more_an_hour_than_is_stated(tmp_path: Path):
    found: list[Measured] = []
    for minutes in MINUTES:
        folder = tmp_path / str(minutes)
        folder.mkdir()
        write_protocol(folder, minutes / 60, RATE)
        found.append(measure(folder, "run"))
    short, long = (own.peak_mb for own in found)
    told = f"from {short:.0f} to {long:.0f} MB"
    assert (long - short) / (MINUTES[1] - MINUTES[0]) * 60 < MOST_MB_AN_HOUR, told
    assert long < MOST_MB, told
