"""The average cycle of a joint's angle in periodic sweeps, estimated against true.

Where a cycle begins is known from the plan; estimate and truth are cut alike.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.evaluation.flexion import JointErrors
from testbench.frames import NANOSECONDS
from testbench.model.statistics.intervals import median_interval
from testbench.records.findings.catalogue import finding
from testbench.records.findings.finding import Finding
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.evaluation import ResultTables
from testbench.records.results.evaluation_rows import CycleRow
from testbench.records.session.layout import CYCLES
from testbench.records.session.plan import PlannedStep

POINTS = 101
"""Points of an average cycle: each percent from 0 to 100, as gait laboratories draw it."""
LEAST_CYCLES = 3
"""An average of fewer cycles is not made: their standard deviation would say nothing."""
WIDEST_GAP = 0.05
"""Part of a cycle that may lie between two of its samples; a cycle with a wider gap is left out."""
LEAST_ROM = np.radians(1.0)
"""A true angle with a smaller range of motion stands still [rad]."""
LEAST_REPEATED = 0.05
"""Scatter of the true cycles, as part of their range of motion, from which they are no repetitions
of one another.
"""
MOST_LATE_S = 0.5
"""How much longer than planned a sweep may last, for an arm that takes its time to come to rest
[s].
"""

Found = tuple[CycleRow, dict[str, np.ndarray]]
"""A row with its average cycle: "estimated", "true", "error" and the standard deviation of each
over the cycles, (101,).
"""


@dataclass(frozen=True)
class CutCycles:
    """The cycles of one sweep, resampled to every percent.

    Attributes:
        estimated: Estimated angle [rad], shape (cycles, 101).
        true: True angle [rad], shape (cycles, 101).
        planned: How many cycles the plan has in the judged part, those with gaps among them.
    """

    estimated: np.ndarray
    true: np.ndarray
    planned: int


def cut_cycles(
    step: PlannedStep, time_ns: np.ndarray, true: np.ndarray, error: np.ndarray
) -> CutCycles | None:
    """The whole cycles of a sweep that samples cover without a gap.

    Linear between samples; estimate and truth are taken at the same instants.

    Args:
        step: A sweep, when it happened.
        time_ns: Of the judged samples, increasing, shape (n,) [ns].
        true: True angle [rad], shape (n,).
        error: Estimated less true angle [rad], shape (n,).

    Returns:
        None for a step without planned cycles, and for one that did not last as planned.
    """
    if step.cycles is None or not lasted_as_planned(step) or len(time_ns) < 2:
        return None
    period = 1 / step.cycles.frequency_hz
    time = (time_ns - step.start_ns) / NANOSECONDS
    borders = step.cycles.first_s + period * np.arange(step.cycles.count + 1)
    borders = borders[
        : np.searchsorted(
            borders, (step.settled_ns - step.start_ns) / NANOSECONDS + 1e-6 * period, "right"
        )
    ]
    edge = min(1.5 * median_interval(time), WIDEST_GAP * period)
    whole = [
        begin
        for begin, end in itertools.pairwise(borders)
        if time[0] - edge <= begin and end <= time[-1] + edge
    ]
    covered = [
        begin for begin in whole if widest_gap(time, begin, begin + period) <= WIDEST_GAP * period
    ]
    instants = np.array(covered)[:, None] + period * np.linspace(0, 1, POINTS)
    true_cycles = np.interp(instants, time, true)
    estimated = true_cycles + np.interp(instants, time, error)
    known = np.isfinite(estimated).all(axis=1)
    return CutCycles(estimated[known], true_cycles[known], len(whole))


def lasted_as_planned(step: PlannedStep) -> bool:
    """Whether a sweep neither broke off nor was held up, so that its cycles are where planned."""
    late = (step.settled_ns - step.start_ns) / NANOSECONDS - (
        step.cycles.motion_s if step.cycles is not None else 0.0
    )
    return step.cycles is None or -1e-3 <= late <= MOST_LATE_S


def widest_gap(time: np.ndarray, begin: float, end: float) -> float:
    """The longest time from begin to end without a sample.

    Args:
        time: Of the samples, increasing, shape (n,) [s].
        begin: Of what is looked at [s].
        end: Of it [s].
    """
    inside = time[np.searchsorted(time, begin) : np.searchsorted(time, end, "right")]
    return float(np.diff(inside, prepend=begin, append=end).max())


def coefficient_of_multiple_correlation(estimated: np.ndarray, true: np.ndarray) -> float | None:
    """Similarity of two waveforms in offset, gain and shape together; 1 where they are the same.

    The inter-protocol CMC of Ferrari, Cutti & Cappello (Gait & Posture 31, 2010, 540-542), with two
    protocols and equally many frames in each cycle; it leaves out how cycles differ from one
    another, which the within-day CMC of Kadaba et al. (Journal of Orthopaedic Research 7, 1989,
    849-860) has for its subject.

    Args:
        estimated: By the sensors, shape (cycles, frames), in any unit.
        true: By the arm at the same instants, shape (cycles, frames), in the same unit.

    Returns:
        None where it is no real number: the two differ more than they move.
    """
    both = np.stack([estimated, true])
    protocols, cycles, frames = both.shape
    within = np.sum((both - both.mean(axis=0)) ** 2) / (cycles * frames * (protocols - 1))
    about = np.sum((both - both.mean(axis=(0, 2))[None, :, None]) ** 2) / (
        cycles * (protocols * frames - 1)
    )
    return float(np.sqrt(1 - within / about)) if about > within else None


def joint_cycles(errors: JointErrors) -> list[Found]:
    """Average cycles of a joint's flexion in every sweep, by every filter and definition."""
    found = []
    for step, rows in errors.steps:
        for (name, sequence), error in errors.error.items():
            cut = cut_cycles(step, errors.time_ns[rows], errors.reference[rows], error[rows])
            if cut is not None:
                found.append(_average(cut, errors.name, name, sequence, step))
    return [item for item in found if item is not None]


