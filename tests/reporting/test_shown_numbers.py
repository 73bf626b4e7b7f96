"""The numbers that a report shows are those of the evaluation, in the unit and the column that
their titles say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.records.results.evaluation_rows import GyroscopeBiasRow, OrientationSweepRow
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Curve, Figure, error_curves
from testbench.reporting.page.page import Figures
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.page.tables import Table, digits
from testbench.reporting.sections.orientation import orientation_section
from tests.reporting.conftest import Judged


def section(quick: Judged, **changed):
    evaluation = replace(quick.evaluation, **changed)
    names = [row.filter for row in evaluation.orientation]
    return orientation_section(evaluation, filter_colours(names), [])


def table(quick: Judged, caption: str, **changed) -> Table:
    blocks = section(quick, **changed).blocks
    return next(b for b in blocks if isinstance(b, Table) and b.caption == caption)


def column(shown: Table, title: str) -> list[str]:
    at = [cell.text for cell in shown.columns].index(title)
    return [row.cells[at].text for row in shown.rows]


def summaries(quick: Judged, motion: str, part: str):
    found = {
        (s.sensor, s.filter): s
        for s in quick.evaluation.orientation_summary
        if (s.motion, s.part) == (motion, part)
    }
    rows = quick.evaluation.orientation
    return [found[row.sensor, row.filter] for row in rows if (row.sensor, row.filter) in found]


CAPTION = "Orientation error of each sensor by each filter"


def test_each_column_of_orientations_shows_what_its_title_says(quick: Judged) -> None:
    shown = table(quick, CAPTION)
    for title, attribute in (
        ("total RMS [deg]", "total_rmse_deg"),
        ("heading RMS [deg]", "heading_rmse_deg"),
        ("inclination RMS [deg]", "inclination_rmse_deg"),
        ("largest total [deg]", "total_max_deg"),
    ):
        wanted = [digits(getattr(row, attribute), 2) for row in quick.evaluation.orientation]
        assert [cell.split()[0] for cell in column(shown, title)] == wanted, title
    heading = summaries(quick, "all", "heading")
    assert any(s.expanded_uncertainty_deg != s.expanded_uncertainty_magnitude_deg for s in heading)
    assert column(shown, "mean heading ± U [deg]") == [
        f"{digits(s.errors.mean_error_deg, 2)} ± {digits(s.expanded_uncertainty_deg, 2)}"
        for s in heading
    ]


def test_bold_is_the_lowest_of_a_sensor(quick: Judged) -> None:
    shown = table(quick, CAPTION)
    for sensor in {row.sensor for row in quick.evaluation.orientation}:
        own = [
            (row, cells.cells[2])
            for row, cells in zip(quick.evaluation.orientation, shown.rows, strict=True)
            if row.sensor == sensor
        ]
        lowest = min(row.total_rmse_deg for row, _ in own)
        assert [row.total_rmse_deg == lowest for row, _ in own] == [
            "best" in cell.kind for _, cell in own
        ]


def test_rest_and_motion_have_their_own_rows(quick: Judged) -> None:
    shown = table(quick, "Orientation error at rest and in motion")
    said = column(shown, "total RMS [deg]")
    by_motion = {
        motion: [s.errors.rmse_deg for s in summaries(quick, motion, "total")]
        for motion in ("static", "dynamic")
    }
    assert len(by_motion["static"]) > 1 and by_motion["static"] != by_motion["dynamic"]
    for motion, wanted in by_motion.items():
        rows = [i for i, name in enumerate(column(shown, "motion")) if name == motion]
        assert [said[i].split()[0] for i in rows] == [digits(value, 2) for value in wanted]


def test_how_far_the_truth_may_be_off_is_the_expanded_uncertainty_of_magnitudes(quick) -> None:
    budgets = [b for b in quick.evaluation.uncertainty if b.quantity == "total"]
    assert len(budgets) == 2
    for budget in budgets:
        wanted = f"{budget.owner} {digits(budget.expanded_magnitude_deg, 2)} deg"
        assert wanted in table(quick, CAPTION).how
        assert digits(budget.combined_deg, 2) != digits(budget.expanded_magnitude_deg, 2)


def test_sweeps_and_biases_show_what_their_titles_say(quick: Judged) -> None:
    sweep = OrientationSweepRow("arm", "f", "s", 3, {}, 99, 1.0, 2.0, 3.0, 25.0, 0.5)
    shown = table(quick, "Orientation error of each sweep", orientation_sweeps=[sweep])
    for title, value in (
        ("total RMS [deg]", "1.000"),
        ("heading RMS [deg]", "2.000"),
        ("inclination RMS [deg]", "3.000"),
        ("true amplitude [deg]", "25.0"),
        ("frequency [Hz]", "0.50"),
    ):
        assert column(shown, title) == [value]
    fields = {
        "sensor": "arm",
        "axis": "x",
        "estimated_deg_s": 0.5,
        "estimated_sd_deg_s": 0.1,
        "error_deg_s": 0.02,
        "error_sd_deg_s": 0.003,
        "samples": 9,
    }
    bias = GyroscopeBiasRow(**fields)
    shown = table(quick, "Error of the calibrated gyroscope's bias", gyroscope_bias=[bias])
    assert column(shown, "what is left at rest [deg/s]") == ["0.0200 ± 0.0060"]  # twice the sd


def unpacked(values) -> np.ndarray:
    """The values of a trace, as the page's own script reads them."""
    if isinstance(values, dict):
        import base64

        return np.frombuffer(base64.b64decode(values["bdata"]), np.dtype(values["dtype"]))
    return np.array([np.nan if value is None else value for value in values], float)


