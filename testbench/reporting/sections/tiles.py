"""The numbers at the top of the report. A filter is called best only where the ranking shows it to
differ from the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from testbench.records.results.evaluation import Evaluation, Metric
from testbench.records.results.evaluation_rows import RankRow
from testbench.reporting.page.page import Tile
from testbench.reporting.page.tables import digits
from testbench.reporting.sections.chain import chain_tiles

CRITERION = "RMS total error"
"""What tiles rank by: all of a rotation's error. The mean error of one angle can be small because
two errors cancel in it.
"""


def result_tiles(evaluation: Evaluation | None, sequences: Mapping[str, str]) -> list[Tile]:
    """The result of each joint by section, in its own Euler sequence, and of each sensor.

    Args:
        evaluation: Of the session.
        sequences: Label of each joint's own definition.
    """
    if evaluation is None:
        return []
    found: list[Tile] = []
    for joint in dict.fromkeys(row.joint for row in evaluation.joint_angle):
        own = [
            m
            for m in evaluation.metrics
            if m.name == f"{joint}.flexion_mean_abs_error_deg"
            and m.value is not None
            and m.sequence == sequences.get(joint)
        ]
        for section in dict.fromkeys(metric.section for metric in own):
            found.append(
                _joint_tile(
                    evaluation,
                    joint,
                    section,
                    [metric for metric in own if metric.section == section],
                )
            )
    found += chain_tiles(evaluation)
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        rows = [row for row in evaluation.orientation if row.sensor == sensor]
        leaders = _leaders(evaluation, sensor, None, [row.filter for row in rows])
        shown = _span([row.total_rmse_deg for row in rows if row.filter in leaders.filters])
        upright = [
            row.inclination_rmse_deg for row in rows if math.isfinite(row.inclination_rmse_deg)
        ]
        alone = f"; inclination alone, all filters: {_span(upright)} deg" if upright else ""
        detail = f"{leaders.said}{alone}"
        found.append(Tile(shown, "deg", f"RMS orientation error, {sensor}", detail))
    return found


def _joint_tile(
    evaluation: Evaluation, joint: str, section: str | None, metrics: list[Metric]
) -> Tile:
    """Mean |flexion error| of the filters that lead by the total error."""
    leaders = _leaders(evaluation, joint, section, [metric.filter or "" for metric in metrics])
    leading = [metric for metric in metrics if metric.filter in leaders.filters]
    bounds = [
        metric.expanded_uncertainty for metric in leading if metric.expanded_uncertainty is not None
    ]
    truth = f" (truth ± {digits(max(bounds), 2)} deg)" if bounds else ""
    shown = _span([metric.value or 0.0 for metric in leading])
    detail = f"{leaders.said}; {metrics[0].sequence}{truth}"
    others = [metric for metric in metrics if metric not in leading]
    if others:
        detail += f"; the others: {_span([metric.value or 0.0 for metric in others])} deg"
    return Tile(shown, "deg", f"mean |flexion error|, {joint}, {section}", detail)


@dataclass(frozen=True)
class _Leaders:
    """Filters of which none was shown to be worse than the best, and a sentence that says so."""

    filters: list[str]
    said: str


def _leaders(
    evaluation: Evaluation, owner: str, section: str | None, filters: list[str]
) -> _Leaders:
    """Those of a joint's section or of a sensor."""
    if len(filters) < 2:
        return _Leaders(filters, ", ".join(filters))
    ranked = [
        row
        for row in evaluation.ranking
        if (row.owner, row.section, row.sequence, row.criterion)
        == (owner, section, None, CRITERION)
        and row.filter in filters
    ]
    if len(ranked) < 2:
        return _Leaders(filters, f"{len(filters)} filters, too little was evaluated to rank them")
    first = min(ranked, key=lambda row: row.value)
    alike: list[RankRow] = [
        row for row in ranked if row is first or row.filter in first.no_difference
    ]
    names = [row.filter for row in alike]
    errors = f"{CRITERION} {_span([row.value for row in alike])} deg"
    if len(alike) == 1:
        worse = [row for row in ranked if row is not first]
        said = (
            f"best: {first.filter}, by {errors} against {_span([row.value for row in worse])} deg"
        )
    elif len(alike) == len(ranked):
        said = f"no difference shown between {len(alike)} filters by {errors}"
    else:
        said = (
            f"no difference shown between {', '.join(names)} by {errors}; the others were shown to "
            "be worse"
        )
    left_out = [name for name in filters if name not in {row.filter for row in ranked}]
    return _Leaders(names, said + (f"; not ranked: {', '.join(left_out)}" if left_out else ""))


def _span(values: list[float]) -> str:
    """Smallest to largest, or one number where they read alike."""
    low, high = digits(min(values), 2), digits(max(values), 2)
    return low if low == high else f"{low} to {high}"
