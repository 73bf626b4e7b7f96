"""The names of a session's files are spelt in one place; elsewhere they stand in sentences only."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from testbench.records.session import layout

PRODUCT = Path(__file__).parents[2] / "testbench"
FILES = {
    layout.MANIFEST,
    layout.EVENTS,
    layout.PLAN,
    layout.PROTOCOL,
    layout.URDF,
    layout.ESTIMATE_SUMMARY,
    layout.EVALUATION_SUMMARY,
    layout.REPORT,
    layout.RECORDING,
    layout.table_file(layout.ARM),
    layout.JOURNALS,
}
TABLES = ("imu_", "truth_", "angles_", "orientation_", "chain_", "joint_", "magnetic_")
ELSEWHERE = {
    "study_report.py",  # a study's own report
    "scene.py",  # a temporary file
    "frame_tree.py",  # frames
    "tables.py",  # an export's tables
    "names.py",  # sensors whose files are called by a number
}


def spelt(source: str) -> set[str]:
    """What of the names of a session's files a module spells."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and node.value in FILES:
            found.add(str(node.value))
        if isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):
            found |= {name for name in TABLES if node.values[0].value == name}
    return found


def test_only_the_layout_spells_the_names_of_a_sessions_files() -> None:
    wrong = {}
    for file in sorted(PRODUCT.rglob("*.py")):
        if file != Path(layout.__file__) and file.name not in ELSEWHERE:
            names = spelt(file.read_text(encoding="utf-8"))
            wrong |= {str(file): names} if names else {}
    assert not wrong, "take these from records/session/layout.py"


def test_a_name_that_is_spelt_out_is_noticed() -> None:
    assert spelt('path / f"imu_{name}.parquet"') == {"imu_"}
    assert spelt('path / "manifest.json"') == {"manifest.json"}
    assert not spelt('"the folder has no manifest.json"')


@pytest.mark.parametrize("sensor", ["arm", "imu_left", "truth"])
def test_a_stream_of_samples_tells_its_sensor(sensor: str) -> None:
    assert layout.sensor_of(layout.imu_stream(sensor)) == sensor
    assert layout.sensor_of(layout.ARM) is None
    assert layout.sensor_of(layout.truth_stream(sensor)) is None
