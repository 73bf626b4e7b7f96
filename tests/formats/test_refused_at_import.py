"""An import tells of samples that no sensor can have measured, as estimation does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.formats import import_recording
from testbench.formats.options import Options
from tests.studies.known_recordings import FixedClock

MAPPING = """\
description: a table
rate_hz: 100
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [gx, gy, gz], unit: rad/s}
"""


def _imported(folder: Path, acc: np.ndarray, gyr: np.ndarray) -> set[str]:
    table = np.column_stack([acc, gyr])
    np.savetxt(
        folder / "t.csv", table, "%.6f", delimiter=",", header="ax,ay,az,gx,gy,gz", comments=""
    )
    (folder / "map.yaml").write_text(MAPPING, encoding="utf-8")
    session = import_recording(
        "generic",
        [folder / "t.csv"],
        folder / "session",
        FixedClock(),
        Options(mapping=str(folder / "map.yaml")),
    )
    codes = {one.code for one in session.manifest.findings if one.where == "imu"}
    return {code for code in codes if code.startswith("samples.")}


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        (None, None),
        ("zeros", "samples.zeros"),
        ("stuck", "samples.stuck"),
        ("spike", "samples.spike"),
        ("dead axis", "samples.dead_axis"),
    ],
)
def test_doubtful_samples_are_findings_of_the_session(
    tmp_path: Path, fault: str | None, code: str | None
) -> None:
    rng = np.random.default_rng(5)
    t = np.arange(2000) / 100
    gyr = np.column_stack([np.sin(t), np.cos(0.7 * t), np.sin(1.3 * t)])
    gyr += rng.normal(0, 0.01, gyr.shape)
    acc = rng.normal(0, 0.05, gyr.shape) + [0, 0, 9.81]
    if fault == "zeros":
        gyr[700:760], acc[700:760] = 0, 0
    elif fault == "stuck":
        acc[700:760] = acc[699]
    elif fault == "spike":
        acc[800, 1] = 150.0
    elif fault == "dead axis":
        gyr[:, 2] = 0.0
    assert _imported(tmp_path, acc, gyr) == ({code} if code else set())
