"""What calibrations say of errors that their models have not, by the size of these."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.system.misfits import LACKS, Lack, clean, named

COUNT = 60
CLEAN_PER_COUNT = 200 / 60
"""So many clean parts for each of the others."""
SQUARES = (0.5, 1.5)
"""Chi-square over the number of parameters lies between these, on average, of complete models."""


def bench_lack_of_fit(count: int = COUNT) -> bool:
    """Print the share of parts of which a lack is named, by its size, and of clean parts of which
    anything is; whether the largest sizes are named in 95 %, and 95 % of clean parts are silent.
    """
    rows: list[list[str | Text]] = []
    kept = True
    for lack in LACKS:
        for size in lack.sizes:
            drawn = resumed(
                f"lack_{lack.code}_{lack.triad}_{size}", count, partial(_parts, lack, size)
            )
            share = 100 * float(np.mean([own for own, _ in drawn]))
            others = 100 * float(np.mean([bool(codes) for _, codes in drawn]))
            kept &= share >= 95 or size < lack.sizes[-1]
            rows.append([Text(lack.kind), f"{size:g} {lack.unit}", f"{share:.0f}", f"{others:.0f}"])
    show(
        f"What models lack: {count} parts of each",
        ["error", "size", "named [%]", "something else named too [%]"],
        rows,
        "target: the last size of each in 95 %",
    )
    return bench_clean(round(count * CLEAN_PER_COUNT)) and kept


def bench_clean(count: int) -> bool:
    """The same of parts that lack nothing, and how right their covariances are as a whole."""
    drawn = resumed("lack_clean", count, _clean)
    silent = 100 * float(np.mean([not part["codes"] for part in drawn]))
    rows: list[list[str | Text]] = []
    kept = silent >= 95
    for triad in ("accelerometer", "gyroscope"):
        squares = [part["chi_square"][triad] for part in drawn if triad in part["chi_square"]]
        mean = float(np.mean(squares))
        kept &= SQUARES[0] <= mean <= SQUARES[1]
        error = float(np.std(squares)) / np.sqrt(len(squares))
        rows.append([Text(triad), f"{silent:.1f}", f"{mean:.2f} ± {error:.2f}"])
    show(
        f"Complete models: {count} parts on an arm with wrong zeros and twists",
        ["triad", "parts without a warning [%]", "chi-square over parameters"],
        rows,
        f"target: 95 %, {SQUARES[0]} to {SQUARES[1]}",
    )
    return kept


def _parts(lack: Lack, size: float, numbers: range) -> Iterator[tuple[bool, list[str]]]:
    for number in numbers:
        yield named(lack, size, number)


def _clean(numbers: range) -> Iterator[dict[str, Any]]:
    for number in numbers:
        yield clean(number)


if __name__ == "__main__":
    sys.exit(not bench_lack_of_fit(count_of(COUNT, __doc__)))
