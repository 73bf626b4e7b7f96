"""Findings on truths from motion capture: clusters of markers, rigid bodies, frames of ROS."""

from __future__ import annotations

from testbench.records.findings.templates.template import NOTE, WARNING, Template

TEMPLATES = {
    "tracking.cluster": Template(
        NOTE,
        "the cluster {markers} fits its own shape to {residual_mm:.2g} mm (RMS)",
        "by so much the markers move against one another, or are measured wrongly",
    ),
    "tracking.lost": Template(
        WARNING,
        "{lost} of {frames} frames of the cluster {markers} give no orientation: {few} with fewer "
        "than three markers, {in_line} with markers on one line, {deformed} with markers out of "
        "place",
        "nothing is evaluated there",
        "label or fill them in the software of the cameras, or name further markers of the same "
        "body with --truth-cluster",
    ),
}
