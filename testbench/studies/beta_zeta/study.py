"""The study `beta_zeta`: the two gains of Madgwick's filter as de Miguel Pueyo 2024 has them, and
with a true bias state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from testbench.estimation.estimator import PreparedSession
from testbench.estimation.filters import (
    OrientationFilter,
    RecursiveFilter,
    UniformSamples,
    get_filter,
)
from testbench.estimation.prepared_sensor import PreparedSensor
from testbench.evaluation.judged import sound_truth
from testbench.evaluation.objective import Objective
from testbench.evaluation.orientation import sensor_errors
from testbench.model import rotation
from testbench.model.noise import random_stream
from testbench.model.statistics.spread import Change, told
from testbench.pipeline.parameter_space import Effort
from testbench.pipeline.run import prepare
from testbench.pipeline.tune import SearchWanted, Sessions, SessionTrials, find_parameters
from testbench.records.results.study import (
    BoxNumbers,
    StudyBoxes,
    StudyRecord,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.results.tuning import Tuning
from testbench.records.session.plan import PlannedStep, judged_steps
from testbench.records.session.session import Session
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published import PublishedTable, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.beta_zeta import words

PROTOCOL, SENSOR = "beta_zeta", "thigh"
PRINTED, MARG, IMU = "madgwick_zeta_as_printed", "madgwick_marg", "madgwick_imu"
TOTAL, INCLINATION = f"{SENSOR}.total_rmse_deg", f"{SENSOR}.inclination_rmse_deg"
BETAS = (0.01, 0.02, 0.041, 0.1, 0.2, 0.35, 0.6, 1.0)
PRINTED_ZETAS = (0.0, 0.01, 0.07, 0.1, 1.0)
STATE_ZETAS = (0.0, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
SWEEPS = {
    "sweep 1": (np.linspace(0.1, 1.0, 10), np.linspace(0.1, 1.0, 10)),
    "sweep 2": (np.linspace(0.3, 0.4, 11), np.linspace(0.01, 0.1, 10)),
}
"""The grids of the source, beta and zeta; it does not give their steps."""
RANDOM_STEPS = 10_000
LAST_DIGIT = 1e-15
"""Relative change of a gain that is no change but one of rounding."""


@dataclass(frozen=True)
class Part:
    """One session of the study.

    Attributes:
        session: The recording.
        sensor: Ready for filters.
        samples: What they get, at one interval.
        rest: Where the samples are in the first rest, shape (n,), bool.
        moving: Where the samples are after the first rest, shape (n,), bool.
    """

    session: Session
    sensor: PreparedSensor
    samples: UniformSamples
    rest: np.ndarray
    moving: np.ndarray

    @staticmethod
    def of(session: Session) -> Part:
        """Of a session of the study's protocol."""
        sensor = PreparedSession(session).sensors[SENSOR]
        samples = replace(sensor.correct(sensor.uniform), intervals=None)
        first = session.steps[0]
        time = np.interp(  # the grid has rows for lost packets, too
            np.arange(len(samples)),
            sensor.access.regular(sensor.estimate.clock)[1],
            sensor.estimate.host_time_ns,
        )
        return Part(
            session,
            sensor,
            samples,
            (time > first.settled_ns) & (time < first.end_ns),
            time > first.end_ns,
        )


