"""What changes over time: signals of the sensors, errors, steps of the protocol."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
import rerun as rr

from testbench.model.joint_angle import flexion_of
from testbench.records.findings.finding import Finding, Severity, told_once
from testbench.records.results.estimate import Estimate
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.layout import chain_table, joint_table, orientation_table
from testbench.records.session.plan import PlannedStep
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Event, Session
from testbench.reporting.page.palette import COLOURS, REFERENCE, filter_colours, rgb
from testbench.reporting.viewer.shown_first import by_flexion, by_orientation, visible
from testbench.reporting.viewer.timeline import every, extremes, send

ERROR_RATE = 20.0
"""Rate of the error signals [Hz]."""
AXIS_COLOURS = ((230, 70, 70), (60, 160, 60), (70, 110, 240))
LEVELS = {"run_error": "ERROR", "run_aborted": "ERROR", "run_interrupted": "WARN", "guard": "WARN"}
"""Of events that somebody should see, by kind."""
PHASES = {"move": "#5b6f8a", "dwell": "#2b333d", "sweep": "#a8641c"}
MOST_JOINTS = 4
"""Joints of a chain that one tab has room for."""
SIGNALS = {
    "rate_deg_s": ("gyr", "angular rate [deg/s]"),
    "specific_force_m_s2": ("acc", "specific force [m/s²]"),
    "magnetic_field_uT": ("mag", "field [µT]"),
}
"""Attribute and title of each signal of a sensor."""
PARTS = ("total", "inclination", "heading")


def log_imu(
    recording: rr.RecordingStream, name: str, samples: ImuSamples, estimate: Estimate | None
) -> None:
    """Raw signals of a sensor, on the host's clock where the clock was fitted."""
    own = None if estimate is None else estimate.sensors.get(name)
    time = (
        own.host_time_ns
        if own is not None and len(own.host_time_ns) == len(samples)
        else samples.host_time_ns
    )
    for key in signals_of(samples):
        values = getattr(samples, SIGNALS[key][0])
        shown = np.degrees(values) if key == "rate_deg_s" else values
        _log_vector(recording, f"imu/{name}/{key}", time, shown)


def signals_of(samples: ImuSamples) -> list[str]:
    """The keys of `SIGNALS` that a sensor has: a file without rates has them not a number."""
    found = {key: getattr(samples, SIGNALS[key][0]) for key in SIGNALS}
    return [k for k, own in found.items() if own is not None and np.isfinite(own).any()]


def log_errors(
    recording: rr.RecordingStream, evaluation: Evaluation, colours: dict[str, str]
) -> None:
    """Errors of every orientation and flexion from the first that is judged, so that no filter's
    start drowns them [deg].
    """
    for sensor in dict.fromkeys(row.sensor for row in evaluation.orientation):
        _log_orientation_errors(recording, evaluation, colours, sensor)
    for joint, sequence in dict.fromkeys(
        (row.joint, row.sequence) for row in evaluation.joint_angle
    ):
        _log_flexion(recording, evaluation, {"true": REFERENCE, **colours}, joint, sequence)


def _log_orientation_errors(
    recording: rr.RecordingStream, evaluation: Evaluation, colours: Mapping[str, str], sensor: str
) -> None:
    """The parts of the errors of one sensor, with the uncertainty of the truth."""
    series = evaluation.series.get(orientation_table(sensor), {})
    filters = by_orientation(evaluation, sensor)
    rows = [row for row in evaluation.orientation_summary if row.sensor == sensor]
    for part in PARTS:
        path = f"errors/{sensor}/{part}"
        columns = {key: f"{key}_{part}_rad" for key in filters}
        lines = {key: series[column] for key, column in columns.items() if column in series}
        time, begin = series.get("host_time_ns"), _first(series)
        _log_lines(recording, path, time, lines, colours, begin, visible(filters))
        signed = part == "heading"
        own = [row for row in rows if (row.part, row.motion) == (part, "all")]
        limits = [
            row.expanded_uncertainty_deg if signed else row.expanded_uncertainty_magnitude_deg
            for row in own
        ]
        _log_uncertainty(recording, path, time, limits, begin, signed)


