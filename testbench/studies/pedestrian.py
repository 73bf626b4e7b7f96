"""Cycles, distance, path and yaw drift of a swung shank, filter by filter, beside the published figures.

An arm does not walk: what is judged is what a sensor and a filter make of the swing. Distance and end of the path are compared
with those that the same parameters make of the arm's true motion; the error of the step-length regression itself, which takes a
walker, is not in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from testbench.estimation.pedestrian import PUBLISHED, PedestrianParameters, Walk, walk
from testbench.exceptions import InputError
from testbench.frames import NANOSECONDS
from testbench.model.heading import HeadingDrift, heading_drift, heading_error
from testbench.model.truth import truth_at
from testbench.records.estimate import Estimate
from testbench.records.plan import PlannedStep
from testbench.records.published import load_published
from testbench.records.session import Session
from testbench.studies.results import Cell, ResultCurve, ResultFigure, ResultTable, StudyResult

CYCLES_VARIABLE, ROLL_VARIABLE = "gait_cycles", "roll_deg"
"""Of the protocol: how many cycles were commanded, and the coupled roll (a walker always has some)."""
MARGIN_S = 1.5
"""Rest before and after a swing that goes with it [s], longer than the window of the step detection; the drift is from the one
to the other."""
DISTANCES = (
    "Distances are those of the published regression on the arm's swing, not of a walk; the truth is the same regression on "
    "the arm's true motion."
)
AREA = (
    "The yaw that is lost by taking body rates for Euler rates is the area that pitch and roll enclose, pi A_pitch A_roll a "
    "cycle, whatever the frequency; without roll there is none."
)


@dataclass(frozen=True)
class SwingResult:
    """One swing by one filter.

    Attributes:
        step: Of the session. filter: Name. cycles: Commanded, None where the protocol does not say. walk: By the filter.
        true_walk: What the same parameters make of the truth. drift: Of the heading against the truth.
    """

    step: PlannedStep
    filter: str
    cycles: int | None
    walk: Walk
    true_walk: Walk
    drift: HeadingDrift

    @property
    def cycle_error(self) -> int:
        """Counted less commanded cycles, or less those of the true motion where none are commanded."""
        return len(self.walk.cycles) - (len(self.true_walk.cycles) if self.cycles is None else self.cycles)

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
        session: A recording with sweeps and a truth. estimate: Of it. parameters: Published ones are in `PUBLISHED`.
        sensor: Its name; the first of the session if None.

    Raises:
        InputError: The session has no judged sweep or no truth for the sensor.
    """
    results = swing_results(session, estimate, parameters, sensor)
    return StudyResult(
        "pedestrian",
        "Gait cycles, path and yaw drift from one sensor on a swung shank",
        [cycle_table(results), drift_table(results), published_table("10"), published_table("14")],
        [drift_figure(session, estimate, result) for result in _longest(results)[:1]],
        notes=[DISTANCES, AREA],
    )


def swing_results(
    session: Session, estimate: Estimate, parameters: PedestrianParameters, sensor: str | None = None
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
        raise InputError(f"session {session.name} has no sweep that is judged, so there is no swing to count")
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
                    heading_drift(time, q[rows], q_true, MARGIN_S / max((time[-1] - time[0]) / NANOSECONDS, MARGIN_S)),
                )
            )
    return results


def cycle_table(results: list[SwingResult]) -> ResultTable:
    """Errors in count, distance and position."""
    rows: list[list[Cell]] = [
        [
            r.step.name, r.filter, r.cycles, len(r.walk.cycles), r.cycle_error, r.walk.distance, r.distance_error,
            100 * r.distance_error / r.true_walk.distance if r.true_walk.distance else None, r.position_error,
        ]
        for r in results
    ]  # fmt: skip
    return ResultTable(
        "Gait cycles, distance and position",
        ["swing", "filter", "commanded cycles", "counted cycles", "error in cycles", "distance [m]", "error in distance [m]",
         "error in distance [%]", "error in position [m]"],
        rows,
        "How to read: position is the end of the dead-reckoned path; its error is mostly that of the heading.",
    )  # fmt: skip


def drift_table(results: list[SwingResult]) -> ResultTable:
    """Yaw drift by filter, with the published figures of the Euler filters beside theirs."""
    front = load_published("reference_4").table("yaw drift")
    simple, improved = front.rows[0][1], front.rows[0][2]
    published: dict[str, Cell] = {
        "euler_ekf_simple": simple, "euler_ekf_simple_as_printed": simple,
        "euler_ekf": improved, "euler_ekf_as_printed": improved,
    }  # fmt: skip
    rows: list[list[Cell]] = []
    for r in results:
        cycles = r.cycles or len(r.true_walk.cycles)
        drift = float(np.degrees(r.drift.drift))
        rows.append(
            [r.step.name, r.filter, drift, drift / cycles if cycles else None, float(np.degrees(r.drift.largest)),
             published.get(r.filter) if r.step.variables.get(ROLL_VARIABLE) != 0 else None]
        )  # fmt: skip
    return ResultTable(
        "Yaw drift over each swing",
        ["swing", "filter", "drift [deg]", "drift a cycle [deg]", "largest error [deg]", "published drift [deg]"],
        rows,
        f"How to read: error of the heading after the swing less that before it. Published: {front.title}; a walker's swing "
        f"always has some roll. {front.note}",
        ["published drift [deg]"],
        load_published("reference_4").source,
    )


def published_table(name: str) -> ResultTable:
    """A table of the source as it stands."""
    published = load_published("reference_4")
    table = published.table(name)
    rows: list[list[Cell]] = [list(row) for row in table.rows]
    title = f"Published table {name}: {table.title}"
    return ResultTable(title, table.columns, rows, table.note, table.columns, published.source)


def drift_figure(session: Session, estimate: Estimate, result: SwingResult, sensor: str | None = None) -> ResultFigure:
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
        error = np.degrees(heading_error(q[rows], q_true))
        known = np.flatnonzero(np.isfinite(error))
        if len(known):
            curves.append(ResultCurve(key, seconds, error - error[known[0]], "measurement"))
    return ResultFigure(f"Error of the yaw, {result.step.name}", "time [s]", "error [deg]", curves)


def _rows(time_ns: np.ndarray, step: PlannedStep) -> np.ndarray:
    """Samples of a sweep and of the rest about it."""
    margin = round(MARGIN_S * NANOSECONDS)
    begin, end = step.start_ns - margin, min(step.settled_ns + margin, step.end_ns)
    return np.flatnonzero((time_ns >= begin) & (time_ns <= end))


def _longest(results: list[SwingResult]) -> list[SwingResult]:
    return sorted(results, key=lambda r: r.step.start_ns - r.step.end_ns)
