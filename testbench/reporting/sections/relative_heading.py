"""What the axes of a joint took out of the headings of its sensors, over time."""

from __future__ import annotations

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import joint_table
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Block, Figures

TURNED, SD = "turned by [deg]", "standard deviation [deg]"


def relative_heading_blocks(
    evaluation: Evaluation,
    joint: str,
    filters: list[str],
    colours: dict[str, str],
    spans: list[Span],
) -> list[Block]:
    """A figure over time for a joint whose protocol states its axes; nothing for others."""
    series = evaluation.series.get(joint_table(joint), {})
    known = [name for name in filters if f"{name}_relative_heading_rad" in series]
    if not known:
        return []
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS)
    panels = {
        title: {
            name: envelope(np.degrees(series[f"{name}_relative_heading{column}_rad"]))
            for name in known
        }
        for title, column in {TURNED: "", SD: "_sd"}.items()
    }
    return [
        Figures(
            f"Headings kept together by the axes of {joint}",
            {
                f"relative heading of {joint} over time": time_panels(
                    envelope.time, panels, colours, spans
                )
            },
            "How to read: by so much the distal sensor's orientation was turned about the vertical "
            "before the joint's angles were taken, so that the axes that the protocol states keep "
            "their angle; without drift it is the zero line. Where the standard deviation grows, "
            "the axes were too near to the vertical to tell.",
        )
    ]
