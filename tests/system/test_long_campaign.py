"""Long campaigns: the memory of planning and running hardly grows with them;
tests/benchmarks/long_campaign.py has hours.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.long_campaign import RECORD_HZ, Measured, measure, write_campaign

SHORT_S, LONG_S, BLOCK = 180.0, 480.0, 10_000
"""The shorter one fills each buffer already: a row group of the arm's samples takes 131 s."""
ROW_BYTES = 152
"""Of the arm's samples: time, commanded and measured angles, and rates of six joints. A run that
kept them, or a plan with states every few milliseconds, would grow by as much a row, and a stage
that reads them whole by twice that.
"""


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[Measured, Measured]:
    found = []
    for seconds in (SHORT_S, LONG_S):
        folder: Path = tmp_path_factory.mktemp("campaign")
        write_campaign(folder, seconds / 3600)
        found.append(measure(folder, "run", BLOCK))
    return found[0], found[1]


@pytest.mark.slow
def test_the_peak_memory_of_a_run_with_its_plan_hardly_grows(measured) -> None:
    short, long = measured
    rows = (long.found["duration_s"] - short.found["duration_s"]) * RECORD_HZ
    assert rows == pytest.approx((LONG_S - SHORT_S) * RECORD_HZ)
    assert (long.peak_mb - short.peak_mb) * 2**20 / rows < ROW_BYTES / 2, (
        f"from {short.peak_mb:.0f} to {long.peak_mb:.0f} MB"
    )


@pytest.mark.slow
def test_the_knots_of_a_plan_go_by_the_motion_and_not_by_the_clock(measured) -> None:
    for found in measured:
        assert found.found["knots"] < 25 * found.found["duration_s"]
