"""Cycles, distance, path and yaw drift of a walker and of a swung shank, filter by filter, beside
the published figures.

An arm does not walk: of the swing is judged what a sensor and a filter make of it. Distance and end
of the path are compared with those that the same parameters make of the arm's true motion; the
error of the step-length regression itself is in the walks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.filters import get_filter
from testbench.estimation.gait import PUBLISHED, PedestrianParameters, Walk, walk
from testbench.estimation.gait.readings import fits_in_memory, readings_of
from testbench.estimation.gait.wearing import FOUND, levelled, mounting_matrix
from testbench.estimation.signals.recording import SensorRecording
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.heading import HeadingDrift, heading_drift, heading_error
from testbench.model.truth import truth_at
from testbench.pipeline.run import prepare
from testbench.records.results.estimate import Estimate
from testbench.records.results.study import (
    StudyCurve,
    StudyCurves,
    StudyRecord,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.session.plan import Plan, PlannedStep
from testbench.records.session.session import Session
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published import PublishedTable, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.parts import over_parts
from testbench.studies.pedestrian.walking import (
    corridor_table,
    drift_of_walks,
    loop_curves,
    loop_table,
    property_table,
    published_alone,
    sentences,
    tuned_table,
    variants_table,
)
from testbench.studies.pedestrian.walks import Walks, all_walks
from testbench.studies.result import StudyResult

CORRIDOR_CYCLES = 14
"""Of the source's straight corridor (table 10)."""
CYCLES_VARIABLE, ROLL_VARIABLE = "gait_cycles", "roll_deg"
"""Of the protocol: how many cycles were commanded, and the coupled roll (a walker always has
some).
"""
SHOWN_SAMPLES = 400
"""Of a curve over time, about; a figure cannot show more."""
MARGIN_S = 1.5
"""Rest before and after a swing that goes with it [s], longer than the window of the step
detection; the drift is from the one to the other.
"""
DISTANCES = (
    "Distances are those of the published regression on the arm's swing, not of a walk; the truth "
    "is the same regression on the arm's true motion."
)
AREA = (
    "The yaw that is lost by taking body rates for Euler rates is the area that pitch and roll "
    "enclose, pi A_pitch A_roll a cycle, whatever the frequency; without roll there is none."
)

OF_A_WALK = "of a walk, whose length, speed and roll are not stated"
PROTOCOL = "shank_swing"
QUESTION = (
    "How far do two Euler filters drift in yaw on a walker, and what of cycles, distance and path "
    "is left, on shank, thigh, wrist and chest?"
)
FILTERS_OF_SOURCE = ("euler_ekf_simple", "euler_ekf")


def run(bench: StudyBench) -> StudyRecord:
    """Walk, swing the shank, and judge every filter; or ask the user's protocol or recording.

    Raises:
        InputError: The user's protocol has no sweep that is judged, and nothing has run then; or
            the user's recording has no sensor that walked.
    """
    started = bench.now()
    if bench.session is not None:
        return _of_recording(bench, started)
    if bench.protocol is not None:
        _has_swings(prepare(bench.request(bench.protocol, bench.seed)).plan)
    results = bench.results(PROTOCOL)
    bench.say("cycles, paths and drifts")
    studies = [pedestrian_study(result.session, result.estimate) for result in results]
    first = results[0]
    swings = swing_results(first.session, first.estimate, PUBLISHED["universal"])
    keys = [table.key for table in studies[0].tables]
    tables = [over_parts([study.table(key) for study in studies]) for key in keys]
    curves, said = list(studies[0].curves), [*_findings(swings), *studies[0].findings]
    if not bench.own:
        found, printed = all_walks(bench), load_published_tables("reference_4").tables
        tables = [*walking_tables(found, printed), *tables]
        curves, said = [loop_curves(found), *curves], [*sentences(found), *said]
    settings = {**bench.settings(PROTOCOL), "sensor": first.session.sensor_names[0]}
    return StudyRecord(
        "reference-4",
        "Steps and path of a walker",
        QUESTION,
        load_published_tables("reference_4").source,
        started,
        settings,
        tuple(str(result.session.path) for result in results),
        tuple(said),
        tuple(tables),
        (),
        software_versions(),
        tuple(curves),
        trace="Those of walks are made anew from seed and part, and kept nowhere.",
    )


