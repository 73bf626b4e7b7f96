"""The terms of docs/terms.md, for who reads a page."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from testbench.records.specs.shipped import shipped_folder

TERMS = "terms.md"


@dataclass(frozen=True)
class Term:
    """One entry.

    Attributes:
        names: Words that it explains, as they are written, abbreviations too.
        text: What they mean.
    """

    names: tuple[str, ...]
    text: str


@cache
def terms() -> tuple[Term, ...]:
    """The nouns of the bench, in the order of the file; none where it did not ship.

    An entry is a paragraph that begins in bold type: `**Name, other name.** Text`, or `**Name**
    (ABC): text`; one paragraph may hold several.
    """
    file = shipped_folder("docs") / TERMS
    if not file.is_file():
        return ()
    found: dict[tuple[str, ...], str] = {}
    for paragraph in file.read_text(encoding="utf-8").split("\n## ")[0].split("\n\n"):
        parts = re.split(r"\*\*(.+?)\*\*", " ".join(paragraph.split()))[1:]
        for bold, rest in zip(parts[::2], parts[1::2], strict=True):
            names = tuple(name.strip() for name in bold.rstrip(".").split(","))
            short = re.match(r"\s*\((\w{1,4})\)", rest)
            plain = re.sub(r"\*(.+?)\*", r"\1", rest).replace("`", "").lstrip(" .:")
            key = (*names, *([short[1]] if short else []))
            found[key] = f"{found[key]} {plain}" if key in found else plain
    return tuple(Term(names, text) for names, text in found.items())
