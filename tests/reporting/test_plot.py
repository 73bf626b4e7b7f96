"""Figures for a notebook are those of the report, as objects of plotly's."""

from __future__ import annotations

from pathlib import Path

import plotly.graph_objects as go
import pytest

import testbench
from testbench.exceptions import InputError, NotFoundError
from testbench.records.session.session import Session
from tests.reporting.conftest import Judged, copy_of


@pytest.fixture(scope="module")
def folder(quick: Judged, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with its estimate and evaluation beside it."""
    path = copy_of(quick.session, tmp_path_factory.mktemp("plotted"))
    quick.estimate.save(path)
    quick.evaluation.save(path)
    return path


def test_the_main_figure_is_that_of_the_first_screen(folder: Path, quick: Judged) -> None:
    figure = testbench.plot.error(folder)
    assert isinstance(figure, go.Figure)
    names = {trace.name for trace in figure.data}
    assert names == {"true flexion", *(row.filter for row in quick.evaluation.joint_angle)}
    assert figure.layout.yaxis2.title.text == "error [deg]"


def test_every_kind_of_figure_is_drawn(folder: Path) -> None:
    session = Session(folder)
    assert {trace.type for trace in testbench.plot.bench(session).data} == {"mesh3d", "scatter3d"}
    for found in (
        testbench.plot.ranking(session),
        testbench.plot.spread(session, "elbow"),
        testbench.plot.spread(session, "forearm"),
        testbench.plot.budget(session),
        testbench.plot.every(session),
    ):
        assert found and all(isinstance(figure, go.Figure) for figure in found.values())
    assert len(testbench.plot.every(session)) > 12
    assert testbench.plot.allan(session) == {}  # it rests for 10 s nowhere


def test_what_cannot_be_drawn_is_said(folder: Path, imported: Judged, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="elbow, arm, forearm"):
        testbench.plot.spread(folder, "knee")
    with pytest.raises(InputError, match="was not evaluated"):
        testbench.plot.error(copy_of(imported.session, tmp_path))
    with pytest.raises(InputError, match="no arm"):
        testbench.plot.bench(imported.session)


def test_sessions_and_evaluations_show_themselves_in_a_notebook(quick: Judged) -> None:
    shown = quick.session._repr_html_()
    assert "<td>ur3e</td>" in shown and "sensor forearm" in shown and "completed" in shown
    shown = quick.evaluation._repr_html_()
    for metric in quick.evaluation.metrics:
        if metric.outcome is not None:
            assert f"<td>{metric.name}</td>" in shown and metric.outcome.words in shown
