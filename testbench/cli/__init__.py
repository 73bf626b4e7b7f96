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
    except OSError as error:  # a full disk, a folder without permission
        say_error(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))
        sys.exit(3)


__all__ = ["main"]
