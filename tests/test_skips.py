"""In CI a test skips only for what no installation could have given it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.skips import complaint, excuses

ROOT = Path(__file__).resolve().parent.parent
MODULES = {
    "test_module.py": "import pytest\npytest.importorskip('no_such_package')\n",
    "test_mark.py": """\
import pytest

@pytest.mark.skipif(True, reason="Chromium is not installed")
def test_page(): ...

def test_disk():
    pytest.skip("this machine does not let tests mount a file system")
""",
}


@pytest.mark.parametrize(("without", "failures"), [("", 2), ("chromium", 1)])
def test_a_module_or_a_test_that_skips_needlessly_fails_in_ci(tmp_path, without, failures) -> None:
    for name, text in MODULES.items():
        (tmp_path / name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-rN", "-p", "tests.conftest", "-c", os.devnull]
    done = subprocess.run(
        [*command, "--continue-on-collection-errors", "--rootdir", str(tmp_path), str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "CI": "1", "CI_WITHOUT": without},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert done.stdout.count("nothing must skip in CI") == failures, done.stdout


def test_nothing_is_asked_of_a_skip_on_a_persons_machine(monkeypatch) -> None:
    monkeypatch.setenv("CI", "1")
    assert complaint("Chromium is not installed")
    monkeypatch.delenv("CI")
    assert complaint("Chromium is not installed") is None


def test_every_excuse_says_why() -> None:
    assert all(excuse.why for excuse in excuses())
