"""Errors of the arm's joints by the chain filter against what the arm measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbench.evaluation.budgets import ChainTruth, TrueArm, chain_budget
from testbench.evaluation.cycles import Found, chain_cycles, cycle_findings
from testbench.evaluation.metrics import rms, summarise
from testbench.frames import NANOSECONDS
from testbench.model.joint_motion import joint_acceleration
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding, told_once
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import ChainRow, ResultTables
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import Session

LEAST_ANGLE = np.radians(1.0)
"""Errors are not divided by angles smaller than this [rad]."""
STANDS_STILL = np.radians(0.01)
"""A joint whose angle varies less than this (standard deviation) has no correlation [rad]."""
COVERAGE_FACTOR = 1.96
"""Of 95 % of a normal distribution (JCGM 100, 6.3.3)."""

LEAST_COVERED_PERCENT = 80.0
"""Stated uncertainties that cover fewer of the errors than this are remarked on; 95 is honest."""


def judge_chain(session: Session, estimate: Estimate) -> tuple[ResultTables, list[Found]]:
    """Rows, error signals, budgets and findings of every section and state, and their average
    cycles.
    """
    arm = TrueArm.of(session) if estimate.chain else None
    recorded = arm.samples if arm is not None else None
    result, found, stated = ResultTables(), list[Found](), set[tuple[str, str | None]]()
    for one in estimate.chain:
        where = f"chain, section {one.section}, {one.state}"
        if recorded is None:
            result.findings.append(finding("chain.no_true_angles", where))
            continue
        rows, series = evaluate_chain(session, one, recorded)
        result.series[one.key] = series
        cycles = chain_cycles(session.steps, one, series)
        found += cycles
        own = [step for step in session.steps if step.section == one.section]
        # the states share their truth, and what is said of it
        told = cycle_findings(f"chain, section {one.section}", own, cycles)
        result.findings[:] = told_once([*result.findings, *told])
        if not rows:
            result.findings.append(finding("chain.no_sample", where))
        for row in rows:
            true = ChainTruth(_true_angle(recorded, row.joint, one), series["judged"])
            budget = chain_budget(session, estimate, one, row.joint, true, arm)
            place = (budget.owner, budget.section)
            if place not in stated:  # the states share their truth, but for the last digits
                stated.add(place)
                result.uncertainty.append(budget)
            known = replace(row, expanded_uncertainty_deg=budget.expanded_deg)
            result.chain.append(
                replace(known, expanded_uncertainty_magnitude_deg=budget.expanded_magnitude_deg)
            )
        result.findings.extend(_coverage(where, rows))
    return result, found


def _true_angle(arm: ArmSamples, joint: str, estimate: ChainEstimate) -> np.ndarray:
    """The measured angle of a joint at a chain's instants, shape (n,) [rad]; NaN where there is
    none. Of two states it is the same to the last bit, which estimate less error is not.
    """
    angle = arm.q_measured[:, arm.joint_names.index(joint)]
    return np.asarray(
        np.interp(estimate.host_time_ns, arm.host_time_ns, angle, left=np.nan, right=np.nan)
    )


def _coverage(where: str, rows: list[ChainRow]) -> list[Finding]:
    """Whether the uncertainties that a state states cover its errors."""
    low = [row for row in rows if row.covered_percent < LEAST_COVERED_PERCENT]
    if not low:
        return []
    worst = min(low, key=lambda row: row.covered_percent)
    return [
        finding(
            "chain.overconfident",
            where,
            low=len(low),
            joints=len(rows),
            covered_percent=worst.covered_percent,
            worst=worst.joint,
        )
    ]


def evaluate_chain(
    session: Session, estimate: ChainEstimate, arm: ArmSamples
) -> tuple[list[ChainRow], dict[str, np.ndarray]]:
    """Rows and error signals of one section by one state.

    The truth is the arm's measured joints at the estimate's instants, by linear interpolation.
    """
    time = estimate.host_time_ns
    columns = [arm.joint_names.index(name) for name in estimate.joints]
    true = np.empty_like(estimate.mean)
    for order, array in enumerate((arm.q_measured, arm.v_measured, joint_acceleration(arm))):
        for i, column in enumerate(columns):
            true[:, order, i] = np.interp(
                time, arm.host_time_ns, array[:, column], left=np.nan, right=np.nan
            )
    error = estimate.mean - true
    judged = _judged(session, estimate.section, time) & np.isfinite(error).all(axis=(1, 2))
    series = {"host_time_ns": time, "judged": judged}
    rows = []
    for i, joint in enumerate(estimate.joints):
        series[f"{joint}_rad"] = estimate.mean[:, 0, i]
        series[f"{joint}_error_rad"] = error[:, 0, i]
        series[f"{joint}_sd_rad"] = estimate.sd[:, 0, i]
        if judged.any():
            rows.append(
                _row(
                    estimate,
                    joint,
                    true[judged, 0, i],
                    error[judged, :, i],
                    estimate.sd[judged, 0, i],
                )
            )
    return rows, series


def _judged(session: Session, section: str, time: np.ndarray) -> np.ndarray:
    """Samples of the section's steps, moves and sweeps alike, less what the protocol leaves out at
    either end, shape (n,).
    """
    chain = session.analysis.estimate.chain
    left_out = round(NANOSECONDS * (chain.settling_s if chain is not None else 0.0))
    judged = np.zeros(len(time), dtype=bool)
    for step in session.steps:
        if step.section == section:
            end = step.settled_ns if step.kind == "sweep" else step.end_ns
            judged |= (time >= step.start_ns + left_out) & (time <= end - left_out)
    return judged


def _row(
    estimate: ChainEstimate, joint: str, true: np.ndarray, error: np.ndarray, sd: np.ndarray
) -> ChainRow:
    degrees = np.degrees(error[:, 0])
    summary = summarise(degrees)
    low, median, high = np.percentile(degrees, [25, 50, 75])
    reach = 1.5 * (high - low)
    order = np.argsort(np.abs(degrees))
    sized = np.abs(true) >= LEAST_ANGLE
    moves = true.std() > STANDS_STILL
    normalised = error[:, 0] / sd
    return ChainRow(
        section=estimate.section,
        state=estimate.state,
        joint=joint,
        n=summary.n,
        mean_error_deg=summary.mean,
        median_error_deg=float(median),
        mean_abs_error_deg=summary.mean_abs,
        rmse_deg=summary.rmse,
        iqr_deg=float(high - low),
        outliers_percent=float(100 * ((degrees > high + reach) | (degrees < low - reach)).mean()),
        largest_error_deg=float(degrees[order[-1]]),
        smallest_error_deg=float(degrees[order[0]]),
        relative_percent=float(100 * np.mean(np.abs(error[sized, 0] / true[sized])))
        if sized.any()
        else None,
        correlation=float(np.corrcoef(true, true + error[:, 0])[0, 1]) if moves else None,
        rate_rmse_deg_s=float(np.degrees(rms(error[:, 1]))),
        acceleration_rmse_deg_s2=float(np.degrees(rms(error[:, 2]))),
        uncertainty_deg=float(np.degrees(rms(sd))),
        normalised_error=rms(normalised),
        covered_percent=float(100 * (np.abs(normalised) <= COVERAGE_FACTOR).mean()),
    )
