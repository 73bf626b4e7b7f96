"""The figure of estimated against true flexion over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation, JointRow
from testbench.records.session.layout import joint_table
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Block, Figures
from testbench.reporting.page.palette import REFERENCE

TRUE = "true flexion"


def flexion_blocks(
    joint: str,
    rows: Sequence[JointRow],
    evaluation: Evaluation,
    colours: Mapping[str, str],
    spans: Sequence[Span],
) -> list[Block]:
    """True flexion and that of every filter by the joint's own definition.

    Nothing where the signals were not kept.
    """
    series = evaluation.series.get(joint_table(joint))
    if not series or not rows:
        return []
    own = rows[0].sequence
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS, series.get("judged"))
    signals = {TRUE: envelope(np.degrees(series["reference_rad"]))}
    for name in dict.fromkeys(row.filter for row in rows if row.sequence == own):
        flexion = series.get(f"{name}_{own}_flexion_rad")
        if flexion is not None:
            signals[name] = envelope(np.degrees(flexion))
    figure = time_panels(
        envelope.time, {f"flexion, {own} [deg]": signals}, {**colours, TRUE: REFERENCE}, spans
    )
    for drawn in figure["data"]:
        if drawn["name"] == TRUE:
            drawn["line"] |= {"width": 2.4, "dash": "dot"}
    return [
        Figures(
            f"Estimated and true flexion over time: {joint}",
            {f"estimated and true flexion of {joint} over time": figure},
            "How to read: the dotted line is the truth, the others the estimates, by the joint's "
            "own definition and only where they are evaluated. Where they cannot be told apart the "
            "figure of the errors, below, does. Drag over a stretch to see it closer.",
        )
    ]
