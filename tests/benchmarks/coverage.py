"""Whether the stated expanded uncertainty covers the known truth."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.evaluation.arms_of_a_session import LAWS, Drawn, judged_arms
from tests.system.known_truth import PLACES, Case, cases, of_one_session

COUNT = 200
ARMS = 10
"""Arms drawn by forward kinematics for each whole session."""
LOW, HIGH = 93, 98
STATED, EDGE = "as stated", "delays at the edge"
COVERED = {STATED, EDGE, "as stated, to 25 %"}
"""Laws by which the truth must lie within U as often as it says; by others it is seen how often."""


def bench_coverage(count: int = COUNT) -> bool:
    """Draw ten arms for each of some sessions by forward kinematics, and simulate whole sessions
    with seeds from 0; print how often the truth lies within the reported mean error and its U.

    Args:
        count: Of whole sessions.

    Returns:
        Whether that is 93 to 98 % everywhere, of errors that are as the robot file states.
    """
    kept = _bench_arms(ARMS * count)
    found = [Case(**case) for session in resumed("coverage", count, _sessions) for case in session]
    rows: list[list[str | Text]] = []
    shares = []
    for joint, section in PLACES:
        own = [case for case in found if (case.joint, case.section) == (joint, section)]
        shares.append(100 * float(np.mean([case.covered for case in own])))
        rows.append([Text(joint), Text(section), f"{shares[-1]:.1f}", *_numbers(own)])
    show(
        f"Coverage of the known mean flexion error: {count} sessions with wrong zeros and links",
        [
            "joint",
            "section",
            "within U [%]",
            "mean U [deg]",
            "sd of the difference [deg]",
            "mean u [deg]",
            "mean difference [deg]",
        ],
        rows,
        f"target: {LOW} to {HIGH} % within, by what {count} sessions can tell",
    )
    slack = _slack(count)  # 200 sessions show a share of 95 % to 4.6 %
    return kept and all(LOW - slack <= share <= HIGH + slack for share in shares)


def _bench_arms(count: int) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        found = judged_arms(of_one_session(folder), count, [law for law in LAWS if law != EDGE])
        late = judged_arms(of_one_session(folder, False), count, [STATED, EDGE])
    unstated = [own for own in late if own.section == "sweep"]
    rows = [_row(own) for own in found] + [_row(own, ", delay unstated") for own in unstated]
    show(
        f"Coverage by forward kinematics: {count} arms, zeros, twists, lengths and times drawn",
        [
            "joint",
            "section",
            "drawn",
            "within U [%]",
            "magnitudes [%]",
            "U [deg]",
            "U of magnitudes [deg]",
            "k",
        ],
        rows,
        f"target: {LOW} to {HIGH} % within, of what is drawn as stated; {LOW} at least, by what "
        "the count can tell, of numbers that are known to 25 % and of delays at the edge",
    )
    slack = _slack(count)
    return all(
        min(own.percent, own.percent_of_magnitudes) >= LOW - (0 if own.law == STATED else slack)
        and (own.law != STATED or own.percent <= HIGH)
        for own in found + unstated
        if own.law in COVERED
    )


def _slack(count: int) -> float:
    """Three standard deviations of a share of 95 % that is counted in so many [%]."""
    return float(300 * np.sqrt(0.95 * 0.05 / count))


def _row(own: Drawn, how: str = "") -> list[str | Text]:
    numbers = [
        f"{own.percent:.1f}",
        f"{own.percent_of_magnitudes:.1f}",
        f"{own.expanded:.4f}",
        f"{own.expanded_of_magnitudes:.4f}",
    ]
    return [Text(own.joint), Text(own.section), Text(own.law + how), *numbers, f"{own.k:.2f}"]


def _sessions(seeds: range) -> Iterator[list[dict[str, Any]]]:
    """The cases of one session after the other."""
    for seed in seeds:
        yield [asdict(case) for case in cases([seed])]


def _numbers(own: list[Case]) -> list[str]:
    difference = np.array([case.reported - case.true for case in own])
    expanded, combined = (
        np.mean([getattr(case, name) for case in own]) for name in ("expanded", "combined")
    )
    return [
        f"{expanded:.4f}",
        f"{difference.std(ddof=1):.4f}",
        f"{combined:.4f}",
        f"{difference.mean():+.4f}",
    ]


if __name__ == "__main__":
    sys.exit(not bench_coverage(count_of(COUNT, __doc__)))