def run(bench: StudyBench) -> StudyRecord:
    """Run the protocol for every part on the simulated arm and compute the tables."""
    started = bench.now()
    published = load_published_tables("reference_2")
    prepared = prepare(bench.request(PROTOCOL, bench.seed))
    the_plan = prepared.plan
    sessions: list[Session] = []
    for seed in bench.seeds:
        bench.say(f"part {len(sessions) + 1} of {bench.parts} on the arm")
        # analysed for its report alone: the study tunes and judges by itself
        result = bench.run_part(bench.request(PROTOCOL, seed), prepared)
        sessions.append(result.session)
    bench.say("gains and tables")
    part = Part.of(sessions[0])
    tunings = gains(sessions, started)
    theirs = published.tables["gains"]
    tables = {
        table.key: table
        for table in (
            identity_table(part),
            difference_table(part, theirs),
            map_table(part, PRINTED, PRINTED_ZETAS, "printed", TOTAL),
            map_table(part, MARG, STATE_ZETAS, "state", TOTAL),
            map_table(part, IMU, STATE_ZETAS, "state_imu", INCLINATION),
            gain_table(tunings),
            bias_table(part, tunings),
            noise_table(part),
        )
    }
    return StudyRecord(
        "beta_zeta",
        "The two gains of Madgwick's filter",
        words.QUESTION,
        published.source,
        started,
        bench.settings(PROTOCOL, the_plan),
        tuple(str(session.path) for session in sessions),
        _findings(tables, tunings),
        tuple(tables.values()),
        (error_boxes(part, tunings),),
        software_versions(),
    )


def step_difference(count: int, interval: float, seed: int = 0) -> float:
    """Largest difference, over random states, of the rate of change of q as printed and with beta +
    interval * zeta [1/s].

    The first is q' = q (w - 2 T zeta q* s) / 2 - beta s with the unit gradient s (eqs 32 to 35 of
    the source), by quaternion products alone.
    """
    rng = random_stream(seed, "beta_zeta")
    q, s = (rotation.normalise(rng.standard_normal((count, 4))) for _ in range(2))
    rate = np.column_stack([np.zeros(count), rng.uniform(-10, 10, (count, 3))])
    beta, zeta = rng.uniform(0, 1, (2, count, 1))
    drift = 2 * interval * zeta * rotation.multiply(rotation.conjugate(q), s)
    printed = 0.5 * rotation.multiply(q, rate - drift) - beta * s
    alone = 0.5 * rotation.multiply(q, rate) - (beta + interval * zeta) * s
    return float(np.abs(printed - alone).max())


def state_difference(part: Part, beta: float, zeta: float) -> float:
    """Largest difference of q after one step in both forms, from every state that the session leads
    the printed form to.
    """
    printed = get_filter(PRINTED, {"beta": beta, "zeta": zeta})
    alone = get_filter(MARG, {"beta": beta + part.samples.interval * zeta})
    _, state = printed.advance(part.samples.piece(slice(0, 1)))
    largest = 0.0
    for i in range(1, len(part.samples)):
        now = part.samples.piece(slice(i, i + 1))
        other, _ = alone.advance(now, {**state, "filter": MARG})
        q, state = printed.advance(now, state)
        largest = max(largest, float(np.abs(q - other).max()))
    return largest


def identity_table(part: Part) -> StudyTable:
    """That the printed zeta is an addition to beta, by number."""
    interval = part.samples.interval
    label = f"rate of change of q [1/s], {RANDOM_STEPS} random states"
    rows = [StudyRow(label, (None, None, None, step_difference(RANDOM_STEPS, interval)))]
    gains_tried = ((0.35, 0.07), (0.33, 0.05), (0.1, 1.0))
    for beta, zeta in gains_tried:
        largest = state_difference(part, beta, zeta)
        rows.append(
            StudyRow(
                "one step from every state of the session",
                (beta, zeta, beta + interval * zeta, largest),
            )
        )
    for beta, zeta in gains_tried:
        together = beta + interval * zeta
        printed = get_filter(PRINTED, {"beta": beta, "zeta": zeta}).run(part.samples)
        alone, nearly = (
            get_filter(MARG, {"beta": b}).run(part.samples)
            for b in (together, together * (1 + LAST_DIGIT))
        )
        rows += [
            StudyRow("the whole session", (beta, zeta, together, _largest(printed, alone))),
            StudyRow(
                "control: both with beta alone, its last digit changed",
                (together, 0.0, together, _largest(nearly, alone)),
            ),
        ]
    return StudyTable(
        "identity",
        "The printed zeta against beta + T zeta alone",
        ("beta [rad/s]", "zeta [rad/s²]", "beta + T zeta [rad/s]", "largest difference"),
        tuple(rows),
        words.IDENTITY_HOW,
        words.IDENTITY,
        decimals=(3, 3, 5, 6),
        short="Identity",
    )


