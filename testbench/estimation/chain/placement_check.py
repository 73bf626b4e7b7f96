"""Whether the chain filter is lost, told without any truth.

A filter whose sensors sit elsewhere than it believes makes innovations that an error of placement
explains. What it would take to explain them, and how far the joints' angles would move by it, is
known after every run (`effect.PlacementEffect`): a filter that is right finds a few hundredths of a
degree, however its process noise was chosen. The mean of the normalised innovations does not serve:
process noise that rises with them keeps it near one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from testbench.estimation.chain.placement import Constants
from testbench.estimation.chain.prefit import PlacementFit, most_probable
from testbench.estimation.chain.run import ChainMotion
from testbench.estimation.chain.sensors import ChainSensors
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.chain import ChainFacts

DOUBT_ROTATION_SD, DOUBT_POSITION_SD = np.radians(5.0), 0.02
"""How far sensors on skin may sit from where they are said to, a standard deviation an axis, where
nothing is stated [rad], [m].
"""
LOST_DEG = 1.8
"""Angles that the readings hold to be further off than this are lost, RMS over the section [deg].
It lies between what the campaign of docs/validation.md found, with equal factors to both: at most
1.5 of filters whose worst joint is good to 1 deg, at least 2.2 of those 5 deg off.
"""
LEAST_EVIDENCE = 9.0
"""Improvement of the innovations' chi-square for each constant below which nothing is said [1]:
three standard deviations.
"""


@dataclass(frozen=True)
class PlacementCheck:
    """What the innovations hold of the placement that a run was made with.

    Attributes:
        evidence: Improvement of their chi-square by the placement they would have, for each
            constant [1].
        off: How far each joint's angle would move by it, RMS over the samples, shape (m,) [rad].
        settled: Whether the placement was stated, or a fit of it settled.
    """

    evidence: float
    off: np.ndarray
    settled: bool = True

    @property
    def lost(self) -> bool:
        """Whether the angles are not to be believed."""
        within = self.evidence <= LEAST_EVIDENCE or bool(np.degrees(self.off.max()) <= LOST_DEG)
        return not (within and self.settled)  # of a filter that went to infinity too

    def facts(self, joints: list[str]) -> dict[str, Any]:
        """As they stand in estimate.json."""
        worst = int(np.argmax(self.off))
        return {
            "lost": self.lost,
            "placement_evidence": self.evidence,
            "placement_off_deg": float(np.degrees(self.off[worst])),
            "placement_off_joint": joints[worst],
        }


def doubted(sensors: ChainSensors) -> Constants:
    """Constants to check a placement by that nobody doubted."""
    return Constants.of(sensors, float(DOUBT_ROTATION_SD), DOUBT_POSITION_SD)


def check_placement(
    motion: ChainMotion, constants: Constants, settled: bool = True
) -> PlacementCheck:
    """Check the placement of a run.

    Args:
        motion: With the effect of the constants.
        constants: With the prior of their distance from what the run was made with.
        settled: Whether the placement was stated, or a fit of it settled.
    """
    effect = motion.effect
    step, _ = most_probable(effect, constants, np.zeros(len(constants.sd)))
    swing = np.einsum("p,jpq,q->j", step, effect.swing, step) / max(len(motion.time), 1)
    evidence = float(step @ effect.score) / len(step)
    return PlacementCheck(evidence, np.sqrt(np.maximum(swing, 0.0)), settled)


def placement_findings(
    estimate: ChainFacts, check: PlacementCheck, fit: PlacementFit | None
) -> list[Finding]:
    """What is to be said of the placement of one estimate."""
    section = f"chain, section {estimate.section}"  # its states share the fit
    where = f"{section}, {estimate.state}"
    told = []
    if fit is not None and not fit.settled:
        told.append(finding("chain.placement_unsettled", section))
    elif check.lost:
        told.append(
            finding(
                "chain.lost" if fit is None else "chain.lost_though_fitted",
                where,
                joint=estimate.facts["placement_off_joint"],
                off_deg=estimate.facts["placement_off_deg"],
            )
        )
    if fit is not None and fit.held:
        told.append(finding("chain.placement_held", section, held=fit.held))
    return told
