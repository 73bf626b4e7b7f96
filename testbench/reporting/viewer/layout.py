"""How the viewer opens: space on the left, time on the right, the steps beneath."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun.blueprint as rrb

from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from testbench.reporting.viewer.scene import ROW, WORLD, arrangement, column_width
from testbench.reporting.viewer.signals import PARTS, chain_joints, told
from testbench.reporting.viewer.timeline import TIMELINE

BENCH = "bench: true axes red, green, blue; estimated axes in the filter's colour"
SIGNALS = {
    "rate_deg_s": "angular rate [deg/s]",
    "specific_force_m_s2": "specific force [m/s²]",
    "magnetic_field_uT": "field [µT]",
}


def layout(
    session: Session,
    evaluation: Evaluation | None,
    columns: int,
    reach: float | None,
    magnetometers: set[str],
    unjudged: Mapping[str, str],
) -> rrb.Blueprint:
    """The blueprint of a session.

    Args:
        session: What is looked at.
        evaluation: Its errors, None without.
        columns: Axes that stand side by side for one sensor.
        reach: Size of what the arm does [m], None without an arm.
        magnetometers: Sensors that have one.
        unjudged: Joints that nothing was judged of, with the label of their own definition.
    """
    spaces = [side_by_side(len(session.sensor_names), columns, alone=reach is None)]
    if reach is not None:
        spaces.insert(0, bench(reach, BENCH))
    left = rrb.Vertical(*spaces, row_shares=[3, 2][: len(spaces)])
    tabs = [
        *_unjudged_tabs(unjudged),
        *_joint_tabs(evaluation),
        *_chain_tabs(evaluation),
        *_orientation_tabs(evaluation),
    ]
    tabs += [_imu_tab(name, name in magnetometers) for name in session.sensor_names]
    right: list[rrb.Container | rrb.View] = [rrb.Tabs(*tabs, active_tab=0)]
    shares = [7.0]
    if session.steps:
        right.append(rrb.StateTimelineView(origin="/state", name="protocol"))
        shares.append(1.6)
    shown = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
    if session.events or told(session, evaluation):
        name = "findings, steps and events"
        right.append(rrb.TextLogView(origin="/events", name=name, columns=shown))
        shares.append(2.2)
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Vertical(*right, row_shares=shares), column_shares=[2, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
        auto_layout=False,
    )


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


def side_by_side(sensors: int, columns: int, alone: bool) -> rrb.Spatial3DView:
    """All axes in view, be it wide and low under the bench or narrow and high where there is
    none.

    Args:
        sensors: How many there are.
        columns: Axes that stand side by side for one sensor.
        alone: Whether there is no bench above.
    """
    rows, columns = arrangement(sensors, columns)
    width = column_width(rows, columns)
    middle = (0.0, width * (columns - 1) / 2, -ROW * (rows - 1) / 2 - 0.05)
    distance = max((1.6 if alone else 0.62) * width * columns, 1.25 * ROW * rows, 1.0)
    return rrb.Spatial3DView(
        origin="/",
        contents=["+ /orientations/**"],
        name="orientations, true and estimated",
        spatial_information=rrb.SpatialInformation(WORLD),
        eye_controls=rrb.EyeControls3D(
            position=(distance, middle[1], middle[2] + 0.25 * distance),
            look_target=middle,
            eye_up=(0, 0, 1),
        ),
        line_grid=False,
    )


def _joint_tabs(evaluation: Evaluation | None) -> list[rrb.Container]:
    tabs: list[rrb.Container] = []
    for joint in dict.fromkeys(row.joint for row in evaluation.joint_angle) if evaluation else []:
        rows = [row for row in evaluation.joint_angle if row.joint == joint] if evaluation else []
        for sequence in dict.fromkeys(row.sequence for row in rows):
            path = f"/joints/{joint}/{sequence}"
            flexion = plot("flexion [deg], true and estimated", [f"+ {path}/flexion"])
            error = plot("flexion error [deg]", [f"+ {path}/error"])
            tabs.append(rrb.Vertical(flexion, error, name=f"{joint} {sequence}"))
    return tabs


def _unjudged_tabs(joints: Mapping[str, str]) -> list[rrb.Container]:
    """The flexion of joints without a truth, all in one tab."""
    plots = [
        plot(f"{name}: flexion [deg], {label}", [f"+ /joints/{name}/{label}/flexion"])
        for name, label in joints.items()
    ]
    return [rrb.Vertical(*plots, name="joint angles")] if plots else []


def _chain_tabs(evaluation: Evaluation | None) -> list[rrb.Container]:
    """Errors of the joints of the chain, then their angles."""
    sections = chain_joints(evaluation) if evaluation else {}
    return [
        rrb.Vertical(
            *(
                plot(f"{joint}, {title} [deg]", [f"+ /chain/{section}/{joint}/{kind}"])
                for joint in joints
            ),
            name=f"{section} {kind}s",
        )
        for section, joints in sections.items()
        for kind, title in (("error", "error"), ("angle", "true and estimated"))
    ]


def _orientation_tabs(evaluation: Evaluation | None) -> list[rrb.Container]:
    sensors = (
        list(dict.fromkeys(row.sensor for row in evaluation.orientation)) if evaluation else []
    )
    return [
        rrb.Vertical(
            *(plot(f"{part} error [deg]", [f"+ /errors/{name}/{part}"]) for part in PARTS),
            name=f"{name} error",
        )
        for name in sensors
    ]


def _imu_tab(name: str, magnetometer: bool) -> rrb.Container:
    signals = {
        key: title for key, title in SIGNALS.items() if magnetometer or key != "magnetic_field_uT"
    }
    return rrb.Vertical(
        *(plot(title, [f"+ /imu/{name}/{key}"]) for key, title in signals.items()),
        name=f"{name} signals",
    )


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
    )


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