def mean_difference(part: Part, kind: OrientationFilter) -> float:
    """Mean length of the difference of a filter's and the device's quaternions, of equal sign,
    while the sensor moves about.
    """
    device = get_filter("device").run(part.samples)[part.moving]
    q = kind.run(part.samples)[part.moving]
    return float(np.linalg.norm(_same_sign(q, device) - device, axis=1).mean())


def angle_of(difference: float) -> float:
    """Angle between two orientations whose unit quaternions lie so far apart [deg]: |q - p| = 2
    sin(angle / 4).
    """
    return float(np.degrees(4 * np.arcsin(difference / 2)))


def difference_table(part: Part, published: PublishedTable) -> StudyTable:
    """The source's own figure: how far Madgwick's filter is from the device's."""

    def printed(beta: float, zeta: float) -> float:
        return mean_difference(part, get_filter(PRINTED, {"beta": beta, "zeta": zeta}))

    theirs = {row.label: tuple(row.values) for row in published.rows}
    ours = printed(0.35, 0.07)
    rows = [
        StudyRow(
            "gains by noise",
            (0.35, 0.07, ours, angle_of(ours), None),
            (*theirs["noise"], None, None),
        )
    ]
    for name, (betas, zetas) in SWEEPS.items():
        grid = np.array([[printed(beta, zeta) for zeta in zetas] for beta in betas])
        i, j = np.unravel_index(int(np.argmin(grid)), grid.shape)
        best, spread = float(grid[i, j]), float(np.ptp(grid, axis=1).max())
        values = (float(betas[i]), float(zetas[j]), best, angle_of(best), spread)
        distance = theirs[name][2]
        angle = None if distance is None else angle_of(distance)
        note = (
            ""
            if angle is None
            else f"the published difference is an angle of {angle:.1f} deg if it is a length"
        )
        rows.append(StudyRow(f"{name}, best", values, (*theirs[name], None, None), note))
    columns = ("beta", "zeta", "mean difference", "as an angle [deg]", "most that zeta changes it")
    why = words.DIFFERENCE.format(angle=angle_of(_number(theirs["sweep 2"][2])))
    return StudyTable(
        "difference",
        "Mean difference between Madgwick's filter, zeta as printed, and the device",
        columns,
        tuple(rows),
        words.DIFFERENCE_HOW,
        why,
        decimals=(2, 2, 5, 2, 5),
        ratio_column=2,
        short="Difference to the device",
    )


def map_table(
    part: Part, name: str, zetas: Sequence[float], key: str, objective: str
) -> StudyTable:
    """Error against the arm over both gains [deg]."""
    trials = SessionTrials(
        part.session, Objective.parse(objective), get_filter(name), ["beta", "zeta"]
    )
    rows = [
        StudyRow(f"beta {beta:g}", tuple(trials((beta, zeta)) for zeta in zetas)) for beta in BETAS
    ]
    caption, short, why = words.MAPS[key]
    return StudyTable(
        key,
        caption,
        tuple(f"zeta {zeta:g}" for zeta in zetas),
        tuple(rows),
        words.MAP_HOW,
        why,
        decimals=(3,) * len(zetas),
        short=short,
    )