def _has_swings(plan: Plan) -> None:
    """Raise InputError where a plan has no swing to judge."""
    if not any(step.kind == "sweep" and step.role == "evaluation" for step in plan.steps):
        name = plan.protocol.spec.name
        raise InputError(
            f"protocol {name} has no sweep in a section that is evaluated, so there is no swing to "
            "count"
        )


def walking_tables(found: Walks, printed: dict[str, PublishedTable]) -> list[StudyTable]:
    """Tables of the walks in the order of the source.

    Args:
        found: All walks.
        printed: Published tables by number.
    """
    counted = ("real", "algorithm", "counter on board")
    return [
        drift_of_walks(found, printed["yaw drift"]),
        variants_table(found),
        published_alone("8", printed["8"], counted),
        published_alone("9", printed["9"], counted),
        corridor_table(found, printed["10"]),
        tuned_table(found, printed["11"]),
        loop_table(found, printed),
        property_table(found),
    ]


def _of_recording(bench: StudyBench, started: str) -> StudyRecord:
    """Cycles, distance and heading of every sensor of a recording that walked, by every filter."""
    bench.say(f"asking {bench.session}")
    session, rows, curves = bench.recording(), [], []
    for name in session.sensor_names:
        for kind, label in OF_RECORDINGS.items():
            walked = reckoned_walk(session, name, kind)
            if walked is None:
                continue
            end = float(np.linalg.norm(walked.end))
            turned = float(np.degrees(walked.headings[-1] - walked.headings[0]))
            cells = (float(len(walked.cycles)), walked.distance, end, turned)
            rows.append(StudyRow(f"{name}, {label}", cells))
            path = walked.positions
            curves.append(StudyCurve(f"{name}, {label}", path[:, 0], path[:, 1], "measurement"))
    missing = [] if rows else ["a sensor with rates and forces that swings as a limb does"]
    bench.refuse_without("the walk", missing)
    table = StudyTable(
        "walks",
        "Gait cycles and path by sensor and filter, thresholds and lengths of the source",
        ("cycles", "distance [m]", "end from start [m]", "turned [deg]"),
        tuple(rows),
        "How to read: the step-length regression was fitted to one walker's shank; on others, and "
        "on a foot, lengths are off by a tenth and more. `testbench gait` reckons a foot by its "
        "stances.",
        decimals=(0, 1, 1, 0),
    )
    how = "How to read: from above, a point after each gait cycle, both axes to one scale."
    figure = StudyCurves("Path", "x [m]", "y [m]", tuple(curves), how, plane=True)
    told = "; ".join(f"{row.label}: {row.values[0]:g} cycles" for row in rows)
    return StudyRecord(
        "reference-4",
        "Steps and path of a walker",
        QUESTION,
        load_published_tables("reference_4").source,
        started,
        bench.settings(PROTOCOL),
        (str(session.path),),
        (f"Gait cycles: {told}.",),
        (table,),
        (),
        software_versions(),
        (figure,),
    )


OF_RECORDINGS = {
    "euler_ekf_simple_as_printed": "simple prediction (text)",
    "euler_ekf_as_printed": "improved prediction (text)",
    "euler_ekf_listing": "improved prediction (program)",
    "euler_ekf": "improved prediction, corrected",
    "vqf_6d": "vqf_6d",
}
"""The source's filters by either print, the corrected one, and one beside them, with their
names.
"""


