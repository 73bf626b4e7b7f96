"""How the viewer opens on a session that is being recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import rerun.blueprint as rrb

from testbench.reporting.viewer.layout import bench, plot, side_by_side
from testbench.reporting.viewer.scene import axes_each
from testbench.reporting.viewer.signals import SIGNALS
from testbench.reporting.viewer.timeline import TIMELINE

WINDOW_S = 30.0
"""So much of the past is in a plot [s]."""
MOST_TABS = 8
"""Sensors with a tab of signals of their own; of more, the others are in the tree of entities."""


@dataclass(frozen=True)
class LiveContent:
    """What a session will hold, as far as its manifest tells.

    Attributes:
        sensors: Names, in order.
        signals: Of each sensor, the keys of `SIGNALS` that it has, and "temperature".
        axes: Most axes side by side of one sensor.
        reach: Size of what the arm does [m]; None without an arm.
        joints: Label of the definition of each joint of the arm's segments, by name.
        judged: Whether filters run that are compared with the arm.
        guarded: Whether limits are watched.
        stepped: Whether there are steps.
    """

    sensors: Sequence[str]
    signals: Mapping[str, Sequence[str]]
    axes: int
    reach: float | None = None
    joints: Mapping[str, str] = field(default_factory=dict)
    judged: bool = False
    guarded: bool = False
    stepped: bool = False


def live_layout(content: LiveContent) -> rrb.Blueprint:
    """The blueprint of a session that is being recorded: the newest instant, and half a minute."""
    space = (
        bench(content.reach, "bench: true axes red, green, blue; filters in their colours")
        if content.reach is not None
        else _beside_one_another(content)
    )
    state = rrb.TextDocumentView(origin="/live/state", name="now")
    left = rrb.Vertical(space, state, row_shares=[3, 2])
    tabs: list[rrb.Container] = []
    for joint, label in content.joints.items():
        path = f"/joints/{joint}/{label}"
        flexion = _recent("flexion [deg], arm and filters", [f"+ {path}/flexion"])
        error = _recent("flexion error [deg], not calibrated", [f"+ {path}/error"])
        tabs.append(rrb.Vertical(flexion, error, name=f"{joint} {label}"))
    shown = content.sensors[:MOST_TABS]
    if content.judged:
        plots = [_recent(f"{name}: error [deg]", [f"+ /errors/{name}/total"]) for name in shown]
        tabs.append(rrb.Vertical(*plots, name="orientation errors"))
    tabs += [_signals(name, content.signals[name]) for name in shown]
    link = {"rate_hz": "rate [Hz]", "age_ms": "age of the last sample [ms]", "lost": "lost samples"}
    tabs.append(
        rrb.Vertical(*(_recent(t, [f"+ /link/{key}"]) for key, t in link.items()), name="links")
    )
    margins = []
    if content.reach is not None:
        margins += [_recent("to the joint's limit [deg]", ["+ /margins/position"])]
        margins += [_recent("speed, part of the limit [%]", ["+ /margins/speed"])]
    if content.guarded:
        margins += [_recent("guards, part of the limit [%]", ["+ /margins/guards/**"])]
    if margins:
        tabs.append(rrb.Vertical(*margins, name="margins"))
    right: list[rrb.Container | rrb.View] = [rrb.Tabs(*tabs, active_tab=0)]
    shares = [7.0]
    if content.stepped:
        right.append(rrb.StateTimelineView(origin="/state", name="protocol"))
        shares.append(2.0)
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
    right.append(rrb.TextLogView(origin="/events", name="events", columns=columns))
    shares.append(2.2)
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*right, row_shares=shares), column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _beside_one_another(content: LiveContent) -> rrb.Spatial3DView:
    """The axes of sensors that no arm carries."""
    sensors = len(content.sensors)
    name = "orientations, as estimated"
    return side_by_side(sensors, axes_each(sensors, content.axes), True, name)


def _signals(name: str, keys: Sequence[str]) -> rrb.Container:
    titles = {key: title for key, (_, title) in SIGNALS.items()}
    titles["temperature"] = "temperature [degC]"
    plots = [_recent(titles[key], [f"+ /imu/{name}/{key}"]) for key in keys]
    return rrb.Vertical(*plots, name=f"{name} signals")


def _recent(name: str, contents: list[str]) -> rrb.TimeSeriesView:
    """A plot of the last half minute."""
    return plot(name, contents, WINDOW_S)
