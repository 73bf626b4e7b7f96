"""The command line."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; every error that was foreseen is one message and an exit code, never a traceback."""
    from testbench.cli.app import app
    from testbench.cli.output import say_error
    from testbench.exceptions import BenchError

    try:
        app()
    except BenchError as error:
        say_error(str(error))
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.exit(1)


__all__ = ["main"]
