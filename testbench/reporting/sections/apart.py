"""How far the filters lie apart over time, whatever the truth is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.model import rotation
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Span, time_panels
from testbench.reporting.page.page import Block, Figures

MOST_SAMPLES = 20_000
"""Of more one in so many is compared that fewer are left."""


def apart_blocks(
    estimate: Estimate,
    evaluation: Evaluation,
    colours: Mapping[str, str],
    spans: Sequence[Span],
) -> list[Block]:
    """The angle between the best filter of each sensor and every other one, drawn when asked for.

    Args:
        estimate: Of the session.
        evaluation: Of it.
        colours: By filter.
        spans: Sections of the protocol.
    """
    blocks: list[Block] = []
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        own = estimate.sensors.get(sensor)
        ranked = sorted(
            (row for row in evaluation.orientation if row.sensor == sensor),
            key=lambda row: row.total_rmse_deg,
        )
        names = [row.filter for row in ranked if own is not None and row.filter in own.orientation]
        if own is None or len(names) < 2:
            continue
        every = slice(None, None, -(-len(own.host_time_ns) // MOST_SAMPLES))
        envelope = Envelope(own.host_time_ns[every] / NANOSECONDS)
        first = rotation.conjugate(own.orientation[names[0]][every])
        panel = {
            name: envelope(
                np.degrees(rotation.angle(rotation.multiply(first, own.orientation[name][every])))
            )
            for name in names[1:]
        }
        best = names[0]
        blocks.append(
            Figures(
                f"Difference between the filters over time: {sensor}",
                {
                    f"difference of every filter from {best} of {sensor} over time": time_panels(
                        envelope.time, {f"angle from {best} [deg]": panel}, colours, spans
                    )
                },
                f"How to read: the angle between each orientation and that by {best}, the smallest "
                "error in all. It needs no truth, and shows when the filters part.",
                folded=True,
            )
        )
    return blocks
