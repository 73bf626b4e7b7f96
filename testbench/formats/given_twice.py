"""Files of a recording that are given twice, by their names or by what they hold."""

from __future__ import annotations

import filecmp
import itertools
from collections.abc import Sequence
from pathlib import Path

from testbench.exceptions import InputError
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding

LEAST_BYTES = 2000
"""Shorter files, such as settings, may be alike [bytes]."""


def refuse_twice(files: Sequence[Path]) -> None:
    """Refuse one file that is given twice: it would be two sensors.

    Args:
        files: Of a recording.

    Raises:
        InputError: Names it.
    """
    seen: dict[Path, Path] = {}
    for file in files:
        other = seen.setdefault(file.resolve(), file)
        if other is not file:
            raise InputError(f"{file} is given twice; each file is read once")


def copies(files: Sequence[Path]) -> list[Finding]:
    """Files that hold the same, byte for byte, under two names.

    Args:
        files: Of a recording, all of which can be read.
    """
    by_size: dict[int, list[Path]] = {}
    for file in files:
        if file.is_file() and file.stat().st_size >= LEAST_BYTES:
            by_size.setdefault(file.stat().st_size, []).append(file)
    return [
        finding("structure.copies", first=first.name, second=second.name)
        for alike in by_size.values()
        for first, second in itertools.combinations(alike, 2)
        if filecmp.cmp(first, second, shallow=False)
    ]
