"""Commands in this process by the thousand, and what is wrong with how they end."""

from __future__ import annotations

import contextlib
import functools
import io
import json
import os
import warnings

import pytest
import typer

from testbench.cli.crash import DEBUG
from tests.command_line import command

_commands = functools.cache(typer.main.get_command)


def run_command(*words: str, codes: tuple[int, ...] = (0, 2)) -> tuple[int, str]:
    """Exit code of a command, and what is wrong with how it ended.

    The commands are put together once, and what is written need not survive: both would take
    longer than the rest.

    Args:
        words: Of the command.
        codes: Exit codes that it may end with; but for 0 and 1 with a message.
    """
    said, told = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        patch.setenv(DEBUG, "1")
        patch.setattr(typer.main, "get_command", _commands)
        patch.setattr(os, "fsync", lambda _: None)
        warnings.simplefilter("error")
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
            try:
                code = command(*words)
            except Exception as error:
                return 70, f"{words[0]}: {_placed(error)}"
    if "--json" in words:
        return code, _wrong_json(words[0], code, said.getvalue(), told.getvalue(), codes)
    return code, _wrong(words[0], code, told.getvalue(), codes)


def _placed(error: Exception) -> str:
    """An exception that nobody foresaw, and where it was raised."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = "" if place is None else f"{place.tb_frame.f_code.co_filename[-60:]}"
    line = 0 if place is None else place.tb_lineno
    what = f"{type(error).__name__}: {error}"[:300]
    return f"{what} ({where}:{line})"


def _wrong(stage: str, code: int, told: str, codes: tuple[int, ...]) -> str:
    """What is wrong with an exit code and what was told with it."""
    if code not in codes or "Traceback" in told or "Warning" in told:
        return f"{stage}: exit code {code}: {told[:300]}"
    if code in (0, 1) or (told.startswith("error: ") and len(told.strip()) > 20):
        return ""
    return f"{stage}: refused in the words {told[:300]!r}"


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not of JSON")


def _wrong_json(stage: str, code: int, said: str, told: str, codes: tuple[int, ...]) -> str:
    """The same where objects were asked for."""
    text = said if code in (0, 1) else told
    try:
        json.loads(text, parse_constant=_refused)
    except ValueError as error:
        return f"{stage}: no JSON, {error}: {text[:200]}"
    return "" if code in codes else f"{stage}: exit code {code}: {told[:300]}"
