"""Histograms, box plots, Allan deviations, budgets and surfaces say what the numbers say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from testbench.evaluation.noise import LongRest, noise_of
from testbench.model.allan import allan_deviation
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import allan_table, joint_table
from testbench.records.session.samples import GYR
from testbench.reporting.page.distributions import histogram, stacked_squares
from testbench.reporting.page.figures import Axis
from testbench.reporting.page.page import Figures
from testbench.reporting.page.space import sphere, surfaces
from testbench.reporting.sections.allan import allan_blocks
from testbench.reporting.sections.outliers import tops
from testbench.reporting.sections.spread import joint_spread
from testbench.reporting.sections.uncertainty import budget_bars
from tests.reporting.conftest import Judged


def test_a_histogram_and_its_density_hold_all_of_the_values() -> None:
    values = np.random.default_rng(0).normal(0.3, 0.1, 20_000)
    bars, curve = histogram("t", values, "#123456", "e [deg]")["data"]
    assert sum(bars["y"]) * bars["width"] == pytest.approx(0.995, abs=2e-3)
    x, y = np.array(curve["x"]), np.array(curve["y"])
    assert np.trapezoid(y, x) == pytest.approx(0.995, abs=3e-3)
    assert x[y.argmax()] == pytest.approx(values.mean(), abs=0.01)
    at_bars = np.interp(bars["x"], x, y)
    assert np.abs(at_bars - bars["y"]).max() < 0.1 * y.max()


def test_a_single_value_far_away_does_not_squeeze_a_histogram() -> None:
    values = np.append(np.random.default_rng(1).normal(0, 1, 5000), 1000.0)
    figure = histogram("t", values, "#123456", "e [deg]")
    assert figure["layout"]["xaxis"]["range"][1] < 5


def test_the_spread_of_a_joint_is_that_of_its_evaluated_errors(quick: Judged) -> None:
    colours = dict.fromkeys({r.filter for r in quick.evaluation.joint_angle}, "#123456")
    histograms, boxes = joint_spread(quick.evaluation, "elbow", colours)
    assert isinstance(histograms, Figures) and isinstance(boxes, Figures)
    series = quick.evaluation.series[joint_table("elbow")]
    drawn = {t["name"]: t for t in next(iter(boxes.figures.values()))["data"]}
    for name, trace in drawn.items():
        errors = np.degrees(series[f"{name}_ZXZ_error_rad"][series["judged"]])
        errors = errors[np.isfinite(errors)]
        assert trace["median"][0] == pytest.approx(np.median(errors), rel=2e-3, abs=1e-4)
        assert trace["upperfence"][0] == pytest.approx(np.percentile(errors, 97.5), rel=2e-3)
    assert joint_spread(replace(quick.evaluation, series={}), "elbow", colours) == []


def white(sd: float, count: int = 20_000, rate: float = 100.0) -> LongRest:
    rng = np.random.default_rng(2)
    columns = {name: rng.normal(0, sd, count) for name in GYR}
    return LongRest(count, (count - 1) / rate, columns, columns.__getitem__)


def test_allan_deviations_are_kept_and_drawn_with_the_slope_of_white_noise() -> None:
    rest = white(np.radians(0.05))
    found = noise_of("imu", rest)
    curve = allan_deviation(rest.read("gyr_x_rad_s"), 100.0)
    assert found.curves["tau_s"] == pytest.approx(curve.tau)
    assert np.radians(found.curves["gyr_x"] / 3600) == pytest.approx(curve.deviation)
    line = found.curves["gyr_x_white"]
    assert line * np.sqrt(curve.tau) == pytest.approx(line[0] * np.sqrt(curve.tau[0]))
    assert line[0] == pytest.approx(0.05 * 3600, rel=0.03)
    evaluation = Evaluation(
        session="s", noise=found.rows, series={allan_table("imu"): found.curves}
    )
    (block,) = allan_blocks(evaluation)
    assert isinstance(block, Figures)
    ((words, figure),) = block.figures.items()
    assert "angular rate of imu" in words
    names = [trace["name"] for trace in figure["data"] if trace.get("showlegend", True)]
    assert names[:3] == ["x", "y", "z"] and "white noise, slope −1/2" in names
    assert figure["layout"]["yaxis"]["title"]["text"] == "Allan deviation [deg/h]"
    assert allan_blocks(replace(evaluation, series={})) == []


def test_the_bars_of_a_budget_add_up_to_what_it_states(quick: Judged) -> None:
    budgets = [own for own in quick.evaluation.uncertainty if own.quantity == "flexion"]
    (block,) = budget_bars("flexion", budgets)
    assert isinstance(block, Figures)
    for figure, budget in zip(block.figures.values(), budgets, strict=False):
        means, magnitudes = (np.array(trace["x"]) for trace in figure["data"])
        assert np.hypot.reduce(means) == pytest.approx(budget.combined_deg, rel=5e-3)
        assert np.hypot.reduce(magnitudes) == pytest.approx(budget.combined_magnitude_deg, rel=5e-3)
    assert budget_bars("flexion", [replace(own, complete=False) for own in budgets]) == []


def test_the_largest_source_lies_on_top() -> None:
    figure = stacked_squares("t", {"a": [1.0], "b": [3.0], "c": [2.0]}, ["u"], "u [deg]")
    assert figure["data"][0]["y"] == ["a", "c", "b"]


def test_maps_that_differ_threefold_have_colours_of_their_own() -> None:
    alike = {"a": np.full((3, 3), 1.0), "b": np.full((3, 3), 2.5)}
    ends, how = tops(alike)
    assert ends == {"a": 2.5, "b": 2.5} and "share their colours" in how
    ends, how = tops(alike | {"c": np.full((3, 3), 3.5)})
    assert ends == {"a": 1.0, "b": 2.5, "c": 3.5} and "of its own" in how


def test_surfaces_begin_with_one_and_hold_every_value() -> None:
    z = {"a": np.array([[1.0, 2.0], [3.0, np.nan]]), "b": np.ones((2, 2))}
    x, y = Axis("x [deg]", [0.0, 1.0]), Axis("y [deg]", [5.0, 6.0])
    colours = {"a": "#123456", "b": "#654321"}
    figure = surfaces("t", x, y, z, colours, "z [deg]", "b")
    assert [trace["visible"] for trace in figure["data"]] == ["legendonly", True]
    assert figure["data"][0]["z"] == [[1.0, 2.0], [3.0, None]]


def test_a_sphere_has_its_points_on_it() -> None:
    directions = np.array([[1.0, 0, 0], [0, 0.6, 0.8]])
    grid, points = sphere("t", directions, np.array([-2.0, 1.0]), "[mg]", "sensor")["data"]
    assert points["marker"]["cmin"] == -2.0 and points["marker"]["cmax"] == 2.0
    lengths = [
        x * x + y * y + z * z
        for x, y, z in zip(grid["x"], grid["y"], grid["z"], strict=True)
        if x is not None
    ]
    assert lengths == pytest.approx([1.0] * len(lengths), abs=2e-3)
