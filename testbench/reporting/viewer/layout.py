"""How the viewer opens: space on the left, time on the right, the steps beneath."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from testbench.exceptions import NotFoundError
from testbench.records.results.evaluation import Evaluation
from testbench.reporting.viewer.scene import ROW, WORLD, Cells
from testbench.reporting.viewer.signals import PARTS, SIGNALS, chain_joints
from testbench.reporting.viewer.timeline import TIMELINE

BENCH = "bench: true axes red, green, blue; estimated axes in the filter's colour"
MOST_TABS = 4
"""Of so many sensors each has tabs of its own beside the others'; of more, tabs within a tab."""
MOST_STATES = 40
"""Steps that can be read beside one another."""
MOST_STACKED = 4
"""Plots that stand above one another in a tab."""


@dataclass(frozen=True)
class Content:
    """What a recording holds, of what can be shown.

    Attributes:
        signals: Of each sensor, the keys of `SIGNALS` that it has.
        axes: Most axes side by side of one sensor; 0 where no orientation is known.
        true: Whether some of them are the true ones.
        reach: Size of what the arm does [m], None without an arm.
        unjudged: Joints that nothing was judged of, with the label of their own definition.
        lanes: How many the timeline of steps and marks has.
        states: How many steps stand in them.
        texts: Whether there are findings or events.
    """

    signals: Mapping[str, Sequence[str]]
    axes: int
    true: bool
    reach: float | None
    unjudged: Mapping[str, str]
    lanes: int
    states: int
    texts: bool


def layout(
    content: Content, evaluation: Evaluation | None, only: str | None = None
) -> rrb.Blueprint:
    """The blueprint of a session: space on the left, time on the right, the steps beneath; nothing
    stands empty.

    Args:
        content: What the recording holds.
        evaluation: Its errors, None without.
        only: Name of the one pane that is shown; all if None.

    Raises:
        NotFoundError: There is no such pane; lists those that exist.
    """
    spaces, tabs = _spaces(content), _tabs(content, evaluation)
    shown: rrb.Container | rrb.View
    if only is not None:
        named: dict[str, rrb.Container | rrb.View] = {**spaces, **tabs}
        if only not in named:
            raise NotFoundError("pane of the viewer", only, list(named))
        shown = named[only]
    else:
        shown = _together(content, spaces, tabs)
    return rrb.Blueprint(
        shown,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
        auto_layout=False,
    )


def _spaces(content: Content) -> dict[str, rrb.View]:
    """What is seen in space, by name."""
    found: dict[str, rrb.View] = {}
    if content.reach is not None:
        found["bench"] = bench(content.reach, BENCH)
    if content.axes:
        alone = content.reach is None
        name = "orientations, true and estimated" if content.true else "orientations, as estimated"
        found["orientations"] = side_by_side(len(content.signals), content.axes, alone, name)
    return found


def _tabs(content: Content, evaluation: Evaluation | None) -> dict[str, rrb.Container]:
    """What is seen over time, by name: angles, errors, signals."""
    found = _unjudged_tabs(content.unjudged) | _joint_tabs(evaluation) | _chain_tabs(evaluation)
    found |= _orientation_tabs(evaluation)
    signals = {name: _imu_tab(name, keys) for name, keys in content.signals.items() if keys}
    return found | {f"{name} signals": tab for name, tab in signals.items()}


def _together(
    content: Content, spaces: Mapping[str, rrb.View], tabs: Mapping[str, rrb.Container]
) -> rrb.Container:
    """All panes of a session."""
    right: list[rrb.Container | rrb.View] = []
    shares: list[float] = []
    if tabs:
        right.append(rrb.Tabs(*_grouped(tabs, len(content.signals)), active_tab=0))
        shares.append(7.0)
    if content.lanes:
        # of many steps only those about the instant that is shown can be read
        axis = whole() if content.states <= MOST_STATES else None
        name = "protocol and marks"
        right.append(rrb.StateTimelineView(origin="/state", name=name, time_view=axis))
        shares.append(1.0 + 0.4 * content.lanes)
    columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
    if content.texts:
        name = "findings, steps and events"
        right.append(rrb.TextLogView(origin="/events", name=name, columns=columns))
        shares.append(2.2)
    beside = rrb.Vertical(*right, row_shares=shares)
    if not spaces:
        return beside
    left = rrb.Vertical(*spaces.values(), row_shares=[3, 2][: len(spaces)])
    return rrb.Horizontal(left, beside, column_shares=[2, 3]) if right else left


def _grouped(tabs: Mapping[str, rrb.Container], sensors: int) -> list[rrb.Container]:
    """Tabs beside one another; of many sensors those of a kind in a tab of their own."""
    if sensors <= MOST_TABS:
        return list(tabs.values())
    kinds = {"errors": " error", "signals": " signals"}
    inner = {
        kind: [tab for name, tab in tabs.items() if name.endswith(end)]
        for kind, end in kinds.items()
    }
    others = [tab for name, tab in tabs.items() if not name.endswith(tuple(kinds.values()))]
    return [*others, *(rrb.Tabs(*own, name=kind) for kind, own in inner.items() if own)]


def bench(reach: float, name: str) -> rrb.Spatial3DView:
    """The arm with its sensors.

    Args:
        reach: The farthest that any sensor comes from the world's origin [m].
        name: Of the view.
    """
    eye = rrb.EyeControls3D(
        position=(1.15 * reach, -1.5 * reach, 1.05 * reach),
        look_target=(0, -0.1 * reach, 0.42 * reach),
        eye_up=(0, 0, 1),
    )
    return rrb.Spatial3DView(
        origin="/",
        contents=["+ /arm/**", "+ /sensors/**", "+ /path/**"],
        name=name,
        spatial_information=rrb.SpatialInformation(WORLD),
        eye_controls=eye,
    )