def _log_flexion(
    recording: rr.RecordingStream,
    evaluation: Evaluation,
    colours: Mapping[str, str],
    joint: str,
    sequence: str,
) -> None:
    """True and estimated flexion by one definition, and its error with the uncertainty of the
    truth.
    """
    series = evaluation.series.get(joint_table(joint), {})
    filters, time = by_flexion(evaluation, joint, sequence), series.get("host_time_ns")
    for kind in ("flexion", "error"):
        known = kind == "flexion" and "reference_rad" in series
        lines = {"true": series["reference_rad"]} if known else {}
        columns = {key: f"{key}_{sequence}_{kind}_rad" for key in filters}
        lines |= {key: series[column] for key, column in columns.items() if column in series}
        path = f"joints/{joint}/{sequence}/{kind}"
        begin = _first(series) if kind == "error" else 0
        _log_lines(recording, path, time, lines, colours, begin, {"true"} | visible(filters))
    limits = [
        row.expanded_uncertainty_deg
        for row in evaluation.joint_summary
        if (row.joint, row.sequence) == (joint, sequence)
    ]
    path = f"joints/{joint}/{sequence}/error"
    _log_uncertainty(recording, path, time, limits, _first(series), signed=True)


def _log_uncertainty(
    recording: rr.RecordingStream,
    path: str,
    time_ns: np.ndarray | None,
    limits: Sequence[float | None],
    begin: int,
    signed: bool,
) -> None:
    """How far the truth may be off on the mean (95 %), as lines of a plot of errors.

    Args:
        recording: To write to.
        path: Of the plot.
        time_ns: Of the plot, shape (n,) [ns].
        limits: Of each row of the table [deg]; the largest is drawn.
        begin: The first row of the plot.
        signed: Whether errors are.
    """
    known = [limit for limit in limits if limit is not None and np.isfinite(limit)]
    if not known or time_ns is None or len(time_ns) <= begin:
        return
    largest = max(known)
    sides = {"U (95 %)": largest} | ({"-U": -largest} if signed else {})
    own = f"{path}_uncertainty"
    style_lines(recording, own, list(sides), dict.fromkeys(sides, REFERENCE))
    ends = np.array([time_ns[begin], time_ns[-1]])
    send_rows(recording, own, ends, np.tile(list(sides.values()), (2, 1)))


def unjudged_joints(
    session: Session, estimate: Estimate | None, evaluation: Evaluation | None
) -> dict[str, str]:
    """Joints with angles that nothing was judged of, and the label of their own definition.

    Args:
        session: The recording.
        estimate: Of it.
        evaluation: Of that.
    """
    judged = {row.joint for row in evaluation.joint_angle} if evaluation is not None else set()
    labels = {name: joint.label for name, joint in session.analysis.joints.items()}
    joints = estimate.joints.items() if estimate is not None else ()
    return {name: labels[name] for name, own in joints if own.angles and name not in judged}


def log_joint_angles(
    recording: rr.RecordingStream,
    session: Session,
    estimate: Estimate | None,
    labels: Mapping[str, str],
    colours: dict[str, str],
) -> None:
    """Flexion of joints that nothing was judged of, by every filter [deg].

    Args:
        recording: To write to.
        session: The recording.
        estimate: Of it.
        labels: Those joints, with the label of their own definition.
        colours: By filter.
    """
    if estimate is None:
        return
    for name, label in labels.items():
        own, joint = estimate.joints[name], session.analysis.joints[name]
        lines = {
            key: np.unwrap(flexion_of(joint, angles))
            for (key, sequence), angles in own.angles.items()
            if sequence == label
        }
        path = f"joints/{name}/{label}/flexion"
        _log_lines(recording, path, own.host_time_ns, lines, colours, 0)