def reckoned_walk(session: Session, name: str, kind: str) -> Walk | None:
    """The walk of one sensor of a recording by one filter.

    None where it has no cycle, or its rates are those of the device's own orientation.

    Args:
        session: The recording.
        name: Of the sensor.
        kind: Of the filter.
    """
    recording = SensorRecording.of(session, name)
    if not fits_in_memory(recording):
        return None
    readings = readings_of(recording)
    if readings.derived or not np.isfinite(readings.acc).any() or not readings.uniform.gyr.any():
        return None
    R, _ = mounting_matrix(FOUND, readings.rate, readings.acc, name)
    level = levelled(replace(readings.uniform, gyr=readings.rate), R)
    times = np.round(readings.time * NANOSECONDS).astype(np.int64)
    found = walk(times, get_filter(kind).run(level), PUBLISHED["universal"])
    return found if len(found.cycles) else None


def _findings(results: list[SwingResult]) -> tuple[str, ...]:
    """The answer in sentences; of the drift, of the swings with the most roll."""
    if not any(len(r.true_walk.cycles) for r in results):
        return (
            (
                "There is no gait cycle to count: in no sweep does the sensor's true pitch swing "
                "as far as the detection asks."
            ),
        )
    wrong = [r for r in results if r.cycle_error]
    counts = " and ".join(
        str(n) for n in sorted({r.cycles for r in results if r.cycles is not None})
    )
    told = ", ".join(f"by {r.filter} in {r.step.name} by {r.cycle_error:+d}" for r in wrong)
    against = (
        f"{counts} commanded"
        if counts
        else f"against the true motion, as the protocol has no variable {CYCLES_VARIABLE}"
    )
    found = [
        f"Gait cycles, {against}: "
        + (f"miscounted {told}." if wrong else "counted exactly by every filter.")
    ]
    for name, r in {r.step.name: r for r in results}.items():
        true = len(r.true_walk.cycles)
        if r.cycles is not None and true != r.cycles:
            found.append(
                f"In {name} the arm's true motion itself counts as {true} gait cycles of "
                f"{r.cycles} commanded: the sensor's pitch does not swing as often, or not as far, "
                "as the step detection asks for."
            )
    for own in _by_step(_rolling(results)):
        if all(name in own for name in FILTERS_OF_SOURCE):
            simple, improved = (
                abs(float(np.degrees(own[name].drift.drift))) for name in FILTERS_OF_SOURCE
            )
            ends = [own[name].position_error for name in FILTERS_OF_SOURCE]
            found.append(
                f"In {own[FILTERS_OF_SOURCE[0]].step.name} the yaw drifts by {simple:.1f} deg by "
                f"the simple prediction and by {improved:.1f} deg by the improved one; the path "
                f"ends {ends[0]:.2f} and {ends[1]:.2f} m off."
            )
    return tuple(found)


def _rolling(results: list[SwingResult]) -> list[SwingResult]:
    """Those with the most coupled roll."""
    most = max(r.step.variables.get(ROLL_VARIABLE, 0.0) for r in results)
    return [r for r in results if r.step.variables.get(ROLL_VARIABLE, 0.0) == most]


def _by_step(results: list[SwingResult]) -> list[dict[str, SwingResult]]:
    """Results by filter, step by step."""
    steps: dict[int, dict[str, SwingResult]] = {}
    for r in results:
        steps.setdefault(r.step.index, {})[r.filter] = r
    return list(steps.values())


@dataclass(frozen=True)
class SwingResult:
    """One swing by one filter.

    Attributes:
        step: Of the session.
        filter: Name.
        cycles: Commanded, None where the protocol does not say.
        walk: By the filter.
        true_walk: What the same parameters make of the truth.
        drift: Of the heading against the truth.
    """

    step: PlannedStep
    filter: str
    cycles: int | None
    walk: Walk
    true_walk: Walk
    drift: HeadingDrift

    @property
    def cycle_error(self) -> int:
        """Counted less commanded cycles, or less those of the true motion where none are
        commanded.
        """
        return len(self.walk.cycles) - (
            len(self.true_walk.cycles) if self.cycles is None else self.cycles
        )

    @property
    def distance_error(self) -> float:
        """Reckoned less true length of the path [m]."""
        return self.walk.distance - self.true_walk.distance

    @property
    def position_error(self) -> float:
        """Distance between the reckoned and the true end of the path [m]."""
        return float(np.linalg.norm(self.walk.end - self.true_walk.end))


