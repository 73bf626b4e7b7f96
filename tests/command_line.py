"""The command line in this process."""

from __future__ import annotations

import pytest

from testbench.cli import main


def command(*arguments: object) -> int:
    """Run a command and give its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["testbench", *map(str, arguments)])
        try:
            main()
        except SystemExit as stopped:
            return int(stopped.code or 0)
    return 0
