"""The study `gimvebo`: what the integrator does to the calibration of a gyroscope, beside Botina &
Vergara 2018.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from testbench.estimation.calibration.gyroscope import static_bias
from testbench.model.imu import TriadErrors, TriadModel
from testbench.model.statistics.spread import Change, told
from testbench.pipeline.run import prepare
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import (
    BoxNumbers,
    StudyBoxes,
    StudyRecord,
    StudyRow,
    StudyTable,
    Value,
)
from testbench.records.session.plan import Plan
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published import PublishedTables, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.gimvebo import words
from testbench.studies.gimvebo.faults import (
    angles_deg,
    as_printed,
    fit_in_degrees,
    in_degrees,
    norms,
    norms_as_printed,
    speed_factor,
)
from testbench.studies.gimvebo.recording import NONE, SENSOR, Part, read_part
from testbench.studies.gimvebo.tables import (
    BOX,
    INTEGRATORS,
    TITLES,
    Calibrated,
    angle_table,
    angles,
    box_values,
    calibrate,
    magnitude_table,
    norm_table,
    others_table,
    parts_table,
    published_box,
    stages_table,
    time_table,
)

PROTOCOL = "gimvebo_gyro"


def run(bench: StudyBench) -> StudyRecord:
    """Run the protocol for every part on the simulated gimbal and compute the tables."""
    started = bench.now()
    published = load_published_tables("reference_3")
    prepared = prepare(bench.request(PROTOCOL, bench.seed))
    the_plan = prepared.plan
    parts: list[Part] = []
    sessions = []
    for seed in bench.seeds:
        bench.say(f"part {len(parts) + 1} of {bench.parts} on the gimbal")
        result = bench.run_part(bench.request(PROTOCOL, seed), prepared)
        parts.append(read_part(result.session, result.estimate))
        sessions.append(str(result.session.path))
    bench.say("calibrations and tables")
    part = parts[0]
    calibrated = {name: calibrate(part, name) for name in TITLES}
    bias = static_bias(part.fit)
    tables = [
        magnitude_table(part, published),
        norm_table(part, published, bias.bias),
        *(angle_table(part, published, name, calibrated[name]) for name in INTEGRATORS),
        others_table(part, calibrated),
        stages_table(part, published),
        time_table(part, published, bench.clock),
        fault_table(part, published, bias),
        parameter_table(part, calibrated["rk4"].with_g, the_plan, bench.seed),
        parts_table(parts),
    ]
    return StudyRecord(
        "gimvebo",
        "Integrators in the calibration of a gyroscope",
        words.QUESTION,
        published.source,
        started,
        bench.settings(PROTOCOL, the_plan),
        tuple(sessions),
        _findings(part, calibrated, {table.key: table for table in tables}),
        tuple(tables),
        (_figure(part, calibrated, published),),
        software_versions(),
        trace="The first one is that of all tables but the last.",
    )


# One piece: two faults for two integrators, and the rows that they make.
def fault_table(part: Part, published: PublishedTables, bias: TriadCalibration) -> StudyTable:
    """Correct integrators fed with the two suspected faults."""
    turned, fitted = (
        in_degrees(part.held_out.turns, bias.bias),
        in_degrees(part.fit.turns, bias.bias),
    )
    speed = float(np.median(np.concatenate([np.linalg.norm(turn.gyr, axis=1) for turn in turned])))
    rows, factors = [], []

    def add(label: str, values: np.ndarray, theirs: Sequence[Value]) -> None:
        rows.append(StudyRow(label, box_values(BoxNumbers.of(values), 3), tuple(theirs)))

    def rk4(factor: float) -> np.ndarray:
        return norms(turned, "rk4", "measured", factor)

    def tustin(factor: float) -> np.ndarray:
        return norms_as_printed(turned, "trapezoid", factor)

    for name, label, quantity in (
        ("rk4", "norm, RK4 with measured middle, deg/s", rk4),
        ("trapezoid", "norm, Tustin as printed, each step from unit length, deg/s", tustin),
    ):
        target = published.tables["4.2"].row(name)
        add(label, quantity(1.0), published_box(target))
        factor = speed_factor(quantity, float(target.values[1] or 0.0))
        if factor is not None:
            factors.append(factor)
            add(
                f"the same at {factor:.2f} times our speed", quantity(factor), published_box(target)
            )
    left = {}
    for name, label, turns in (
        *((name, TITLES[name], fitted) for name in INTEGRATORS),
        ("trapezoid", "Tustin as printed", as_printed(fitted)),
    ):
        table = published.tables[INTEGRATORS[name]]
        before, after = (
            angles_deg(NONE, turns, name),
            angles_deg(fit_in_degrees(turns, name), turns, name),
        )
        left[label] = float(np.median(after))
        add(
            f"angle [deg], {label}, deg/s, before the fit",
            before,
            published_box(table.row("accelerometer")),
        )
        add(f"angle [deg], {label}, deg/s, after the fit", after, published_box(table.row("both")))
    theirs = float(published.tables[INTEGRATORS["trapezoid"]].row("both").values[1] or 0.0)
    return StudyTable(
        "faults",
        "What two faults of an implementation do: rates in deg/s taken for rad/s, and a misplaced "
        "1/2",
        BOX,
        tuple(rows),
        f"{words.BOX_HOW} {words.FAULTS_HOW.format(speed=speed)}",
        words.FAULTS.format(
            agree=words.agreement(*factors) if len(factors) == 2 else "",
            angle=words.tustin_angle(left[TITLES["trapezoid"]], left["Tustin as printed"], theirs),
        ),
        "4.2 to 4.5",
        (3,) * 7,
        1,
        "Faults",
    )


def true_parameters(plan: Plan, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrix, bias and response to force of the simulated gyroscope that a calibration should find,
    from the seed of its run.

    The calibrated frame is that of the accelerometer's calibration, T K upper triangular. The
    accelerometer's own errors A turn it from the frame that the simulator works in: T K = R A^-1
    with a rotation R, a QR decomposition of A^-1.
    """
    sheet = plan.protocol.spec.sensors[SENSOR].imu()

    def errors(kind: str) -> TriadErrors:
        return TriadModel(getattr(sheet, kind).triad(), sheet.rate_hz, seed, SENSOR, kind).errors

    gyroscope = errors("gyroscope")
    Q, U = np.linalg.qr(np.linalg.inv(errors("accelerometer").matrix))
    R = (Q * np.sign(np.diag(U))).T
    return R @ np.linalg.inv(gyroscope.matrix), gyroscope.bias, gyroscope.g_matrix @ R.T


