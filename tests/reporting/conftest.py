"""Sessions to report on: a real one of the quick protocol, and an imported one without arm, joints
and steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.execution import RunOptions, execute
from testbench.model import rotation
from testbench.planning import plan
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import SessionWriter
from testbench.records.specs.protocol import Analysis, Estimation


@dataclass(frozen=True)
class Judged:
    """A session with what was made of it."""

    session: Session
    estimate: Estimate
    evaluation: Evaluation


@pytest.fixture(scope="package")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    session = execute(
        plan("quick"),
        tmp_path_factory.mktemp("logs"),
        seed=1,
        options=RunOptions(session_name="quick"),
    )
    estimated = estimate(session)
    return Judged(session, estimated, evaluate(session, estimated))


@pytest.fixture(scope="package")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    """A sensor that turns about the vertical for 20 s, as a public data set would give it: truth,
    but no arm.
    """
    n, rate = 2000, 100.0
    time = np.round(np.arange(n) / rate * 1e9).astype(np.int64)
    angle = np.sin(np.arange(n) / rate)
    gyr = np.column_stack([np.zeros(n), np.zeros(n), np.cos(np.arange(n) / rate)])
    acc = np.tile([0.0, 0.0, 9.80665], (n, 1))
    q = rotation.from_heading(angle)
    samples = ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, dtype=bool))
    settings = Estimation(
        filters=["vqf_6d", "fusion"], align="heading", align_clock=False, calibrate="none"
    )
    writer = SessionWriter(
        tmp_path_factory.mktemp("logs") / "imported",
        Analysis(estimate=settings),
        {"imu": {"driver": "import", "description": "from a data set", "rate_hz": rate}},
        datetime(2026, 1, 2, tzinfo=UTC),
        {"kind": "import", "source": ["a_data_set.csv"], "licence": "CC0"},
    )
    writer.add_table("imu_imu", samples.to_columns())
    writer.add_table("truth_imu", Truth(time, q).to_columns())
    writer.close(RunStatus.COMPLETED, duration_s=n / rate)
    session = Session(writer.path)
    estimated = estimate(session)
    return Judged(session, estimated, evaluate(session, estimated))


def copy_of(session: Session, folder: Path) -> Path:
    """The raw files of a session in another folder, so that a test may change them."""
    target = folder / session.name
    target.mkdir()
    for file in session.path.iterdir():
        if (
            file.is_file()
            and file.suffix in {".json", ".jsonl", ".parquet", ".yaml", ".urdf"}
            and file.name != "evaluation.json"
        ):
            (target / file.name).write_bytes(file.read_bytes())
    return target
