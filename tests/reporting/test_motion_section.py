"""The report of sessions without a truth: every figure that their data allow, none empty."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.formats import import_recording
from testbench.reporting.report import render, report
from testbench.reporting.sections.motion import motion_tiles
from tests import without_truth as made
from tests.conftest import FakeClock
from tests.reporting.browsing import browse, needs_browser
from tests.reporting.conftest import Judged
from tests.reporting.test_report import Page

FIGURES = {
    "one_imu": {
        "Euler angles of wrist over time, ZYX": 12,
        "quaternion of wrist over time": 16,
        "difference from device of wrist over time": 9,
        "signals of wrist over time": 9,
        "average cycle of wrist": 2,
    },
    "two_dots": {
        "angles of knee over time, isb_knee": 3,
        "average cycle of knee": 2,
        "Euler angles of thigh over time, ZYX": 3,
        "Euler angles of shank over time, ZYX": 3,
        "quaternion of thigh over time": 4,
        "quaternion of shank over time": 4,
        "signals of thigh over time": 3,
        "signals of shank over time": 3,
        "average cycle of shank": 2,
        "Allan deviation of the specific force of thigh": 7,  # six of three axes, and white noise
    },
    "accelerometer_alone": {
        "signals of chest over time": 3,
        "average cycle of chest": 2,
    },
}
"""By kind of session, the figures and how many lines and bands each has."""


@pytest.fixture(scope="module", params=list(FIGURES))
def kind(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    session = getattr(made, request.param)(tmp_path_factory.mktemp("logs"))
    estimated = estimate(session)
    return request.param, Judged(session, estimated, evaluate(session, estimated))


def drawn(page: Page) -> dict[str, dict]:
    """The figures of a page by what a screen reader says of them."""
    names = [str(own["aria-label"]) for _, own in page.tags if own.get("role") == "figure"]
    return dict(zip(names, page.all_figures, strict=True))


def values(part) -> np.ndarray:
    """Ordinates of a line, whichever way they are written."""
    if isinstance(part, dict):
        return np.frombuffer(base64.b64decode(part["bdata"]), "<f4")
    return np.array([np.nan if value is None else value for value in part], float)


def test_every_figure_that_the_data_allow_is_there_and_holds_data(kind):
    name, judged = kind
    page = Page(render(judged.session, judged.estimate, judged.evaluation))
    figures = drawn(page)
    assert {key: len(figure["data"]) for key, figure in figures.items()} == FIGURES[name]
    for key, figure in figures.items():
        for line in figure["data"]:
            y = values(line["y"])
            assert (
                len(y) > (10 if key.startswith("Allan") else 50) and np.isfinite(y).mean() > 0.9
            ), (key, line["name"])


def test_the_range_of_a_joint_stands_at_the_top(kind):
    tiles = motion_tiles(kind[1].evaluation)
    if kind[0] != "two_dots":
        assert tiles == []
        return
    (tile,) = tiles
    assert float(tile.value) == pytest.approx(made.FLEXION_DEG, abs=0.1)
    assert "not evaluated" in tile.detail and "1.00 Hz" in tile.detail


def test_nothing_was_judged_stands_there_once(kind):
    page = Page(render(kind[1].session, kind[1].estimate, kind[1].evaluation))
    assert page.words.count("nothing was evaluated") == 1
    assert "No orientation was evaluated" not in page.words
    assert "Nothing was evaluated" not in page.words


def test_figures_come_before_what_was_recorded(kind):
    page = render(kind[1].session, kind[1].estimate, kind[1].evaluation)
    assert page.index('id="signals"') < page.index('id="run"')


def test_the_figures_of_a_judged_session_stay_as_they_were(quick: Judged):
    page = Page(render(quick.session, quick.estimate, quick.evaluation))
    assert not any("signals of" in key or "Euler angles" in key for key in drawn(page))


def test_a_sensor_of_quaternions_alone_has_no_empty_figure(tmp_path: Path):
    seconds = made.times(4.0)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(seconds), 1))
    nothing = np.full((len(seconds), 3), np.nan)
    samples = replace(made.samples_of(seconds, q, q), gyr=nothing, acc=nothing)
    session = made.written(tmp_path / "alone", {"imu": samples}, ["device"])
    estimated = estimate(session)
    page = Page(render(session, estimated, evaluate(session, estimated)))
    assert "imu gave no rate, no specific force and no field." in page.words
    assert set(drawn(page)) == {"Euler angles of imu over time, ZYX", "quaternion of imu over time"}


def test_a_recorded_knee_has_its_figures(data: Path, tmp_path: Path):
    files = sorted((data / "xsens_dot").glob("R*.csv"))
    session = import_recording("xsens_dot", files, tmp_path / "dots", FakeClock())
    estimated = estimate(session)
    page = Page(render(session, estimated, evaluate(session, estimated)))
    figures = drawn(page)
    assert "Euler angles of RFemur over time, ZXY" in figures
    assert "signals of RTibia over time" in figures
    for figure in figures.values():
        assert all(np.isfinite(values(line["y"])).mean() > 0.9 for line in figure["data"])


@pytest.mark.browser
@needs_browser
def test_a_browser_draws_them(tmp_path: Path):
    session = made.two_dots(tmp_path)
    estimated = estimate(session)
    page = report(session, estimated, evaluate(session, estimated))
    drawn = browse(page, tmp_path / "profile", "--window-size=1000,9000", "--dump-dom")
    assert drawn.count('class="main-svg"') >= 6
