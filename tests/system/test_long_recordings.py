"""Long recordings: the memory of every stage hardly grows with their length;
tests/benchmarks/long_recordings.py has hours.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.benchmarks.long_recordings import (
    DRIFT_PPM,
    OFFSET_S,
    STAGES,
    Measured,
    measure,
    write_case,
)

RATE, KEPT = 1000.0, 25_000
SHORT_S, LONG_S = 100.0, 400.0
RAW_BYTES = 48
"""Of a sample: rate and force in float64. A stage that held no more than these would grow by as
much; with times, orientations and errors it would be over 150.
"""


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Measured, Measured]]:
    """Every stage over the short and over the long recording."""
    folders: list[Path] = []
    for seconds in (SHORT_S, LONG_S):
        folders.append(tmp_path_factory.mktemp("long"))
        write_case(folders[-1], 1, seconds, RATE)
    return {stage: tuple(measure(folders, stage, KEPT)) for stage in STAGES}


@pytest.mark.slow
@pytest.mark.parametrize("stage", STAGES)
def test_the_peak_memory_of_a_stage_hardly_grows_with_the_recording(measured, stage: str) -> None:
    short, long = measured[stage]
    grown = (long.peak_mb - short.peak_mb) * 2**20 / ((LONG_S - SHORT_S) * RATE)
    assert grown < RAW_BYTES, (
        f"{grown:.0f} bytes a sample: from {short.peak_mb:.0f} to {long.peak_mb:.0f} MB"
    )


@pytest.mark.slow
def test_what_comes_out_is_right_whatever_the_length(measured) -> None:
    assert measured["import"][1].found["samples"] == LONG_S * RATE
    for found in (m.found for m in measured["estimate"]):
        assert found["clock"] == pytest.approx([OFFSET_S], abs=2e-3)
        assert found["drift_ppm"] == pytest.approx([DRIFT_PPM], abs=10)
        assert set(found["frames"]) == {"motion"}
    for found in (m.found for m in measured["evaluate"]):
        assert found["errors"]["imu1 vqf_6d"] < 0.3 and found["noise"] == 6
        assert 0.9 * KEPT < found["samples"]["imu1"] <= KEPT
