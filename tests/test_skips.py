"""In CI a test skips only for what no installation could have given it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests.processes import forked
from tests.skips import complaint, excuses

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


def pytest_in_ci(folder: Path, without: str, said: Path) -> None:
    """Run the tests of a folder as in CI, in a process of its own, and keep what they say."""
    os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT), 1)
    os.environ.update(CI="1", CI_WITHOUT=without)
    options = ["-rN", "-p", "tests.conftest", "-c", os.devnull, "--continue-on-collection-errors"]
    sys.exit(pytest.main([*options, "--rootdir", str(folder), str(folder)]))


@pytest.mark.parametrize(("without", "failures"), [("", 2), ("chromium", 1)])
def test_a_module_or_a_test_that_skips_needlessly_fails_in_ci(tmp_path, without, failures) -> None:
    for name, text in MODULES.items():
        (tmp_path / name).write_text(text)
    said = tmp_path / "said"
    process = forked(pytest_in_ci, tmp_path, without, said)
    process.join(120)
    assert process.exitcode == pytest.ExitCode.TESTS_FAILED, said.read_text()
    assert said.read_text().count("nothing must skip in CI") == failures, said.read_text()


def test_nothing_is_asked_of_a_skip_on_a_persons_machine(monkeypatch) -> None:
    monkeypatch.setenv("CI", "1")
    assert complaint("Chromium is not installed")
    monkeypatch.delenv("CI")
    assert complaint("Chromium is not installed") is None


def test_every_excuse_says_why() -> None:
    assert all(excuse.why for excuse in excuses())
