"""Sessions to export: one of the bench, and one that was imported: no arm, no magnetometer, gaps in
samples and truth.
"""

from __future__ import annotations

import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from testbench.estimation import estimate
from testbench.formats.exporters import ExportSource
from testbench.model import rotation
from testbench.pipeline.analyse import Result
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import SessionWriter
from testbench.records.specs.protocol import Analysis, Estimation

RATE = 100.0
STARTED = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


@pytest.fixture(scope="session")
def source(quick: Result) -> ExportSource:
    """The run `quick`, with every filter."""
    return ExportSource(quick.session, quick.estimate)


@pytest.fixture
def own_session(quick: Result, tmp_path: Path) -> Session:
    """A copy of the run `quick` that a test may write to."""
    return Session(shutil.copytree(quick.session.path, tmp_path / "logs" / "quick"))


@pytest.fixture(scope="session")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """A sensor that turns about the vertical for 20 s; samples 500 to 599 are lost, and the truth
    of 12 to 13 s.
    """
    n = 2000
    time = np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    angle = np.sin(np.arange(n) / RATE)
    gyr = np.column_stack([np.zeros(n), np.zeros(n), np.cos(np.arange(n) / RATE)])
    acc = np.random.default_rng(1).normal([0.0, 0.0, 9.80665], 0.01, (n, 3))  # it is not frozen
    q = rotation.from_heading(angle)
    q[1200:1300] = np.nan
    q[7::11] *= -1
    kept = np.r_[0:500, 600:n]
    samples = ImuSamples(
        time[kept],
        time[kept],
        gyr[kept],
        acc[kept],
        None,
        None,
        kept,
        np.zeros(len(kept), dtype=bool),
    )
    settings = Estimation(
        filters=["vqf_6d", "fusion"], align="none", align_clock=False, calibrate="none"
    )
    writer = SessionWriter(
        tmp_path_factory.mktemp("logs") / "imported",
        Analysis(estimate=settings),
        {"imu": {"driver": "imported", "description": "made up", "rate_hz": RATE}},
        STARTED,
        {"kind": "import"},
    )
    writer.add_table("imu_imu", samples.to_columns())
    writer.add_table("truth_imu", Truth(time, q).to_columns())
    writer.close(RunStatus.COMPLETED, duration_s=n / RATE)
    return Session(writer.path)


@pytest.fixture(scope="session")
def imported_source(imported: Session) -> ExportSource:
    """The imported recording, with every filter."""
    return ExportSource(imported, estimate(imported))
