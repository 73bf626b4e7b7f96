"""Hundreds of plausible wrong numbers put into a copy of the program: do the tests see them?

Each patch of tests/mutants is put into a copy of the tree, and the tests that ought to see it are
run there. Stopped, it goes on where it was; a patch is asked again where the file that it is put
into, or a file of its tests, has changed since.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn, TextIO

import numba
import pytest

from tests.benchmarks.resuming import FOLDER, ROOT, finished
from tests.benchmarks.timing import Text, once, show
from tests.mutants import Mutant, mutants

LEAST_KILLED = 95.0
"""Share of the patches that the tests must see [%]."""
LONGEST_S = 600.0
"""Tests that take longer with a patch than this have seen it [s]."""
KILLED, ALIVE, BROKEN = "killed", "alive", "broken"
STANDS_ON = (
    "numba.core.caching",
    "numpy",
    "pinocchio",
    "pyarrow.parquet",
    "pydantic",
    "ruckig",
    "scipy.interpolate",
    "scipy.optimize",
    "scipy.signal",
    "scipy.spatial.transform",
    "typer.testing",
    "yaml",
)
"""What takes long to load, and is loaded once."""
LEFT_BEHIND = shutil.ignore_patterns(".git", ".venv", "build", "logs", ".*_cache", ".hypothesis")


def bench_mutants(count: int | None = None, only: str = "") -> bool:
    """Print the share that is killed, by area, and who lives; whether it is as large as it must be.

    Args:
        count: The first so many; None for all.
        only: Part of the area, file or lie of those that are asked; "" for all.
    """
    wanted = [one for one in mutants() if only in f"{one.area} {one.file} {one.lie}"][:count]
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "mutants.jsonl").open("a", encoding="utf-8") as kept:
        try:
            fcntl.flock(kept, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            sys.exit("the campaign mutants is under way in another process")
        known: dict[str, dict[str, Any]] = {one["key"]: one for one in finished(Path(kept.name))}
        missing = [one for one in wanted if one.key() not in known]
        print(
            f"mutants: {len(wanted) - len(missing)} of {len(wanted)} were done before", flush=True
        )
        if missing:
            with tempfile.TemporaryDirectory() as folder:
                tree = Path(folder) / "tree"
                shutil.copytree(ROOT, tree, ignore=LEFT_BEHIND, symlinks=True)
                _ask(missing, tree, known, kept)
    return _told(wanted, {one.key(): known[one.key()] for one in wanted})


def _ask(missing: list[Mutant], tree: Path, known: dict[str, dict[str, Any]], kept: TextIO) -> None:
    """Put patches to their tests, and keep what becomes of each.

    Args:
        missing: Those that were not asked before.
        tree: A copy of the project.
        known: By key; grows.
        kept: The file of them.
    """

    def keep(found: dict[str, Any]) -> None:
        known[found["key"]] = found
        kept.write(json.dumps(found) + "\n")
        kept.flush()

    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for name in STANDS_ON:
        import_module(name)
    tests = sorted({name for one in missing for name in one.tests})
    if _outcome(tests, tree) != ALIVE:
        sys.exit(f"mutants: without any patch these tests fail: {' '.join(tests)}")
    for mutant in missing:
        took, outcome = once(lambda mutant=mutant: _with(mutant, tree))
        print(f"  {outcome:6}  {took:5.1f} s  {mutant.file}: {mutant.lie}", flush=True)
        keep({"key": mutant.key(), "outcome": outcome, "seconds": round(took, 1)})


def _with(mutant: Mutant, tree: Path) -> str:
    """What becomes of a patch in a copy of the tree, which is left as it was."""
    file = tree / mutant.file
    whole, stat = file.read_bytes(), file.stat()
    text = mutant.patched(tree)
    try:
        file.write_text(text, encoding="utf-8")
        if "@njit" not in text:
            return _outcome(mutant.tests, tree)
        # Numba keeps a compiled kernel when one that it calls was changed.
        with tempfile.TemporaryDirectory() as compiled:
            return _outcome(mutant.tests, tree, compiled)
    finally:
        file.write_bytes(whole)
        os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def _outcome(tests: Sequence[str], tree: Path, compiled: str | None = None) -> str:
    """Whether tests see what was done to a tree.

    They run in a fork of this process, which has loaded what the program stands on, and nothing of
    the program.

    Args:
        tests: Files of them.
        tree: A copy of the project.
        compiled: Folder for compiled kernels; None for the usual places.
    """
    sys.stdout.flush()
    process = os.fork()
    if process == 0:
        _run(tests, tree, compiled)
    ends = threading.Timer(LONGEST_S, os.kill, (process, signal.SIGKILL))
    ends.start()
    status = os.waitpid(process, 0)[1]
    ends.cancel()
    ends.join()
    code = os.waitstatus_to_exitcode(status)
    return {0: ALIVE, 1: KILLED, -signal.SIGKILL: KILLED}.get(code, BROKEN)


def _run(tests: Sequence[str], tree: Path, compiled: str | None) -> NoReturn:
    """Run tests of a tree in a process of their own, and end it."""
    code = 99
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        os.chdir(tree)
        os.environ["PYTHONPATH"] = str(tree)
        here = {"", str(ROOT), str(ROOT / "tests")}
        sys.path[:] = [str(tree), *(entry for entry in sys.path if entry not in here)]
        for name in [name for name in sys.modules if name.partition(".")[0] == "tests"]:
            del sys.modules[name]
        if compiled is not None:
            os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = compiled
        code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests]))
    finally:
        os._exit(code)


def _told(wanted: list[Mutant], known: dict[str, dict[str, Any]]) -> bool:
    """Print what became of patches; whether the tests see enough of them.

    Args:
        wanted: All that were asked for.
        known: What became of each, by key.
    """
    outcomes = {one: known[one.key()]["outcome"] for one in wanted}
    rows: list[list[str | Text]] = []
    for area in [*sorted({one.area for one in wanted}), ""]:
        own = [outcome for one, outcome in outcomes.items() if area in ("", one.area)]
        killed = own.count(KILLED)
        share = f"{100 * killed / max(len(own), 1):.1f}"
        rows.append([Text(area or "all"), str(len(own)), str(killed), share])
    show("Wrong numbers that the tests see", ["area", "patches", "killed", "share [%]"], rows)
    for one, outcome in outcomes.items():
        if outcome != KILLED:
            print(f"  {outcome}: {one.file}: {one.lie}")
    share = 100 * list(outcomes.values()).count(KILLED) / max(len(outcomes), 1)
    return bool(outcomes) and share >= LEAST_KILLED


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, help="the first so many (all)")
    parser.add_argument("--only", default="", help="part of an area, a file or a lie (all)")
    asked = parser.parse_args()
    sys.exit(not bench_mutants(asked.count, asked.only))
