"""Sessions to certify, made once: a simulated rest, and a recording of a device that is not."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from testbench.pipeline.analyse import Result
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import RunStatus, Session
from testbench.records.session.session_writer import SessionWriter
from testbench.records.specs.laboratory import Laboratory, save_laboratory
from testbench.records.specs.protocol import Analysis, Estimation

LABORATORY = Laboratory(
    name="Laboratory of Motion",
    address="Street 1, 12345 Town",
    authorised_by="C. Head",
    accreditation="D-K-00000",
    ambient="(23 ± 2) °C",
    traceability="gravity by certificate 17",
)
DEVICE = {"serial_number": "4711", "firmware": "2.1.0", "device_tag": "D4-22"}


@pytest.fixture(scope="package")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a laboratory that states much, but no operator."""
    return save_laboratory(LABORATORY, tmp_path_factory.mktemp("laboratory") / "own.yaml")


@pytest.fixture(scope="package")
def resting(run_protocol) -> Result:
    """A simulated minute at rest, analysed."""
    return run_protocol("static_noise")


@pytest.fixture(scope="package")
def device(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Half a minute of a device at rest, as it was recorded: nothing of it is simulated."""
    n, rate = 3000, 100.0
    rng = np.random.default_rng(4)
    time = np.round(np.arange(n) / rate * 1e9).astype(np.int64)
    gyr, acc = 2e-3 * rng.standard_normal((2, n, 3)) + np.array([[[0, 0, 0]], [[0, 0, 9.81]]])
    samples = ImuSamples(time, time, gyr, acc, None, None, np.arange(n), np.zeros(n, dtype=bool))
    writer = SessionWriter(
        tmp_path_factory.mktemp("logs") / "device",
        Analysis(estimate=Estimation(filters=["vqf_6d"], align="heading", calibrate="none")),
        {"foot": {"driver": "serial", "description": "a board", "rate_hz": rate} | DEVICE},
        datetime(2026, 1, 2, tzinfo=UTC),
        {"kind": "recording"},
    )
    writer.add_table("imu_foot", samples.to_columns())
    writer.close(RunStatus.COMPLETED, duration_s=n / rate)
    return Session(writer.path)
