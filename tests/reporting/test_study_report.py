"""The report of a study shows every number of ours with the published one beside it."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import SessionError
from testbench.records.results.study import (
    BoxNumbers,
    StudyBoxes,
    StudyCurve,
    StudyCurves,
    StudyReason,
    StudyRecord,
    StudyRow,
    StudySurface,
    StudyTable,
)
from testbench.reporting.page.figures import box_plots
from testbench.reporting.page.palette import COLOURS, ORDERED, REFERENCE, ordered_colours
from testbench.reporting.page.tables import ratio
from testbench.reporting.study_report import draw_curves, render_study, study_report
from tests.reporting.browsing import browse, needs_browser


@pytest.fixture
def study() -> StudyRecord:
    rows = (
        StudyRow("both <calibrated>", (0.25, None, 4.5e-7), (23.72, "91.65", 8.9378e-7)),
        StudyRow("with g", (0.025, "0.05", 1.0), note="more of it"),
    )
    table = StudyTable(
        "4.3",
        "Angles",
        ("median [deg]", "outliers", "MSE"),
        rows,
        "How to read: so.",
        "Because of & so on.",
        "4.3",
        (3, 0, 9),
        0,
    )
    other = StudyTable(
        "parts", "Other parts", ("median [deg]",), (StudyRow("a", (1.0,)),), "How to read: thus."
    )
    boxes = StudyBoxes(
        "Boxes",
        "angle [deg]",
        {
            "RK4": BoxNumbers(0.1, 0.2, 0.3, 0.4, 0.5, (0.9,)),
            "RK4, with g": BoxNumbers(0.01, 0.02, 0.03, 0.04, 0.05),
        },
        {"RK4, published": BoxNumbers(7, 17, 24, 44, 74)},
        "How.",
        True,
    )
    x = np.array([0.0, 10, 20])
    curves = StudyCurves(
        "Curves <d>",
        "misalignment [deg]",
        "|error| [deg]",
        (
            StudyCurve("theory, 60 deg", x, x**2 / 80, "theory", "60 deg"),
            StudyCurve("fit", x, x**2 / 81, "fit", "60 deg"),
            StudyCurve("simulation, 60 deg", x, x**2 / 79, "simulation", "60 deg"),
            StudyCurve("device, 60 deg", x, np.array([0.1, np.nan, 5.0]), "measurement", "60 deg"),
            StudyCurve("vqf, 60 deg", x, x**2 / 78, "measurement", "60 deg"),
            StudyCurve("over time", np.arange(500.0), np.zeros(500), "measurement"),
        ),
        "How to read: curves.",
    )
    surfaces = (
        StudySurface(
            "About X",
            "d [deg]",
            "f [deg]",
            "|e| [deg]",
            x,
            x[:2],
            np.array([[0, 1.0, 2], [3, np.nan, 5]]),
        ),
        StudySurface("About Z", "d [deg]", "f [deg]", "|e| [deg]", x, x[:2], np.zeros((2, 3))),
    )
    return StudyRecord(
        "demo",
        "Demo study",
        "Why?",
        "Someone, 2018",
        "2026-01-02T03:04:05Z",
        {"seed": 1, "plan_hash": "f00"},
        ("logs/a_session",),
        ("It works.",),
        (table, other),
        (boxes,),
        {"numpy": "2.4"},
        curves=(curves,),
        surfaces=surfaces,
        trace="The first is that of all.",
    )


def words(page: str) -> str:
    body = re.sub(r"<(style|script)\b.*?</\1>", " ", page, flags=re.S)
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", body.replace("<wbr>", ""))))


def test_our_rows_stand_above_the_published_ones_with_their_ratio(study):
    shown = words(render_study(study))
    assert "both <calibrated> 0.250 – 4.50·10⁻⁷ 0.011 published 23.72 91.65 8.9378·10⁻⁷" in shown
    assert "with g more of it 0.025 0.05 1.000000000 –" in shown
    assert "Angles (beside table 4.3)" in shown and "Because of & so on." in shown


def test_a_published_row_without_ours_is_a_row_of_its_own(study):
    row = StudyRow("chest", (None, None, None), (1.5, 2.0, None), "of a walker")
    alone = replace(study.tables[0], rows=(*study.tables[0].rows, row), ratio_column=None)
    page = render_study(replace(study, tables=(alone,)))
    assert "chest of a walker 1.5 2 –" in words(page) and "chest of a walker – – –" not in words(
        page
    )
    assert row.published_alone and not any(r.published_alone for r in study.tables[0].rows)


def test_spreads_settings_prints_and_other_definitions_are_seen(study):
    row = StudyRow(
        "imufilter",
        (0.2873, "word", 1.0),
        (0.76, None, None),
        spread=(0.0312, None, None),
        published_spread=(0.05, None, None),
        settings="published",
        printed="text",
        other="of the norm",
    )
    table = replace(
        study.tables[0],
        rows=(row,),
        spread="standard deviation over 5 parts",
        published_spread="standard deviation in a pose",
        reasons=(StudyReason("A heading.", "candidate", "4.3"), StudyReason("The rest.", "open")),
    )
    page = words(render_study(replace(study, tables=(table,))))
    assert "imufilter, published settings, as printed (text) 0.287 ± 0.031 word" in page
    assert "published: of the norm 0.76 ± 0.05" in page
    assert "± is the standard deviation over 5 parts. Published: ± is the standard" in page
    assert "candidate A heading. Table 4.3 open The rest. –" in page
    assert row.ratio(0) is None


def test_a_report_of_data_of_ones_own_says_whose_method_it_is_and_nothing_is_simulated(study):
    own = words(render_study(replace(study.without_published(), simulated=False)))
    assert "Ours are simulated" not in own and "Ratio" not in own
    assert "The method is that of Someone, 2018; the data are not theirs." in own
    assert "After Someone, 2018" in own and "Beside" not in own


def test_published_points_take_their_turn_among_the_symbols_of_a_group():
    x = np.arange(3.0)
    curves = tuple(
        StudyCurve(name, x, x, kind, "g")
        for name, kind in (("theirs", "published"), ("ours", "measurement"), ("long", "line"))
    )
    theirs, ours, line = draw_curves(StudyCurves("c", "x", "y", curves))["data"]
    assert [theirs["mode"], ours["mode"], line["mode"]] == ["markers", "markers", "lines"]
    assert theirs["marker"]["symbol"] == "circle" and ours["marker"]["symbol"] == "diamond"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (412.3, "410"),
        (12345.0, "12000"),
        (1.0, "1"),
        (0.0512, "0.051"),
        (0.00034, "0.00034"),
        (-0.783, "−0.78"),
        (9.96, "10"),
        (3.4e7, "3.4·10⁷"),
        (5.03e-8, "5.0·10⁻⁸"),
        (0.0, "0"),
        (None, "–"),
        (float("nan"), "–"),
    ],
)
def test_ratios_are_plain_numbers_while_their_zeros_can_be_seen(value, shown):
    assert ratio(value).text == shown


def test_sessions_are_linked_from_where_the_report_lies(study, tmp_path):
    logs, folder = tmp_path / "the logs", tmp_path / "the logs" / "study"
    for session in ("with report", "without"):
        (logs / session).mkdir(parents=True)
    (logs / "with report" / "report.html").write_text("", encoding="utf-8")
    folder.mkdir()
    sessions = tuple(str(logs / name) for name in ("with report", "without", "gone"))
    page = render_study(replace(study, sessions=sessions), folder)
    assert re.findall(r'<a href="(\.\.[^"]+)">([^<]+)</a>', page) == [
        ("../with%20report/report.html", "with report"),
        ("../without", "without"),
    ]
    assert sessions[2] in words(page)
    assert 'href="../' not in render_study(replace(study, sessions=sessions))


def test_axes_are_logarithmic_or_a_plane_and_colours_ordered_where_asked_for(study):
    x = np.array([0.0, 1, 2])
    curves = tuple(StudyCurve(f"{i} deg", x, x + i, "measurement") for i in range(8))
    plain = StudyCurves("c", "x", "y", (StudyCurve("true", x, x, "truth"), *curves))
    drawn = draw_curves(plain)
    assert "type" not in drawn["layout"]["yaxis"] and drawn["data"][0]["line"]["color"] == REFERENCE
    assert [entry["mode"] for entry in drawn["data"]] == ["lines"] + ["markers"] * 8
    assert [entry["line"]["color"] for entry in drawn["data"][1:]] == list(COLOURS[:8])
    assert draw_curves(replace(plain, logarithmic=True))["layout"]["yaxis"]["type"] == "log"
    plane = draw_curves(replace(plain, plane=True))
    assert (
        plane["layout"]["yaxis"]["scaleanchor"] == "x"
        and plane["data"][1]["mode"] == "lines+markers"
    )
    ordered = draw_curves(replace(plain, ordered=True))
    assert [entry["line"]["color"] for entry in ordered["data"][1:]] == list(ORDERED)
    assert ordered_colours(2) == [ORDERED[0], ORDERED[-1]] and ordered_colours(1) == [ORDERED[0]]


def test_findings_sessions_and_versions_are_there(study):
    shown, _, explained = words(render_study(study)).partition(" Terms ")
    assert "Acceptance limit" in explained
    for text in (
        "Demo study",
        "Why?",
        "It works.",
        "logs/a_session",
        "version of numpy 2.4",
        "plan_hash f00",
        "Someone, 2018",
    ):
        assert text in shown
    assert "not measured" not in shown
    assert "Ours are simulated" in shown
    assert (
        "come from these sessions." not in shown
        and "comes from these sessions. The first is that of all." in shown
    )


def test_theory_is_a_line_and_measurements_are_points_of_one_colour(study):
    theory, fit, simulation, device, vqf, series = draw_curves(study.curves[0])["data"]
    assert [entry["mode"] for entry in (theory, fit, simulation, device, vqf, series)] == [
        "lines",
        "lines",
        "markers",
        "markers",
        "markers",
        "lines",
    ]
    assert theory["line"]["dash"] == "solid" and fit["line"]["dash"] == "dot"
    assert len({entry["line"]["color"] for entry in (theory, fit, simulation, device, vqf)}) == 1
    assert series["line"]["color"] != theory["line"]["color"]
    assert len({entry["marker"]["symbol"] for entry in (simulation, device, vqf)}) == 3
    assert device["y"] == [0.1, None, 5.0]


def test_curves_and_surfaces_come_back_from_the_file_as_they_were(study, tmp_path):
    study.save(tmp_path)
    again = StudyRecord.load(tmp_path)
    assert again.to_dict() == study.to_dict()
    device = again.curves[0].curves[3]
    np.testing.assert_array_equal(device.y, [0.1, np.nan, 5.0])
    assert again.surfaces[0].z.shape == (2, 3) and np.isnan(again.surfaces[0].z[1, 1])
    file = tmp_path / "study.json"
    file.write_text(
        file.read_text(encoding="utf-8").replace('"theory"', '"guess"'), encoding="utf-8"
    )
    with pytest.raises(SessionError, match=r"kind: must be 'theory', .*, not 'guess'"):
        StudyRecord.load(tmp_path)


def test_surfaces_share_their_colours(study):
    page = render_study(study)
    assert re.findall(r'"zmax": ?([0-9.]+)', page) == ["5.0", "5.0"]
    assert "Curves &lt;d&gt;" in page and "Surfaces of |e| [deg]" in page


def test_the_page_is_one_file_that_asks_nobody(study, tmp_path):
    page = study_report(study, tmp_path).read_text(encoding="utf-8")
    assert not list(tmp_path.glob("*.partial"))
    head = page[: page.index("</head>")]
    assert "default-src 'none'" in head
    assert not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=\"http", page)


def test_boxes_are_drawn_from_their_numbers_uppermost_first():
    figure = box_plots(
        {"a": BoxNumbers(1, 2, 3, 4, 5, (9.0,)), "b": BoxNumbers(0, 1, 2, 3, 4)},
        {"a": "#000000", "b": "#111111"},
        "x",
    )
    box, outliers, _ = figure["data"]
    assert (box["lowerfence"], box["q1"], box["median"], box["q3"], box["upperfence"]) == (
        [1],
        [2],
        [3],
        [4],
        [5],
    )
    assert outliers["x"] == [9.0]
    assert figure["layout"]["yaxis"]["categoryarray"] == ["b", "a"]


@pytest.mark.browser
@needs_browser
def test_a_browser_draws_it_without_complaint(study, tmp_path: Path):
    page = study_report(study, tmp_path)
    drawn = browse(page, tmp_path / "profile", "--dump-dom")
    assert 'data-drawn="all"' in drawn
    assert drawn.count('class="trace boxes"') == 3
