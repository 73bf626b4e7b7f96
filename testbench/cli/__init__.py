"""The command line."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from contextlib import suppress
from signal import SIGPIPE
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from typer import Typer

    from testbench.exceptions import BenchError


READER_GONE = 128 + SIGPIPE
"""Exit code of a program whose reader went away, as shells tell it."""
INTERRUPTED = 130


def main() -> None:
    """Run the command line; each foreseen error is one message and an exit code, no traceback.

    What nobody foresaw is a fault of the program: one message that names a file to attach, and exit
    code 70. Exit code 1 is a limit that was broken, and nothing else.

    With --json among the arguments the message is one JSON object on stderr, also for a command
    that was mistyped.
    """
    _collect_seldom()
    from testbench.exceptions import BenchError, ProgramError, StorageError

    try:
        _run()
    except BenchError as error:
        _tell(error)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        _leave_reader()
    except OSError as error:  # a full disk, a folder without permission
        from testbench.records.disk.replacing import disk_reason

        place = f"{error.filename}: " if error.filename else ""
        _tell(StorageError(f"{place}{disk_reason(error)}"))
        sys.exit(StorageError.exit_code)
    except Exception as error:
        from testbench.cli.crash import explain, wants_traceback

        if wants_traceback():
            raise
        _tell(explain(error, sys.argv[1:]))
        sys.exit(ProgramError.exit_code)


def _tell_of_compiling() -> None:
    """Let who looks at a terminal know that the first commands in an environment compile."""
    import logging

    logger = logging.getLogger("testbench.model.kernel_cache")
    if sys.stderr.isatty() and not logger.handlers:
        logger.addHandler(logging.StreamHandler())
        logger.setLevel(logging.INFO)
        logger.propagate = False


def _run() -> None:
    """Run a command, and hand on what it printed while what goes wrong with that can be told."""
    import typer

    from testbench.cli.app import app

    try:
        if _wants_json():
            _log_nothing()
            sys.exit(_run_without_own_errors(app))
        _tell_of_compiling()
        app()
    except SystemExit as stopped:
        # typer ends by 1 where the reader went away, and where a question was not answered
        if isinstance(stopped.__context__, OSError):
            raise BrokenPipeError from None
        if isinstance(stopped.__context__, typer.Abort):
            sys.exit(INTERRUPTED)
        sys.stdout.flush()
        raise


def _leave_reader() -> NoReturn:
    """End where nobody reads any more: nothing else is said, not even when files are closed."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(READER_GONE)


def _wants_json() -> bool:
    return "--json" in sys.argv[1:]


def _tell(error: BenchError) -> None:
    from testbench.cli.output import say_error, say_json_error

    if _wants_json():
        say_json_error(error)
    else:
        say_error(str(error), getattr(error, "__notes__", []))


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
        return INTERRUPTED
    return code if isinstance(code, int) else 0


__all__ = ["main"]
