"""The command line."""

from __future__ import annotations

import atexit
import gc
import sys
from errno import ENOSPC
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typer import Typer


def main() -> None:
    """Run the command line; each foreseen error is one message and an exit code, no traceback.

    What nobody foresaw is a fault of the program: one message that names a file to attach, and exit
    code 70, so that no caller takes it for a limit that was broken.

    With --json among the arguments the message is one JSON object on stderr, also for a command
    that was mistyped.
    """
    _collect_seldom()
    from testbench.cli.output import say_error, say_json_error
    from testbench.exceptions import BenchError, ProgramError

    wants_json = "--json" in sys.argv[1:]

    def tell(error: BenchError) -> None:
        say_json_error(error) if wants_json else say_error(
            str(error), getattr(error, "__notes__", [])
        )

    try:
        from testbench.cli.app import app

        if wants_json:
            _log_nothing()
            sys.exit(_run_without_own_errors(app))
        app()
    except BenchError as error:
        tell(error)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:  # a full disk, a folder without permission
        reason = "there is no room left on the disk" if error.errno == ENOSPC else str(error)
        say_error(
            f"{error.filename}: {error.strerror}" if error.filename and error.strerror else reason
        )
        sys.exit(3)
    except Exception as error:
        from testbench.cli.crash import explain, wants_traceback

        if wants_traceback():
            raise
        tell(explain(error, sys.argv[1:]))
        sys.exit(ProgramError.exit_code)


def _collect_seldom() -> None:
    """Let the collector of circular garbage look seldom at what a command loads, and not at all
    once it ends: both together are a fifth of a short command. Reference counts close every file.
    """
    gc.set_threshold(50_000, 10, 10)
    atexit.register(gc.freeze)


def _log_nothing() -> None:
    """Keep what the program notices on its way, such as a wait, off stderr, where JSON is read."""
    import logging

    logger = logging.getLogger("testbench")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())  # else what is left goes to stderr


def _run_without_own_errors(app: Typer) -> int:
    """Run the commands; what is wrong with the arguments is raised as our own error instead of
    being printed in a frame.
    """
    import typer

    from testbench.exceptions import InputError

    # typer brings a click of its own or uses the installed one, by version; this is the base of its
    # errors in either
    wrong_arguments: Any = next(
        kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException"
    )
    try:
        code = app(standalone_mode=False)
    except wrong_arguments as error:
        raise InputError(error.format_message()) from None
    except typer.Abort:
        return 130
    return code if isinstance(code, int) else 0


__all__ = ["main"]
