"""The examples run as they stand and say something useful; what the documents show exists and
works.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from testbench import plan
from tests.patience import PATIENCE_S
from tests.processes import bench

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def run_example(name: str, folder: Path, *arguments: str) -> str:
    """What an example prints; it must end well and without a warning."""
    result = subprocess.run(
        [sys.executable, "-W", "error", str(ROOT / "examples" / name), *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert not result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("examples")


@pytest.fixture(scope="module")
def first_output(folder: Path) -> str:
    return run_example("01_run_a_protocol.py", folder)


def test_the_first_example_runs_a_protocol_and_prints_errors(
    folder: Path, first_output: str
) -> None:
    assert "outcome: pass" in first_output
    errors = [float(line.split()[2]) for line in first_output.splitlines() if line.endswith(" deg")]
    assert len(errors) >= 4
    assert all(0 < error < 10 for error in errors)
    (session,) = (folder / "logs").iterdir()
    assert session.name.endswith("_quick")


def test_the_third_example_is_a_filter_that_passes_the_self_test(folder: Path) -> None:
    assert run_example("03_a_filter_of_your_own.py", folder).splitlines()[-1] == "pass"


def test_the_second_example_compares_a_gyroscope_with_the_arm(
    folder: Path, first_output: str
) -> None:
    (session,) = (folder / "logs").iterdir()
    assert bench("estimate", session).returncode == 0
    by_name = run_example("02_open_a_session_in_pandas.py", folder, str(session))
    newest = run_example("02_open_a_session_in_pandas.py", folder)
    assert by_name == newest
    assert "completed" in by_name
    spread = next(line for line in by_name.splitlines() if line.startswith("std"))
    assert all(float(value) < 2 for value in spread.split()[1:])


def test_every_example_is_run_here() -> None:
    assert [path.name for path in EXAMPLES] == [
        "01_run_a_protocol.py",
        "02_open_a_session_in_pandas.py",
        "03_a_filter_of_your_own.py",
    ]


def test_the_protocol_in_the_readme_passes_every_check(tmp_path: Path) -> None:
    (text,) = re.findall(
        r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL
    )
    (tmp_path / "readme.yaml").write_text(text, encoding="utf-8")
    assert plan(tmp_path / "readme.yaml").check.steps == 16


def test_pictures_are_small_enough_for_a_page() -> None:
    assert all(path.stat().st_size <= 300_000 for path in (ROOT / "docs" / "images").iterdir())
