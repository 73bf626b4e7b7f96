"""What the documents show: their fenced blocks, and the commands in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HOW_TO = ROOT / "docs" / "how_to"
FENCE = re.compile(r"^( *)```([\w-]*)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)
SHELL = ("sh", "bash")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        document: Path from the root of the repository.
        line: Of its fence, from 1.
        language: After the fence; empty where none is named.
        text: Between the fences, each line with its end.
    """

    document: str
    line: int
    language: str
    text: str


def documents() -> list[Path]:
    """README and everything below docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(document: Path) -> list[Block]:
    """The fenced blocks of a document, in their order."""
    text = document.read_text(encoding="utf-8")
    name = document.relative_to(ROOT).as_posix()
    return [
        Block(name, text.count("\n", 0, found.start()) + 1, found[2], found[3])
        for found in FENCE.finditer(text)
    ]


def is_shell(block: Block) -> bool:
    """Whether a reader would type it into a terminal."""
    return block.language in SHELL or (not block.language and block.text.startswith("testbench "))


def commands(block: Block) -> list[str]:
    """The commands of a block for a shell, without their comments; continued lines are joined."""
    joined = re.sub(r"[ ]*\\\n[ ]*", " ", re.sub(r"\\([ ]+#.*)?\n", "\\\n", block.text))
    return [own for line in joined.splitlines() if (own := re.sub(r"(^|\s)#.*", "", line).strip())]


def script_of(page: Path) -> str:
    """All that a page has a reader type, in one script that ends at the first failure."""
    return "set -e\n" + "".join(own.text for own in blocks(page) if own.language in SHELL)
