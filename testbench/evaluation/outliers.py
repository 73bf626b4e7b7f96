"""Filters whose error is far from that of all others, with the reason where one is known."""

from __future__ import annotations

from collections.abc import Mapping

from testbench.model.statistics.robust import far_ones, outer_fence
from testbench.records.results.evaluation import ResultTables
from testbench.records.results.evaluation_rows import OutlierRow


def outlier_rows(evaluation: ResultTables, behaviour: Mapping[str, str]) -> list[OutlierRow]:
    """One row for each filter that is far from the others by an error of a sensor's orientation or
    of a joint.

    Args:
        evaluation: With its summaries and rankings.
        behaviour: What is known of each filter, in a sentence.
    """
    groups: dict[tuple[str, str | None, str | None, str, str], dict[str, float]] = {}
    for orientation in evaluation.orientation_summary:
        if orientation.part != "total":
            place = (orientation.sensor, None, None, orientation.motion, orientation.part)
            groups.setdefault(place, {})[orientation.filter] = orientation.errors.rmse_deg
    for joint in evaluation.joint_summary:
        own = (joint.joint, joint.section, joint.sequence, joint.motion, "flexion")
        groups.setdefault(own, {})[joint.filter] = joint.errors.mean_abs_error_deg
    for rank in evaluation.ranking:
        if rank.section is not None and rank.sequence is None:
            groups.setdefault((rank.owner, rank.section, None, "all", "total"), {})[rank.filter] = (
                rank.value
            )
    return [
        OutlierRow(*place, name, value, outer_fence(values), behaviour.get(name, ""))
        for place, values in groups.items()
        for name, value in far_ones(values).items()
    ]