def parameter_table(part: Part, found: TriadCalibration, plan: Plan, seed: int) -> StudyTable:
    """The parameters with their uncertainty, beside the errors drawn for the simulated part."""
    matrix, bias, g_matrix = true_parameters(plan, seed)
    scale = np.diag(matrix)
    T = matrix / scale
    truth = [
        *scale,
        -T[0, 1],
        T[0, 2],
        T[1, 0],
        -T[1, 2],
        -T[2, 0],
        T[2, 1],
        *bias,
        *g_matrix.ravel(),
    ]
    (fit,) = found.fits
    shown = {
        "rad": (1e3, "mrad"),
        "rad/s": (np.degrees(1), "deg/s"),
        "rad/s/(m/s^2)": (np.degrees(part.gravity), "deg/s/g"),
    }
    rows = []
    for i, name in enumerate(fit.names):
        factor, unit = shown.get(fit.units[i], (1.0, fit.units[i]))
        value, sd, true = (
            float(factor * number) for number in (fit.values[i], fit.sd[i], truth[i])
        )
        rows.append(StudyRow(name, (unit, value, sd, true, (value - true) / sd)))
    return StudyTable(
        "parameters",
        "The parameters (RK4, with g-sensitivity), beside the errors that the simulated part was "
        "drawn for the part",
        ("unit", "value", "standard uncertainty", "true", "difference / uncertainty"),
        tuple(rows),
        words.PARAMETERS_HOW.format(condition=fit.condition),
        decimals=(0, 5, 5, 5, 1),
    )


def _findings(
    part: Part, calibrated: dict[str, Calibrated], tables: dict[str, StudyTable]
) -> tuple[str, ...]:
    def number(table: str, row: int, column: int) -> float:
        return float(tables[table].rows[row].values[column] or 0.0)

    medians = {
        name: float(np.median(angles(part, found.nine, name))) for name, found in calibrated.items()
    }
    with_g = float(np.median(angles(part, calibrated["rk4"].with_g, "rk4")))
    seconds = [number("4.7", -1, column) for column in (0, 2, 4)]
    spread = max(medians.values()) - min(medians.values())
    rows = range(len(tables["parts"].rows))
    gained = Change.of(
        [number("parts", row, 2) for row in rows], [number("parts", row, 0) for row in rows]
    )
    return (
        words.FOUND_ANGLE.format(**medians),
        words.FOUND_G.format(with_g=with_g, shown=told(gained)),
        words.FOUND_INTEGRATOR.format(
            spread=spread, percent=100 * spread / float(np.mean(list(medians.values())))
        ),
        words.FOUND_TIME.format(*seconds),
        words.FOUND_MAGNITUDE.format(raw=number("4.1", 1, 7), calibrated=number("4.1", 3, 7)),
        words.FOUND_FAULT,
    )


def _figure(
    part: Part, calibrated: dict[str, Calibrated], published: PublishedTables
) -> StudyBoxes:
    ours, theirs = {}, {}
    for name, title in TITLES.items():
        ours[title] = BoxNumbers.of(angles(part, calibrated[name].nine, name))
        ours[f"{title}, with g"] = BoxNumbers.of(angles(part, calibrated[name].with_g, name))
        if name in INTEGRATORS:
            row = published.tables[INTEGRATORS[name]].row("both")
            q1, median, q3, _, low, high = (float(value or 0.0) for value in row.values)
            theirs[f"{title}, published"] = BoxNumbers(
                low, q1, median, q3, high, tuple(row.outliers)
            )
    return StudyBoxes(
        "Angle between gravity by the accelerometer and by integration, everything calibrated",
        "angle [deg]",
        ours,
        theirs,
        "How to read: boxes from the lower to the upper quartile with the median, whiskers to the "
        "farthest value within 1.5 interquartile ranges; the axis is logarithmic. Ours are held "
        "out, the published ones were fitted.",
        logarithmic=True,
    )
