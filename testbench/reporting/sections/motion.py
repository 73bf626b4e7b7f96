"""The sections of the report on what nobody judges: how joints and sensors moved, how far the
filters lie apart, and what the sensors read.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from testbench.frames import NANOSECONDS
from testbench.records.results.estimate import Estimate, SensorEstimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.results.recording_rows import (
    AngleRangeRow,
    DifferenceRow,
    FoundCycleRow,
    OrientationChangeRow,
)
from testbench.records.session.layout import (
    FOUND_CYCLES,
    difference_table,
    euler_table,
    motion_table,
)
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.band import Band
from testbench.reporting.page.decimation import Envelope
from testbench.reporting.page.figures import Curve, Figure, Span, error_curves, time_panels
from testbench.reporting.page.page import Block, Figures, Heading, Section, Sentence, Tile
from testbench.reporting.page.palette import AXES_COLOURS, COLOURS
from testbench.reporting.page.tables import (
    Row,
    Table,
    counted,
    digits,
    header,
    label,
    number,
    text,
    unit_words,
)
from testbench.reporting.sections.normal import normal_band, normal_words

Colours = Mapping[str, str]
PLACES = ("first", "second", "third")
AXES = "xyz"
MOST_DRAWN = 3
"""Sensors whose figures are drawn at once; those of further ones are drawn when asked for."""
SAMPLES = {"gyr": "angular rate [deg/s]", "acc": "specific force [m/s²]", "mag": "field [µT]"}
NOT_JUDGED = "Nobody knows the true angle here: these are estimates, and none is an error."


def unjudged_joints(evaluation: Evaluation) -> list[str]:
    """Joints that are described and not judged."""
    return _owners(evaluation, "joint")


def unjudged_sensors(evaluation: Evaluation) -> list[str]:
    """Sensors that are described and not judged."""
    return list(dict.fromkeys(row.sensor for row in evaluation.rests))


def motion_tiles(evaluation: Evaluation) -> list[Tile]:
    """Range of motion of each joint that nobody judges, by its first filter."""
    tiles = []
    for joint in unjudged_joints(evaluation):
        row = next(
            (
                r
                for r in evaluation.angle_ranges
                if (r.kind, r.owner) == ("joint", joint) and r.flexion and r.range_deg is not None
            ),
            None,
        )
        if row is None:
            continue
        cycles = next((r for r in evaluation.found_cycles if r.owner == joint), None)
        often = (
            f"; {counted(cycles.cycles, 'cycle')} found, {digits(cycles.frequency_hz, 2)} Hz"
            if cycles is not None
            else ""
        )
        detail = f"{row.filter}, {row.sequence}; not evaluated{often}"
        tiles.append(Tile(digits(row.range_deg, 1), "deg", f"range of flexion, {joint}", detail))
    return tiles


def _title(what: str, evaluation: Evaluation) -> str:
    """Of a section, told apart from that of what was judged."""
    return f"{what}, not evaluated" if evaluation.judged else what


def _owners(evaluation: Evaluation, kind: str) -> list[str]:
    return list(dict.fromkeys(row.owner for row in evaluation.angle_ranges if row.kind == kind))


def joint_motion_section(
    evaluation: Evaluation,
    colours: Colours,
    spans: list[Span],
    curves: Mapping[str, list[Block]],
    band: Band | None = None,
) -> Section | None:
    """Angles of the joints over time, their ranges and cycles; None where there are none.

    Args:
        evaluation: Of the session.
        colours: By filter.
        spans: Sections of the protocol.
        curves: By joint of a body, its angles with their uncertainty.
        band: Of persons without complaints, drawn behind the cycles of angles that it has.
    """
    joints = unjudged_joints(evaluation)
    if not joints:
        return None
    section = Section("joint_motion", _title("Joint angles", evaluation))
    for joint in joints:
        rows = [row for row in evaluation.angle_ranges if (row.kind, row.owner) == ("joint", joint)]
        if len(joints) > 1:
            section.blocks.append(Heading(joint))
        section.blocks += curves.get(joint, [])
        drawn = {rows[0].sequence} if joint in curves else set()
        for sequence in dict.fromkeys(row.sequence for row in rows if row.sequence not in drawn):
            own = [row for row in rows if row.sequence == sequence]
            figure = _angles_over_time(
                evaluation.series.get(motion_table(joint), {}), own, colours, spans
            )
            section.blocks.append(
                Figures(
                    f"Joint angles over time: {joint}, {sequence}",
                    {f"angles of {joint} over time, {sequence}": figure},
                    f"How to read: {NOT_JUDGED} The angles are unwrapped; gaps are samples that "
                    "were left out, or gimbal lock.",
                    folded=sequence != rows[0].sequence,
                )
            )
        section.blocks.append(_ranges(f"Range of motion: {joint}", rows))
        section.blocks += _cycle_blocks(evaluation, "joint", joint, colours, band)
    return section


def sensor_motion_section(
    estimate: Estimate, evaluation: Evaluation, colours: Colours, spans: list[Span]
) -> Section | None:
    """Orientation of the sensors over time; None where every one is judged, or has none."""
    sensors = [name for name in unjudged_sensors(evaluation) if estimate.sensors[name].orientation]
    changes = [
        r for r in evaluation.orientation_changes if r.sensor in unjudged_sensors(evaluation)
    ]
    if not sensors and not changes:
        return None
    section = Section("sensor_motion", _title("Orientation", evaluation))
    for place, name in enumerate(sensors):
        folded = place >= MOST_DRAWN
        rows = [r for r in evaluation.angle_ranges if (r.kind, r.owner) == ("sensor", name)]
        sequence = rows[0].sequence if rows else ""
        if len(sensors) > 1:
            section.blocks.append(Heading(name))
        if rows:
            series = evaluation.series.get(euler_table(name), {})
            figure = _angles_over_time(series, rows, colours, spans)
            section.blocks.append(
                Figures(
                    f"Euler angles over time: {name}, {sequence}",
                    {f"Euler angles of {name} over time, {sequence}": figure},
                    f"How to read: intrinsic {_turns(sequence)}, of the sensor in the world of "
                    "each filter, z up, whose heading is its own unless a magnetometer or a truth "
                    f"sets it. {NOT_JUDGED} They are unwrapped; near gimbal lock the outer two are "
                    "not defined and not drawn.",
                    folded=folded,
                )
            )
        section.blocks.append(_quaternions(name, estimate.sensors[name], colours, spans))
    if sensors:
        ranges = [r for r in evaluation.angle_ranges if r.kind == "sensor"]
        section.blocks.append(_ranges("Range of the sensors' Euler angles", ranges, folded=True))
    if changes:
        section.blocks.append(_changes(changes))
    return section


def _turns(sequence: str) -> str:
    """An Euler sequence in words."""
    known = {"ZYX": ": heading about z, pitch about y, roll about x"}
    known["ZXY"] = ": heading about z, then about x, then about y"
    return sequence + known.get(sequence, ": about " + ", then ".join(sequence.lower()))


def _angles_over_time(
    series: Mapping[str, np.ndarray], rows: list[AngleRangeRow], colours: Colours, spans: list[Span]
) -> Figure:
    """Three panels, one an angle, in each the filters."""
    envelope = Envelope(series["host_time_ns"] / NANOSECONDS)
    panels: dict[str, dict[str, np.ndarray]] = {}
    for row in rows:
        column = f"{row.filter}_{row.sequence}_{row.angle}_rad"
        what = row.name or _named_turn(row.sequence, row.angle)
        if column in series:
            panels.setdefault(f"{what} [deg]", {})[row.filter] = envelope(
                np.degrees(series[column])
            )
    return time_panels(envelope.time, panels, colours, spans)


def _named_turn(sequence: str, angle: str) -> str:
    """An angle of an Euler sequence by its axis; other definitions have names of their own."""
    place = PLACES.index(angle)
    if len(sequence) != 3 or not sequence.isupper():
        return angle
    named = {"ZYX": ("heading", "pitch", "roll")}.get(sequence)
    return named[place] if named else f"{angle}, about {sequence[place].lower()}"


def _quaternions(name: str, sensor: SensorEstimate, colours: Colours, spans: list[Span]) -> Figures:
    """The four parts over time, signs chosen so that nothing jumps."""
    envelope = Envelope(sensor.host_time_ns / NANOSECONDS)
    panels: dict[str, dict[str, np.ndarray]] = {part: {} for part in "wxyz"}
    first: np.ndarray | None = None
    for key, q in sensor.orientation.items():
        smooth = _one_sign(q)
        start = smooth[np.isfinite(smooth).all(axis=1)][:1]
        if first is not None and len(start) and float(start[0] @ first) < 0:
            smooth = -smooth
        elif first is None and len(start):
            first = start[0]
        for i, part in enumerate("wxyz"):
            panels[part][key] = envelope(smooth[:, i])
    return Figures(
        f"Quaternion over time: {name}",
        {f"quaternion of {name} over time": time_panels(envelope.time, panels, colours, spans)},
        "How to read: q_world_from_sensor, w x y z, Hamilton, in the world of each filter; q and "
        "−q are the same orientation, and the sign is kept from sample to sample.",
        folded=True,
    )


def _one_sign(q: np.ndarray) -> np.ndarray:
    """The same orientations, each of the sign that is nearer to the one before, shape (n, 4)."""
    known = np.isfinite(q).all(axis=1)
    own = q[known]
    steps = np.sign(np.sum(own[1:] * own[:-1], axis=1))
    signs = np.concatenate([[1.0], np.cumprod(np.where(steps < 0, -1.0, 1.0))])
    result = np.full(q.shape, np.nan)
    result[known] = own * signs[: len(own), None]
    return result


def difference_section(
    evaluation: Evaluation, colours: Colours, spans: list[Span]
) -> Section | None:
    """Filters against one another and against the device; None where there is nothing to compare.

    The device's orientation, or what was asked for, has no curve: it is the line at zero.
    """
    rows = evaluation.comparison
    if not rows:
        return None
    section = Section("comparison", "Comparison of the orientations")
    for place, name in enumerate(dict.fromkeys(row.sensor for row in rows)):
        series = evaluation.series.get(difference_table(name), {})
        own = [r for r in rows if r.sensor == name and f"{r.first}_{r.second}_total_rad" in series]
        if not own:
            continue
        envelope = Envelope(series["host_time_ns"] / NANOSECONDS)
        panels = {
            f"{part} [deg]": {
                r.first: envelope(np.degrees(series[f"{r.first}_{r.second}_{column}_rad"]))
                for r in own
            }
            for part, column in (
                ("angle between", "total"),
                ("inclination", "inclination"),
                ("heading, signed", "heading"),
            )
        }
        section.blocks.append(
            Figures(
                f"Difference from {own[0].second} over time: {name}",
                {
                    f"difference from {own[0].second} of {name} over time": time_panels(
                        envelope.time, panels, colours, spans
                    )
                },
                f"How to read: each filter against {own[0].second}, which is no truth: a "
                "difference says that one of both is wrong, not which. The mean heading between "
                "their worlds is taken off; no reference shares it.",
                folded=place >= MOST_DRAWN,
            )
        )
    section.blocks.append(_comparison(rows))
    return section


def _comparison(rows: list[DifferenceRow]) -> Table:
    body = [
        Row(
            [
                label(row.first),
                text(row.second),
                text(row.sensor),
                *(number(v, 2) for v in (row.mean_deg, row.rms_deg, row.max_deg)),
                *(number(v, 2) for v in (row.inclination_rms_deg, row.heading_rms_deg)),
                number(row.mean_quaternion_length, 4),
                *(number(v, 2) for v in (row.heading_offset_deg, row.tilt_offset_deg)),
                number(row.n, 0),
            ]
        )
        for row in rows
    ]
    return Table(
        "Difference of two orientations",
        header(
            "orientation",
            "against",
            "sensor",
            "mean angle [deg]",
            "RMS [deg]",
            "largest [deg]",
            "inclination RMS [deg]",
            "heading RMS [deg]",
            "mean length of Δq",
            "heading taken off [deg]",
            "between verticals [deg]",
            "samples",
            numbers_from=3,
        ),
        body,
        "How to read: differences, not errors; neither of both is the truth. The heading between "
        "both worlds is constant and is taken off first; the angle between their verticals is part "
        "of the difference. Δq is the difference of the unit quaternions.",
    )


def _ranges(caption: str, rows: list[AngleRangeRow], folded: bool = False) -> Table:
    body = []
    for row in rows:
        what = row.name or _named_turn(row.sequence, row.angle)
        body.append(
            Row(
                [
                    label(row.owner),
                    text(what + (" (flexion)" if row.flexion and row.name != "flexion" else "")),
                    text(row.filter),
                    *(number(v, 1) for v in (row.range_deg, row.lowest_deg, row.highest_deg)),
                    number(row.locked_percent, 1),
                    number(row.n, 0),
                    text(row.sequence),
                ]
            )
        )
    return Table(
        caption,
        header(
            "of",
            "angle",
            "filter",
            "range [deg]",
            "lowest [deg]",
            "highest [deg]",
            "in gimbal lock [%]",
            "samples",
            numbers_from=3,
        )
        + header("sequence"),
        body,
        "How to read: over the whole recording, by estimates that nobody evaluated. A dash: "
        "passages of gimbal lock leave whole turns open, or the angle is not defined by itself.",
        folded=folded,
    )


# One piece: the figure and what is said of it follow from the same rows.
def _cycle_blocks(
    evaluation: Evaluation, kind: str, owner: str, colours: Colours, band: Band | None = None
) -> list[Block]:
    """The average cycles of one joint or sensor."""
    found = [
        (i, row)
        for i, row in enumerate(evaluation.found_cycles)
        if (row.kind, row.owner) == (kind, owner)
    ]
    if not found:
        return [
            Sentence(str(own) + ".")
            for own in evaluation.findings
            if own.code == "cycles.none_found"
            and own.where == (f"joint '{owner}'" if kind == "joint" else owner)
        ]
    table = evaluation.series.get(FOUND_CYCLES, {})
    curves = []
    for i, row in found:
        own = table["row"] == i if table else np.zeros(0, dtype=bool)
        if own.any():
            curves.append(
                Curve(
                    row.filter or row.signal,
                    list(table["cycle_percent"][own]),
                    list(table["mean"][own]),
                    colours.get(row.filter or "", COLOURS[0]),
                    list(table["sd"][own]),
                    mode="lines",
                )
            )
    first = found[0][1]
    blocks: list[Block] = [_cycles([row for _, row in found])]
    if curves:
        unit = unit_words(first.unit)
        figure = error_curves(curves, "cycle [%]", f"{first.signal} [{unit}]", signed=True)
        normal = None if band is None else band.curve(f"{owner}_{first.signal}")
        if normal is not None and unit == "deg":
            drawn = np.array(curves[0].x), np.array(curves[0].y, dtype=float)
            figure["data"].insert(0, normal_band(normal, *drawn))
        blocks.insert(
            0,
            Figures(
                f"Average cycle: {owner}, {first.signal}",
                {f"average cycle of {owner}": figure},
                f"How to read: mean and standard deviation of "
                f"{counted(first.cycles, 'cycle')} that were found in the data, for nobody planned "
                "them; each begins at a largest value of the smoothed signal, so that 0 % is no "
                f"event of a gait.{'' if normal is None else normal_words(band)}",
            ),
        )
    return blocks


def _cycles(rows: list[FoundCycleRow]) -> Table:
    body = [
        Row(
            [
                label(row.owner),
                text(row.signal),
                text(row.filter),
                number(row.cycles, 0),
                number(row.left_out, 0),
                text(f"{digits(row.begin_s, 1)} to {digits(row.end_s, 1)}"),
                text(f"{digits(row.frequency_hz, 3)} ± {digits(row.frequency_sd_hz, 3)}"),
                text(f"{digits(row.range, 1)} ± {digits(row.range_sd, 1)}"),
                number(row.scatter, 1),
                text(unit_words(row.unit)),
                number(row.likeness, 3),
            ]
        )
        for row in rows
    ]
    return Table(
        "Cycles found in the data",
        header(
            "of",
            "signal",
            "filter",
            "cycles",
            "left out",
            "from, to [s]",
            "frequency ± sd [Hz]",
            "range ± sd",
            "scatter",
            "unit",
            "likeness",
            numbers_from=3,
        ),
        body,
        "How to read: the period is where the autocorrelation peaks. Left out are those between "
        "the first and the last with gaps, of another length or of another shape; sd is that of a "
        "single cycle, scatter the standard deviation over the cycles, likeness the median "
        "correlation of a cycle with the average.",
    )


def _changes(rows: list[OrientationChangeRow]) -> Table:
    returned = any(row.returned for row in rows)
    body = [
        Row(
            [
                label(row.filter),
                text(row.sensor),
                number(row.first_s, 1),
                number(row.last_s, 1),
                *(number(v, 2) for v in (row.total_deg, row.heading_deg, row.inclination_deg)),
            ]
        )
        for row in rows
    ]
    how = (
        "It was stated that the sensor ended as it began, so that this is the error of the closed "
        "loop; nobody measured that it did."
        if returned
        else "It is how the sensor lies at the end against the beginning, and an error only if it "
        "lies the same again, which `--returned` states."
    )
    return Table(
        "Closure of the loop between the first and the last rest"
        if returned
        else "Change of orientation between the first and the last rest",
        header(
            "filter",
            "sensor",
            "first rest at [s]",
            "last rest at [s]",
            "total [deg]",
            "heading [deg]",
            "inclination [deg]",
            numbers_from=2,
        ),
        body,
        f"How to read: {how} The accelerometer's row is the direction of gravity in both rests: no "
        "filter is in it, and it knows no heading.",
    )


def signal_section(
    session: Session, estimate: Estimate, evaluation: Evaluation, spans: list[Span]
) -> Section | None:
    """What the sensors read over time, and the cycles of their most active axis.

    None where every sensor is judged.
    """
    sensors = unjudged_sensors(evaluation)
    if not sensors:
        return None
    section = Section("signals", "Signals")
    for place, name in enumerate(sensors):
        sensor = estimate.sensors[name]
        samples = session.imu(name, every=sensor.every)
        if len(sensors) > 1:
            section.blocks.append(Heading(name))
        section.blocks.append(_signals(name, sensor, samples, spans, place >= MOST_DRAWN))
        section.blocks += _cycle_blocks(evaluation, "sensor", name, {})
    return section


def _signals(
    name: str, sensor: SensorEstimate, samples: ImuSamples, spans: list[Span], folded: bool
) -> Block:
    """The figure of a sensor's readings; a sentence where it gave none, as one of quaternions."""
    envelope = Envelope(sensor.host_time_ns / NANOSECONDS)
    panels: dict[str, dict[str, np.ndarray]] = {}
    for key, title in SAMPLES.items():
        values = getattr(samples, key)
        if values is not None and np.isfinite(values).any():
            size = np.degrees(1.0) if key == "gyr" else 1.0
            panels[title] = {AXES[i]: envelope(size * values[:, i]) for i in range(3)}
    if not panels:
        return Sentence(f"{name} gave no rate, no specific force and no field.")
    thinned = f" One of {sensor.every} samples is shown." if sensor.every > 1 else ""
    return Figures(
        f"Signals over time: {name}",
        {f"signals of {name} over time": time_panels(envelope.time, panels, AXES_COLOURS, spans)},
        "How to read: as the sensor reported them, in its own axes, samples that the quality gates "
        "refuse included. Long recordings show the lowest and highest value of each short span."
        + thinned,
        folded=folded,
    )