def chain_joints(evaluation: Evaluation) -> dict[str, list[str]]:
    """The joints of each section's chain that are shown: those with the largest errors."""
    found: dict[str, list[str]] = {}
    for row in sorted(evaluation.chain, key=lambda row: -row.rmse_deg):
        joints = found.setdefault(row.section, [])
        if row.joint not in joints and len(joints) < MOST_JOINTS:
            joints.append(row.joint)
    return found


def log_chain(recording: rr.RecordingStream, evaluation: Evaluation) -> None:
    """True and estimated angles of the joints of a chain, and their errors from the first to the
    last that is judged [deg].
    """
    states = list(dict.fromkeys(row.state for row in evaluation.chain))
    colours = filter_colours(states)
    for section, joints in chain_joints(evaluation).items():
        series = {state: evaluation.series.get(chain_table(section, state)) for state in states}
        known = {
            state: own
            for state, own in series.items()
            if own is not None and len(own["host_time_ns"])
        }
        if not known:
            continue
        first = next(iter(known.values()))
        alike = {
            state: own
            for state, own in known.items()
            if np.array_equal(own["host_time_ns"], first["host_time_ns"])
        }
        time, judged = first["host_time_ns"], np.flatnonzero(first["judged"])
        shown = slice(judged[0], judged[-1] + 1) if len(judged) else slice(None)
        for joint in joints:
            angles = {"true": first[f"{joint}_rad"] - first[f"{joint}_error_rad"]}
            angles |= {state: own[f"{joint}_rad"] for state, own in alike.items()}
            errors = {state: own[f"{joint}_error_rad"][shown] for state, own in alike.items()}
            path = f"chain/{section}/{joint}"
            _log_lines(recording, f"{path}/angle", time, angles, {"true": REFERENCE, **colours}, 0)
            _log_lines(recording, f"{path}/error", time[shown], errors, colours, 0)


def _first(series: Mapping[str, np.ndarray]) -> int:
    """The first row that is judged."""
    judged = series.get("judged")
    return int(np.argmax(judged)) if judged is not None and judged.any() else 0


def told(session: Session, evaluation: Evaluation | None) -> list[Finding]:
    """What was noticed about a session, when it was recorded and when it was evaluated."""
    return told_once(
        [*session.manifest.findings, *([] if evaluation is None else evaluation.findings)]
    )


def log_steps(
    recording: rr.RecordingStream, session: Session, evaluation: Evaluation | None
) -> None:
    """A line of text for each finding and event, and the section and phase of the protocol as
    states.
    """
    findings = told(session, evaluation)
    if findings:
        texts = [str(found) for found in findings]
        levels = ["WARN" if found.severity is Severity.WARNING else "INFO" for found in findings]
        lines = rr.TextLog.columns(text=texts, level=levels)
        send(recording, "events", np.zeros(len(texts), dtype=np.int64), lines)
    send_events(recording, session.events)
    steps = session.steps
    if steps:
        name_sections(recording, [step.section for step in steps])
        send_steps(recording, steps)


def send_events(recording: rr.RecordingStream, events: Sequence[Event]) -> None:
    """A line of text for each event that says something."""
    told = [(event, text) for event in events if (text := _sentence(event.event, event.details))]
    if told:
        times = np.array([event.host_time_ns for event, _ in told])
        levels = [LEVELS.get(event.event, "INFO") for event, _ in told]
        lines = rr.TextLog.columns(text=[text for _, text in told], level=levels)
        send(recording, "events", times, lines)


def name_sections(recording: rr.RecordingStream, sections: Iterable[str]) -> None:
    """The colours of a protocol's sections and phases, before `send_steps`."""
    names = dict.fromkeys(sections)
    colours = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    name_states(recording, "state/section", colours)
    name_states(recording, "state/phase", PHASES)


