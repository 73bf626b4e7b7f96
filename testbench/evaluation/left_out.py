"""What was planned to be judged and was not, in sentences with counts and reasons."""

from __future__ import annotations

from collections import Counter

import numpy as np

from testbench.evaluation.judged import window_rows
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.session.plan import PlannedStep

FEW = 0.5
"""Where less than this of the samples counts of those steps that count at all, that is said."""
NO_SAMPLES, MOVING, NO_TRUTH, FLAGGED = (
    "there are no samples in {}",
    "the sensors were not at rest in {}",
    "the truth is not known in {}",
    "the samples of {} are flagged",
)


def left_out(
    subject: str,
    steps: list[PlannedStep],
    time_ns: np.ndarray,
    static: np.ndarray,
    known: np.ndarray,
    sound: np.ndarray,
) -> list[Finding]:
    """One finding for each section of which steps, or most samples, do not count.

    Args:
        subject: Sensor or joint, as findings call it.
        steps: Those to be judged.
        time_ns: Of the samples, increasing, shape (n,) [ns].
        static: Where the sensors are at rest, shape (n,), bool.
        known: Where the truth is known, shape (n,), bool.
        sound: Where no sample is flagged, shape (n,), bool.
    """
    sections: dict[str, list[PlannedStep]] = {}
    for step in steps:
        sections.setdefault(step.section, []).append(step)
    found = []
    for section, own in sections.items():
        where = f"{subject}, section {section}"
        lost: list[PlannedStep] = []
        steps_by, samples_by = Counter[str](), Counter[str]()
        planned = counted = 0
        for step, *span in zip(own, *window_rows(own, time_ns, "right"), strict=True):
            rows = slice(*span)
            rest = static[rows] | (step.kind == "sweep")
            judged = rest & known[rows] & sound[rows]
            reasons = Counter({MOVING: int((~rest).sum())})
            reasons[NO_TRUTH] = int((rest & ~known[rows]).sum())
            reasons[FLAGGED] = int((rest & known[rows] & ~sound[rows]).sum())
            if judged.any():
                planned, counted = planned + len(rest), counted + int(judged.sum())
                samples_by += reasons
            else:
                lost.append(step)
                steps_by[reasons.most_common(1)[0][0] if len(rest) else NO_SAMPLES] += 1
        if lost:
            found.append(
                finding(
                    "judged.steps_left_out",
                    where,
                    lost=len(lost),
                    planned=len(own),
                    kind=_kind(own),
                    reasons=_reasons(steps_by),
                )
            )
        if counted < FEW * planned:
            code = "judged.few_samples_of_others" if lost else "judged.few_samples"
            why = _reasons(samples_by)
            found.append(finding(code, where, judged=counted, planned=planned, reasons=why))
    return found


def _kind(steps: list[PlannedStep]) -> str:
    sweeps = sum(step.kind == "sweep" for step in steps)
    return "steps" if 0 < sweeps < len(steps) else "sweeps" if sweeps else "poses"


def _reasons(counts: Counter[str]) -> str:
    """Reasons, the most frequent first, each with its count where there are several."""
    found = [(reason, count) for reason, count in counts.most_common() if count]
    return ", ".join(reason.format(count if len(found) > 1 else "them") for reason, count in found)
