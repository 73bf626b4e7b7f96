"""What `testbench compare` claims: of two sessions of one part that differ in nothing, of two
parts, and of errors that are larger by twice the margin.

Every session is a whole run of a short protocol, simulated, estimated and evaluated. A part is
recorded seven times, which is 21 pairs, and another part once, which is seven pairs of two parts.
The last question is asked of the same pairs: with c added to the magnitude of every error of one
session its difference is larger by c and scatters as before.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from testbench import evaluate, execute, plan
from testbench.estimation import estimate
from testbench.evaluation.paired_errors import Judged
from testbench.evaluation.ranking import SIGNIFICANCE, holm
from testbench.evaluation.session_differences import Side, compare_metrics, p_values
from testbench.records.results.answer import headline_metrics
from testbench.records.results.session_comparison import Told
from testbench.records.session.parts import part_of
from testbench.records.session.plan import Plan
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show

COUNT, OF_TWO_PARTS = 1000, 200
"""Pairs of one part, and of two parts."""
SESSIONS = 7
"""Of each part."""
PAIRS = SESSIONS * (SESSIONS - 1) // 2
LEAST_ALARMS, MOST_ALARMS = 0.02, 0.07
LEAST_FOUND = 0.95
ERRORS = 4.0
"""The margin, in standard errors."""
ANOTHER = 100_000
"""Numbers of second parts begin so much later."""
PROTOCOL: dict[str, Any] = {
    "name": "compared",
    "purpose": "Flexion of an elbow in poses and sweeps, short enough to be run by the thousand",
    "robot": "ur3e",
    "sensors": {
        "arm": {
            "preset": "xsens_dot",
            "link": "wrist_1_link",
            "segment": {"name": "upper_arm", "rotation_deg": {"XYZ": [90, 0, 0]}},
            "mounting": {"rotation_deg": {"XYZ": [90, 0, 0]}, "position_mm": [0, 45, 0]},
        },
        "forearm": {
            "preset": "xsens_dot",
            "link": "wrist_3_link",
            "segment": {"name": "forearm", "rotation_deg": {"XYZ": [90, 0, 0]}},
            "mounting": {"rotation_deg": {"XYZ": [90, 90, 0]}, "position_mm": [0, 0, 10]},
        },
    },
    "joints": {
        "elbow": {
            "proximal": "arm",
            "distal": "forearm",
            "sequence": "ZXZ",
            "flexion": "second",
            "reference_joint": "wrist_3_joint",
        }
    },
    "variables": {
        "misalignment_deg": [0, 20],
        "flexion_deg": {"start": 0, "stop": 70, "step": 5},
    },
    "sections": [
        {
            "name": "reference",
            "role": "reference",
            "steps": [{"move_to_deg": [180, -90, -90, 0, 90, 0], "dwell_s": 12}],
        },
        {
            "name": "static",
            "for_each": ["misalignment_deg", "flexion_deg"],
            "steps": [
                {
                    "move_to_deg": [
                        *("180 + misalignment_deg", -90, -90, 0),
                        *("90 - misalignment_deg", "flexion_deg"),
                    ],
                    "dwell_s": 1.5,
                }
            ],
        },
        {
            "name": "centre",
            "role": "reference",
            "steps": [{"move_to_deg": [180, -90, -90, 0, 90, 30], "dwell_s": 0.5}],
        },
        {
            "name": "sweep",
            "steps": [
                {
                    "sweep": {
                        "wrist_3_joint": {
                            "sine": {"amplitude_deg": 25, "frequency_hz": 0.4, "cycles": 16}
                        }
                    },
                    "dwell_s": 0.5,
                }
            ],
        },
    ],
    "estimate": {"filters": ["vqf_6d", "madgwick_imu"], "align": "reference_pose"},
}


@cache
def planned(part: int) -> Plan:
    """The protocol with both sensors of one part."""
    spec = PROTOCOL | {
        "sensors": {name: own | {"part": part} for name, own in PROTOCOL["sensors"].items()}
    }
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "compared.yaml"
        file.write_text(yaml.safe_dump(spec), encoding="utf-8")
        return plan(file)


def judged(part: int, seed: int, folder: Path) -> Judged:
    """One session, run, estimated and evaluated."""
    session = execute(planned(part), folder, seed=seed)
    return Judged(session, evaluate(session, estimate(session)))


def side(sessions: list[Judged]) -> Side:
    """Of a comparison."""
    return Side(sessions, [part_of(one.session) for one in sessions])


def compared(base: Side, new: Side) -> list[dict[str, Any]]:
    """What a comparison without a margin tells of each metric."""
    metrics = headline_metrics(base.judged[0].evaluation)
    return [
        {
            "filter": own.filter,
            "section": own.section,
            "told": own.told,
            "difference": own.difference,
            "error": own.standard_error,
            "freedom": own.freedom,
            "ci95": own.ci95,
        }
        for own in compare_metrics(base, new, metrics, 0.0, False)
    ]


def pairs_of(numbers: range) -> Iterator[dict[str, list[list[dict[str, Any]]]]]:
    """Of each number the pairs of one part, and those of that and another part."""
    for number in numbers:
        with tempfile.TemporaryDirectory() as name:
            seeds = range((SESSIONS + 1) * number, (SESSIONS + 1) * (number + 1))
            parts = [number] * SESSIONS + [number + ANOTHER]
            *own, other = (
                side([judged(part, seed, Path(name) / str(seed))])
                for part, seed in zip(parts, seeds, strict=True)
            )
            yield {
                "same": [compared(*pair) for pair in combinations(own, 2)],
                "two": [compared(one, other) for one in own],
            }
        planned.cache_clear()


def alarms(found: list[list[dict[str, Any]]]) -> float:
    """Share of comparisons in which any metric is told to differ."""
    return float(np.mean([any(own["told"] in SHOWN for own in rows) for rows in found]))


SHOWN = {Told.WORSE, Told.BETTER}


def found_share(found: list[list[dict[str, Any]]], filters: set[str]) -> dict[str, float]:
    """How often a difference of twice the margin is told of a metric that alone has it, the margin
    being four standard errors as they are stated.

    Args:
        found: Pairs without a difference.
        filters: Whose metrics are compared.
    """
    told: dict[str, list[bool]] = {}
    for rows in found:
        family = [own for own in rows if own["filter"] in filters and own["ci95"] is not None]
        for place in range(len(family)):
            name = f"{family[place]['filter']}, {family[place]['section']}"
            told.setdefault(name, []).append(_is_found(family, place))
    return {name: float(np.mean(own)) for name, own in told.items()}


def _is_found(family: list[dict[str, Any]], place: int) -> bool:
    margin = ERRORS * family[place]["error"]
    tests = [
        p_values(
            own["difference"] + 2 * margin * (i == place),
            own["error"],
            own["freedom"],
            (margin, margin),
        )
        for i, own in enumerate(family)
    ]
    adjusted = holm([none for none, _ in tests])
    return max(adjusted[place], tests[place][1]) < SIGNIFICANCE


def coverage(found: list[list[dict[str, Any]]]) -> tuple[float, float]:
    """How often an interval is given, and how often it holds no difference then."""
    given = [own["ci95"] for rows in found for own in rows]
    known = [ends for ends in given if ends is not None]
    inside = [ends[0] <= 0 <= ends[1] for ends in known]
    return len(known) / len(given), float(np.mean(inside))


def bench_comparisons(count: int = COUNT) -> bool:
    """Print what is told of pairs without a difference, of two parts, and of twice the margin;
    whether all bars are kept.
    """
    parts = -(-count // PAIRS)
    drawn = resumed("compared", parts, pairs_of)
    same = [rows for one in drawn for rows in one["same"]]
    apart = [rows for one in drawn for rows in one["two"]]
    alarm, (given, covered) = alarms(same), coverage(same)
    regressions = sum(own["told"] in SHOWN for rows in apart for own in rows)
    filters = sorted({str(own["filter"]) for own in same[0]})
    every = found_share(same, set(filters))
    rows: list[list[str | Text]] = [
        [Text("false alarms of one part"), f"{100 * alarm:.1f} %", Text("2 to 7 %")],
        [Text("intervals given"), f"{100 * given:.0f} %", Text("-")],
        [Text("of these hold no difference"), f"{100 * covered:.1f} %", Text("-")],
        [Text("two parts told as one's change"), f"{regressions} of {len(apart)}", Text("0")],
        *(
            [Text(f"twice the margin found: {name}"), f"{100 * share:.1f} %", Text("95 % at least")]
            for name, share in every.items()
        ),
    ]
    show(
        f"Comparisons of sessions: {len(same)} pairs of {parts} parts, {len(apart)} of two parts",
        ["what", "measured", "bar"],
        rows,
        "whole runs of 2 minutes of robot time, 7 of each part; twice the margin of four stated "
        "standard errors is put into one metric of the same pairs",
    )
    enough = min(every.values()) >= LEAST_FOUND
    return LEAST_ALARMS <= alarm <= MOST_ALARMS and not regressions and enough


if __name__ == "__main__":
    sys.exit(not bench_comparisons(count_of(COUNT, __doc__)))
