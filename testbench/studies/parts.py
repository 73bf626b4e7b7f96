"""Several simulated parts of one protocol, run side by side, and their tables made into one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import lru_cache
from multiprocessing import get_context
from os import cpu_count

import numpy as np

from testbench.clock import SystemClock
from testbench.exceptions import BenchError, InputError
from testbench.model.statistics.spread import Change, in_percent
from testbench.pipeline.prepared import Prepared
from testbench.pipeline.request import Request
from testbench.pipeline.run import prepare, run
from testbench.pipeline.watcher import Watcher
from testbench.records.results.numbers import decimals_by
from testbench.records.results.study import StudyRow, StudyTable, Value

SAME = 1e-9
"""Share of a mean below which a spread is that of rounding."""
MOST_PROCESSES = 8
"""More would wait for memory rather than for processors."""


def run_side_by_side(asked: Sequence[Request], done: Callable[[int], None]) -> list[str]:
    """Run several requests, as many at a time as there are processors.

    Each process plans a protocol once, whatever number of its parts it runs.

    Args:
        asked: Requests, each for a run of its own.
        done: Called with how many are done.

    Returns:
        Folder of the session of each, in the order of the requests.

    Raises:
        InputError: One of them was refused; in its words.
        BenchError: One of them failed; in its words.
    """
    processes = min(len(asked), cpu_count() or 1, MOST_PROCESSES)
    paths = []
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        runs = pool.map(_run_one, [each.canonical() for each in asked])
        for i, (path, refused, fault) in enumerate(runs):
            if refused or fault:
                pool.shutdown(cancel_futures=True)
                raise InputError(refused) if refused else BenchError(fault)
            paths.append(path)
            done(i + 1)
    return paths


def _run_one(asked: str) -> tuple[str, str, str]:
    """Folder of the session of a request, why it was refused, or what went wrong; in a process of
    its own.
    """
    request = Request.model_validate_json(asked)
    alike = {
        "run": request.run.model_copy(update={"seed": 0}),
        "analysis": request.analysis.model_copy(update={"report": False}),
    }
    try:
        prepared = _prepared(request.model_copy(update=alike).canonical())
        result = run(request, Watcher(SystemClock()), prepared)
    except InputError as error:
        return "", str(error), ""
    except BenchError as error:
        return "", "", str(error)
    return str(result.session.path), "", ""


@lru_cache(maxsize=4)
def _prepared(asked: str) -> Prepared:
    """The plan of a request, made once a process."""
    return prepare(Request.model_validate_json(asked))


def over_parts(tables: Sequence[StudyTable]) -> StudyTable:
    """The tables of several parts as one: the mean of each number, with its spread.

    Words that are not the same for all parts become a dash; a row that a part lacks is one of the
    others.

    Args:
        tables: The same table of each part, at least one.
    """
    first = tables[0]
    if len(tables) == 1:
        return first
    labels = dict.fromkeys(row.title for table in tables for row in table.rows)
    found = [{row.title: row for row in table.rows} for table in tables]
    rows = [_row([rows[title] for rows in found if title in rows]) for title in labels]
    spread = f"standard deviation over {len(tables)} parts"
    return replace(first, rows=tuple(rows), spread=spread)


def _row(rows: Sequence[StudyRow]) -> StudyRow:
    cells = [_cell([row.values[i] for row in rows]) for i in range(len(rows[0].values))]
    values, spread = (tuple(column) for column in zip(*cells, strict=True))
    return replace(rows[0], values=values, spread=spread)


def _cell(values: Sequence[Value]) -> tuple[Value, Value]:
    """Mean and standard deviation of numbers; words that are the same for all."""
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    if not numbers:
        return (values[0] if len(set(values)) == 1 else None), None
    if len(numbers) == 1:
        return numbers[0], None
    mean, sd = float(np.mean(numbers)), float(np.std(numbers, ddof=1))
    return mean, sd if sd > SAME * abs(mean) else None  # what no part changes has no spread


def number_with(values: Sequence[float]) -> str:
    """A number of each part as their mean and standard deviation; of one part the number alone."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return f"{mean:.2g}"
    sd = float(np.std(values, ddof=1))
    decimals = decimals_by(sd)
    return f"{mean:.3g}" if decimals is None else f"{mean:.{decimals}f} ± {sd:.{decimals}f}"


def told_over(first: np.ndarray, second: np.ndarray) -> str:
    """What is shown of one error against another, over parts and over motions.

    More or less is said only where the intervals over both say so.

    Args:
        first: Errors, shape (parts, motions), above zero.
        second: Of the same parts in the same motions, shape (parts, motions).
    """
    over = {
        "parts": Change.of(np.median(first, axis=1), np.median(second, axis=1)),
        "motions": Change.of(np.median(first, axis=0), np.median(second, axis=0)),
    }
    if any(change.interval is None for change in over.values()):
        return "one part, or one motion, does not show which has less"
    spans = []
    for what, change in over.items():
        low, high = change.interval or (0.0, 0.0)
        spans.append(f"{in_percent(low)} to {in_percent(high)} over {len(change.ratios)} {what}")
    span = f"95 % intervals: {', '.join(spans)}"
    verdicts = {change.verdict for change in over.values()}
    if len(verdicts) > 1 or verdicts == {"not shown"}:
        return f"neither more nor less is shown ({span})"
    return f"{in_percent(over['parts'].percent)} ({span})"
