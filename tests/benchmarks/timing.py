"""Time a call, and print tables whose columns align."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any


def seconds(call: Callable[[], Any], repeats: int = 3) -> float:
    """Wall-clock time of a call [s]: the shortest of some repeats, after one call that does not
    count.

    The first call compiles, fills caches and reads files; the shortest of the rest is what the
    machine can do undisturbed.
    """
    call()
    return min(once(call)[0] for _ in range(repeats))


def once(call: Callable[[], Any]) -> tuple[float, Any]:
    """Wall-clock time of one call [s], and what it returned."""
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Processes that want all of a core each, for as long as this is entered."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


@dataclass(frozen=True)
class Text:
    """A cell that is aligned to the left."""

    text: str


def show(title: str, columns: list[str], rows: list[list[str | Text]], notes: str = "") -> None:
    """Print a table; cells that are not Text are aligned to the right."""
    texts = [[cell.text if isinstance(cell, Text) else cell for cell in row] for row in rows]
    widths = [max(len(line[i]) for line in [columns, *texts]) for i in range(len(columns))]
    left = [isinstance(cell, Text) for cell in rows[0]]

    def line(cells: list[str]) -> str:
        padded = [
            cell.ljust(w) if flush else cell.rjust(w)
            for cell, w, flush in zip(cells, widths, left, strict=True)
        ]
        return "  " + "  ".join(padded).rstrip()

    print(f"\n{title}")
    print(line(columns))
    print("  " + "  ".join("-" * width for width in widths))
    for cells in texts:
        print(line(cells))
    if notes:
        print(f"  {notes}")


def rate(value: float) -> str:
    """A number a second, with three digits that count."""
    for factor, prefix in ((1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {prefix}/s"
    return f"{value:.3g} /s"


def duration(value: float) -> str:
    """A time [s], with three digits that count."""
    for factor, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


def ratio(ours: float, theirs: float) -> str:
    """How many times faster ours is, from the two times [s]."""
    return f"{theirs / ours:.3g} x"
