"""Recordings with one fault each, from their file to their evaluation: what is wrong is named, or
refused in a sentence, and nothing is evaluated as if it were right.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from tests.benchmarks.commands import run_command
from tests.formats.conftest import turned

MAPPING = """\
description: a recording with a fault
time: {column: t, unit: UNIT}
sensors:
  hand:
    acc: {columns: [ax, ay, az], unit: m/s^2}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
    mag: {columns: [mx, my, mz], unit: uT}
    truth: {file: truth.csv, columns: [qw, qx, qy, qz], order: wxyz, time: {column: time, unit: s}}
estimate: {filters: [vqf_6d, vqf_9d], align: motion}
"""
COLUMNS = ("t", "ax", "ay", "az", "wx", "wy", "wz", "mx", "my", "mz")
Table = dict[str, np.ndarray]
Change = Callable[[Table], object]


def put(names: str, value: float, rows: slice = slice(None)) -> Change:
    def change(table: Table) -> None:
        for name in names.split():
            table[name][rows] = value

    return change


def stamped_by(count: int) -> Change:
    """Packets of so many samples, each with the time of its first one."""

    def change(table: Table) -> None:
        table["t"] = np.repeat(table["t"][::count], count)[: len(table["t"])]

    return change


def gap_of(seconds: float) -> Change:
    def change(table: Table) -> None:
        table["t"][800:] += seconds

    return change


def brought(folder: Path, change: Change, unit: str = "s") -> tuple[int, str]:
    """Exit code of importing a motion with a fault, and what is wrong with how that ended."""
    m = turned(1500)
    rng = np.random.default_rng(4)
    read = [m.acc + rng.normal(0, 0.02, m.acc.shape), m.gyr + rng.normal(0, 0.002, m.gyr.shape)]
    read.append(m.mag + rng.normal(0, 0.1, m.mag.shape))
    table = dict(zip(COLUMNS, np.column_stack([m.t, *read]).T.copy(), strict=True))
    change(table)
    header, true = ",".join(COLUMNS), np.column_stack([m.t, m.q])
    np.savetxt(
        folder / "d.csv",
        np.column_stack([*table.values()]),
        "%.7g",
        ",",
        header=header,
        comments="",
    )
    np.savetxt(folder / "truth.csv", true, "%.7f", ",", header="time,qw,qx,qy,qz", comments="")
    (folder / "map.yaml").write_text(MAPPING.replace("UNIT", unit), encoding="utf-8")
    words = ("generic", folder / "d.csv", "--mapping", folder / "map.yaml", "--out", folder / "s")
    return run_command("import", *map(str, words))


def told(folder: Path) -> tuple[set[str], dict[str, float]]:
    """Codes of what is said of the sensor, and the RMS error of the inclination by filter [deg]."""
    assert run_command("evaluate", str(folder / "s")) == (0, "")
    evaluation = Evaluation.load(folder / "s")
    found = [*Session(folder / "s").manifest.findings, *evaluation.findings]
    errors = {row.filter: row.inclination_rmse_deg for row in evaluation.orientation}
    return {own.code for own in found}, errors


def test_without_a_fault_nothing_is_said_and_the_errors_are_small(tmp_path):
    assert brought(tmp_path, lambda table: None) == (0, "")
    codes, errors = told(tmp_path)
    assert not {code for code in codes if code.startswith(("samples.", "consistency.", "time."))}
    assert errors["vqf_6d"] < 0.5 and errors["vqf_9d"] < 0.5


@pytest.mark.parametrize("count", [2, 3])
def test_samples_that_came_in_packets_with_one_stamp_are_analysed_as_if_they_had_their_own(
    tmp_path, count
):
    assert brought(tmp_path, stamped_by(count)) == (0, "")
    codes, errors = told(tmp_path)
    assert "time.grouped" in codes
    assert errors["vqf_6d"] < 0.5


BOTH = {"vqf_6d", "vqf_9d"}
NAMED = {
    "gyroscope all zero": (put("wx wy wz", 0.0), "samples.dead", set()),
    "gyroscope says the same": (put("wx wy wz", 0.01), "samples.dead", set()),
    "one axis of it dead": (put("wz", 0.0), "samples.dead_axis", set()),
    "magnetometer all zero": (put("mx my mz", 0.0), "samples.dead", {"vqf_6d"}),
    "magnetometer says the same": (put("mx my mz", 20.0), "samples.dead", {"vqf_6d"}),
    "one rate of a million": (put("wx", 1e6, slice(700, 701)), "samples.beyond", BOTH),
    "one rate of 1e300": (put("wx", 1e300, slice(700, 701)), "samples.beyond", BOTH),
    "one force of 1e300": (put("ax", 1e300, slice(700, 701)), "samples.beyond", BOTH),
}


@pytest.mark.parametrize("name", NAMED)
def test_what_is_dead_or_cannot_be_is_named_and_no_filter_is_evaluated_by_it(tmp_path, name):
    change, code, evaluated = NAMED[name]
    assert brought(tmp_path, change) == (0, "")
    codes, errors = told(tmp_path)
    assert code in codes, codes
    assert set(errors) == evaluated
    assert all(error < 0.5 for error in errors.values())


REFUSED = {
    "seconds read as milliseconds": (lambda table: None, "ms"),
    "milliseconds read as seconds": (lambda table: table["t"].__imul__(1000), "s"),
    "a gap of thirty thousand years": (gap_of(1e12), "s"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_times_that_no_recording_has_are_refused_and_nothing_is_written(tmp_path, name):
    change, unit = REFUSED[name]
    assert brought(tmp_path, change, unit) == (2, "")
    assert not (tmp_path / "s").exists()
