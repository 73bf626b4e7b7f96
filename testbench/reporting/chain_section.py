"""The section of the report on the joints of the whole chain, estimated from several sensors together."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.estimate import Estimate
from testbench.records.evaluation import ChainRow, Evaluation
from testbench.reporting.decimation import Envelope
from testbench.reporting.figures import Span, time_panels
from testbench.reporting.page import Figures, Section, Sentence
from testbench.reporting.palette import filter_colours
from testbench.reporting.tables import Cell, Row, Table, header, label, number, significant, text

MOST_PANELS = 6
"""Joints drawn over time; of more, those with the largest errors."""
KINDS = (
    ("mean_error_deg", 3), ("mean_abs_error_deg", 3), ("rmse_deg", 3), ("iqr_deg", 3), ("largest_error_deg", 2),
    ("correlation", 5), ("rate_rmse_deg_s", 2), ("acceleration_rmse_deg_s2", 1), ("uncertainty_deg", 3), ("covered_percent", 0),
)  # fmt: skip


def chain_section(estimate: Estimate, evaluation: Evaluation | None, spans: list[Span]) -> Section | None:
    """Errors of every joint by every state of the filter; None where no chain was asked for."""
    if not estimate.chain:
        return None
    section = Section("chain", "Joints of the chain")
    section.blocks.append(_facts(estimate))
    rows = evaluation.chain if evaluation is not None else []
    if not rows or evaluation is None:
        section.blocks.append(Sentence("Its errors were not judged: nobody knows the true angles of the joints."))
        return section
    section.blocks.append(_errors(rows))
    colours = filter_colours(list(dict.fromkeys(chain.state for chain in estimate.chain)))
    for name in dict.fromkeys(row.section for row in rows):
        own = [row for row in rows if row.section == name]
        states = list(dict.fromkeys(row.state for row in own))
        worst = sorted(own, key=lambda row: -row.rmse_deg)
        drawn = list(dict.fromkeys(row.joint for row in worst))[:MOST_PANELS]
        series = evaluation.series[f"chain_{name}_{states[0]}"]
        envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series["judged"])
        panels = {
            f"{joint} [deg]": {
                state: envelope(np.degrees(evaluation.series[f"chain_{name}_{state}"][f"{joint}_error_rad"]))
                for state in states
            }
            for joint in drawn
        }
        section.blocks.append(
            Figures(
                f"Error of the joint angles over time: {name}",
                {f"error of the joints of {name} over time": time_panels(envelope.time, panels, colours, spans)},
                "How to read: estimate less what the arm measured; a constant part is a bias of a sensor or of the start, a "
                "growing one a heading that nothing tells. Of many joints the six with the largest errors are drawn.",
            )
        )
    return section


def _facts(estimate: Estimate) -> Table:
    rows = [
        Row([
            label(chain.section), text(chain.state), text(", ".join(chain.sensors)), number(len(chain.joints), 0),
            text("yes" if chain.facts.get("smoothed") else "no"),
            significant(chain.facts.get("jerk_deg_s3_sqrthz")), significant(chain.facts.get("walk_deg_sqrts")),
            significant(chain.facts.get("frequency_hz"), 6), significant(chain.facts.get("frequency_sd_hz"), 2),
            number(chain.facts.get("normalised_innovation_squared"), 2),
        ])
        for chain in estimate.chain
    ]  # fmt: skip
    return Table(
        "Chain filters",
        header("section", "state", "sensors", "joints", "smoothed", "jerk [deg/s³/√Hz]", "walk [deg/√s]",
               "base frequency [Hz]", "sd [Hz]", "innovation² / variance", numbers_from=5),
        rows,
        "How to read: what the filter was told or found of the motion. The last column is 1 where the readings differ from "
        "what was predicted as much as their variances say; far above 1 the model is too sure of itself.",
    )  # fmt: skip


def _errors(rows: list[ChainRow]) -> Table:
    body = []
    for section in dict.fromkeys(row.section for row in rows):
        for joint in dict.fromkeys(row.joint for row in rows if row.section == section):
            own = [row for row in rows if row.section == section and row.joint == joint]
            best = min(own, key=lambda row: row.rmse_deg)
            for row in own:
                cells: list[Cell] = [
                    number(
                        getattr(row, kind), digits, kind="best" if kind == "rmse_deg" and row is best and len(own) > 1 else ""
                    )
                    for kind, digits in KINDS
                ]
                body.append(Row([label(joint), text(section), text(row.state), *cells]))
    return Table(
        "Error of each joint by each state",
        header("joint", "section", "state", "mean [deg]", "mean magnitude [deg]", "RMS [deg]", "IQR [deg]", "largest [deg]",
               "correlation", "rate, RMS [deg/s]", "acceleration, RMS [deg/s²]", "uncertainty [deg]", "covered [%]",
               numbers_from=3),
        body,
        "How to read: the mean is signed and hides what it averages; bold is the lower RMS. Uncertainty is what the filter "
        "states (RMS of the standard uncertainty), covered the part of the errors within 1.96 of it: 95 is honest.",
    )  # fmt: skip
