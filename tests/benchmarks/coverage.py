"""Whether the stated expanded uncertainty covers the known truth: `python -m
tests.benchmarks.coverage [sessions]`.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from tests.benchmarks.timing import Text, show
from tests.system.known_truth import PLACES, Case, cases

SESSIONS, PROCESSES = 500, 2


def bench_coverage(sessions: int = SESSIONS) -> None:
    """Simulate sessions with seeds from 0, and count how often the truth lies within the reported
    mean error and its U.
    """
    begin = time.perf_counter()
    with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
        parts = pool.map(cases, [range(start, sessions, PROCESSES) for start in range(PROCESSES)])
        found = [case for part in parts for case in part]
    rows: list[list[str | Text]] = []
    for joint, section in PLACES:
        own = [case for case in found if (case.joint, case.section) == (joint, section)]
        rows.append([Text(joint), Text(section), *_numbers(own)])
    show(
        f"Coverage of the known mean flexion error: {sessions} sessions with wrong joint zeros",
        [
            "joint",
            "section",
            "within U [%]",
            "mean U [deg]",
            "twice the scatter [deg]",
            "mean difference [deg]",
        ],
        rows,
        f"target: 93 to 97 % within; {time.perf_counter() - begin:.0f} s",
    )


def _numbers(own: list[Case]) -> list[str | Text]:
    difference = np.array([case.reported - case.true for case in own])
    covered = 100 * np.mean([case.covered for case in own])
    expanded = np.mean([case.expanded for case in own])
    return [
        f"{covered:.1f}",
        f"{expanded:.4f}",
        f"{2 * difference.std(ddof=1):.4f}",
        f"{difference.mean():+.4f}",
    ]


if __name__ == "__main__":
    bench_coverage(int(sys.argv[1]) if len(sys.argv) > 1 else SESSIONS)
