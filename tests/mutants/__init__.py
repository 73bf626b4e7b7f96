"""Patches that make the program tell a plausible wrong number, and where they are read.

Each `*.yaml` beside this is an area: by file of the program the tests that ought to see its lies,
and the lies: text that occurs once in the file, and what takes its place.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Mutant:
    """One patch.

    Attributes:
        area: Of the program.
        file: That is changed, from the root of the project.
        lie: What a user would be told wrongly.
        old: Text in the file.
        new: What takes its place.
        tests: Files of tests, from the root of the project, that ought to see it.
    """

    area: str
    file: str
    lie: str
    old: str
    new: str
    tests: tuple[str, ...]

    def patched(self, root: Path = ROOT) -> str:
        """The text of the file with the lie in it.

        Args:
            root: Of the project, or of a copy.

        Raises:
            ValueError: The patch does not apply to exactly one place.
        """
        text = (root / self.file).read_text(encoding="utf-8")
        found = text.count(self.old)
        if found != 1 or self.old == self.new:
            raise ValueError(f"{self.file}: {self.lie}: the old text is there {found} times")
        return text.replace(self.old, self.new)

    def key(self, root: Path = ROOT) -> str:
        """SHA-256 over the patch, the file that it is put into, and the tests that it is put to."""
        digest = hashlib.sha256("\0".join((self.file, self.old, self.new)).encode())
        for name in (self.file, *self.tests):
            digest.update(name.encode() + b"\0" + (root / name).read_bytes())
        return digest.hexdigest()


def mutants() -> list[Mutant]:
    """All, in an order that has every area in every part of it."""
    found = [
        mutant for file in sorted(Path(__file__).parent.glob("*.yaml")) for mutant in _of(file)
    ]
    return sorted(found, key=lambda one: hashlib.sha256((one.file + one.lie).encode()).digest())


def _of(path: Path) -> Iterator[Mutant]:
    content: dict[str, dict[str, Any]] = yaml.safe_load(path.read_text(encoding="utf-8"))
    for file, own in content.items():
        for patch in own["patches"]:
            tests = tuple(patch.get("tests", own["tests"]))
            yield Mutant(path.stem, file, patch["lie"], patch["old"], patch["new"], tests)
