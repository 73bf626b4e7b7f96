"""Lines as serial monitors and sketches write them, turned into rows of a table.

The serial monitor of Arduino's IDE puts the time at which it received a line before it
(`12:34:56.789 -> 0.12,9.81`), and many sketches write what a number is beside it (`ax: 0.12, ay:
9.81`). Either is told by the first lines of a file; what it adds is taken off or becomes a column.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from testbench.exceptions import FileProblems, Problem
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

SNIFFED = 8192
"""Bytes that tell how the lines are written."""
FEWEST, LEAST_PART = 3, 0.5
"""So many lines at least, and such a part of them, are written so [1]: the others are what a board
says when it starts.
"""
FEWEST_LABELS = 3
"""Of a line; fewer are keys of a header."""
_RECEIVED = rb"(?P<clock>\d{1,2}:\d{2}:\d{2}[.,]\d{1,6})[ \t]*->[ \t]?"
_PREFIX = re.compile(rb"^" + _RECEIVED, re.MULTILINE)
_PREFIX_OF_WORDS = re.compile(rb"^" + _RECEIVED + rb"(?=[A-Za-z#%])", re.MULTILINE)
_NUMBER = rb"(?=[-+]?\.?\d|[-+]?(?:nan|inf)\b)"
_LABEL = re.compile(
    rb"(?<![\w.+:\-])(?P<name>[A-Za-z_][\w .\[\]/()]*?)[ \t]*[:=][ \t]*" + _NUMBER, re.IGNORECASE
)
_UNIT = re.compile(
    rb"(?<=[\d.])[ \t]*(?P<unit>m/s\^?2|m/s/s|rad/s|deg/s|dps|mg|g|[um]T|\xc2\xb5T|Hz|degC|C)"
    rb"(?=[ \t]*(?:[,;|\r\n]|$)|[ \t]+[A-Za-z_])",
    re.MULTILINE,
)


@dataclass(frozen=True)
class Written:
    """How the lines of a file are written.

    Attributes:
        time: Title of the column of times that a monitor put before each line, "" if none did.
        labels: What stands beside the numbers of a line, with units; none where nothing does.
        separator: That follows the time.
    """

    time: str
    labels: list[str]
    separator: bytes

    @property
    def titles(self) -> list[str]:
        """Of the columns, where the lines themselves tell them; else none."""
        return [*([self.time] if self.time else []), *self.labels] if self.labels else []

    def findings(self, file: Path) -> list[Finding]:
        """What is said of it."""
        found = []
        if self.time:
            found.append(finding("structure.received", file=file.name, column=self.time))
        if self.labels:
            found.append(finding("structure.labels", file=file.name, labels=self.labels))
        return found

    def plain(self, lines: bytes) -> bytes:
        """Whole lines as rows of a table.

        Args:
            lines: In UTF-8.
        """
        if self.labels:
            lines = _LABEL.sub(b"", _UNIT.sub(b"", lines)).replace(b"|", b",")
        if self.time:
            title = self.time.encode() + self.separator
            lines = _PREFIX_OF_WORDS.sub(title, lines)
            lines = _PREFIX.sub(rb"\g<clock>" + self.separator, lines)
        return lines


def written_in(file: Path, encoding: str) -> Written | None:
    """How the lines of a text file are written; None where they are rows as they are.

    Args:
        file: That exists.
        encoding: Of it.

    Raises:
        FileProblems: What belongs to one sample stands in several lines.
    """
    with file.open("rb") as stream:
        head = stream.read(SNIFFED)
    text = head.decode(encoding, errors="ignore").replace("\r\n", "\n").replace("\r", "\n")
    lines = [line.encode() for line in text.split("\n")]
    lines = [line for line in (lines[:-1] if len(head) == SNIFFED else lines) if line.strip()]
    plain = [_PREFIX.sub(b"", line) for line in lines]
    received = _are_most(sum(a != b for a, b in zip(lines, plain, strict=True)), lines)
    found = [tuple(match["name"].decode() for match in _LABEL.finditer(line)) for line in plain]
    counts = Counter(own for own in found if len(own) >= FEWEST_LABELS)
    kinds = [own for own, count in counts.most_common() if count >= FEWEST]
    if len(kinds) > 1 and _are_most(counts.total(), lines):
        shown = "' and '".join(", ".join(own) for own in kinds[:3])
        problem = Problem(
            f"lines with '{shown}' take turns, where each line of a table is one sample: let the "
            "sketch print all of a sample before it ends the line"
        )
        raise FileProblems(file, [problem])
    labels = kinds[0] if kinds and _are_most(counts[kinds[0]], lines) else ()
    if not (received or labels):
        return None
    rows = [line for line, own in zip(plain, found, strict=True) if own == labels]
    row = rows[0] if labels else plain[-1]
    separator = next((own for own in (b"\t", b";", b",", b"|") if own in row), b" ")
    called = any(b"time" in line.lower() for line in plain)
    return Written(
        ("received" if called else "time") if received else "",
        _with_units(row, list(labels)) if labels else [],
        b"," if separator == b"|" else separator,
    )


def _are_most(count: int, lines: list[bytes]) -> bool:
    return count >= FEWEST and count >= LEAST_PART * len(lines)


def _with_units(row: bytes, labels: list[str]) -> list[str]:
    """Labels of a line with the unit that stands behind each number, where one does."""
    ends = [match.end() for match in _LABEL.finditer(row)]
    titles = []
    for label, begin, end in zip(labels, ends, [*ends[1:], len(row)], strict=True):
        unit = _UNIT.search(row[begin:end])
        titles.append(label if unit is None else f"{label} ({unit['unit'].decode()})")
    return titles