def send_steps(recording: rr.RecordingStream, steps: Sequence[PlannedStep]) -> None:
    """The sections and phases of steps, with the times at which they happened."""
    sections = [None, *(step.section for step in steps)]
    starts = [
        (step.start_ns, step.section)
        for last, step in zip(sections, steps, strict=False)
        if step.section != last
    ]
    send_states(recording, "section", starts)
    phases: list[tuple[int, str]] = []
    for step in steps:
        if step.settled_ns > step.start_ns:
            phases.append((step.start_ns, moving_phase(step.kind)))
        if step.end_ns > step.settled_ns:
            phases.append((step.settled_ns, "dwell"))
    send_states(recording, "phase", phases)


def moving_phase(kind: str) -> str:
    """What the first part of a step of a kind is called."""
    return "sweep" if kind == "sweep" else "move"


def send_states(
    recording: rr.RecordingStream, which: str, states: Sequence[tuple[int, str]]
) -> None:
    """From when on [ns] "section" or "phase" was what."""
    if states:
        changes = rr.StateChange.columns(state=[name for _, name in states])
        send(recording, f"state/{which}", np.array([t for t, _ in states]), changes)


def name_states(recording: rr.RecordingStream, path: str, colours: Mapping[str, str]) -> None:
    """The words of a lane of states, and their colours."""
    names = list(colours)
    style = rr.StateConfiguration(
        values=names, labels=names, colors=[(*rgb(colour), 255) for colour in colours.values()]
    )
    recording.log(path, style, static=True)


def _sentence(event: str, details: dict[str, object]) -> str:
    if event == "step_started":
        return f"step {details.get('index')}: {details.get('name')}"
    if event in {"step_settled", "step_ended"}:
        return ""
    rest = ", ".join(f"{key} {value}" for key, value in details.items() if value not in (None, ""))
    return event.replace("_", " ") + (f": {rest}" if rest else "")


def style_vector(recording: rr.RecordingStream, path: str) -> None:
    """Three lines of one plot: the axes of a sensor."""
    lines = rr.SeriesLines(names=["x", "y", "z"], colors=AXIS_COLOURS, widths=[1.2] * 3)
    recording.log(path, lines, static=True)


def send_rows(
    recording: rr.RecordingStream, path: str, time_ns: np.ndarray, values: np.ndarray
) -> None:
    """Points of the lines of one plot.

    Args:
        recording: To write to.
        path: Of the plot.
        time_ns: Host times, shape (n,) [ns].
        values: One column a line, shape (n, k).
    """
    columns = rr.Scalars.columns(scalars=values.ravel()).partition(
        np.full(len(values), values.shape[1])
    )
    send(recording, path, time_ns, columns)


def _log_vector(
    recording: rr.RecordingStream, path: str, time_ns: np.ndarray, values: np.ndarray
) -> None:
    style_vector(recording, path)
    send_rows(recording, path, *extremes(time_ns, values))


def style_lines(
    recording: rr.RecordingStream,
    path: str,
    names: Sequence[str],
    colours: Mapping[str, str],
    shown: Collection[str] | None = None,
) -> None:
    """The lines of one plot, by name; those not `shown` come with a click on the legend."""
    style = rr.SeriesLines(
        names=list(names),
        colors=[rgb(colours[name]) for name in names],
        widths=[1.4] * len(names),
        visible_series=[shown is None or name in shown for name in names],
    )
    recording.log(path, style, static=True)


def _log_lines(
    recording: rr.RecordingStream,
    path: str,
    time_ns: np.ndarray | None,
    lines: dict[str, np.ndarray],
    colours: Mapping[str, str],
    begin: int,
    shown: Collection[str] | None = None,
) -> None:
    """Angles [rad] as lines of one plot [deg].

    One entity, for each costs its own times and row identifiers.
    """
    if time_ns is None or not lines:
        return
    chosen = slice(begin, None, every(time_ns, ERROR_RATE).step)
    values = np.degrees(np.column_stack([line[chosen] for line in lines.values()]))
    style_lines(recording, path, list(lines), colours, shown)
    send_rows(recording, path, *extremes(time_ns[chosen], values))
