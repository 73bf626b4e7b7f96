"""The viewer is laid out by what a session holds, and marks what is not sound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun.blueprint as rrb

from testbench.exceptions import NotFoundError
from testbench.records.results.gait import Gait, SensorGait, Stride
from testbench.records.session.samples import ImuSamples
from testbench.reporting.viewer.layout import Content, layout
from testbench.reporting.viewer.marks import changes, contacts, unsound_sensors, with_gaps
from testbench.reporting.viewer.recording import _Seen
from testbench.reporting.viewer.shown_first import by_flexion, by_orientation, visible
from testbench.reporting.viewer.signals import signals_of
from tests.reporting.conftest import Judged

BARE = Content({"imu": ["specific_force_m_s2"]}, 0, False, None, {}, 0, 0, False)


def views(part: rrb.Container | rrb.View) -> Iterator[rrb.View]:
    if isinstance(part, rrb.View):
        yield part
        return
    for inner in part.contents:
        yield from views(inner)


def names(content: Content, only: str | None = None) -> list[str]:
    return [str(view.name) for view in views(layout(content, None, only).root_container)]


def test_an_accelerometer_alone_has_one_plot_and_nothing_else() -> None:
    assert names(BARE) == ["specific force [m/s²]"]


@pytest.mark.parametrize(
    ("change", "more"),
    [
        ({"reach": 0.8}, "bench"),
        ({"axes": 2}, "orientations, as estimated"),
        ({"axes": 2, "true": True}, "orientations, true and estimated"),
        ({"lanes": 2}, "protocol and marks"),
        ({"texts": True}, "findings, steps and events"),
        ({"unjudged": {"knee": "isb_knee"}}, "knee: flexion [deg], isb_knee"),
    ],
)
def test_each_thing_that_a_session_holds_has_its_pane(change: dict, more: str) -> None:
    found = names(replace(BARE, **change))
    assert len(found) == 2
    assert any(name.startswith(more) for name in found)


def test_forty_sensors_have_their_tabs_in_one_tab() -> None:
    many = replace(BARE, signals={f"s{i}": ["specific_force_m_s2"] for i in range(40)})
    (tabs,) = layout(many, None).root_container.contents
    assert [str(tab.name) for tab in tabs.contents] == ["signals"]
    assert len(tabs.contents[0].contents) == 40


def test_one_pane_is_shown_alone_and_another_name_is_told_which_there_are() -> None:
    content = replace(BARE, reach=0.8)
    assert names(content, "imu signals") == ["specific force [m/s²]"]
    assert names(content, "bench")[0].startswith("bench")
    with pytest.raises(NotFoundError, match=r"'elbow'.*bench, imu signals"):
        layout(content, None, "elbow")


def test_a_session_with_arm_and_errors_has_them_all(quick: Judged) -> None:
    content = _Seen.of(quick.session, quick.estimate, quick.evaluation).content()
    assert content.reach is not None and content.true and content.axes == 5
    assert content.lanes == 3, "section, phase, evaluated"
    layouts = layout(content, quick.evaluation)
    shown = [str(view.name) for view in views(layouts.root_container)]
    assert shown.count("flexion [deg], true and estimated") == 2
    assert shown.count("total error [deg]") == 2


def test_what_a_file_does_not_hold_is_no_signal(imported: Judged) -> None:
    samples = imported.session.imu("imu")
    assert signals_of(samples) == ["rate_deg_s", "specific_force_m_s2"]
    without = replace(samples, gyr=np.full_like(samples.gyr, np.nan))
    assert signals_of(without) == ["specific_force_m_s2"]


def test_the_best_and_the_worst_filter_come_first(quick: Judged) -> None:
    rows = {row.filter: row.total_rmse_deg for row in quick.evaluation.orientation[:4]}
    order = by_orientation(quick.evaluation, quick.evaluation.orientation[0].sensor)
    assert order[0] == min(rows, key=rows.__getitem__)
    assert order[1] == max(rows, key=rows.__getitem__)
    assert sorted(order) == sorted(rows)
    assert visible(order) == set(order[:2])
    assert visible(order[:3]) == set(order[:3])
    assert sorted(by_flexion(quick.evaluation, "elbow", "ZXZ")) == sorted(rows)


def test_gaps_full_scale_and_flags_are_marked(imported: Judged, tmp_path: Path) -> None:
    samples, own = imported.session.imu("imu"), imported.estimate.sensors["imu"]
    assert unsound_sensors(imported.session, {"imu": samples}, imported.estimate) == {}
    saturated = samples.saturated.copy()
    saturated[100:120] = True
    clipped = replace(samples, saturated=saturated)
    found = unsound_sensors(imported.session, {"imu": clipped}, imported.estimate)["imu"]
    assert [word for _, word in found] == ["sound", "at full scale", "sound"]
    assert found[1][0] == own.host_time_ns[100]
    kept = np.ones(len(samples), dtype=bool)
    kept[500:600] = False
    parts: ImuSamples = samples.rows(kept)
    found = unsound_sensors(imported.session, {"imu": parts}, None)["imu"]
    assert [word for _, word in found] == ["sound", "gap", "sound"]
    assert (found[2][0] - found[1][0]) * 1e-9 == pytest.approx(1.01, abs=0.02)


def test_a_gap_ends_in_what_the_samples_are_then() -> None:
    time = np.array([0, 1, 2, 100, 101, 102]) * 100_000_000
    words = np.array(["sound", "sound", "sound", "flagged", "flagged", "sound"])
    states = with_gaps(time, changes(time, words))
    assert [word for _, word in states] == ["sound", "gap", "flagged", "sound"]
    assert [at // 100_000_000 for at, _ in states] == [0, 2, 100, 102]


def test_each_foot_that_walks_has_a_lane_of_stance_and_swing() -> None:
    strides = [
        Stride(begin_s=0.0, end_s=1.1, tc_s=0.6, ic_s=1.0),
        Stride(begin_s=1.1, end_s=2.2, tc_s=1.7, ic_s=2.1),
    ]
    feet = {
        "left": SensorGait(sensor="left", on="foot", strides=strides),
        "chest": SensorGait(sensor="chest", on="chest"),
    }
    found = contacts(Gait(session="walk", fingerprint="", sensors=feet))
    assert found.keys() == {"left"}
    assert [(at // 10**8, word) for at, word in found["left"]] == [
        *((6, "swing"), (10, "stance"), (17, "swing"), (21, "stance"))
    ]
    assert contacts(None) == {}
