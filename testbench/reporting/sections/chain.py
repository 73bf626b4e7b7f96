"""The section of the report on the joints of the whole chain, estimated from several sensors
together.
"""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.chain import ChainEstimate
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import ChainRow, Evaluation
from testbench.records.session.layout import chain_table
from testbench.records.specs.band import Band
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Figures, Section, Sentence
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.page.tables import (
    Cell,
    Row,
    Table,
    digits,
    header,
    label,
    number,
    significant,
    text,
)
from testbench.reporting.sections.cycle import cycle_blocks
from testbench.reporting.sections.findings import finding_sentences
from testbench.reporting.sections.ranking import plus_minus

MOST_PANELS = 6
"""Joints drawn over time; of more, those with the largest errors."""
KINDS = (
    ("mean_abs_error_deg", 3),
    ("rmse_deg", 3),
    ("iqr_deg", 3),
    ("largest_error_deg", 2),
    ("correlation", 5),
    ("rate_rmse_deg_s", 2),
    ("acceleration_rmse_deg_s2", 1),
    ("uncertainty_deg", 3),
    ("covered_percent", 0),
)


def chain_section(
    estimate: Estimate,
    evaluation: Evaluation | None,
    spans: list[Span],
    band: Band | None = None,
) -> Section | None:
    """Errors of every joint by every state of the filter; None where no chain was asked for."""
    if not estimate.chain:
        return None
    section = Section("chain", "Joints of the chain")
    noticed = estimate.findings if evaluation is None else evaluation.findings
    section.blocks += finding_sentences(
        found for found in noticed if found.where.startswith("chain, ")
    )
    rows = [] if evaluation is None else evaluation.chain
    if not rows:
        section.blocks += [
            Sentence("Nobody knows the true angles: their errors are not known."),
            *(_angles_over_time(one, spans) for one in estimate.chain),
        ]
    if evaluation is None:
        section.blocks += [_facts(estimate), *_placements(estimate)]
        return section
    section.blocks += [_errors(rows)] if rows else []
    section.blocks += [_facts(estimate), *_placements(estimate)]
    colours = filter_colours(list(dict.fromkeys(chain.state for chain in estimate.chain)))
    for name in dict.fromkeys(row.section for row in rows):
        cycles = {
            i: row
            for i, row in enumerate(evaluation.cycles)
            if row.section == name and row.sequence is None
        }
        section.blocks += cycle_blocks(
            evaluation, cycles, f"joints of the chain, section {name}", colours, band
        )
        own = [row for row in rows if row.section == name]
        section.blocks.append(_over_time(evaluation, name, own, colours, spans))
    return section


def _over_time(
    evaluation: Evaluation,
    name: str,
    rows: list[ChainRow],
    colours: dict[str, str],
    spans: list[Span],
) -> Figures:
    """The errors of a section's joints, those with the largest first."""
    states = list(dict.fromkeys(row.state for row in rows))
    worst = sorted(rows, key=lambda row: -row.rmse_deg)
    joints = list(dict.fromkeys(row.joint for row in worst))
    drawn = joints[:MOST_PANELS]
    series = evaluation.series[chain_table(name, states[0])]
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series["judged"])
    panels = {
        f"{joint} [deg]": {
            state: envelope(
                np.degrees(evaluation.series[chain_table(name, state)][f"{joint}_error_rad"])
            )
            for state in states
        }
        for joint in drawn
    }
    figure = time_panels(envelope.time, panels, colours, spans)
    how = (
        "How to read: estimate less what the arm measured; a constant part is a bias of a sensor "
        "or of the start, a growing one a heading that nothing tells."
    )
    if len(joints) > len(drawn):
        how += f" Of {len(joints)} joints those with the largest errors are drawn."
    return Figures(
        f"Error of the joint angles over time: {name}",
        {f"error of the joints of {name} over time": figure},
        how,
    )


def _facts(estimate: Estimate) -> Table:
    rows = [
        Row(
            [
                label(chain.section),
                text(chain.state),
                text(", ".join(chain.sensors)),
                number(len(chain.joints), 0),
                text("yes" if chain.facts.get("smoothed") else "no"),
                significant(chain.facts.get("jerk_deg_s3_sqrthz")),
                significant(chain.facts.get("walk_deg_sqrts")),
                significant(chain.facts.get("frequency_hz"), 6),
                significant(chain.facts.get("frequency_sd_hz"), 2),
                number(chain.facts.get("normalised_innovation_squared"), 2),
                number(chain.facts.get("placement_off_deg"), 2),
                text("yes" if chain.facts.get("lost") else "no"),
            ]
        )
        for chain in estimate.chain
    ]
    return Table(
        "Chain filters",
        header(
            "section",
            "state",
            "sensors",
            "joints",
            "smoothed",
            "jerk [deg/s³/√Hz]",
            "walk [deg/√s]",
            "base frequency [Hz]",
            "sd [Hz]",
            "innovation² / variance",
            "off by placement [deg]",
            "lost",
            numbers_from=5,
        ),
        rows,
        "How to read: what the filter was told or found of the motion. Innovation² over variance "
        "is 1 where the readings differ from what was predicted as much as their variances say; "
        "far above 1 the model is too sure of itself. Off by placement is how far the worst joint "
        "would move if the sensors sat where their readings say: beyond 1.8 deg the filter is "
        "lost.",
    )