def drawn(figures: Figures) -> Figure:
    (figure,) = figures.figures.values()
    return figure


def test_errors_over_time_are_drawn_in_degrees_and_where_they_are_judged(quick: Judged) -> None:
    pictures = [b for b in section(quick).blocks if isinstance(b, Figures)]
    seen = 0
    for sensor in ("arm", "forearm"):
        figure = drawn(next(b for b in pictures if f"over time: {sensor}" in b.caption))
        for row in quick.evaluation.orientation:
            if row.sensor == sensor:
                traces = [t for t in figure["data"] if t["name"] == row.filter]
                largest = [np.nanmax(np.abs(unpacked(t["y"]))) for t in traces]
                # the first panel is the total
                assert largest[0] == pytest.approx(row.total_max_deg, rel=1e-3)
                seen += 1
    assert seen == len(quick.evaluation.orientation)


def test_of_a_span_only_what_is_judged_is_drawn() -> None:
    n = 10_000
    keep = np.arange(n) % 2 == 0
    value = np.where(keep, 1.0, np.where(np.arange(n) % 4 == 1, 50.0, -50.0))
    drawn = Envelope(np.arange(float(n)), keep, points=500)(value)
    assert np.nanmin(drawn) == np.nanmax(drawn) == 1.0
    short = Envelope(np.arange(100.0), keep[:100])(value[:100])
    np.testing.assert_array_equal(np.isfinite(short), keep[:100])
    assert np.nanmax(short) == 1.0


def test_a_span_is_drawn_where_it_lies() -> None:
    time = np.arange(10_000.0)
    envelope = Envelope(time, points=500)
    shown = envelope(time)
    assert np.abs(shown - envelope.time).max() <= 20.5  # half a span of 40
    assert np.all(np.diff(envelope.time) > 0)


def test_a_band_reaches_as_far_up_as_down() -> None:
    curve = Curve("a", [0.0, 1.0], [5.0, 6.0], "#112233", sd=[1.0, 2.0])
    (band,) = [t for t in error_curves([curve], "x", "y")["data"] if t.get("fill")]
    assert band["y"] == [4.0, 4.0, 8.0, 6.0]
    assert band["x"] == [0.0, 1.0, 1.0, 0.0]
