"""The help of every command says what was written: brackets are words to the reader and markup to
the printer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.text import Text
from typer.main import get_command

from testbench.cli.app import app


def helps(command: Any, path: str = "testbench") -> Iterator[tuple[str, str]]:
    """Every sentence and placeholder of a command's help and of those below it, with where it
    stands.
    """
    yield path, command.help or ""
    for parameter in command.params:
        for text in (getattr(parameter, "help", None), parameter.metavar):
            yield f"{path} {parameter.name}", text or ""
    for name, below in getattr(command, "commands", {}).items():
        yield from helps(below, f"{path} {name}")


def test_nothing_of_any_help_is_taken_for_markup():
    found = list(helps(get_command(app)))
    assert len(found) > 200
    assert any("[" in text for _, text in found)
    assert [(where, text) for where, text in found if Text.from_markup(text).plain != text] == []
