"""The page of a comparison: what it shows, and that a browser draws it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from testbench.records.results.session_comparison import (
    ComparedMetric,
    ComparedSession,
    Differing,
    Overlay,
    SessionComparison,
    Told,
)
from testbench.reporting.comparison_report import comparison_report, render_comparison
from tests.reporting.browsing import browse, needs_browser

NAMES = {Told.WORSE: "vqf_6d", Told.NOT_SHOWN: "vqf_9d", Told.NOT_KNOWN: "fusion"}


def metric(told: Told) -> ComparedMetric:
    known = told is not Told.NOT_KNOWN
    return ComparedMetric(
        *("elbow.flexion_mean_abs_error_deg", NAMES[told], "ZXZ", "static", "deg"),
        *(0.312, 0.45678, 0.14478),
        ci95=[0.1211, 0.1684] if known else None,
        standard_error=0.0117 if known else None,
        freedom=20,
        p=1e-6 if known else None,
        p_holm=3e-6 if known else None,
        paired_by="step",
        told=told,
        why=None if known else "errors may hang together over 40 s",
    )


@pytest.fixture
def comparison() -> SessionComparison:
    time = np.arange(0, 60, 1 / 60)
    errors = {
        "base": {"a": (time + 15, np.where(time % 4 < 2, 0.3, np.nan))},
        "new": {"b": (time[:-7] + 15.01, np.where(time[:-7] % 4 < 2, -0.45, np.nan))},
    }
    sessions = [ComparedSession(n, f"logs/{n}", "part 1", "2026-12-01T10:00:00Z") for n in "ab"]
    return SessionComparison(
        *(sessions[:1], sessions[1:], 0.05, [metric(told) for told in NAMES]),
        differing=[Differing("firmware of forearm", ["1.6"], ["<1.7>"])],
        left_out=["c is left out: its steps are others."],
        notes=["One session a side."],
        simulated=["arm", "sensors"],
        overlays=[Overlay(1, errors), Overlay(0, errors)],
    )


def words(page: str) -> str:
    shown = re.sub(r"(?s)<script.*?</script>|<style.*?</style>|<[^>]+>", " ", page)
    return " ".join(shown.split())


def test_the_page_says_what_was_found(comparison) -> None:
    told = words(render_comparison(comparison))
    assert (
        "b against a: 1 of 2 metrics is worse by more than the margin of 0.05; 1 of 3 is "
        "not known." in told
    )
    assert "difference +0.145 deg (95 %: +0.121 to +0.168): worse" in told
    assert "Not known of elbow.flexion_mean_abs_error_deg (fusion, ZXZ, static)" in told
    assert "What differs: firmware of forearm (1.6 to &lt;1.7&gt;)" in told
    assert "c is left out: its steps are others." in told
    assert "Simulated: these samples come from models of the arm and of the sensors" in told


def test_no_number_is_finer_than_it_is_known(comparison) -> None:
    """The standard error is 0.0117: values end at the third decimal."""
    told = words(render_comparison(comparison))
    assert not re.search(r"0\.\d{5}", told)
    assert "0.457" in told


def test_what_became_worse_is_drawn_first(comparison) -> None:
    page = render_comparison(comparison)
    first, second = (
        page.index(f"errors of both sides over time, {n}") for n in ("vqf_6d", "vqf_9d")
    )
    assert first < second


def test_without_differences_and_figures_the_page_stands(comparison) -> None:
    bare = replace(comparison, overlays=[], differing=[], metrics=comparison.metrics[2:])
    told = words(render_comparison(bare))
    assert "nothing could be told of 1 metric." in told
    assert "Nothing that the sessions state differs" in told


@needs_browser
@pytest.mark.browser
@pytest.mark.parametrize("width", [1300, 420])
def test_a_browser_draws_it_without_a_complaint(comparison, tmp_path, width) -> None:
    path = comparison_report(comparison, tmp_path / "page.html")
    size = f"--window-size={width},3000"
    dom = browse(path, tmp_path / "profile", size, "--dump-dom")
    assert dom.count('class="main-svg"') >= 3
