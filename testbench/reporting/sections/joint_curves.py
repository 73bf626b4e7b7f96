"""Joint angles over time as they were estimated, with their uncertainty: what needs no truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model.joint_angle import INDEX, decomposition_of
from testbench.records.results.estimate import Estimate, JointEstimate
from testbench.records.session.session import Session
from testbench.records.specs.protocol import JointDefinition
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figure_parts import packed
from testbench.reporting.page.figures import Figure, Span, time_panels
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.palette import translucent
from testbench.reporting.page.tables import Row, Table, header, label, number, text

COVERED = 1.96
"""Standard uncertainties to either side that hold 95 % of normal errors."""


def curve_blocks(
    session: Session, estimate: Estimate, colours: Mapping[str, str], spans: Sequence[Span]
) -> dict[str, list[Block]]:
    """How each joint of a body was placed, its angles over time and how well they are known.

    Args:
        session: The recording.
        estimate: Of it.
        colours: By filter.
        spans: Sections of the protocol.

    Returns:
        By joint; those of an arm, and those without an angle, are left out.
    """
    found: dict[str, list[Block]] = {}
    for name, own in estimate.joints.items():
        joint = session.analysis.joints[name]
        if own.sd and any(label == joint.label for _, label in own.angles):
            figure = _curves(name, joint, own, colours, spans)
            found[name] = [figure, _known(name, joint, own)]
    return found


def angle_names(joint: JointDefinition) -> list[str]:
    """The three angles of a joint's own definition, in words, the flexion called so."""
    names = list(decomposition_of(joint).names)
    if names[0] == "first":
        names = [f"{joint.label}, {which}" for which in names]
        names[INDEX[joint.flexion]] += " (flexion)"
    return names


def _curves(
    name: str,
    joint: JointDefinition,
    own: JointEstimate,
    colours: Mapping[str, str],
    spans: Sequence[Span],
) -> Figures:
    envelope = Envelope(own.host_time_ns / NANOSECONDS)
    panels: dict[str, dict[str, np.ndarray]] = {}
    bands: list[tuple[int, str, np.ndarray]] = []
    for i, title in enumerate(angle_names(joint)):
        signals = panels.setdefault(f"{title} [deg]", {})
        for (key, sequence), angles in own.angles.items():
            if sequence != joint.label:
                continue
            sign = joint.sign if i == INDEX[joint.flexion] else 1
            degrees = sign * np.degrees(np.unwrap(angles[:, i]))
            signals[key] = envelope(degrees)
            if len(signals) == 1 and (key, sequence) in own.sd:
                wide = COVERED * np.degrees(own.sd[key, sequence][:, i])
                edges = np.stack([envelope(degrees - wide), envelope(degrees + wide)])
                bands.append((i, key, edges))
    figure = time_panels(envelope.time, panels, colours, spans)
    figure["data"] = [*_bands(envelope.time, bands, colours), *figure["data"]]
    return Figures(
        f"Angles over time: {name}",
        {f"angles of {name} over time": figure},
        "How to read: the joint's own definition, by every filter; the band is the 95 % interval "
        "that the first of them states. It holds how well the segments' axes, the headings and the "
        "verticals are known; what skin and muscles move is not in it.",
    )


def _bands(
    time: np.ndarray, bands: list[tuple[int, str, np.ndarray]], colours: Mapping[str, str]
) -> list[Figure]:
    """Lower and upper edge of each band, the space between them filled."""
    drawn: list[Figure] = []
    for panel, key, edges in bands:
        for i, values in enumerate(edges):
            trace: Figure = {
                "type": "scatter",
                "mode": "lines",
                "name": key,
                "legendgroup": key,
                "showlegend": False,
                "hoverinfo": "skip",
                "x": packed(time),
                "y": packed(values),
                "yaxis": f"y{'' if panel == 0 else panel + 1}",
                "line": {"width": 0, "color": colours[key]},
            }
            filled = {"fill": "tonexty", "fillcolor": translucent(colours[key], 0.18)}
            drawn.append(trace | (filled if i else {}))
    return drawn


def _known(name: str, joint: JointDefinition, own: JointEstimate) -> Table:
    """How well each angle is known, by filter, and what placed the sensors."""
    rows = []
    for (key, sequence), sd in own.sd.items():
        if sequence == joint.label:
            halves = COVERED * np.degrees(np.nanmedian(sd, axis=0))
            placed = "; ".join(own.placements.get(key, {}).values())
            rows.append(Row([label(key), *(number(half, 1) for half in halves), text(placed)]))
    titles = [f"{title} ± [deg]" for title in angle_names(joint)]
    return Table(
        f"How well the angles of {name} are known",
        [
            *header("filter", numbers_from=9),
            *header(*titles, numbers_from=0),
            *header("proximal; distal sensor placed by", numbers_from=9),
        ],
        rows,
        "How to read: half the 95 % interval of an angle, the median over time. Most of it lasts "
        "for the whole recording, and drops out of a range of motion.",
    )
