"""Mutated files of each format and of each kind of truth, the whole way to a report."""

from __future__ import annotations

import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.commands import run_command
from tests.benchmarks.foreign_kinds import KINDS, Kind
from tests.benchmarks.points import by, failed, tell_failures
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.system.mutations import mutate_bytes, mutate_text

COUNT = 10_000
SLOWER = 10.0
"""Times the unchanged file: what takes longer, and over `LEAST_S`, hangs."""
LEAST_S = 5.0
"""On a machine that does other things beside."""
STAGES = ("import", "estimate", "evaluate", "report")
LEAST_ANALYSED = 1 / 3
Words = tuple[str, ...]


def bench_mutated_imports(count: int = COUNT) -> bool:
    """Print the figures; whether every file went its way or was refused in a sentence, in time."""
    found = resumed("mutated_imports", count, _trials)
    rows: list[list[str | Text]] = []
    for kind in KINDS:
        own = by(found, "kind").get(kind, [])
        reached = Counter(one["reached"] for one in own)
        numbers = [str(sum(reached[n] for n in range(k, 5))) for k in range(1, 5)]
        slowest = max((one["spent_s"] for one in own), default=0.0)
        rows.append([Text(kind), str(len(own)), *numbers, str(failed(own)), f"{slowest:.2f}"])
    titles = ["", "files", "imported", "estimated", "evaluated", "reported", "failed", "slowest"]
    show("Mutated recordings and truths", titles, rows)
    analysed = sum(one["reached"] == len(STAGES) for one in found)
    print(f"{analysed} analysed")
    sound = tell_failures(found, "{number}, {kind}", "files tried")
    return sound and analysed >= LEAST_ANALYSED * len(found)


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        seeds = Seeds(Path(name))
        for number in numbers:
            yield seeds.trial(number)


class Seeds:
    """The unchanged files of each kind, and how long they take.

    Args:
        folder: To work in.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.kinds: dict[str, Kind] = {}
        self.usual: dict[str, float] = {}

    def trial(self, number: int) -> dict[str, Any]:
        """A mutation, by its number: how far it came, and what should not have been."""
        name = list(KINDS)[number % len(KINDS)]
        kind = self.kind(name)
        case = self._copy(name, f"case{number}")
        mutate(case, kind, random.Random(number))
        more = ("--json",) if number // len(KINDS) % 4 == 0 else ()
        reached, failure, spent = self._analysed(kind, case, more)
        if not failure and spent > max(SLOWER * self.usual[name], LEAST_S):
            failure = f"took {spent:.1f} s, the unchanged file {self.usual[name]:.1f} s"
        return {
            "number": number,
            "kind": name,
            "reached": reached,
            "failure": failure,
            "spent_s": spent,
        }

    def kind(self, name: str) -> Kind:
        """A kind, whose unchanged files are found to go the whole way.

        Raises:
            AssertionError: They do not.
        """
        if name not in self.kinds:
            own = self.folder / "seeds" / str(list(KINDS).index(name))
            own.mkdir(parents=True)
            kind = self.kinds[name] = KINDS[name](own)
            for _ in range(2):  # the first loads modules
                reached, failure, spent = self._analysed(kind, self._copy(name, "clean"))
                assert reached == len(STAGES) and not failure, f"{name}: {failure or 'refused'}"
            self.usual[name] = spent
        return self.kinds[name]

    def _copy(self, name: str, case: str) -> Path:
        own = self.folder / "seeds" / str(list(KINDS).index(name))
        return Path(shutil.copytree(own, self.folder / case))

    def _analysed(self, kind: Kind, case: Path, more: Words = ()) -> tuple[int, str, float]:
        here = Path.cwd()
        begin = time.perf_counter()
        os.chdir(case)
        try:
            return *_outcome(kind, more), time.perf_counter() - begin
        finally:
            os.chdir(here)
            shutil.rmtree(case)


def mutate(folder: Path, kind: Kind, rng: random.Random) -> None:
    """A change of one of the files of a kind: of one bit or digit, or several."""
    file = folder / rng.choice(kind.mutated)
    raw = file.read_bytes()
    gentle, binary = rng.random() < 0.5, b"\0" in raw[:2000]
    if gentle:
        size = len(raw) if rng.random() < 0.5 else min(1200, len(raw))
        array, at = bytearray(raw), rng.randrange(size)
        digits = (
            b"0123456789" if chr(array[at]).isdigit() and rng.random() < 0.7 else b"0159.-, \tnae"
        )
        array[at] = array[at] ^ (1 << rng.randrange(8)) if binary else rng.choice(digits)
        file.write_bytes(bytes(array))
    elif binary or rng.random() < 0.3:
        size = rng.choice([1200, 5000, len(raw)])
        file.write_bytes(mutate_bytes(raw[:size], rng) + raw[size:])
    else:
        text = raw.decode("utf-8", "replace")
        size = len(text) if rng.random() < 0.5 else 600
        changed = mutate_text(text[:size], rng) + text[size:]
        file.write_text(changed, encoding="utf-8", errors="replace")


def _outcome(kind: Kind, more: Words) -> tuple[int, str]:
    """How many stages the files of the current folder come through, and what should not be.

    Args:
        kind: Of the files.
        more: Words for every command.
    """
    words = [*kind.words, "--out", "session"]
    if kind.format == "--guess":
        code, failure = run_command(
            "import", "--guess", *kind.words, "--out", "guessed.yaml", *more
        )
        if failure or code:
            return 0, failure
        if not Path("guessed.yaml").exists():
            return 0, ""
        words = [*kind.words, "--mapping", "guessed.yaml", "--out", "session"]
    format_name = "generic" if kind.format == "--guess" else kind.format
    commands = (
        ["import", format_name, *words],
        ["estimate", "session"],
        ["evaluate", "session"],
        ["report", "session"],
    )
    for reached, command_words in enumerate(commands):
        code, failure = run_command(*command_words, *more)
        if failure or code:
            if reached == 0 and Path("session").exists():
                failure = failure or "a refused import left a session"
            return reached, failure
    return len(commands), ""


if __name__ == "__main__":
    sys.exit(not bench_mutated_imports(count_of(COUNT, __doc__)))
