"""A protocol for studies that take one of the user's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.clock import SystemClock
from testbench.formats import import_recording
from testbench.records.session.session import Session

PROTOCOLS = Path(__file__).resolve().parents[2] / "protocols"


@pytest.fixture(scope="module")
def own_swing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of shank_swing with other cycle numbers, beside what it includes."""
    folder = tmp_path_factory.mktemp("protocols")
    (folder / "calibration_3d.yaml").write_text(
        (PROTOCOLS / "calibration_3d.yaml").read_text(encoding="utf-8")
    )
    text = (PROTOCOLS / "shank_swing.yaml").read_text(encoding="utf-8")
    assert "gait_cycles: [14, 109]" in text and "roll_deg: [0, 3]" in text
    text = text.replace("gait_cycles: [14, 109]", "gait_cycles: [5, 9]").replace(
        "roll_deg: [0, 3]", "roll_deg: 3"
    )
    file = folder / "own.yaml"
    file.write_text(
        text.replace("filters: [device, vqf_6d, fusion,", "filters: [device,"), encoding="utf-8"
    )
    return file


@pytest.fixture(scope="module")
def imu_tk(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The public recording of imu_tk: 38 rests held by hand and the turns between them."""
    files = [data / "imu_tk" / f"xsens_{kind}.mat" for kind in ("acc", "gyro")]
    out = tmp_path_factory.mktemp("imu_tk") / "session"
    return import_recording("imu_tk", files, out, SystemClock())
