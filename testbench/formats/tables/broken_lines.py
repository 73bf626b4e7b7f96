"""Lines of a text table that hold no sample: cut off with the power, or words of the logger."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench.exceptions import one_line
from testbench.formats.tables.fields import MISSING, NUMBER, split_line
from testbench.formats.tables.monitor import Written
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

MOST_OF_TEXT = 0.01
"""Part of the lines that may be text; of more nobody knows what the file is."""
_INSIDE = ("source", "main", "other", "table")


@dataclass
class Broken:
    """Lines that are left out of a table.

    Attributes:
        texts: By number of the line, from 1.
        cut: Number of the last line where that is cut short.
    """

    texts: dict[int, str] = field(default_factory=dict)
    cut: int | None = None

    def findings(self, file: Path) -> list[Finding]:
        """What is said of them."""
        words = [number for number in self.texts if number != self.cut]
        found = []
        if words:
            shown = one_line(self.texts[words[0]][:40])
            found.append(
                finding(
                    "structure.lines_of_text",
                    file=file.name,
                    count=len(words),
                    line=words[0],
                    text=shown,
                )
            )
        if self.cut is not None:
            found.append(finding("structure.cut_short", file=file.name, line=self.cut))
        return found


def find_broken(
    rows: Iterable[tuple[int, str]], separator: str, width: int, ended: bool
) -> Broken | None:
    """The lines that hold no sample; None where they are too many.

    Args:
        rows: Number and text of each line.
        separator: Of the fields.
        width: Number of fields that a line has.
        ended: Whether the file ends with the end of a line.
    """
    broken, count, last, before = Broken(), 0, (0, ""), ""
    for number, text in rows:
        count += 1
        if is_text(text, separator):
            broken.texts[number] = text
        before, last = last[1], (number, text)
    if len(broken.texts) > MOST_OF_TEXT * count:
        return None
    number, text = last
    fields, others = split_line(text, separator), split_line(before, separator)
    if number in broken.texts:
        broken.cut = None if ended else number
    elif len(fields) < width == len(others) or (
        not ended and len(fields) == width and _ends_in_number(others) > _ends_in_number(fields)
    ):
        broken.texts[number], broken.cut = text, number
    return broken


def is_text(line: str, separator: str) -> bool:
    """Whether a line holds words and no number at all."""
    fields = split_line(line, separator)
    return not any(NUMBER.fullmatch(one) for one in fields) and any(
        one not in MISSING for one in fields
    )


def _ends_in_number(fields: list[str]) -> bool:
    return bool(fields) and (fields[-1] in MISSING or bool(NUMBER.fullmatch(fields[-1])))


def without(block: bytes, broken: Broken) -> bytes:
    """A block of lines in UTF-8 without the broken ones."""
    out = {text.split() and tuple(text.split()) for text in broken.texts.values()}
    lines = block.split(b"\n")
    return b"\n".join(one for one in lines if tuple(one.decode("utf-8").split()) not in out)


def ends_a_line(file: Path) -> bool:
    """Whether a file ends with the end of a line, in whatever encoding."""
    with file.open("rb") as stream:
        stream.seek(0, 2)
        stream.seek(max(stream.tell() - 4, 0))
        return stream.read().rstrip(b"\0")[-1:] in (b"\n", b"\r")


def left_out(source: Any) -> Iterator[Finding]:
    """What is said of the lines of all tables that a source is made of: those left out, and what
    stands in them beside numbers.
    """
    written = getattr(source, "written", None)
    if isinstance(written, Written):
        yield from written.findings(source.file)
    broken = getattr(source, "broken", None)
    if isinstance(broken, Broken):
        yield from broken.findings(source.file)
    inside = [getattr(source, name) for name in _INSIDE if hasattr(source, name)]
    for one in [*inside, *getattr(source, "others", ())]:
        yield from left_out(one)
