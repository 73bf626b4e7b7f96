"""Logs of serial monitors and of sketches that write what a number is are read as tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import FileProblems, InputError
from testbench.formats import import_recording
from testbench.formats.guessing.guess import guess
from testbench.formats.options import Options
from testbench.formats.tables.monitor import written_in

MAPPING = """\
description: a board
{time}
sensors:
  imu:
    acc: {{columns: [ax, ay, az], unit: m/s^2}}
    gyr: {{columns: [gx, gy, gz], unit: rad/s}}
"""
TITLES = ["ax", "ay", "az", "gx", "gy", "gz"]
T = np.arange(600) / 50
VALUES = np.column_stack(
    [0.3 * np.sin(T), 0.2 * np.cos(T), 9.8 + 0 * T, 0.1 * np.cos(T), 0.2 * np.sin(T), 0.05 * T]
) + np.random.default_rng(1).normal(0, 0.01, (600, 6))


def stamp(seconds: float) -> str:
    return f"23:59:{50 + seconds:06.3f}" if seconds < 10 else f"00:00:{seconds - 10:06.3f}"


def log(path: Path, prefix: bool, labels: str | None, separator: str, titles: bool) -> Path:
    """A log as a monitor saves it."""
    lines = ["MPU6050 ready", *([separator.join(TITLES)] if titles else [])]
    for row in VALUES:
        cells = [f"{value:.4f}" for value in row]
        if labels is not None:
            cells = [name + labels + cell for name, cell in zip(TITLES, cells, strict=True)]
        lines.append(separator.join(cells))
    begin = [f"{stamp(i / 50)} -> " if prefix else "" for i in range(len(lines))]
    path.write_text("".join(a + b + "\r\n" for a, b in zip(begin, lines, strict=True)))
    return path


@pytest.mark.parametrize(
    ("prefix", "labels", "separator", "titles"),
    [
        (True, None, ",", True),
        (True, None, "\t", True),
        (True, ": ", ", ", False),
        (True, ":", "\t", False),
        (False, ": ", " ", False),
        (False, "=", ";", False),
        (False, ": ", " | ", False),
    ],
)
def test_what_a_monitor_adds_is_taken_off(prefix, labels, separator, titles, tmp_path, clock):
    file = log(tmp_path / "log.txt", prefix, labels, separator, titles)
    time = "time: {column: time, unit: clock}" if prefix else "rate_hz: 50"
    time += "\ntext: {skip_lines: 1}" if titles else ""
    (tmp_path / "m.yaml").write_text(MAPPING.format(time=time))
    asked = Options(str(tmp_path / "m.yaml"))
    session = import_recording("generic", [file], tmp_path / "s", clock, asked)
    samples = session.imu("imu")
    read = np.column_stack([samples.acc, samples.gyr])
    np.testing.assert_allclose(read, np.round(VALUES, 4), atol=1e-9)
    np.testing.assert_allclose(np.diff(samples.host_time_ns), 2e7, atol=1e6)
    codes = {found.code for found in session.manifest.findings}
    assert ("structure.received" in codes) == prefix
    assert ("structure.labels" in codes) == (labels is not None)


def test_units_behind_the_numbers_become_those_of_the_titles(tmp_path):
    file = tmp_path / "log.txt"
    file.write_text("".join(f"Accel X: {v:.2f} g, Y: 0.1 g, Z: 1e-1 g, T: 30.1 C\n" for v in T))
    written = written_in(file, "utf-8")
    assert written is not None and not written.time
    assert written.titles == ["Accel X (g)", "Y (g)", "Z (g)", "T (C)"]
    assert (
        written.plain(b"Accel X: -0.12 g, Y: .3 g, Z: 1e-1 g, T: 3 C\n") == b"-0.12, .3, 1e-1, 3\n"
    )


def test_samples_that_stand_in_several_lines_are_refused_with_what_to_do(tmp_path):
    file = tmp_path / "log.txt"
    file.write_text("Acc X: 0.1, Y: 0.2, Z: 9.8 m/s^2\nGyro X: 0, Y: 0, Z: 1 rad/s\n\n" * 50)
    with pytest.raises(FileProblems, match=r"'Acc X, Y, Z' and 'Gyro X, Y, Z' take turns"):
        written_in(file, "utf-8")


def test_the_guess_of_a_labelled_log_is_a_mapping_that_reads_it(tmp_path, clock):
    file = log(tmp_path / "log.txt", True, ": ", ", ", False)
    mapping = guess([file]).mapping
    assert mapping is not None
    assert mapping["time"] == {"column": "time", "unit": "clock"}
    assert mapping["sensors"]["imu"]["gyr"]["columns"] == TITLES[3:]


@pytest.mark.parametrize(
    "text",
    [
        "DeviceTag: 1\nRate: 60 Hz\nMode: 3\nx,y\n1,2\n3,4\n",
        "time,a b: c,d\n12:00:01.5,1,2\n12:00:01.6,1,2\n12:00:01.7,1,2\n",
        "2024-01-01T12:00:01,1e-5,2E5\n" * 9,
    ],
)
def test_rows_and_headers_are_left_as_they_are(text, tmp_path):
    (tmp_path / "d.csv").write_text(text)
    assert written_in(tmp_path / "d.csv", "utf-8") is None


def test_a_log_of_numbers_alone_is_asked_about_and_no_fault_of_the_program(tmp_path):
    """A clock of stamps tells no rate yet, by which turns would be compared."""
    file = log(tmp_path / "log.txt", True, None, " ", False)
    with pytest.raises(InputError, match="name them in a mapping"):
        guess([file])
