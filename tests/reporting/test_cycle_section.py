"""Which average cycles are drawn, and what stands in their figures and tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.records.results.evaluation import Evaluation
from testbench.records.results.evaluation_rows import CycleRow
from testbench.reporting.page.page import Figures, Page, Section
from testbench.reporting.page.palette import filter_colours
from testbench.reporting.page.render import render_page
from testbench.reporting.page.tables import Table
from testbench.reporting.sections.cycle import MOST_FILTERS, MOST_SHOWN, TRUE, cycle_blocks
from tests.reporting.browsing import browse, needs_browser

OPEN = """
const page = document.documentElement.dataset;
const count = () => document.querySelectorAll(".figure.js-plotly-plot").length;
const waiting = setInterval(() => {
  if (page.drawn !== "all") return;
  if (page.before) page.after = count();
  else { page.before = count(); document.querySelector("details:not(.how)").open = true; }
}, 500);
"""
"""Counts the figures that are drawn before and after the first fold is opened."""


def row(joint="knee", name="vqf_6d", sequence="ZXZ", step=0, hz=0.5, rom=50.0, rmse=0.5, **more):
    numbers = {
        "rom_deg": rom + 0.5,
        "true_rom_deg": rom,
        "rom_error_deg": 0.5,
        "rom_error_sd_deg": 0.125,
        "mean_error_deg": -0.25,
    }
    numbers |= {"rmse_deg": rmse, "error_sd_deg": 0.064, "true_sd_deg": 0.0, "cmc": 0.9875}
    return CycleRow(
        joint,
        name,
        sequence,
        "walk",
        step,
        more.pop("variables", {}),
        hz,
        12,
        **({"left_out": 0} | numbers | more),
    )


def judged(rows):
    """An evaluation whose average cycles are known: of row i the error is i degrees, the angle a
    sine of its true range.
    """
    percent = np.tile(np.arange(101), len(rows))
    place = np.repeat(np.arange(len(rows)), 101)
    true = np.radians(np.array([r.true_rom_deg / 2 for r in rows])[place]) * np.sin(
        2 * np.pi * percent / 100
    )
    error = np.radians(place.astype(float))
    sd = np.full(len(place), np.radians(0.5))
    table = {
        "row": place,
        "cycle_percent": percent,
        "estimated_rad": true + error,
        "estimated_sd_rad": sd,
    }
    table |= {"true_rad": true, "true_sd_rad": 0 * sd, "error_rad": error, "error_sd_rad": sd}
    return Evaluation(session="s", series={"cycles": table}, cycles=list(rows))


def blocks_of(rows):
    evaluation = judged(rows)
    colours = filter_colours(list(dict.fromkeys(r.filter for r in rows)))
    return cycle_blocks(evaluation, dict(enumerate(rows)), "knee, section walk", colours)


def drawn(block):
    return [name.removeprefix("average cycle of ") for name in block.figures]


def test_a_figure_has_the_average_cycle_with_its_band_and_its_error_below():
    first, second = row(), row(name="fusion", rmse=0.75)
    figures, table = blocks_of([first, second])
    [figure] = figures.figures.values()
    assert figure["layout"]["xaxis"]["title"]["text"] == "cycle [%]" and figure["layout"]["xaxis"][
        "range"
    ] == [0, 100]
    assert figure["layout"]["yaxis"]["title"]["text"] == "angle [deg]"
    assert figure["layout"]["yaxis2"]["title"]["text"] == "error [deg]"
    lines = {(d["name"], d["yaxis"]): d for d in figure["data"] if "fill" not in d}
    assert set(lines) == {
        (TRUE, "y"),
        ("vqf_6d", "y"),
        ("fusion", "y"),
        ("vqf_6d", "y2"),
        ("fusion", "y2"),
    }
    assert sorted(d["name"] for d in figure["data"] if d["showlegend"]) == [
        "fusion",
        "true",
        "vqf_6d",
    ]
    percent = np.array(lines["fusion", "y"]["x"])
    assert (percent[0], percent[-1]) == (0, 100)
    np.testing.assert_allclose(
        lines[TRUE, "y"]["y"], 25 * np.sin(2 * np.pi * percent / 100), atol=0.01
    )
    np.testing.assert_allclose(
        lines["fusion", "y"]["y"], 1 + 25 * np.sin(2 * np.pi * percent / 100), atol=0.01
    )
    np.testing.assert_allclose(lines["fusion", "y2"]["y"], 1)
    [band] = [
        d for d in figure["data"] if "fill" in d and (d["name"], d["yaxis"]) == ("fusion", "y2")
    ]
    assert (min(band["y"]), max(band["y"])) == (0.5, 1.5)
    assert [cell.text for cell in table.rows[0].cells] == [
        "knee",
        "vqf_6d",
        "ZXZ",
        "0.500",
        "12",
        "50.50",
        "50.00",
        "0.500 ± 0.125",
        "−0.250",
        "0.500",
        "0.064",
        "0.98750",
    ]
    assert [cell.text for line in table.rows for cell in line.cells if "best" in cell.kind] == [
        "0.500"
    ]
    assert len(table.columns) == len(table.rows[0].cells)


def test_cycles_left_out_and_a_missing_coefficient_are_shown():
    _, table = blocks_of([row(left_out=2, cmc=None)])
    texts = [cell.text for cell in table.rows[0].cells]
    assert "12 (−2)" in texts and texts[-1] == "–"


def test_of_many_joints_those_that_move_most_are_drawn_and_the_others_are_folded():
    joints = [
        row(f"joint_{i}", state, None, rom=rom)
        for state in ("kinematic", "fourier")
        for i, rom in enumerate(range(5, 50, 5))
    ]
    figures, table, others, everything = blocks_of(joints)
    assert drawn(figures) == [f"joint_{i}" for i in range(9 - MOST_SHOWN, 9)] and not figures.folded
    assert drawn(others) == ["joint_0", "joint_1", "joint_2"] and others.folded and others.small
    assert len(table.rows) == 2 * MOST_SHOWN and [
        line.cells[0].text for line in table.rows[:3]
    ] == [
        "joint_3",
        "joint_3",
        "joint_4",
    ]
    assert len(everything.rows) == 18 and everything.folded
    assert "state" in [cell.text for cell in table.columns] and "sequence" not in [
        cell.text for cell in table.columns
    ]


def test_of_many_sweeps_the_widest_at_each_frequency_is_drawn():
    sweeps = [
        row(
            name=name,
            step=10 * i + j,
            hz=hz,
            rom=2 * amplitude,
            variables={"amplitude_deg": amplitude, "frequency_hz": hz},
        )
        for i, amplitude in enumerate((5.0, 30.0, 10.0))
        for j, hz in enumerate((0.75, 0.1))
        for name in ("vqf_6d", "fusion")
    ]
    figures, table, everything = blocks_of(sweeps)
    assert drawn(figures) == ["knee, 0.1 Hz", "knee, 0.75 Hz"]
    assert {line.cells[1].text for line in table.rows} == {"30.00"} and len(table.rows) == 4
    assert "frequency [Hz]" not in [
        cell.text for cell in table.columns
    ]  # a variable says it already
    assert len(everything.rows) == len(sweeps)
    assert "widest range" in figures.how


def test_of_many_filters_the_best_are_drawn_together_and_the_others_apart():
    names = ["a", "b", "c", "d", "e", "f"]
    figures, table, others, everything = blocks_of(
        [row(name=n, rmse=10.0 - i) for i, n in enumerate(names)]
    )

    def curves(block):
        return list(
            dict.fromkeys(d["name"] for figure in block.figures.values() for d in figure["data"])
        )

    assert curves(figures) == [TRUE, *names[-MOST_FILTERS:]]
    assert curves(others) == [TRUE, "a", "b"] and others.folded
    assert (len(table.rows), len(everything.rows)) == (MOST_FILTERS, len(names))


def test_only_the_joints_own_sequence_is_drawn_and_every_one_is_in_the_table():
    figures, _, everything = blocks_of([row(), row(sequence="YXZ", rmse=0.1)])
    [figure] = figures.figures.values()
    np.testing.assert_allclose(
        next(d["y"] for d in figure["data"] if d["yaxis"] == "y2" and "fill" not in d), 0
    )
    assert [line.cells[2].text for line in everything.rows] == ["ZXZ", "YXZ"]


def test_without_cycles_there_is_nothing_to_show():
    assert blocks_of([]) == []
    assert cycle_blocks(replace(judged([row()]), series={}), {0: row()}, "knee", {}) == []


@pytest.mark.browser
@needs_browser
def test_what_is_folded_is_drawn_once_it_is_opened(tmp_path: Path):
    blocks = blocks_of(
        [row(f"joint_{i}", "fourier", None, rom=5.0 + i) for i in range(MOST_SHOWN + 2)]
    )
    assert [type(block) for block in blocks] == [Figures, Table, Figures, Table]
    page = render_page(Page("t", "p", [], [], [Section("chain", "Chain", blocks)]))
    file = tmp_path / "page.html"
    file.write_text(page.replace("</body>", f"<script>{OPEN}</script></body>"), encoding="utf-8")
    drawn = browse(file, tmp_path / "profile", "--dump-dom")
    assert f'data-before="{MOST_SHOWN}"' in drawn
    assert f'data-after="{MOST_SHOWN + 2}"' in drawn
