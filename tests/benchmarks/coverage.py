"""Whether the stated expanded uncertainty covers the known truth."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.system.known_truth import PLACES, Case, cases

COUNT = 500


def bench_coverage(count: int = COUNT) -> bool:
    """Simulate sessions with seeds from 0, and print how often the truth lies within the reported
    mean error and its U; whether that is 93 to 97 % everywhere.
    """
    found = [Case(**case) for session in resumed("coverage", count, _sessions) for case in session]
    rows: list[list[str | Text]] = []
    shares = []
    for joint, section in PLACES:
        own = [case for case in found if (case.joint, case.section) == (joint, section)]
        shares.append(100 * float(np.mean([case.covered for case in own])))
        rows.append([Text(joint), Text(section), f"{shares[-1]:.1f}", *_numbers(own)])
    show(
        f"Coverage of the known mean flexion error: {count} sessions with wrong joint zeros",
        [
            "joint",
            "section",
            "within U [%]",
            "mean U [deg]",
            "twice the scatter [deg]",
            "mean difference [deg]",
        ],
        rows,
        "target: 93 to 97 % within",
    )
    return all(93 <= share <= 97 for share in shares)


def _sessions(seeds: range) -> Iterator[list[dict[str, Any]]]:
    """The cases of one session after the other."""
    for seed in seeds:
        yield [asdict(case) for case in cases([seed])]


def _numbers(own: list[Case]) -> list[str]:
    difference = np.array([case.reported - case.true for case in own])
    expanded = np.mean([case.expanded for case in own])
    return [f"{expanded:.4f}", f"{2 * difference.std(ddof=1):.4f}", f"{difference.mean():+.4f}"]


if __name__ == "__main__":
    sys.exit(not bench_coverage(count_of(COUNT, __doc__)))
