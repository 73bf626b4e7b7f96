"""The commands and snippets of README and docs that take long: run in the order of each document,
those for an arm against an emulated controller. What becomes of which is said in
tests/documents/kinds.py.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.documents.asked import asked_of, kind_of, run_document
from tests.documents.blocks import HOW_TO, ROOT
from tests.documents.how_to import faults_of
from tests.documents.kinds import LONG_PAGES, PAGES, WITH_AN_ARM
from tests.documents.shell import run_script

STARTS_S = 6
"""What an emulator is given to start [s]."""


def trials() -> list[tuple[str, str]]:
    """What is run, one after the other: documents, those with an arm, and pages of docs/how_to."""
    hows = {name: {kind.how for kind in page.kinds.values()} for name, page in PAGES.items()}
    found = [(name, "machine") for name in PAGES if hows[name] & {"long", "data"}]
    found += [(name, "arm") for name in PAGES if hows[name] & {"serves", "arm"}]
    return found + [(name, "how_to") for name in (*LONG_PAGES, *WITH_AN_ARM)]


def bench_documents(count: int | None = None) -> bool:
    """Print how the commands of each document ended; whether all did as they should."""
    asked = trials()[:count]
    found = resumed("documents", len(asked), _trials)
    rows: list[list[str | Text]] = [
        [Text(f"{name}, {where}"), f"{one['run']}", Text("; ".join(one["wrong"])[:300] or "none")]
        for (name, where), one in zip(asked, found, strict=True)
    ]
    wrong = sum(len(one["wrong"]) for one in found)
    show(
        "Commands and snippets of the documents",
        ["document", "run", "not as they should be"],
        rows,
        f"{wrong} of {sum(one['run'] for one in found)} did not end as they should",
    )
    return not wrong


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    made = trials()
    for number in numbers:
        name, where = made[number]
        with tempfile.TemporaryDirectory() as folder:
            yield _RUN[where](name, Path(folder))


def _on_this_machine(name: str, folder: Path) -> dict[str, Any]:
    hows = {"quick", "long"} | ({"data"} if os.environ.get("TESTBENCH_DATA") else set())
    ended = run_document(name, hows, folder)
    wrong = [
        f"{one.place}: exit code {one.code}: {one.said[-300:]}"
        for one in ended
        if one.code != one.wanted or "Traceback" in one.said
    ]
    return {"run": len(ended), "wrong": wrong}


def _with_an_arm(name: str, folder: Path) -> dict[str, Any]:
    """Each block by itself: what serves is started, and ends with it."""
    count, wrong = 0, []
    by_block: dict[int, list[tuple[str, str]]] = {}
    for asked in asked_of(ROOT / name):
        kind = kind_of(asked)
        if kind is not None and kind.how in ("serves", "arm"):
            by_block.setdefault(asked.block.line, []).append((kind.how, asked.text))
    for line, texts in by_block.items():
        served = [
            f"{text} >served_{i} 2>&1 &" for i, (how, text) in enumerate(texts) if how == "serves"
        ]
        runs = [f"{text} || exit $?" for how, text in texts if how == "arm"]
        script = "\n".join(
            [*served, f"sleep {STARTS_S}", "grep -q 'emulated at\\|proxy' served_* || exit 99"]
        )
        script += "\n" + "\n".join(runs) + "\ncode=$?; kill $(jobs -p); exit $code"
        code, out, err = run_script(script, folder, own_processes=True)
        count += len(texts)
        if code:
            wrong.append(f"{name}:{line}: exit code {code}: {(out + err)[-300:]}")
        for file in folder.glob("served_*"):
            file.unlink()
    return {"run": count, "wrong": wrong}


def _how_to(name: str, folder: Path) -> dict[str, Any]:
    faults = faults_of(HOW_TO / f"{name}.md", folder)
    return {"run": 1, "wrong": [f"{name}: {fault[-300:]}" for fault in faults]}


_RUN = {"machine": _on_this_machine, "arm": _with_an_arm, "how_to": _how_to}


if __name__ == "__main__":
    sys.exit(not bench_documents(count_of(len(trials()), __doc__)))
