"""The commands of docs/how_to run as they stand there, and print what the page shows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "how_to" / "compare_two_firmwares.md"


def blocks(kind: str) -> list[str]:
    """The fenced blocks of the page of a kind."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.S | re.M)
    return [text for own, text in found if own == kind]


@pytest.mark.slow
def test_two_firmwares_are_compared_as_the_page_says(tmp_path) -> None:
    """Simulated runs are the same on every machine but for their dates."""
    (tmp_path / "protocols").symlink_to(ROOT / "protocols")
    script = f'testbench() {{ "{sys.executable}" -m testbench "$@"; }}\n' + blocks("sh")[0]
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=4 * PATIENCE_S,
    )
    assert done.returncode == 1, done.stderr
    said = done.stdout.splitlines()
    for line in blocks("")[0].splitlines():
        assert line in said
    assert (tmp_path / "firmware.html").is_file()
