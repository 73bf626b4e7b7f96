"""The study `gimvebo`: what the integrator does to the calibration of a gyroscope, beside Botina &
Vergara 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from testbench.exceptions import InputError
from testbench.model.imu import TriadErrors, TriadModel
from testbench.model.integrators import Stages
from testbench.pipeline.run import prepare
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.study import StudyReason, StudyRecord, StudyRow, StudyTable
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from testbench.records.session.session_writer import software_versions
from testbench.records.specs.published import PublishedTables, load_published_tables
from testbench.studies.bench import StudyBench
from testbench.studies.gimvebo import words
from testbench.studies.gimvebo.diagnosis import (
    angle_reasons,
    angles_table,
    norms_table,
    tested_norms,
)
from testbench.studies.gimvebo.figures import boxes, curves
from testbench.studies.gimvebo.recording import (
    SENSOR,
    Part,
    bias_of,
    has_sections,
    lacking,
    read_part,
    read_recording,
)
from testbench.studies.gimvebo.tables import (
    INTEGRATORS,
    TITLES,
    Calibrated,
    angle_table,
    angles,
    calibrate,
    heading_errors,
    heading_table,
    interval_table,
    magnitude_table,
    norm_table,
    others_table,
    stages_table,
    time_table,
)
from testbench.studies.parts import number_with, over_parts, told_over

PROTOCOL = "gimvebo_gyro"
EVERY, STAGES = "every", "stages"
"""Options: one sample of so many is taken; where the rates inside a step come from."""
COVERED = 1.96


def run(bench: StudyBench) -> StudyRecord:
    """Run the protocol for every part on the simulated gimbal, or ask the user's recording."""
    started = bench.now()
    published = load_published_tables("reference_3")
    parts, sessions = _parts(bench)
    bench.say("calibrations and tables")
    calibrated = [{name: calibrate(part, name) for name in TITLES} for part in parts]
    tables = _tables(parts, calibrated, published)
    tables.append(time_table(parts[0], published, bench.clock))
    plan, seen = None, []
    if bench.session is None:
        plan = prepare(bench.request(bench.protocol or PROTOCOL, bench.seed)).plan
        seen = [
            parameter_table(part, own, plan, seed)
            for part, found, seed in zip(parts, calibrated, bench.seeds, strict=True)
            if (own := found["rk4"].with_g) is not None
        ]
        tables += seen[:1]
    said = _findings(parts, calibrated, {table.key: table for table in tables}, seen)
    if not bench.own:
        bench.say("published norms and angles by hypothesis")
        tested = tested_norms(parts[0], published)
        by_degrees = over_parts([angles_table(part, published) for part in parts])
        by_degrees = replace(by_degrees, reasons=angle_reasons(by_degrees))
        tables += [norms_table(tested, published), by_degrees]
        said = (*said, *_beside(tested, tables))
    return StudyRecord(
        "gimvebo",
        "Integrators in the calibration of a gyroscope",
        words.QUESTION,
        published.source,
        started,
        {**bench.settings(PROTOCOL, plan), **bench.options},
        tuple(sessions),
        said,
        tuple(tables),
        boxes(parts[0], calibrated[0], published),
        software_versions(),
        curves(parts[0]),
        trace="Figures, run times and parameters are of the first.",
    )


def _parts(bench: StudyBench) -> tuple[list[Part], list[str]]:
    """What was recorded of each part, and in which sessions."""
    every, stages = _options(bench)
    if bench.session is not None and not has_sections(bench.recording()):
        session = bench.recording()
        bench.refuse_without("the calibration of a gyroscope", lacking(session))
        found, sessions = [read_recording(session)], [session]
    else:
        results = bench.results(PROTOCOL)
        sessions = [result.session for result in results]
        bench.refuse_without("the calibration of a gyroscope", _sections_lacking(sessions[0]))
        found = [read_part(result.session, result.estimate) for result in results]
    parts = [replace(part.every(every), stages=stages) for part in found]
    return parts, [str(session.path) for session in sessions]


def _sections_lacking(session: Session) -> list[str]:
    """What a session of a protocol lacks to be cut at its steps."""
    missing = [] if SENSOR in session.sensor_names else [f"a sensor called {SENSOR}"]
    return missing + ([] if has_sections(session) else ["sections poses, fit and held_out"])


def _options(bench: StudyBench) -> tuple[int, Stages | None]:
    """One sample of so many, and where rates come from.

    Raises:
        InputError: No such value.
    """
    every, stages = bench.options.get(EVERY, "1"), bench.options.get(STAGES)
    if not every.isdigit() or int(every) < 1:
        raise InputError(f"--option {EVERY}={every}: a whole number from 1 on is needed")
    for known in get_args(Stages):
        if stages == known:
            return int(every), known
    if stages is not None:
        raise InputError(f"--option {STAGES}={stages}: known are {', '.join(get_args(Stages))}")
    return int(every), None