def pedestrian_study(
    session: Session,
    estimate: Estimate,
    parameters: PedestrianParameters = PUBLISHED["universal"],
    sensor: str | None = None,
) -> StudyResult:
    """Tables of a session such as `shank_swing`.

    Args:
        session: A recording with sweeps and a truth.
        estimate: Of it.
        parameters: Published ones are in `PUBLISHED`.
        sensor: Its name; the first of the session if None.

    Raises:
        InputError: The session has no judged sweep or no truth for the sensor.
    """
    results = swing_results(session, estimate, parameters, sensor)
    rolling = _by_step(_rolling(results))
    drifts = [drift_curves(session, estimate, next(iter(own.values())), sensor) for own in rolling]
    return StudyResult(
        load_published_tables("reference_4").source,
        (DISTANCES, AREA),
        (cycle_table(results), drift_table(results)),
        tuple(
            curves
            for pair in zip(drifts, map(path_curves, rolling), strict=True)
            for curves in pair
        ),
    )


def swing_results(
    session: Session,
    estimate: Estimate,
    parameters: PedestrianParameters,
    sensor: str | None = None,
) -> list[SwingResult]:
    """Every judged sweep by every filter.

    Raises:
        InputError: The session has no judged sweep or no truth for the sensor.
    """
    name = sensor or session.sensor_names[0]
    truth = session.truth(name)
    if truth is None:
        raise InputError(f"session {session.name}: sensor '{name}' has no truth to compare with")
    steps = [step for step in session.steps if step.kind == "sweep" and step.role == "evaluation"]
    if not steps:
        raise InputError(
            f"session {session.name} has no sweep that is evaluated, so there is no swing to count"
        )
    own = estimate.sensors[name]
    results = []
    for step in steps:
        rows = _rows(own.host_time_ns, step)
        time = own.host_time_ns[rows]
        q_true = truth_at(truth, time)
        true_walk = walk(time, q_true, parameters)
        commanded = step.variables.get(CYCLES_VARIABLE)
        for key, q in own.orientation.items():
            results.append(
                SwingResult(
                    step,
                    key,
                    None if commanded is None else round(commanded),
                    walk(time, q[rows], parameters),
                    true_walk,
                    heading_drift(
                        time,
                        q[rows],
                        q_true,
                        MARGIN_S / max((time[-1] - time[0]) / NANOSECONDS, MARGIN_S),
                    ),
                )
            )
    return results


def cycle_table(results: list[SwingResult]) -> StudyTable:
    """Errors in count, distance and position."""
    rows = []
    for r in results:
        true = r.true_walk.distance
        percent = 100 * r.distance_error / true if true else None
        values = (
            r.cycles,
            len(r.walk.cycles),
            r.cycle_error,
            r.walk.distance,
            r.distance_error,
            percent,
            r.position_error,
        )
        rows.append(StudyRow(f"{r.step.name}, {r.filter}", values))
    return StudyTable(
        "cycles",
        "Gait cycles, distance and position by swing and filter",
        (
            "commanded cycles",
            "counted cycles",
            "error in cycles",
            "distance [m]",
            "error in distance [m]",
            "error in distance [%]",
            "error in position [m]",
        ),
        tuple(rows),
        "How to read: position is the end of the dead-reckoned path; lengths have a part in its "
        "error and, the more the longer the path, the heading.",
        decimals=(0, 0, 0, 2, 3, 2, 2),
        short="Gait cycles",
    )


