"""The source's conclusions one by one: what our runs confirm, what they do not, and what they
cannot test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from testbench.model.misalignment import middle_angle_error
from testbench.model.statistics.spread import Change
from testbench.pipeline.analyse import Result
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.study import StudyRow, StudyTable
from testbench.studies.elbow.calibration import Calibrated, one_pose, spread_ratio
from testbench.studies.elbow.flexion import flexion_errors
from testbench.studies.parts import number_with, told_over

Verdict = Literal["confirmed", "not confirmed", "cannot be tested here"]
HEADLINE_MG = 27.0
"""Below which the source says every bias lies after calibration [mg]."""
UNCHANGED = 0.02
"""A standard deviation that changes by less counts as unchanged."""
SAME_DEG = 1e-3
LINEAR_AT_DEG = 20.0
FLEXIONS_DEG = np.arange(0.0, 71.0, 5.0)


@dataclass(frozen=True)
class Evidence:
    """What the conclusions are held against, part by part.

    Attributes:
        tables: Of elbow_tables.
        untuned: Of the same sessions, imufilter with MATLAB's defaults.
        calibrated: Sensors and methods.
    """

    tables: Sequence[Result]
    untuned: Sequence[Result]
    calibrated: Sequence[list[Calibrated]]

    def errors(self, name: str, sequence: str = "ZXZ", untuned: bool = False) -> np.ndarray:
        """Mean |error| of the DOT's flexion, shape (parts, flexions) [deg]."""
        results = self.untuned if untuned else self.tables
        found = [flexion_errors(result.evaluation, "elbow", name, sequence) for result in results]
        return np.array([[errors[f] for f in sorted(errors)] for errors in found])

    def spreads(self, name: str) -> np.ndarray:
        """Standard deviation within each pose, ZXZ, shape (parts, flexions) [deg]."""
        return np.array([_spreads(result.evaluation, name) for result in self.tables])


def _spreads(evaluation: Evaluation, name: str) -> list[float]:
    return [
        max(row.flexion_sd_deg, 1e-9)
        for row in evaluation.joint_angle
        if (row.joint, row.filter, row.sequence) == ("elbow", name, "ZXZ")
        and row.flexion_deg is not None
    ]


def conclusions_table(evidence: Evidence) -> StudyTable:
    """Each conclusion with a verdict, and the run that it rests on."""
    rows = [
        _worst_filter(evidence),
        _triad(evidence),
        _noisier(evidence),
        _headline(evidence),
        _unchanged(evidence),
        _row(
            "Misaligned about X the error grows with the square of the misalignment and with the "
            "flexion; about Y it is the misalignment; about Z there is none",
            "confirmed",
            "theory recomputed, to the digits printed",
            "fits",
        ),
        _linear(),
        _row(
            "The misalignment shows in the third angle by quaternion difference, in the first by "
            "TRIAD",
            "not confirmed",
            "by eq. 2.5 in the first of both; in the third by the order of the annexed program",
            "carried",
        ),
        _row(
            "The vendor's filter on the DOT is the most exact of all that were tried",
            "cannot be tested here",
            "ours is an error model that was made to stay below table 5.6",
            "flexion",
        ),
    ]
    return StudyTable(
        "conclusions",
        "The source's conclusions, one by one",
        ("verdict", "ours", "shown by the table"),
        tuple(rows),
        "How to read: confirmed and not confirmed are what simulated sensors on a simulated arm "
        "say, over all parts and motions; a difference that their 95 % intervals do not show "
        "confirms nothing.",
        short="Conclusions",
    )


def _row(conclusion: str, verdict: Verdict, ours: str, run: str) -> StudyRow:
    return StudyRow(conclusion, (verdict, ours, run))


def _shown(first: np.ndarray, second: np.ndarray) -> str:
    """Which is larger over parts and over motions alike: "more", "less" or "not shown"."""
    over = {
        Change.of(np.median(first, axis=axis), np.median(second, axis=axis)).verdict
        for axis in (0, 1)
    }
    return over.pop() if len(over) == 1 else "not shown"