def side_by_side(sensors: int, columns: int, alone: bool, name: str) -> rrb.Spatial3DView:
    """All axes in view, be it wide and low under the bench or narrow and high where there is
    none.

    Args:
        sensors: How many there are.
        columns: Axes that stand side by side for one sensor.
        alone: Whether there is no bench above.
        name: Of the view.
    """
    cells = Cells(sensors, columns)
    wide, high = cells.width * cells.columns, ROW * cells.rows
    middle = (0.0, (wide - cells.width) / 2, -(high - ROW) / 2 - 0.05)
    distance = max((1.6 if alone else 0.62) * wide, 1.25 * high, 1.0)
    return rrb.Spatial3DView(
        origin="/",
        contents=["+ /orientations/**"],
        name=name,
        spatial_information=rrb.SpatialInformation(WORLD),
        eye_controls=rrb.EyeControls3D(
            position=(distance, middle[1], middle[2] + 0.25 * distance),
            look_target=middle,
            eye_up=(0, 0, 1),
        ),
        line_grid=False,
    )


def _joint_tabs(evaluation: Evaluation | None) -> dict[str, rrb.Container]:
    tabs: dict[str, rrb.Container] = {}
    rows = evaluation.joint_angle if evaluation is not None else []
    for joint, sequence in dict.fromkeys((row.joint, row.sequence) for row in rows):
        path, name = f"/joints/{joint}/{sequence}", f"{joint} {sequence}"
        flexion = plot("flexion [deg], true and estimated", [f"+ {path}/flexion"])
        contents = [f"+ {path}/error", f"+ {path}/error_uncertainty"]
        error = plot("flexion error [deg], and how far the truth may be off", contents)
        tabs[name] = rrb.Vertical(flexion, error, name=name)
    return tabs


def _unjudged_tabs(joints: Mapping[str, str]) -> dict[str, rrb.Container]:
    """The flexion of joints without a truth, a few in a tab."""
    plots = [
        plot(f"{name}: flexion [deg], {label}", [f"+ /joints/{name}/{label}/flexion"])
        for name, label in joints.items()
    ]
    parts = [plots[i : i + MOST_STACKED] for i in range(0, len(plots), MOST_STACKED)]
    names = ["joint angles", *(f"joint angles {i}" for i in range(2, len(parts) + 1))]
    return {name: rrb.Vertical(*part, name=name) for name, part in zip(names, parts, strict=False)}


def _chain_tabs(evaluation: Evaluation | None) -> dict[str, rrb.Container]:
    """Errors of the joints of the chain, then their angles."""
    sections = chain_joints(evaluation) if evaluation else {}
    found: dict[str, rrb.Container] = {}
    for section, joints in sections.items():
        for kind, title in (("error", "error"), ("angle", "true and estimated")):
            plots = [
                plot(f"{joint}, {title} [deg]", [f"+ /chain/{section}/{joint}/{kind}"])
                for joint in joints
            ]
            found[f"{section} {kind}s"] = rrb.Vertical(*plots, name=f"{section} {kind}s")
    return found


def _orientation_tabs(evaluation: Evaluation | None) -> dict[str, rrb.Container]:
    rows = evaluation.orientation if evaluation is not None else []
    found: dict[str, rrb.Container] = {}
    for sensor in dict.fromkeys(row.sensor for row in rows):
        plots = []
        for part in PARTS:
            path = f"/errors/{sensor}/{part}"
            contents = [f"+ {path}", f"+ {path}_uncertainty"]
            plots.append(plot(f"{part} error [deg]", contents))
        found[f"{sensor} error"] = rrb.Vertical(*plots, name=f"{sensor} error")
    return found


def _imu_tab(name: str, keys: Sequence[str]) -> rrb.Container:
    plots = [plot(SIGNALS[key][1], [f"+ /imu/{name}/{key}"]) for key in keys]
    return rrb.Vertical(*plots, name=f"{name} signals")


def plot(name: str, contents: list[str], window_s: float | None = None) -> rrb.TimeSeriesView:
    """Lines over time.

    Args:
        name: Of the plot.
        contents: Entities, as the viewer's queries spell them.
        window_s: Only so much before the instant that is shown [s]; everything if None.
    """
    window = None
    if window_s is not None:
        begin = rrb.TimeRangeBoundary.cursor_relative(seconds=-window_s)
        end = rrb.TimeRangeBoundary.cursor_relative()
        window = [rrb.VisibleTimeRange(TIMELINE, start=begin, end=end)]
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=name,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        time_ranges=window,
        axis_x=None if window is not None else whole(),
    )


def whole() -> rrb.archetypes.TimeAxis:
    """All of a recording from side to side; else the viewer begins with a minute of it."""
    ends = rrb.TimeRangeBoundary.infinite()
    return rrb.archetypes.TimeAxis(view_range=rr.TimeRange(start=ends, end=ends))


def reach_of(positions: list[np.ndarray]) -> float:
    """The farthest that any sensor comes from the world's origin [m], at least 0.3.

    Args:
        positions: Of each sensor in the world, shape (n, 3) each [m].
    """
    return max(
        [
            0.3,
            *(
                float(np.linalg.norm(position, axis=1).max())
                for position in positions
                if len(position)
            ),
        ]
    )
