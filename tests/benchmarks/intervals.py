"""How often the 95 % intervals of calibrations hold the truth."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial

import numpy as np

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.estimation.calibration.covering import TRIALS

COUNT = 4000


def bench_intervals(count: int = COUNT) -> bool:
    """Print the lowest and the highest share of any parameter of each calibration; whether all are
    93 to 97 %.
    """
    rows: list[list[str | Text]] = []
    within = True
    for name in TRIALS:
        inside = np.array(resumed(name.replace(" ", "_"), count, partial(_trials, name)))
        shares = 100 * inside.mean(axis=0)
        within &= bool(((shares >= 93) & (shares <= 97)).all())
        rows.append([Text(name), str(len(shares)), f"{shares.min():.1f}", f"{shares.max():.1f}"])
    show(
        f"Stated 95 % intervals of calibrations: {count} of each",
        ["calibration", "parameters", "lowest share [%]", "highest share [%]"],
        rows,
        "target: 93 to 97 %",
    )
    return within


def _trials(name: str, numbers: range) -> Iterator[list[bool]]:
    for number in numbers:
        yield TRIALS[name](number).tolist()


if __name__ == "__main__":
    sys.exit(not bench_intervals(count_of(COUNT, __doc__)))
