"""Runs of equal lines in two product modules: one of the two will be forgotten at the next fault.

`python -m tests.repeats` lists them.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.house import ROOT, comments

LONGEST = 8
"""So many equal lines are one too many."""


@dataclass(frozen=True)
class Place:
    """Lines of a module, both counted from 1 and among them."""

    file: Path
    first: int
    last: int

    def __str__(self) -> str:
        file = self.file.relative_to(ROOT) if self.file.is_relative_to(ROOT) else self.file
        return f"{file}:{self.first}-{self.last}"


@dataclass(frozen=True)
class Repeat:
    """Two places that share so many lines of code."""

    lines: int
    one: Place
    other: Place

    def __str__(self) -> str:
        return f"{self.one} ~ {self.other}: {self.lines} equal lines"


def code_lines(source: str) -> list[tuple[int, str]]:
    """Numbers and folded text of the lines that count: no blank ones, comments, imports or
    docstrings.
    """
    left_out: set[int] = set()
    for node in statements(ast.parse(source)):
        text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.Import | ast.ImportFrom) or (text and _is_text(node)):
            left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = source.splitlines()
    for row, column, _ in comments(source):
        lines[row - 1] = lines[row - 1][:column]
    folded = ((number, "".join(line.split())) for number, line in enumerate(lines, 1))
    return [(number, line) for number, line in folded if line and number not in left_out]


def statements(tree: ast.Module) -> Iterator[ast.stmt]:
    """Every statement, at any depth; what expressions hold is passed by."""
    todo: list[ast.AST] = [tree]
    while todo:
        for child in ast.iter_child_nodes(todo.pop()):
            if isinstance(child, ast.stmt):
                yield child
            if not isinstance(child, ast.expr):
                todo.append(child)


def _is_text(node: ast.AST) -> bool:
    assert isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return isinstance(node.value.value, str)


def repeats(files: Iterable[Path], longest: int = LONGEST) -> list[Repeat]:
    """Runs of at least so many equal lines that two files share, longest first; each run once."""
    code = {file: code_lines(file.read_text(encoding="utf-8")) for file in files}
    places: dict[tuple[str, ...], list[tuple[Path, int]]] = defaultdict(list)
    for file, lines in code.items():
        texts = [text for _, text in lines]
        for start in range(len(lines) - longest + 1):
            places[tuple(texts[start : start + longest])].append((file, start))
    pairs = {
        (one, other)
        for found in places.values()
        for i, one in enumerate(found)
        for other in found[i + 1 :]
        if one[0] != other[0]
    }
    result = []
    for (file, i), (other, k) in pairs:
        if ((file, i - 1), (other, k - 1)) in pairs:
            continue  # within a run that began before
        length = longest
        while ((file, i + length - longest + 1), (other, k + length - longest + 1)) in pairs:
            length += 1
        one, two = (
            Place(path, code[path][start][0], code[path][start + length - 1][0])
            for path, start in ((file, i), (other, k))
        )
        result.append(Repeat(length, one, two))
    return sorted(result, key=lambda repeat: (-repeat.lines, str(repeat)))


def product() -> list[Path]:
    """Every module of the product."""
    return sorted((ROOT / "testbench").rglob("*.py"))


if __name__ == "__main__":
    found = repeats(product())
    for repeat in found:
        print(repeat)
    print(f"{len(found)} runs of {LONGEST} equal lines or more")
