"""The section of the report on a walk: strides, events, the path from above."""

from __future__ import annotations

import numpy as np

from testbench.records.results.gait import Gait, SensorGait, Stride
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figure_parts import Figure, packed
from testbench.reporting.page.figures import Curve, error_curves, time_panels
from testbench.reporting.page.page import Figures, Section, Sentence, Tile
from testbench.reporting.page.palette import COLOURS, REFERENCE
from testbench.reporting.page.tables import (
    Row,
    Table,
    counted,
    digits,
    header,
    label,
    number,
    significant,
    text,
)
from testbench.reporting.sections.findings import finding_sentences

WORDS = {
    "stride_time_s": ("stride time [s]", 3),
    "step_time_s": ("step time [s]", 3),
    "double_support_s": ("double support [s]", 3),
    "swing_s": ("swing time [s]", 3),
    "length_m": ("stride length [m]", 3),
    "speed_m_s": ("speed [m/s]", 3),
    "rise_m": ("rise of a stride [m]", 3),
    "clearance_m": ("clearance of the sensor [m]", 3),
    "stance_percent": ("stance [%]", 1),
    "cycles": ("cycles", 0),
    "distance_m": ("distance [m]", 2),
    "path_length_m": ("length of the path [m]", 2),
    "end_off_m": ("end of the path off by [m]", 2),
    "path_off_m": ("farthest off the path [m]", 2),
}
"""Of quantities, and their decimals."""
SIGNALS = {
    "toe_down_deg_s": "foot turns toe down [deg/s]",
    "pitch_deg": "pitch [deg]",
    "force_m_s2": "|specific force| [m/s²]",
}
SHOWN_S = 8.0
"""Events are drawn over so much of the walk; the rest is like it."""


def gait_section(found: Gait) -> Section:
    """What a walk came to."""
    section = Section("gait", "Gait")
    section.blocks += finding_sentences(found.all_findings())
    walked = [own for own in found.sensors.values() if own.method]
    if not walked:
        section.blocks.append(Sentence("No walk was found in this session."))
        return section
    colours = {own.sensor: COLOURS[i % len(COLOURS)] for i, own in enumerate(walked)}
    section.blocks += [_sensors(walked), _means(walked)]
    if found.symmetry:
        section.blocks.append(_symmetry(found))
    if found.checks:
        section.blocks.append(_checks(found))
    section.blocks.append(_path(found, walked, colours))
    for own in walked:
        section.blocks.append(_events(found, own, colours[own.sensor]))
        section.blocks.append(_strides(own))
    return section


def gait_tiles(found: Gait | None) -> list[Tile]:
    """The distance of each sensor's walk."""
    walked = [] if found is None else [own for own in found.sensors.values() if own.method]
    return [
        Tile(
            digits(own.distance_m, 2),
            "m",
            f"walked, by {own.sensor}",
            f"{counted(len(own.strides), 'stride')}, {digits(own.cadence_steps_min, 0)} steps a "
            f"minute; end {digits(1e-3 * own.closure_mm, 2)} m from the start",
        )
        for own in walked
    ]


def _sensors(walked: list[SensorGait]) -> Table:
    rows = [
        Row(
            [
                label(own.sensor),
                text(own.on, f"by its {own.known_by}" if own.known_by != "told" else "as told"),
                text(own.method, " ".join(filter(None, (own.parameters, own.filter)))),
                text(own.floor or own.mounting),
                number(len(own.strides), 0),
                number(own.distance_m, 2),
                number(own.cadence_steps_min, 1),
                number(own.stance_percent, 1),
                number(own.closure_mm, 0),
                number(own.closure_sd_mm, 0),
            ]
        )
        for own in walked
    ]
    return Table(
        "Walks",
        header(
            "sensor",
            "on",
            "by",
            "floor or mounting",
            "strides",
            "distance [m]",
            "cadence [steps/min]",
            "stance [%]",
            "end from start [mm]",
            "sd [mm]",
            numbers_from=4,
        ),
        rows,
        "How to read: distance is the sum of the strides; where the walk ended at its start, the "
        "last but one column is the error of the path, and the last one its standard uncertainty.",
    )


def _means(walked: list[SensorGait]) -> Table:
    body = []
    for own in walked:
        for row in own.rows:
            words, decimals = WORDS[row.quantity]
            values = (row.mean, row.sd, row.least, row.most)
            cells = [number(value, decimals) for value in values]
            body.append(Row([label(own.sensor), text(words), number(row.count, 0), *cells]))
    return Table(
        "Means over straight strides",
        header("sensor", "quantity", "strides", "mean", "sd", "least", "most", numbers_from=2),
        body,
        "How to read: sd is the variation from stride to stride. Strides that turn the foot, and "
        "those that begin or end in standing, are left out; the table of strides says which.",
    )