def _tables(
    parts: Sequence[Part],
    calibrated: Sequence[dict[str, Calibrated]],
    published: PublishedTables,
) -> list[StudyTable]:
    """Those of all parts, as means with their spread."""
    both = list(zip(parts, calibrated, strict=True))
    magnitude = over_parts([magnitude_table(part, published) for part in parts])
    tables = [
        replace(magnitude, reasons=(_no_single_samples(magnitude),)),
        over_parts([norm_table(p, published, bias_of(p).bias) for p in parts]),
    ]
    for name in INTEGRATORS:
        tables.append(
            over_parts([angle_table(part, published, name, each[name]) for part, each in both])
        )
    tables.append(over_parts([others_table(part, each) for part, each in both]))
    tables.append(over_parts([stages_table(part, published) for part in parts]))
    tables.append(over_parts([interval_table(part) for part in parts]))
    if all(part.true_turns is not None for part in parts):
        tables.append(over_parts([heading_table(part, each) for part, each in both]))
    return tables


def _no_single_samples(table: StudyTable) -> StudyReason:
    """What noise says of the published calibrated samples, rows in the order of the table."""
    single, means = (1e3 * float(table.rows[row].values[3] or 0.0) for row in (2, 3))
    claim = words.MAGNITUDE_SHOWN.format(single=single, means=means)
    return StudyReason(claim, "shown", table.key)


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
        "drawn with",
        ("unit", "value", "standard uncertainty", "true", "difference / uncertainty"),
        tuple(rows),
        words.PARAMETERS_HOW.format(condition=fit.condition),
        decimals=(0, 5, 5, 5, 1),
    )


# One piece: the sentences and the numbers in them.
def _findings(
    parts: Sequence[Part],
    calibrated: Sequence[dict[str, Calibrated]],
    tables: dict[str, StudyTable],
    parameters: Sequence[StudyTable],
) -> tuple[str, ...]:
    """What ours say, of whatever data."""

    def found(name: str, kind: str) -> np.ndarray:
        """Angles after the held-out turns, shape (parts, turns) [deg]."""
        return np.array(
            [
                angles(part, getattr(each[name], kind), name)
                for part, each in zip(parts, calibrated, strict=True)
            ]
        )

    def median(values: np.ndarray) -> str:
        return number_with(np.median(values, axis=1))

    nine = {name: found(name, "nine") for name in TITLES}
    medians = [float(np.median(values, axis=1).mean()) for values in nine.values()]
    spread = max(medians) - min(medians)
    fits = "turns that were fitted" if parts[0].fitted else "held-out turns"
    several = f", mean and standard deviation over {len(parts)} parts" if len(parts) > 1 else ""
    said = [
        words.FOUND_ANGLE.format(
            **{name: median(nine[name]) for name in INTEGRATORS},
            turns=f"{nine['rk4'].shape[1]} {fits}",
            parts=several,
        ),
        words.FOUND_INTEGRATOR.format(
            spread=spread,
            percent=100 * spread / float(np.mean(medians)),
            interval=1e3 * parts[0].interval,
            shown=told_over(nine["cg4"], nine["rk4"]),
        ),
    ]
    if all(part.knows_force for part in parts):
        with_g = found("rk4", "with_g")
        told = told_over(with_g, nine["rk4"])
        said.append(words.FOUND_G.format(with_g=median(with_g), shown=told))
    if "heading" in tables:
        headings = {
            kind: np.array(
                [
                    heading_errors(part, getattr(each["rk4"], kind), "rk4")
                    for part, each in zip(parts, calibrated, strict=True)
                ]
            )
            for kind in ("nine", "with_g")
        }
        said.append(words.FOUND_HEADING.format(**{kind: median(v) for kind, v in headings.items()}))
    seconds = [float(tables["4.7"].rows[-1].values[column] or 0.0) for column in (0, 2, 4)]
    said.append(words.FOUND_TIME.format(*seconds))
    magnitude = tables["4.1"].rows
    said.append(
        words.FOUND_MAGNITUDE.format(raw=magnitude[1].values[7], calibrated=magnitude[3].values[7])
    )
    if parameters:
        off = [abs(float(row.values[4] or 0.0)) for table in parameters for row in table.rows]
        inside = sum(value <= COVERED for value in off)
        said.append(
            words.FOUND_PARAMETERS.format(count=len(off), parts=len(parameters), inside=inside)
        )
    return tuple(said)


def _beside(tested: dict[str, Any], tables: Sequence[StudyTable]) -> tuple[str, ...]:
    """What stands beside what was published."""
    reasons = [reason for table in tables for reason in table.reasons]
    said = [words.PUBLISHED_ANGLE, words.PUBLISHED_TIME, words.PUBLISHED_MAGNITUDE]
    for name, several in tested.items():
        fitting = [
            reason.claim.partition("with deg/s")[0].rpartition("those of ")[2].strip()
            for reason in reasons
            if reason.verdict == "candidate" and f"norms of {TITLES[name]} " in reason.claim
        ]
        said.append(
            words.FOUND_FITTING.format(
                published=TITLES[name],
                tried=len(several),
                fitting=f"{len(fitting)} have" if fitting else "none has",
                which=f" ({', '.join(fitting)})" if fitting else "",
            )
        )
    return tuple(said)