def _worst_filter(evidence: Evidence) -> StudyRow:
    """MATLAB's imufilter with its defaults against ecompass, both by ZXZ."""
    own = np.maximum(evidence.errors("imufilter", untuned=True), 1e-9)
    other = np.maximum(evidence.errors("ecompass"), 1e-9)
    verdict: Verdict = "confirmed" if _shown(own, other) == "more" else "not confirmed"
    return _row(
        "Of the filters imufilter has the largest error",
        verdict,
        f"with MATLAB's defaults {number_with(own.mean(axis=1))} deg, ecompass "
        f"{number_with(other.mean(axis=1))} deg; the first against the other: "
        f"{told_over(own, other)}",
        "flexion",
    )


def _triad(evidence: Evidence) -> StudyRow:
    first, second = evidence.errors("triad", "ZYZ"), evidence.errors("ecompass", "ZYZ")
    apart = float(np.abs(first - second).max())
    same = apart < SAME_DEG
    return _row(
        "TRIAD is better than ecompass (tables 5.9 and 5.8)",
        "cannot be tested here" if same else "not confirmed",
        f"both take the same two vectors and differ by {apart:.1g} deg at most: what differed in "
        "the source was not the method",
        "flexion",
    )


def _noisier(evidence: Evidence) -> StudyRow:
    """Ecompass against imufilter: the standard deviation within a pose."""
    first, second = evidence.spreads("ecompass"), evidence.spreads("imufilter")
    verdict: Verdict = "confirmed" if _shown(first, second) == "more" else "not confirmed"
    return _row(
        "ecompass and TRIAD are noisier than the other filters",
        verdict,
        f"within a pose {number_with(first.mean(axis=1))} deg (ecompass), "
        f"{number_with(second.mean(axis=1))} deg (imufilter); {told_over(first, second)}",
        "steadiness",
    )


def _headline(evidence: Evidence) -> StudyRow:
    worst = [
        max(float(one_pose(each)[6] or 0.0) for each in found if each.settings == "published")
        for found in evidence.calibrated
    ]
    below = max(worst) < HEADLINE_MG
    several = len(worst) > 1
    verdict: Verdict = "confirmed" if below and several else "not confirmed"
    return _row(
        f"After calibration every bias is below {HEADLINE_MG:g} mg",
        verdict,
        f"by the source's definition the largest of a part is {number_with(worst)} mg, "
        f"{max(worst):.1f} mg at most",
        "calibration",
    )


def _unchanged(evidence: Evidence) -> StudyRow:
    ratios = np.array([[spread_ratio(each) for each in found] for found in evidence.calibrated])
    most = float(np.abs(ratios - 1).max())
    verdict: Verdict = "confirmed" if most < UNCHANGED else "not confirmed"
    return _row(
        "Calibration leaves the standard deviation as it is",
        verdict,
        f"it changes by {100 * most:.1f} % at most, by any method and sensor",
        "calibration",
    )


def _linear() -> StudyRow:
    """Eq. 5.16: |e| about linear in the flexion."""
    error = np.degrees(
        np.abs(
            middle_angle_error(
                np.radians(FLEXIONS_DEG),
                np.full(len(FLEXIONS_DEG), np.radians(LINEAR_AT_DEG)),
            )
        )
    )
    line = np.polynomial.Polynomial.fit(FLEXIONS_DEG, error, 1)(FLEXIONS_DEG)
    left = float(np.sqrt(np.mean((line - error) ** 2)))
    return _row(
        "The error is about linear in the flexion (eq. 5.16)",
        "not confirmed",
        f"misaligned by {LINEAR_AT_DEG:g} deg a straight line leaves {left:.2f} deg RMS of up to "
        f"{error.max():.2f} deg, and {float(np.abs(line - error).max()):.2f} deg at most",
        "growth",
    )