def gains(sessions: Sequence[Session], now: str) -> dict[str, Tuning]:
    """Each form of the filter tuned in the same way, each part also by the gains of all others."""
    found = {}
    for label, name, parameters, objective in (
        ("zeta as printed", PRINTED, ["beta", "zeta"], TOTAL),
        ("beta alone", MARG, ["beta"], TOTAL),
        ("with a bias state", MARG, ["beta", "zeta"], TOTAL),
        ("beta alone, without magnetometer", IMU, ["beta"], INCLINATION),
        ("with a bias state, without magnetometer", IMU, ["beta", "zeta"], INCLINATION),
    ):
        found[label] = find_parameters(
            get_filter(name),
            Sessions.given(sessions, []),
            SearchWanted(objective, parameters, Effort(values=7), len(sessions) > 1),
            now,
        )
    return found


def gain_table(tunings: dict[str, Tuning]) -> StudyTable:
    """What each form of the filter comes to."""
    rows = []
    for label, found in tunings.items():
        own = [entry.own_value for entry in found.sessions]
        held = [entry.left_out_value for entry in found.sessions]
        kind = found.objective.removeprefix(f"{SENSOR}.").removesuffix("_rmse_deg")
        best = (found.parameters["beta"], found.parameters["zeta"])
        rows.append(
            StudyRow(
                label, (kind, *best, found.default_value, found.value, _mean(own), _mean(held))
            )
        )
    columns = (
        "error",
        "beta [rad/s]",
        "zeta [rad/s²]",
        "default [deg]",
        "tuned on all parts [deg]",
        "each part's own [deg]",
        "each part by the others' gains [deg]",
    )
    return StudyTable(
        "gains",
        "RMS error against the arm with tuned gains, mean over the parts",
        columns,
        tuple(rows),
        words.GAINS_HOW,
        words.GAINS,
        decimals=(0, 4, 5, 3, 3, 3, 3),
        short="What a bias state gains",
    )


def bias_table(part: Part, tunings: dict[str, Tuning]) -> StudyTable:
    """The bias that the filter ends with, beside what the gyroscope read at rest at the
    beginning.
    """
    rest = np.degrees(part.samples.gyr[part.rest].mean(axis=0))
    columns, found = ["at rest before [deg/s]"], [rest]
    for label in (
        "zeta as printed",
        "with a bias state",
        "with a bias state, without magnetometer",
    ):
        kind = get_filter(tunings[label].filter, tunings[label].parameters)
        assert isinstance(kind, RecursiveFilter)
        _, state = kind.advance(part.samples)
        columns.append(f"{label} [deg/s]")
        found.append(np.degrees(state["gyr_bias_rad_s"]))
    rows = [
        StudyRow(axis, tuple(float(values[i]) for values in found)) for i, axis in enumerate("xyz")
    ]
    return StudyTable(
        "bias",
        "Bias of the gyroscope at the end of the first part",
        tuple(columns),
        tuple(rows),
        words.BIAS_HOW,
        words.BIAS,
        decimals=(3,) * len(columns),
        short="Bias",
    )


def noise_table(part: Part) -> StudyTable:
    """Gains from the noise at rest: by the printed formulas, in both units, and by those of
    Madgwick's report.
    """
    rate = part.samples.gyr[part.rest]
    sigma = float(rate.std(axis=0, ddof=1).mean())
    middle = len(rate) // 2
    drift = float(
        np.abs(rate[middle:].mean(axis=0) - rate[:middle].mean(axis=0)).mean()
        / (middle * part.samples.interval)
    )
    degree = float(np.degrees(1.0))
    factor = np.sqrt(0.75)
    rows = (
        StudyRow(
            "as printed, sqrt(3/4 sigma), rad/s",
            (sigma, *(float(np.sqrt(0.75 * x)) for x in (sigma, drift))),
        ),
        StudyRow(
            "as printed, deg/s taken for rad/s",
            (sigma * degree, *(float(np.sqrt(0.75 * degree * x)) for x in (sigma, drift))),
            (None, 0.35, 0.07),
        ),
        StudyRow(
            "Madgwick 2010, sqrt(3/4) sigma, rad/s",
            (sigma, float(factor * sigma), float(factor * drift)),
        ),
    )
    implied = 0.35**2 / 0.75
    why = words.NOISE.format(
        printed=implied, right=0.35 / factor, right_deg=float(np.degrees(0.35 / factor))
    )
    return StudyTable(
        "noise",
        "Gains from the noise at rest",
        ("sigma", "beta", "zeta"),
        rows,
        words.NOISE_HOW,
        why,
        decimals=(6, 5, 6),
        short="Gains by noise",
    )


