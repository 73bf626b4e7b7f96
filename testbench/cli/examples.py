"""The command `example`: recordings to try the bench with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbench.cli.options import JsonOption
from testbench.cli.output import say, say_json, say_table


def _complete_example(incomplete: str) -> list[str]:
    from testbench.pipeline.examples import EXAMPLES

    return [name for name in EXAMPLES if name.startswith(incomplete)]


def example(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Which recording; all are listed if none is named.",
            autocompletion=_complete_example,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for its files, to be made; called like it if none."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write simulated recordings as sensors' apps would, to try the bench with."""
    from testbench.exceptions import InputError
    from testbench.pipeline.examples import EXAMPLES, write_example

    if name is None:
        if out is not None:
            raise InputError(f"--out needs the name of an example: {', '.join(EXAMPLES)}")
        if json:
            listed = [{"name": key, "line": one.line} for key, one in EXAMPLES.items()]
            say_json({"examples": listed})
        else:
            rows = [[key, one.line] for key, one in EXAMPLES.items()]
            say_table("Examples, all simulated", ["name", "what"], rows)
        return
    folder = out or Path(name)
    files = write_example(name, folder)
    if json:
        say_json({"files": [str(file) for file in files], "simulated": True})
        return
    say(f"files: {', '.join(map(str, files))} (simulated)")
    say(f"next: {EXAMPLES[name].next.format(folder=folder)}")
