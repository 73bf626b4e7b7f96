"""The U beside a signed mean is that of signed means."""

from __future__ import annotations

from dataclasses import replace

from tests.reporting.conftest import Judged
from tests.reporting.test_shown_numbers import CAPTION, column, table


def test_the_mean_heading_has_the_uncertainty_of_a_signed_mean(quick: Judged) -> None:
    known = [
        replace(s, expanded_uncertainty_deg=0.11, expanded_uncertainty_magnitude_deg=0.77)
        for s in quick.evaluation.orientation_summary
    ]
    shown = column(table(quick, CAPTION, orientation_summary=known), "mean heading ± U [deg]")
    assert shown and all(cell.endswith("± 0.11") for cell in shown)