def chain_cycles(
    steps: list[PlannedStep], estimate: ChainEstimate, series: dict[str, np.ndarray]
) -> list[Found]:
    """Average cycles of every joint of a chain that moves, in the sweeps of its section.

    Args:
        steps: Of the session.
        estimate: The chain's.
        series: Its error signals by name, as `evaluate_chain` gives them, shape (n,) each.
    """
    judged = series["judged"]
    time = series["host_time_ns"][judged]
    found = []
    for step in steps:
        if step.section == estimate.section and step.cycles is not None:
            for joint in estimate.joints:
                error = series[f"{joint}_error_rad"][judged]
                cut = cut_cycles(step, time, series[f"{joint}_rad"][judged] - error, error)
                if cut is not None:
                    found.append(_average(cut, joint, estimate.state, None, step))
    return [item for item in found if item is not None]


def _average(
    cut: CutCycles, joint: str, name: str, sequence: str | None, step: PlannedStep
) -> Found | None:
    """The row of one joint and filter, and its average cycle.

    None for too few cycles, and where the joint stands still.
    """
    if len(cut.true) < LEAST_CYCLES or np.ptp(cut.true.mean(axis=0)) < LEAST_ROM:
        return None
    assert step.cycles is not None  # they were cut by it
    error = cut.estimated - cut.true
    average: dict[str, np.ndarray] = {}
    for key, cycles in (("estimated", cut.estimated), ("true", cut.true), ("error", error)):
        average |= {key: cycles.mean(axis=0), f"{key}_sd": cycles.std(axis=0, ddof=1)}
    rom, true_rom = (np.degrees(np.ptp(cycles, axis=1)) for cycles in (cut.estimated, cut.true))
    row = CycleRow(
        joint=joint,
        filter=name,
        sequence=sequence,
        section=step.section,
        step=step.index,
        variables=step.variables,
        frequency_hz=step.cycles.frequency_hz,
        cycles=len(cut.true),
        left_out=cut.planned - len(cut.true),
        rom_deg=float(rom.mean()),
        true_rom_deg=float(true_rom.mean()),
        rom_error_deg=float((rom - true_rom).mean()),
        rom_error_sd_deg=float((rom - true_rom).std(ddof=1)),
        mean_error_deg=float(np.degrees(error.mean())),
        rmse_deg=_rms_deg(average["error"]),
        error_sd_deg=_rms_deg(average["error_sd"]),
        true_sd_deg=_rms_deg(average["true_sd"]),
        cmc=coefficient_of_multiple_correlation(cut.estimated, cut.true),
    )
    return row, average


def _rms_deg(angles: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(angles**2))))


def cycle_tables(found: list[Found]) -> ResultTables:
    """The rows, and their average cycles as the table "cycles", which numbers them as the rows
    are.
    """
    if not found:
        return ResultTables()
    columns = {
        "row": np.repeat(np.arange(len(found)), POINTS),
        "cycle_percent": np.tile(np.arange(POINTS), len(found)),
    }
    for key in found[0][1]:
        columns[f"{key}_rad"] = np.concatenate([average[key] for _, average in found])
    return ResultTables(cycles=[row for row, _ in found], series={CYCLES: columns})


def cycle_findings(where: str, steps: Sequence[PlannedStep], found: list[Found]) -> list[Finding]:
    """What must be known of the cycles of a joint or chain, `where` as findings call it."""
    periodic = [
        (step, step.cycles)
        for step in steps
        if step.cycles is not None and step.cycles.count >= LEAST_CYCLES
    ]
    told = []
    for step, cycles in periodic:
        if not lasted_as_planned(step):
            lasted = (step.settled_ns - step.start_ns) / NANOSECONDS
            planned = cycles.motion_s
            told.append(
                finding(
                    "cycles.duration", where, step=step.name, lasted_s=lasted, planned_s=planned
                )
            )
    averaged = {row.step for row, _ in found}
    missing = [
        step for step, _ in periodic if lasted_as_planned(step) and step.index not in averaged
    ]
    if missing:
        few, of = len(missing), len(periodic)
        told.append(finding("cycles.too_few", where, missing=few, sweeps=of, least=LEAST_CYCLES))
    unlike = {
        (row.joint, row.step): row
        for row, _ in found
        if row.true_sd_deg > LEAST_REPEATED * row.true_rom_deg
    }
    for row in unlike.values():
        told.append(
            finding(
                "cycles.unlike",
                where,
                joint=row.joint,
                step=row.step,
                period_s=1 / row.frequency_hz,
                sd_deg=row.true_sd_deg,
                range_deg=row.true_rom_deg,
            )
        )
    return told
