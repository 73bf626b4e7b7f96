"""What a logger leaves in its file beside samples: words, titles again, a last line cut short."""

from __future__ import annotations

import pytest

from testbench.formats import import_recording
from testbench.formats.options import Options

MAPPING = """\
description: a board
time: {column: millis, unit: ms}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [gx, gy, gz], unit: rad/s}
"""
TITLES = "millis,ax,ay,az,gx,gy,gz"
ROWS = [f"{10 * i},0.{i % 10},0.2,9.8,0.1,-0.2,0.{i % 7 + 1}" for i in range(600)]


@pytest.mark.parametrize(
    ("lines", "end", "samples", "found"),
    [
        ([TITLES, *ROWS[:300], "I2C error", *ROWS[300:]], "\n", 600, {"lines_of_text": 302}),
        ([TITLES, *ROWS[:300], TITLES, *ROWS[300:]], "\n", 600, {"lines_of_text": 302}),
        ([TITLES, *ROWS[:-1], ROWS[-1][:9]], "", 599, {"cut_short": 601}),
        ([TITLES, *ROWS[:-1], ROWS[-1][:-3] + "-"], "", 599, {"cut_short": 601}),
        (
            [TITLES, *ROWS[:9], "reset", *ROWS[9:-1], "5"],
            "",
            599,
            {"lines_of_text": 11, "cut_short": 602},
        ),
        ([TITLES, *ROWS], "", 600, {}),
    ],
)
def test_lines_without_a_sample_are_left_out_and_named(lines, end, samples, found, tmp_path, clock):
    (tmp_path / "d.csv").write_text("\n".join(lines) + end)
    (tmp_path / "m.yaml").write_text(MAPPING)
    asked = Options(str(tmp_path / "m.yaml"))
    session = import_recording("generic", [tmp_path / "d.csv"], tmp_path / "s", clock, asked)
    told = {
        finding.code.partition(".")[2]: finding.values["line"]
        for finding in session.manifest.findings
        if finding.code in ("structure.lines_of_text", "structure.cut_short")
    }
    assert told == found and session.manifest.samples["imu"] == samples