def drift_table(results: list[SwingResult]) -> StudyTable:
    """Yaw drift by filter.

    Published figures stand beside the Euler filters in a swing as long as the corridor, with roll.
    """
    front = load_published_tables("reference_4").tables["yaw drift"].rows[0]
    simple, improved = front.values
    published: dict[str, Value] = {
        "euler_ekf_simple": simple,
        "euler_ekf_simple_as_printed": simple,
        "euler_ekf": improved,
        "euler_ekf_as_printed": improved,
    }
    rows = []
    for r in results:
        cycles = r.cycles or len(r.true_walk.cycles)
        size = abs(float(np.degrees(r.drift.drift)))
        corridor = r.cycles == CORRIDOR_CYCLES and r.step.variables.get(ROLL_VARIABLE) != 0
        beside = published.get(r.filter) if corridor else None
        values = (size, size / cycles if cycles else None, float(np.degrees(r.drift.largest)))
        rows.append(
            StudyRow(
                f"{r.step.name}, {r.filter}",
                values,
                (beside, None, None) if beside is not None else (),
                other=OF_A_WALK if beside is not None else "",
            )
        )
    return StudyTable(
        "drift",
        "Magnitude of the yaw drift over each swing",
        ("drift [deg]", "drift a cycle [deg]", "largest error [deg]"),
        tuple(rows),
        "How to read: error of the heading in the rest after the swing less that in the rest "
        "before it.",
        f"Published is {front.label}, in words: about 50 deg and below 10 deg, of walks whose "
        "length, speed and roll are not stated. The drift of the simple prediction is the area "
        "that pitch and roll enclose, cycle by cycle; ours is chosen by the protocol. The improved "
        "one has no such term.",
        decimals=(2, 3, 2),
        short="Yaw drift",
    )


def drift_curves(
    session: Session, estimate: Estimate, result: SwingResult, sensor: str | None = None
) -> StudyCurves:
    """Heading error of every filter over one swing."""
    name = sensor or session.sensor_names[0]
    truth = session.truth(name)
    assert truth is not None  # there would be no result without
    own = estimate.sensors[name]
    rows = _rows(own.host_time_ns, result.step)
    time = own.host_time_ns[rows]
    q_true, seconds = truth_at(truth, time), (time - time[0]) / NANOSECONDS
    curves = []
    for key, q in own.orientation.items():
        error = heading_error(q[rows], q_true)
        known = np.flatnonzero(np.isfinite(error))
        if len(known):
            shown = known[:: max(len(known) // SHOWN_SAMPLES, 1)]
            error[known] = np.degrees(np.unwrap(error[known]))
            curves.append(
                StudyCurve(key, seconds[shown], error[shown] - error[known[0]], "measurement")
            )
    how = "How to read: heading against the arm's, from the rest before the swing on."
    return StudyCurves(
        f"Error of the yaw, {result.step.name}", "time [s]", "error [deg]", tuple(curves), how
    )


def path_curves(results: dict[str, SwingResult]) -> StudyCurves:
    """The dead-reckoned path of one swing by every filter, and what the same parameters make of the
    true motion.
    """
    first = next(iter(results.values()))
    true = first.true_walk.positions
    curves = [StudyCurve("true motion", true[:, 0], true[:, 1], "truth")]
    for name, result in results.items():
        curves.append(
            StudyCurve(
                name, result.walk.positions[:, 0], result.walk.positions[:, 1], "measurement"
            )
        )
    how = (
        "How to read: from above, a point after each gait cycle, both axes to one scale; the path "
        "starts at the origin."
    )
    return StudyCurves(f"Path, {first.step.name}", "x [m]", "y [m]", tuple(curves), how, plane=True)


def _rows(time_ns: np.ndarray, step: PlannedStep) -> np.ndarray:
    """Samples of a sweep and of the rest about it."""
    margin = round(MARGIN_S * NANOSECONDS)
    begin, end = step.start_ns - margin, min(step.settled_ns + margin, step.end_ns)
    return np.flatnonzero((time_ns >= begin) & (time_ns <= end))
