"""What happens on a fault of the program itself: a file to attach, and one sentence."""

from __future__ import annotations

import os
import platform
import re
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from testbench.exceptions import ProgramError

SHORTEST_NAME = 4
"""Characters of a name that is left out of a file: shorter ones are words of the program, too."""
DEBUG = "TESTBENCH_DEBUG"
"""Environment variable: where it is set to 1, the exception is shown as Python shows it."""


def wants_traceback() -> bool:
    """Whether whoever runs the program wants to see the exception itself."""
    return os.environ.get(DEBUG) == "1"


def explain(error: Exception, words: Sequence[str]) -> ProgramError:
    """Write what a maintainer needs of an exception that nobody foresaw, and say where it lies.

    Args:
        error: That was raised.
        words: Of the command line. Only the command and the names of its options are kept: names of
            files, devices and hosts, and of persons in them, are nobody's business.

    Returns:
        One sentence, with the notes of the exception.
    """
    what = f"this is a fault of testbench itself ({type(error).__name__})"
    try:
        opened, name = tempfile.mkstemp(prefix="testbench_fault_", suffix=".txt")
        with os.fdopen(opened, "w", encoding="utf-8") as file:
            file.write(_content(error, words))
    except OSError as refused:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        told = ProgramError(
            f"{what}, at {place}, and what happened cannot be written down: {refused}; "
            f"{DEBUG}=1 shows it"
        )
    else:
        told = ProgramError(f"{what}; please report it and attach {name}")
        told.file = name
    for note in getattr(error, "__notes__", []):
        told.add_note(note)
    return told


def _content(error: Exception, words: Sequence[str]) -> str:
    options = [word.partition("=")[0] for word in words[1:] if word.startswith("--")]
    lines = [
        f"command: {' '.join([*words[:1], *options])}",
        f"system: {platform.platform()}",
        *(f"{name}: {version}" for name, version in _versions().items()),
        "",
        *traceback.format_exception(error),
    ]
    return _without_names("\n".join(lines), words[1:])


def _versions() -> dict[str, str]:
    try:
        from testbench.records.session.session_writer import software_versions

        return software_versions()
    except Exception:  # an installation that is broken is what is to be reported
        return {"python": sys.version}


def _without_names(text: str, words: Sequence[str]) -> str:
    """The text without what was typed, the home folder, where the command ran, and on which host:
    their names are mostly those of persons, participants or projects.
    """
    for name, shown in _names(words).items():
        text = re.sub(rf"(?<![\w.-]){re.escape(name)}(?![\w.-])", shown, text)
    return text


def _names(words: Sequence[str]) -> dict[str, str]:
    """What must not be told, and what stands for it, the longest first."""
    found = {platform.node(): "HOST"}
    with suppress(RuntimeError, OSError):
        found |= dict.fromkeys(map(str, (Path.home(), Path.home().resolve())), "~")
    with suppress(OSError):
        found[str(Path.cwd())] = "."
    for number, word in enumerate(words, 1):
        value = word.partition("=")[2] if word.startswith("--") else word
        if not word.startswith("-") or value:
            whole = {value, str(Path(value).absolute()), Path(value).name}
            found |= dict.fromkeys(whole, f"ARGUMENT_{number}")
    told = {name: shown for name, shown in found.items() if len(name) >= SHORTEST_NAME}
    return dict(sorted(told.items(), key=lambda one: len(one[0]), reverse=True))
