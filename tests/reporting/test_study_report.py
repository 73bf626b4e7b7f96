"""The report of a study shows every number of ours with the published one beside it."""

from __future__ import annotations

import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest

from testbench.records.study import BoxNumbers, StudyBoxes, StudyRecord, StudyRow, StudyTable
from testbench.reporting.figures import box_plots
from testbench.reporting.study_report import render_study, study_report

CHROMIUM = shutil.which("chromium")


@pytest.fixture
def study() -> StudyRecord:
    rows = (
        StudyRow("both <calibrated>", (0.25, None, 4.5e-7), (23.72, "91.65", 8.9378e-7)),
        StudyRow("with g", (0.025, "0.05", 1.0), note="more of it"),
    )
    table = StudyTable("4.3", "Angles", ("median [deg]", "outliers", "MSE"), rows, "How to read: so.", "Because of & so on.",
                       "4.3", (3, 0, 9), 0)  # fmt: skip
    other = StudyTable("parts", "Other parts", ("median [deg]",), (StudyRow("a", (1.0,)),), "How to read: thus.")
    boxes = StudyBoxes("Boxes", "angle [deg]", {"RK4": BoxNumbers(0.1, 0.2, 0.3, 0.4, 0.5, (0.9,)), "RK4, with g": BoxNumbers(
        0.01, 0.02, 0.03, 0.04, 0.05)}, {"RK4, published": BoxNumbers(7, 17, 24, 44, 74)}, "How.", True)  # fmt: skip
    return StudyRecord("demo", "Demo study", "Why?", "Someone, 2018", "2026-01-02T03:04:05Z", {"seed": 1, "plan_hash": "f00"},
                       ("logs/a_session",), ("It works.",), (table, other), (boxes,), {"numpy": "2.4"})  # fmt: skip


def words(page: str) -> str:
    body = re.sub(r"<(style|script)\b.*?</\1>", " ", page, flags=re.S)
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", body)))


def test_our_rows_stand_above_the_published_ones_with_their_ratio(study):
    shown = words(render_study(study))
    assert "both <calibrated> 0.250 – 4.5e−07 0.011 published 23.72 91.65 8.9378e-07" in shown
    assert "with g more of it 0.025 0.05 1.000000000 –" in shown
    assert "Angles (beside table 4.3)" in shown and "Because of & so on." in shown


def test_findings_sessions_and_versions_are_there(study):
    shown = words(render_study(study))
    for text in ("Demo study", "Why?", "It works.", "logs/a_session", "version of numpy 2.4", "plan_hash f00", "Someone, 2018"):
        assert text in shown
    assert "not measured" not in shown
    assert "Ours are simulated" in shown


def test_the_page_is_one_file_that_asks_nobody(study, tmp_path):
    page = study_report(study, tmp_path).read_text(encoding="utf-8")
    assert not list(tmp_path.glob("*.partial"))
    head = page[: page.index("</head>")]
    assert "default-src 'none'" in head
    assert not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=\"http", page)


def test_boxes_are_drawn_from_their_numbers_uppermost_first():
    figure = box_plots(
        {"a": BoxNumbers(1, 2, 3, 4, 5, (9.0,)), "b": BoxNumbers(0, 1, 2, 3, 4)}, {"a": "#000000", "b": "#111111"}, "x"
    )
    box, outliers, _ = figure["data"]
    assert (box["lowerfence"], box["q1"], box["median"], box["q3"], box["upperfence"]) == ([1], [2], [3], [4], [5])
    assert outliers["x"] == [9.0]
    assert figure["layout"]["yaxis"]["categoryarray"] == ["b", "a"]


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_a_browser_draws_it_without_complaint(study, tmp_path: Path):
    page = study_report(study, tmp_path)
    command = [
        str(CHROMIUM),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--no-first-run",
    ]
    command += [
        f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=10000",
        "--enable-logging=stderr",
        "--dump-dom",
    ]
    result = subprocess.run([*command, page.as_uri()], capture_output=True, text=True, check=False, timeout=60)
    assert "CONSOLE" not in result.stderr, result.stderr
    assert 'data-drawn="all"' in result.stdout
    assert result.stdout.count('class="trace boxes"') == 3
