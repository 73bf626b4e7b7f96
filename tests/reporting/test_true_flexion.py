"""Figures over time: estimated against true flexion, and panels with long names."""

from __future__ import annotations

import base64
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from testbench.reporting.page.figures import time_panels
from testbench.reporting.page.page import Figures
from testbench.reporting.sections.true_flexion import TRUE, flexion_blocks
from tests.reporting.conftest import Judged


def test_titles_of_many_panels_fit_beside_them() -> None:
    time, names = np.arange(5.0), [f"definition_of_{i}_words" for i in range(6)]
    panels = {f"error, {name} [deg]": {"vqf_6d": np.zeros(5)} for name in names}
    layout = time_panels(time, panels, {"vqf_6d": "#123456"})["layout"]
    domains = [layout[f"yaxis{i or ''}"]["domain"] for i in (0, *range(2, 7))]
    assert all(high - low > 0.13 for low, high in domains)
    assert all(below[1] < above[0] for above, below in pairwise(domains))
    assert layout["yaxis"]["title"]["text"] == "error,<br>definition_of_0_words [deg]"


def test_the_flexion_is_drawn_beside_the_true_one(quick: Judged) -> None:
    rows = [row for row in quick.evaluation.joint_angle if row.joint == "elbow"]
    colours = {row.filter: "#123456" for row in rows}
    (block,) = flexion_blocks("elbow", rows, quick.evaluation, colours, [])
    assert isinstance(block, Figures)
    (figure,) = block.figures.values()
    drawn = {
        item["name"]: np.frombuffer(base64.b64decode(item["y"]["bdata"]), "<f4")
        for item in figure["data"]
    }
    assert set(drawn) == {TRUE, *colours}
    known = np.isfinite(drawn[TRUE])
    assert np.nanmax(drawn[TRUE]) == pytest.approx(60, abs=0.1) and np.nanmin(
        drawn[TRUE]
    ) == pytest.approx(0, abs=0.1)
    assert np.abs(drawn["device"][known] - drawn[TRUE][known]).max() < 2
    assert flexion_blocks("elbow", rows, replace(quick.evaluation, series={}), colours, []) == []