def error_boxes(part: Part, tunings: dict[str, Tuning]) -> StudyBoxes:
    """Total errors of the first part."""
    steps = judged_steps(part.session.steps)
    boxes = {
        "zeta as printed, 0.35 and 0.07": _errors(part, get_filter(PRINTED), steps),
        "default, beta 0.041": _errors(part, get_filter(MARG), steps),
    }
    for label in ("beta alone", "with a bias state"):
        kind = get_filter(tunings[label].filter, tunings[label].parameters)
        boxes[f"tuned, {label}"] = _errors(part, kind, steps)
    return StudyBoxes(words.BOXES, "total error [deg]", boxes, {}, words.BOXES_HOW)


def _errors(part: Part, kind: OrientationFilter, steps: list[PlannedStep]) -> BoxNumbers:
    """Total errors in a twentieth of the judged samples, evenly spread [deg]."""
    truth, _ = sound_truth(part.session, SENSOR)
    assert truth is not None
    found = sensor_errors(SENSOR, part.sensor.run([kind]), truth, steps)
    return BoxNumbers.of(np.degrees(found.errors[kind.name].total[found.judged][::20]))


# One piece: the numbers of the sentences, which stand in `words`.
def _findings(tables: dict[str, StudyTable], tunings: dict[str, Tuning]) -> tuple[str, ...]:
    def errors(label: str) -> list[float]:
        found = tunings[label].sessions
        return [
            _number(entry.own_value if entry.left_out_value is None else entry.left_out_value)
            for entry in found
        ]

    gained = told(Change.of(errors("with a bias state"), errors("beta alone")))
    imu_gained = told(
        Change.of(
            errors("with a bias state, without magnetometer"),
            errors("beta alone, without magnetometer"),
        )
    )
    steps = [_numbers(row) for row in tables["identity"].rows if row.label.startswith("one step")]
    ours, theirs = tables["difference"].rows[-1].values, tables["difference"].rows[-1].published
    distance, published = _number(ours[2]), _number(theirs[2])
    # held-out errors where there is more than one part
    held_out = all(row.values[-1] is not None for row in tables["gains"].rows)
    printed, alone, state, imu_alone, imu_state = (
        _number(row.values[-1 if held_out else 4]) for row in tables["gains"].rows
    )
    where = (
        "on parts that they were not tuned on"
        if held_out
        else "on the part that they were tuned on"
    )
    return (
        words.IDENTICAL.format(
            first=steps[0][0],
            second=steps[0][1],
            together=steps[0][2],
            most=max(row[3] for row in steps),
        ),
        words.DISTANCE.format(
            ours=distance,
            angle=angle_of(distance),
            theirs=published,
            their_angle=angle_of(published),
        ),
        words.GAINED.format(
            where=where,
            printed=printed,
            alone=alone,
            state=state,
            imu_alone=imu_alone,
            imu_state=imu_state,
            gained=gained,
            imu_gained=imu_gained,
        ),
    )


def _number(value: Value) -> float:
    assert isinstance(value, int | float)
    return float(value)


def _numbers(row: StudyRow) -> list[float]:
    return [_number(value) for value in row.values]


def _largest(q: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(_same_sign(q, other) - other).max())


def _same_sign(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The first or its negative, whichever is nearer to the other, shape (n, 4)."""
    return np.where(np.sum(q * other, axis=1, keepdims=True) < 0, -q, q)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if len(known) == len(values) else None
