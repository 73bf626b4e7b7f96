"""Options that hold one value are given once: of two, the one that does not count says nothing."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import typer
from typer.core import TyperCommand


class OnceCommand(TyperCommand):
    """A command that refuses an option of one value that is given twice."""

    def make_parser(self, ctx: Any) -> Any:
        """The parser, which counts how often each option was given."""
        parser = super().make_parser(ctx)
        parse, bare = parser.parse_args, values_left_away(self)

        def counted(args: list[str]) -> Any:
            found = parse(args=with_defaults(args, bare))
            given = Counter(id(own) for own in found[2])
            for own in found[2]:
                single = not (own.multiple or getattr(own, "is_flag", False))
                if own.param_type_name == "option" and single and given[id(own)] > 1:
                    ctx.fail(f"{own.opts[0]} is given {_times(given[id(own)])}; say which holds")
            return found

        parser.parse_args = counted  # type: ignore[method-assign]
        return parser


def values_left_away(command: TyperCommand) -> dict[str, tuple[str, ...]]:
    """Options of a command whose value may be left away, and their values.

    Their help shows them as `(first|second)`; the first one is meant where there is none.
    """
    shown = {
        name: re.fullmatch(r"\((\w+(?:\|\w+)+)\)", getattr(own, "metavar", None) or "")
        for own in command.params
        for name in own.opts
    }
    return {name: tuple(found[1].split("|")) for name, found in shown.items() if found is not None}


def with_defaults(args: list[str], bare: dict[str, tuple[str, ...]]) -> list[str]:
    """Arguments in which options without their value have it.

    Args:
        args: As typed.
        bare: As `values_left_away` gives them.
    """
    whole: list[str] = []
    for i, word in enumerate(args):
        whole.append(word)
        values = bare.get(word)
        if values is not None and (i + 1 == len(args) or args[i + 1] not in values):
            whole.append(values[0])
    return whole


def _times(count: int) -> str:
    return "twice" if count == 2 else f"{count} times"


def options_once(app: typer.Typer) -> None:
    """Let all commands of an application, and of those within it, take single options once.

    Args:
        app: With its commands.
    """
    for command in app.registered_commands:
        command.cls = OnceCommand
    for group in app.registered_groups:
        if group.typer_instance is not None:
            options_once(group.typer_instance)
