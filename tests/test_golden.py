"""The comparison of two states of the program counts what is missing, too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.benchmarks.golden import compare_all


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """What two states made of two protocols, alike."""
    for folder in ("base", "new"):
        (tmp_path / folder).mkdir()
        for name in ("quick", "tiny"):
            made = {"raw": {"arm:q": "ab"}, "evaluation": {".mean": 1.0}}
            (tmp_path / folder / f"{name}.json").write_text(json.dumps(made), encoding="utf-8")
    return tmp_path / "base", tmp_path / "new"


def test_alike_is_alike(folders) -> None:
    assert compare_all(*folders) == 0


def test_a_protocol_that_is_missing_differs(folders) -> None:
    (folders[1] / "tiny.json").unlink()
    assert compare_all(*folders) == 1


def test_nothing_is_not_alike(folders) -> None:
    for file in [*folders[0].iterdir(), *folders[1].iterdir()]:
        file.unlink()
    assert compare_all(*folders) > 0


@pytest.mark.parametrize(
    "other", [{"raw": {"arm:q": "ba"}, "evaluation": {".mean": 1.0}}, {"raw": {}, "evaluation": {}}]
)
def test_another_column_or_value_differs(folders, other) -> None:
    (folders[1] / "tiny.json").write_text(json.dumps(other), encoding="utf-8")
    assert compare_all(*folders) == 1