def _symmetry(found: Gait) -> Table:
    rows = []
    for row in found.symmetry:
        words, decimals = WORDS[row.quantity]
        sides = [number(value, decimals) for value in (row.left, row.right)]
        rows.append(Row([label(words), *sides, number(row.difference_percent, 1)]))
    return Table(
        "Left and right",
        header("mean of", "left", "right", "difference [%]"),
        rows,
        "How to read: left less right, by the mean of both (Robinson et al. 1987); 0 is symmetric.",
    )


def _checks(found: Gait) -> Table:
    rows = []
    for row in found.checks:
        words, decimals = WORDS[row.quantity]
        values = [number(value, decimals) for value in (row.value, row.truth, row.error)]
        rows.append(
            Row([label(row.sensor), text(words), *values, significant(row.error_percent, 2)])
        )
    return Table(
        "Against what was counted or measured",
        header("sensor", "quantity", "estimated", "true", "error", "error [%]", numbers_from=2),
        rows,
        "How to read: the truth is what was typed. A path is turned about its start to fit the "
        "corners best, for no sensor knows its heading there.",
    )


def _path(found: Gait, walked: list[SensorGait], colours: dict[str, str]) -> Figures:
    curves = []
    if found.corners_m:
        start = found.corners_m[0]
        x, y = ([corner[i] - start[i] for corner in found.corners_m] for i in (0, 1))
        curves.append(Curve("as walked", x, y, REFERENCE, dashed=True, mode="lines"))
    for own in walked:
        turned = 0.0 if np.isnan(own.path_heading_deg) else np.radians(own.path_heading_deg)
        c, s = float(np.cos(turned)), float(np.sin(turned))
        x = [0.0, *(c * stride.x_m - s * stride.y_m for stride in own.strides)]
        y = [0.0, *(s * stride.x_m + c * stride.y_m for stride in own.strides)]
        curves.append(Curve(own.sensor, x, y, colours[own.sensor]))
    return Figures(
        "The path from above",
        {"the path from above": error_curves(curves, "x [m]", "y [m]", plane=True)},
        "How to read: a point where the foot stands after each stride, both axes to one scale, "
        "each path counted from its own start, along its heading there unless corners were typed.",
    )


def _events(found: Gait, own: SensorGait, colour: str) -> Figures:
    walk = found.walks[own.sensor]
    begin = next((s.begin_s for s in own.strides if s.counted), own.strides[0].begin_s)
    rows = (walk["time_s"] >= begin) & (walk["time_s"] <= begin + SHOWN_S)
    envelope = Envelope(walk["time_s"][rows])
    names = [name for name in SIGNALS if name in walk]
    panels = {SIGNALS[name]: {own.sensor: envelope(walk[name][rows])} for name in names}
    figure = time_panels(envelope.time, panels, {own.sensor: colour})
    shown = [s for s in own.strides if begin <= s.begin_s and s.ic_s <= begin + SHOWN_S]
    if own.method == "strapdown":
        signal = walk["time_s"], walk[names[0]]
        figure["data"] += [
            _marks("initial contact", [s.ic_s for s in shown], signal, "triangle-down"),
            _marks("terminal contact", [s.tc_s for s in shown], signal, "triangle-up"),
        ]
    return Figures(
        f"Events in the signals: {own.sensor}",
        {f"gait events of {own.sensor}": figure},
        "How to read: a foot leaves the ground where it turns fastest toe down, and comes down "
        f"where it ceases to turn toe up. Drawn are {SHOWN_S:g} s from the first straight stride.",
    )


def _marks(
    name: str, times: list[float], signal: tuple[np.ndarray, np.ndarray], symbol: str
) -> Figure:
    """Events on the signal that they were found in."""
    known = np.array([time for time in times if np.isfinite(time)])
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": packed(known),
        "y": packed(np.interp(known, *signal)),
        "yaxis": "y",
        "marker": {"size": 9, "symbol": symbol, "color": REFERENCE},
        "hovertemplate": "%{x:.3f} s",
    }


def _strides(own: SensorGait) -> Table:
    return Table(
        f"Strides of {own.sensor}",
        header(
            "stride",
            "begin [s]",
            "TC [s]",
            "IC [s]",
            "stride time [s]",
            "length [m]",
            "sd [m]",
            "rise [m]",
            "clearance [m]",
            "turn [deg]",
            "left out",
            numbers_from=1,
        ),
        [_stride_row(i, stride) for i, stride in enumerate(own.strides)],
        "How to read: TC is terminal contact, IC initial contact, the stride time that from the IC "
        "before. Clearance is how far the sensor rises; the toe rises less.",
        folded=True,
    )


def _stride_row(i: int, stride: Stride) -> Row:
    times = (stride.begin_s, stride.tc_s, stride.ic_s, stride.stride_time_s)
    ways = (stride.length_m, stride.length_sd_m, stride.rise_m, stride.clearance_m)
    cells = [number(value, 3) for value in (*times, *ways)]
    return Row([label(i + 1), *cells, number(stride.turn_deg, 0), text(stride.left_out)])
