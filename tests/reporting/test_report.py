"""The report is one file that needs nothing else, says what it knows, and escapes what it is
told.
"""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from testbench.cli.output import say_evaluation
from testbench.records.findings.catalogue import finding
from testbench.records.findings.earlier import NOTED
from testbench.records.results.answer import answers
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Metric, Outcome
from testbench.records.results.evaluation_rows import FieldFollowingRow, OutlierRow
from testbench.records.session.session import Session
from testbench.records.specs.published import load_published
from testbench.reporting.page.page import Figures, Heading, Section, Sentence, figures_first
from testbench.reporting.page.palette import COLOURS, filter_colours, rgb
from testbench.reporting.page.tables import Cell, Row, Table
from testbench.reporting.report import render, report
from testbench.reporting.sections.fit import fit_section
from testbench.reporting.sections.joint import joint_section
from testbench.reporting.sections.magnetic import magnetic_blocks
from testbench.reporting.sections.orientation import orientation_section
from tests.reporting.browsing import browse, needs_browser
from tests.reporting.conftest import Judged, copy_of


class Page(HTMLParser):
    """The tags, scripts and words of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.words = ""
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.words += data

    @property
    def all_figures(self) -> list[dict]:
        return [json.loads(script) for script in self.scripts if script.startswith('{"data"')]

    @property
    def figures(self) -> list[dict]:
        """Those that lie flat."""
        return [figure for figure in self.all_figures if "scene" not in figure["layout"]]


@pytest.fixture(scope="module")
def quick_page(quick: Judged) -> Page:
    return Page(report(quick.session, quick.estimate, quick.evaluation).read_text(encoding="utf-8"))


def test_the_report_refers_to_nothing_outside(quick_page: Page) -> None:
    for tag, attributes in quick_page.tags:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:")), (tag, name, value)
    policy = next(a["content"] for tag, a in quick_page.tags if tag == "meta" and "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_the_button_that_uploads_figures_is_off(quick_page: Page) -> None:
    own = quick_page.scripts[-1]
    assert "showSendToCloud: false" in own
    assert "sendChartToCloud" not in own


def test_the_report_names_what_was_run_and_the_verdict(quick_page: Page, quick: Judged) -> None:
    badges = [
        a["class"]
        for tag, a in quick_page.tags
        if tag == "span" and "large" in (a.get("class") or "")
    ]
    assert badges == [f"badge {quick.evaluation.outcome.value} large"]
    for words in (
        "A look at the whole bench",
        "ur3e",
        "wrist_3_link",
        "Xsens DOT",
        quick.session.manifest.plan.hash,
        "seed",
    ):
        assert words.lower() in quick_page.words.lower()


@pytest.mark.parametrize("outcome", [None, *Outcome])
def test_report_and_terminal_give_the_verdict_in_the_same_words(
    imported: Judged, outcome: Outcome | None, capsys: pytest.CaptureFixture[str]
) -> None:
    evaluation = imported.evaluation
    if outcome is not None:
        limited = Metric("imu.total_rmse_deg", 0.5, "deg", None, 1.0, outcome, "")
        evaluation = replace(evaluation, metrics=[limited], outcome=outcome)
    page = report(imported.session, imported.estimate, evaluation).read_text(encoding="utf-8")
    found = re.search(r'<span class="badge (\w+) large">([^<]+)</span>', page)
    assert found is not None
    say_evaluation(evaluation, "session", None)
    assert f"outcome: {found[2]}\n" in capsys.readouterr().out
    assert found[2] == (
        "no limits were stated" if outcome is None else outcome.value.replace("_", " ")
    )


def test_an_imported_recording_is_not_spoken_of_as_a_run(imported: Judged) -> None:
    words = re.sub(
        r"\s+",
        " ",
        Page(report(imported.session, imported.estimate, imported.evaluation).read_text()).words,
    )
    for said in (
        "Imported2026-01-02",
        "What was recorded",
        "none: an imported recording",
        "the same files, options and versions",
    ):
        assert said in words, said
    for wrong in (
        "Started",
        "same plan",
        "seed",
        "What was run",
        "status of the bench",
        "The protocol",
    ):
        assert wrong not in words, wrong


def test_a_recording_of_devices_is_dated_as_one_and_says_what_it_cannot_repeat(
    imported: Judged, tmp_path: Path
) -> None:
    folder = copy_of(imported.session, tmp_path)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest |= {
        "kind": "recording",
        "notes": ["imu: 98.0 samples in a second arrived, 100 were expected."],
    }
    del manifest["source"]
    (folder / "manifest.json").write_text(json.dumps(manifest))
    words = re.sub(r"\s+", " ", Page(report(Session(folder)).read_text()).words)
    for said in (
        "Recorded2026-01-02",
        "none: devices recorded alone",
        "cannot be measured again",
        "98.0 samples in a second",
    ):
        assert said in words, said
    assert "same plan" not in words and "Started" not in words


def test_every_table_and_figure_says_how_to_read_it(quick_page: Page) -> None:
    classes = [a.get("class") or "" for _, a in quick_page.tags]
    blocks = classes.count("scroll") + classes.count("figures") + classes.count("small-figures")
    assert blocks > 10
    assert quick_page.words.count("How to read") == blocks == classes.count("how")


def test_the_first_screen_answers_before_anything_else(quick_page: Page, quick: Judged) -> None:
    for answer in answers(quick.evaluation):
        assert quick_page.words.index(answer.text) < quick_page.words.index("Metrics with limits")
    first, beside = quick_page.figures[:2]
    names = {trace["name"] for trace in first["data"]}
    assert names == {"true flexion", *(row.filter for row in quick.evaluation.joint_angle)}
    assert first["layout"]["yaxis2"]["title"]["text"] == "error [deg]"
    values = {t["name"]: t["x"][0] for t in beside["data"] if t["mode"] == "markers"}
    assert list(values.values()) == sorted(values.values())
    for row in quick.evaluation.joint_summary:
        if (row.sequence, row.section) == ("ZXZ", "static"):
            assert values[row.filter] == pytest.approx(row.errors.mean_abs_error_deg, rel=1e-3)
            assert beside["layout"]["shapes"][0]["x0"] == row.expanded_uncertainty_magnitude_deg


def test_figures_stand_before_tables_and_tables_are_folded() -> None:
    table = Table("t", [Cell("a")], [Row([Cell("1")])], "How to read: so.")
    figure = Figures("f", {"f": {"data": [], "layout": {"height": 1}}}, "")
    said = Sentence("said")
    plain = Section("a", "A", [table, said])
    assert figures_first(plain) is plain
    mixed = Section("b", "B", [table, figure, Heading("part"), table, said, figure])
    blocks = figures_first(mixed).blocks
    kinds = [Figures, Table, Heading, Sentence, Figures, Table]
    assert [type(block) for block in blocks] == kinds
    assert all(block.folded for block in blocks if isinstance(block, Table))
    hidden = Section("c", "C", [table, replace(figure, folded=True)])
    assert figures_first(hidden) is hidden


def test_published_numbers_stand_beside_ours(quick_page: Page) -> None:
    for row in load_published().flexion_mean_abs_error:
        assert f"Table {row.table}" in quick_page.words
    # Table 5.6 at 0, 30 and 60 degrees, and 5.7, which belongs to the sequence YXZ.
    text = re.sub(r"\s+", " ", quick_page.words)
    assert re.search(r"Table 5\.6 [^0-9]*0\.00 ?0\.21 ?0\.36", text)
    assert re.search(r"Euler sequence YXZ.*Table 5\.7 [^0-9]*3\.68 ?1\.16 ?4\.47", text)
    assert re.search(r"Euler sequence ZYZ, published only.*Table 5\.9", text)


def test_the_published_row_of_a_filter_stands_right_under_it(quick: Judged) -> None:
    text = report(quick.session, quick.estimate, quick.evaluation).read_text(encoding="utf-8")
    table = text[text.index("Euler sequence ZXZ") : text.index("Euler sequence YXZ")]
    names = re.findall(r'<th scope="row"[^>]*>([^<]+?)\s*<', table)
    assert names[:2] == ["device", "Table 5.6"]
    assert names[-2:] == ["Table 5.8", "Table 5.10"]


def test_our_numbers_are_those_of_the_evaluation(quick_page: Page, quick: Judged) -> None:
    row = next(
        r
        for r in quick.evaluation.joint_angle
        if r.flexion_deg == 60 and r.misalignment_deg == 0 and r.filter == "fusion"
    )
    titles = [a.get("title") or "" for tag, a in quick_page.tags if tag == "td"]
    assert any(title.startswith(f"{row.flexion_mean_abs_error_deg:.4f} deg") for title in titles)


def test_every_axis_of_every_figure_has_a_unit(quick_page: Page) -> None:
    assert len(quick_page.figures) > 8
    for figure in quick_page.figures:
        axes = {
            key: value
            for key, value in figure["layout"].items()
            if re.fullmatch(r"[xy]axis\d*", key)
        }
        assert len(axes) >= 2
        for axis in axes.values():
            if axis.get("type") == "category":
                continue  # names of filters
            assert re.search(r"\[.+\]", axis["title"]["text"])


def test_no_figure_is_empty(quick_page: Page) -> None:
    for figure in quick_page.figures:
        assert figure["data"]
        for trace in figure["data"]:
            assert len(trace["y"]["bdata"] if isinstance(trace["y"], dict) else trace["y"]) > 0


def test_hostile_text_is_shown_and_not_run(quick: Judged, tmp_path: Path) -> None:
    folder = copy_of(quick.session, tmp_path)
    hostile = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["protocol"] |= {"purpose": hostile, "name": hostile}
    manifest["message"] = manifest["sensors"]["arm"]["description"] = hostile
    manifest["software"][hostile] = hostile
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    metrics = [replace(metric, meaning=hostile) for metric in quick.evaluation.metrics]
    rows = [replace(row, section=hostile) for row in quick.evaluation.joint_angle]
    evaluation = replace(
        quick.evaluation, metrics=metrics, joint_angle=rows, findings=[finding(NOTED, text=hostile)]
    )
    text = report(Session(folder), quick.estimate, evaluation).read_text(encoding="utf-8")
    assert hostile not in text
    assert html.escape(hostile, quote=False) in text
    assert not [a for tag, a in Page(text).tags if tag == "img" or "onerror" in a]
    assert [
        script
        for script in Page(text).scripts
        if "alert(1)" in script and not script.startswith('{"data"')
    ] == []


def test_a_session_that_was_not_evaluated_says_so(quick: Judged, tmp_path: Path) -> None:
    page = Page(report(Session(copy_of(quick.session, tmp_path))).read_text(encoding="utf-8"))
    assert "This session has not been evaluated" in page.words
    assert "Nothing has been estimated" in page.words
    assert page.figures == []
    assert all("plotly.js" not in script[:400] for script in page.scripts)
    assert [a["class"] for _, a in page.tags if "large" in (a.get("class") or "")] == [
        f"badge {Outcome.NOT_MEASURED.value} large"
    ]


def test_estimate_and_evaluation_are_read_from_the_folder(quick: Judged, tmp_path: Path) -> None:
    folder = copy_of(quick.session, tmp_path)
    quick.estimate.save(folder)
    quick.evaluation.save(folder)
    given = report(Session(folder), quick.estimate, quick.evaluation).read_text(encoding="utf-8")
    assert report(Session(folder)).read_text(encoding="utf-8") == given


def test_an_imported_recording_has_orientation_but_no_joints(imported: Judged) -> None:
    page = Page(
        report(imported.session, imported.estimate, imported.evaluation).read_text(encoding="utf-8")
    )
    sections = [a["id"] for tag, a in page.tags if tag == "section"]
    assert "orientation" in sections
    assert "joints" not in sections
    # over time and filter beside filter; its chapter with two histograms, box plot and difference
    assert len(page.figures) == 7
    assert "an imported recording" in page.words
    assert "it is evaluated as a whole" in page.words
    assert "CC0" in page.words
    assert "Simulated" not in page.words


def test_of_simulated_sensors_on_an_arm_that_reports_only_the_sensors_are_called_simulated(
    quick: Judged, tmp_path: Path
) -> None:
    folder = copy_of(quick.session, tmp_path)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["arm"] = {"driver": "ur", "timing": {"samples_missed": 398}}
    happened = [
        {
            "host_time_ns": 2 * 10**9,
            "event": "state",
            "state": "paused",
            "before": "running",
            "why": "guard: too warm",
        },
        {"host_time_ns": 3 * 10**9, "event": "paused"},
        {
            "host_time_ns": 3 * 10**9,
            "event": "guard",
            "guard": "temperature_degC",
            "subject": "elbow",
            "action": "pause",
        },
        {"host_time_ns": 7 * 10**9, "event": "resumed"},
    ]
    with (folder / "events.jsonl").open("a", encoding="utf-8") as events:
        events.writelines(json.dumps(event) + "\n" for event in happened)
    manifest["files"].pop("events.jsonl")
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    page = Page(
        report(Session(folder), quick.estimate, quick.evaluation).read_text(encoding="utf-8")
    )
    assert (
        "models of the sensors, which followed the motion that the controller of an arm reported"
        in page.words
    )
    assert "models of the arm" not in page.words
    assert "bit by bit" not in page.words
    assert "Paused at 3.0 s for 4.0 s (guard: too warm)." in page.words
    assert (
        "Limits of guards that were broken (1 in all): temperature_degC of elbow (pause)."
        in page.words
    )
    assert "398 did not come" in page.words


def test_sweeps_without_a_flexion_get_a_table_of_their_own(quick: Judged) -> None:
    swept = [
        row
        for row in quick.evaluation.joint_angle
        if row.section == "sweep" and row.filter == "device"
    ][:1]
    rows = [
        replace(swept[0], variables={"amplitude_deg": a, "frequency_hz": f}, flexion_rmse_deg=a * f)
        for a in (5.0, 10.0)
        for f in (0.1, 0.5)
    ]
    evaluation = replace(quick.evaluation, joint_angle=rows)
    page = Page(report(quick.session, quick.estimate, evaluation).read_text(encoding="utf-8"))
    assert "RMS flexion error [deg] of the sweeps" in page.words
    assert re.search(r"frequency \[Hz\]\s*amplitude \[deg\]\s*0\.1\s*0\.5", page.words)
    assert re.search(r"5\s*0\.50\s*2\.50\s*10\s*1\.00\s*5\.00", page.words)


@pytest.mark.browser
@needs_browser
def test_a_browser_draws_the_figures_without_complaint(quick: Judged, tmp_path: Path) -> None:
    page = report(quick.session, quick.estimate, quick.evaluation)
    picture = tmp_path / "page.png"
    browse(
        page,
        tmp_path / "profile",
        "--blink-settings=preferredColorScheme=0",  # dark; test_looks has the light one
        "--window-size=1000,6000",
        f"--screenshot={picture}",
    )
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
    assert (pixels == (20, 23, 28)).all(axis=1).mean() > 0.5
    for colour in COLOURS[:4]:
        assert (pixels == rgb(colour)).all(axis=1).sum() > 40, colour


def test_every_mean_error_has_its_uncertainty_and_every_source_its_line(
    quick_page: Page, quick: Judged
) -> None:
    text = re.sub(r"\s+", " ", quick_page.words)
    for summary in quick.evaluation.joint_summary:
        assert summary.expanded_uncertainty_deg is not None
        shown = (
            f"{summary.errors.mean_error_deg:.3f} ± {summary.expanded_uncertainty_deg:.3f}".replace(
                "-", "−"
            )
        )
        assert shown.removeprefix("−") in text
    for budget in quick.evaluation.uncertainty:
        assert f"Budget of the {budget.quantity} error" in text
        assert all(source.source in text for source in budget.sources)


def test_the_report_says_what_intervals_speak_of_and_why_there_is_no_ranking(
    quick_page: Page, quick: Judged
) -> None:
    assert not quick.evaluation.ranking
    for owner in ("elbow, section static", "arm", "forearm"):
        assert f"The filters are not ranked for {owner}: their errors may last" in quick_page.words
    short = "The filters are not ranked for elbow, section sweep: one short sweep does not tell"
    assert short in quick_page.words
    assert "is for this session repeated on the same part" in quick_page.words
    reasons = {m.no_interval for m in quick.evaluation.metrics if m.no_interval}
    assert reasons and all(reason in quick_page.words for reason in reasons)
    assert "[not known]" in quick_page.words


def test_a_joint_that_names_no_publication_gets_none_beside_it(
    quick: Judged, tmp_path: Path
) -> None:
    folder = copy_of(quick.session, tmp_path)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["analysis"]["joints"]["elbow"]["published"] = None
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    text = report(Session(folder), quick.estimate, quick.evaluation).read_text(encoding="utf-8")
    assert "Table 5." not in text and "published" not in Page(text).words.lower()


def test_an_optical_truth_of_unknown_accuracy_is_said_to_be_so(imported: Judged) -> None:
    text = Page(
        report(imported.session, imported.estimate, imported.evaluation).read_text(encoding="utf-8")
    ).words
    assert "the accuracy of the reference system is not known" in text
    assert "±" not in text[
        text.index("Orientation error of each sensor") : text.index("Spread, delay")
    ].replace("mean heading ± U", "")


def test_an_outlier_is_remarked_beside_its_row_and_begins_hidden(quick: Judged) -> None:
    rows = [
        OutlierRow(
            "arm", None, None, "all", "heading", "fusion", 80.0, 2.0, "It is known to run away."
        ),
        OutlierRow(
            "elbow",
            "static",
            "ZXZ",
            "static",
            "flexion",
            "fusion",
            30.0,
            1.5,
            "It is known to run away.",
        ),
    ]
    evaluation = replace(quick.evaluation, outliers=rows)
    colours = filter_colours(["device", "vqf_6d", "vqf_9d", "fusion"])
    table = next(
        block
        for block in orientation_section(evaluation, colours, []).blocks
        if isinstance(block, Table)
    )
    remarks = {(row.cells[0].text, row.cells[1].text): row.cells[-1].text for row in table.rows}
    assert (
        remarks["fusion", "arm"]
        == "heading 80.0 deg: outlier, above 2.0 deg. It is known to run away."
    )
    assert all(said == "–" for place, said in remarks.items() if place != ("fusion", "arm"))
    blocks = joint_section(evaluation, {"elbow": None}, colours, []).blocks
    sentences = [block.text for block in blocks if isinstance(block, Sentence)]
    assert (
        "Outlier fusion (ZXZ, static, static: 30.0 deg, above 1.5 deg). It is known to run away."
        in sentences
    )
    curves = [
        curve
        for block in blocks
        if isinstance(block, Figures) and block.caption.startswith(("Mean", "Signed"))
        for figure in block.figures.values()
        for curve in figure["data"]
        if "visible" in curve
    ]
    assert curves and {
        curve["name"] for curve in curves if curve["visible"] == "legendonly" and "name" in curve
    } == {"fusion"}


def test_the_report_shows_the_magnetic_field_and_what_disturbed_it(
    quick_page: Page, quick: Judged
) -> None:
    for sensor in ("arm", "forearm"):
        assert f"Magnetic field at {sensor} against that of the reference pose" in quick_page.words
        assert f"Magnetic field over time: {sensor}" in quick_page.words
        assert (
            f"How much of the field's heading each filter follows at {sensor} cannot be told"
            in quick_page.words
        )
    for dipole in quick.session.manifest.content["environment"]["dipoles"]:
        assert dipole["name"] in quick_page.words
    assert "de Vries" in quick_page.words


def test_the_report_shows_how_much_of_the_field_each_filter_follows(quick: Judged) -> None:
    told = FieldFollowingRow("arm", "vqf_9d", 700, 1.234, 0.307, [0.111, 0.503], 9)
    evaluation = replace(
        quick.evaluation, magnetic_following=[told, replace(told, filter="vqf_6d", followed=-0.004)]
    )
    filters = {row.filter for row in evaluation.magnetic_errors}
    blocks = magnetic_blocks(evaluation, "arm", dict.fromkeys(filters, "#000000"), [])
    table = next(
        block for block in blocks if isinstance(block, Table) and "follows: arm" in block.caption
    )
    assert "1.23 deg" in table.caption
    assert [[cell.text for cell in row.cells] for row in table.rows] == [
        ["vqf_9d", "0.31 [0.11, 0.50]", "9"],
        ["vqf_6d", "0.00 [0.11, 0.50]", "9"],
    ]


def test_what_became_of_samples_without_a_stored_calibration_depends_on_the_sessions_own(
    quick: Judged,
) -> None:
    def said(estimate: Estimate) -> str:
        return " ".join(
            block.text for block in fit_section(estimate).blocks if isinstance(block, Sentence)
        )

    assert "the samples went on as recorded: arm, forearm" in said(quick.estimate)
    arm = quick.estimate.sensors["arm"]
    fitted = replace(arm, calibration=replace(arm.calibration, method="static_poses"))
    estimate = replace(quick.estimate, sensors=quick.estimate.sensors | {"arm": fitted})
    assert "corrected by the one above alone: arm." in said(
        estimate
    ) and "as recorded: forearm." in said(estimate)


def test_the_vendors_filter_is_spoken_of_only_where_it_ran(quick: Judged) -> None:
    assert "Rows of the filter “device”" in render(quick.session, quick.estimate, quick.evaluation)
    evaluation = replace(quick.evaluation, orientation=[], joint_angle=[])
    assert "Rows of the filter" not in render(quick.session, None, evaluation)
