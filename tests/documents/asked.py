"""Which commands of a document are run, in its order, in one script."""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.documents.blocks import ROOT, Block, blocks, commands, is_shell
from tests.documents.kinds import PAGES, Kind, Page
from tests.documents.shell import run_script

MARK = "@@ended"
SETUPS = {
    "from testbench.estimation.filters import": """\
import numpy as np
from testbench.estimation.filters import UniformSamples
first_piece = second_piece = UniformSamples(
    100.0, gyr=np.zeros((50, 3)), acc=np.tile([0.0, 0.0, 9.81], (50, 1)),
    mag=np.tile([20.0, 0.0, -40.0], (50, 1))
)
"""
}
"""What snippets take for granted, by how they begin."""


@dataclass(frozen=True)
class Asked:
    """A command or a snippet of Python.

    Attributes:
        block: Where it stands.
        text: As it stands there, without comments.
        python: Whether it is Python.
    """

    block: Block
    text: str
    python: bool = False

    @property
    def place(self) -> str:
        """For people."""
        return f"{self.block.document}:{self.block.line}: {self.text.splitlines()[0]}"


def asked_of(document: Path) -> list[Asked]:
    """All commands and snippets of a document."""
    found = []
    for block in blocks(document):
        if is_shell(block):
            found += [Asked(block, text) for text in commands(block)]
        elif block.language == "python":
            found.append(Asked(block, block.text, python=True))
    return found


def kind_of(asked: Asked) -> Kind | None:
    """What becomes of it; None where nobody said."""
    page = PAGES.get(asked.block.document)
    fitting = [] if page is None else [key for key in page.kinds if asked.text.startswith(key)]
    return None if page is None or not fitting else page.kinds[max(fitting, key=len)]


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes:
        place: What it is.
        code: Its exit code.
        wanted: What it should be.
        said: What it printed.
    """

    place: str
    code: int
    wanted: int
    said: str


def run_document(name: str, hows: Collection[str], folder: Path) -> list[Ended]:
    """Run commands of a document.

    Args:
        name: Path from the root.
        hows: Which.
        folder: Empty, to run in.
    """
    page = PAGES[name]
    chosen = [
        (asked, kind)
        for asked in asked_of(ROOT / name)
        if (kind := kind_of(asked)) is not None and kind.how in hows
    ]
    long = any(how != "quick" for how in hows)
    lines = ["set -e", page.before, page.before_long if long else "", "set +e"]
    for number, (asked, _) in enumerate(chosen):
        lines += [_line(asked, number, folder, page), f'printf "\\n%s %s %s\\n" {MARK} {number} $?']
    code, out, err = run_script("\n".join(lines), folder)
    found = dict(_ends(out))
    assert code == 0 and len(found) == len(chosen), f"{name}: {out[-3000:]}{err[-3000:]}"
    return [
        Ended(asked.place, int(found[n][0]), kind.code, found[n][1])
        for n, (asked, kind) in enumerate(chosen)
    ]


def _line(asked: Asked, number: int, folder: Path, page: Page) -> str:
    text = asked.text
    for word, own in page.words.items():
        text = re.sub(rf"(?<![\w/.]){word}\b", own, text)
    # studies start processes of their own, which forked ones may not
    text = text.replace("testbench study", "testbench_process study")
    if not asked.python:
        return f"{text} 2>&1"
    snippet = folder / f"snippet_{number}.py"
    setup = next((own for key, own in SETUPS.items() if text.startswith(key)), "")
    snippet.write_text(setup + text, encoding="utf-8")
    return f"python {shlex.quote(snippet.name)} 2>&1"


def _ends(out: str) -> Iterator[tuple[int, tuple[str, str]]]:
    """Number, exit code and output of each command, from what the script printed."""
    begun = 0
    for found in re.finditer(rf"^{MARK} (\d+) (\d+)$", out, re.MULTILINE):
        yield int(found[1]), (found[2], out[begun : found.start()])
        begun = found.end()