def _angles_over_time(one: ChainEstimate, spans: list[Span]) -> Figures:
    """The angles of an estimate that nobody can judge; of many, those that move most."""
    moved = np.argsort(-np.ptp(one.mean[:, 0], axis=0), kind="stable")
    drawn = [one.joints[i] for i in moved[:MOST_PANELS]]
    colours = filter_colours([one.state])
    envelope = Envelope(one.host_time_ns / NANOSECONDS, np.ones(len(one.mean), dtype=bool))
    panels = {
        f"{joint} [deg]": {one.state: envelope(np.degrees(one.mean[:, 0, one.joints.index(joint)]))}
        for joint in drawn
    }
    title = f"Joint angles over time: {one.section}, {one.state}"
    sd = np.degrees(np.sqrt(np.mean(one.sd[:, 0] ** 2, axis=0)))
    stated = ", ".join(
        f"{joint} {digits(float(sd[one.joints.index(joint)]), 2)}" for joint in drawn
    )
    how = f"How to read: as estimated. Standard uncertainties by the filter [deg]: {stated}."
    if len(one.joints) > len(drawn):
        how += f" Of {len(one.joints)} joints those that move most are drawn."
    return Figures(title, {title.lower(): time_panels(envelope.time, panels, colours, spans)}, how)


def _placements(estimate: Estimate) -> list[Table]:
    """Where the sensors sit by their readings, once for the states of a section."""
    tables, told = [], set[str]()
    for chain in estimate.chain:
        fitted = chain.facts.get("placement")
        if fitted is None or chain.section in told:
            continue
        told.add(chain.section)
        rows = [
            Row([label(name), *(text(_triple(own, *keys)) for keys in PLACED)])
            for name, own in fitted["sensors"].items()
        ]
        rows += [
            Row([label(f"length before {joint}"), text(_percent(own)), text("")])
            for joint, own in fitted["lengths"].items()
        ]
        tables.append(
            Table(
                f"Placement by the readings: {chain.section}",
                header("sensor", "turned about x, y, z [deg]", "moved along x, y, z [mm]"),
                rows,
                "How to read: how far each sensor sits from where it is stated, with the standard "
                "uncertainty that is left; its own axes for the turn, those of the joint that "
                "carries it for the place. What the motion hardly tells is held by the stated "
                "standard deviation.",
            )
        )
    return tables


PLACED = (("rotation_vector_deg", "rotation_sd_deg"), ("position_mm", "position_sd_mm"))


def _triple(own: dict[str, list[float]], value: str, sd: str) -> str:
    return ", ".join(f"{a:.2f} ± {b:.2f}" for a, b in zip(own[value], own[sd], strict=True))


def _percent(own: dict[str, float]) -> str:
    return f"{own['percent']:.2f} ± {own['sd_percent']:.2f} %"


def _errors(rows: list[ChainRow]) -> Table:
    body = []
    for section in dict.fromkeys(row.section for row in rows):
        for joint in dict.fromkeys(row.joint for row in rows if row.section == section):
            own = [row for row in rows if row.section == section and row.joint == joint]
            best = min(own, key=lambda row: row.rmse_deg)
            for row in own:
                cells: list[Cell] = [
                    number(
                        getattr(row, kind),
                        digits,
                        kind="best" if kind == "rmse_deg" and row is best and len(own) > 1 else "",
                    )
                    for kind, digits in KINDS
                ]
                mean = plus_minus(row.mean_error_deg, row.expanded_uncertainty_deg)
                body.append(Row([label(joint), text(section), text(row.state), mean, *cells]))
    return Table(
        "Error of each joint by each state",
        header(
            "joint",
            "section",
            "state",
            "mean ± U [deg]",
            "mean magnitude [deg]",
            "RMS [deg]",
            "IQR [deg]",
            "largest [deg]",
            "correlation",
            "rate, RMS [deg/s]",
            "acceleration, RMS [deg/s²]",
            "uncertainty [deg]",
            "covered [%]",
            numbers_from=3,
        ),
        body,
        "How to read: the mean is signed and hides what it averages; bold is the lower RMS. ± U is "
        "how far the arm's own angle may be off (95 %). Uncertainty is what the filter states "
        "(RMS of the standard uncertainty), covered the part of the errors within 1.96 of it: 95 "
        "is honest.",
    )
