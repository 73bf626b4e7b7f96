"""The study gimvebo: its bars, its tables, the published ones, and the faults that it feeds to
correct integrators.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from testbench import estimate, execute
from testbench.clock import SystemClock
from testbench.estimation.calibration.gyroscope import gravity_turns, static_bias
from testbench.estimation.calibration.prepared import prepare
from testbench.estimation.calibration.recording import CalibrationRecording
from testbench.estimation.calibration.turns import Turn
from testbench.exceptions import InputError, NotFoundError, SessionError
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.model.integrators import get_integrator, steps_as_printed
from testbench.pipeline.calibrate import calibrate
from testbench.pipeline.prepared import make_plan
from testbench.pipeline.request import CalibrationRequest
from testbench.records.results.numbers import decimals_by
from testbench.records.results.study import BoxNumbers, StudyRecord
from testbench.records.session.samples import ImuSamples
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Analysis, Estimation
from testbench.records.specs.published import load_published_tables
from testbench.studies import STUDIES, get_study
from testbench.studies.bench import StudyBench
from testbench.studies.gimvebo.hypotheses import (
    RK4,
    TUSTIN,
    NormHypothesis,
    fit_in_degrees,
    in_degrees,
    speed_factor,
    try_norms,
)
from testbench.studies.gimvebo.recording import read_part, read_recording
from testbench.studies.gimvebo.study import true_parameters
from testbench.studies.gimvebo.tables import heading_errors
from tests.asking import run_of
from tests.studies.hostile import complaints, missing, published_words
from tests.studies.known_recordings import write_known

pytestmark = pytest.mark.slow

# Sums of each published table as printed: a digit that was copied wrongly changes one.
SUMS = {
    "4.1": 98.62170089378,
    "4.2": 11.9803,
    "4.3": 1245.58,
    "4.4": 1049.51,
    "4.5": 1384.0056,
    "4.6": 441.49,
    "4.7": 111316.58,
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def study(logs) -> StudyRecord:
    said: list[str] = []
    record = get_study("gimvebo").run(
        StudyBench(logs, SystemClock(), seed=3, parts=2, say=said.append)
    )
    assert said[-1] == "published norms and angles by hypothesis"
    return record


@pytest.fixture(scope="module")
def part(study):
    session = Session(study.sessions[0])
    return read_part(session, estimate(session))


def test_published_tables_are_those_of_the_source():
    tables = load_published_tables("reference_3").tables
    assert set(tables) == set(SUMS)
    for number, table in tables.items():
        total = sum(value for row in table.rows for value in row.values if value is not None)
        assert total == pytest.approx(SUMS[number], abs=1e-7), number


def test_published_interquartile_ranges_fit_their_quartiles_but_for_the_one_the_source_misprints():
    for number, table in load_published_tables("reference_3").tables.items():
        for row in table.rows if number != "4.7" else ():
            q1, _, q3, iqr = row.values[:4]
            misprint = (number, row.label) == ("4.3", "accelerometer")
            assert (abs(q3 - q1 - iqr) < 0.02) != misprint, (number, row.label)
            assert not misprint or "70.01" in row.remark


def test_unknown_publications_and_studies_are_refused_with_those_that_exist():
    with pytest.raises(NotFoundError, match="reference_3"):
        load_published_tables("reference_1")
    with pytest.raises(NotFoundError, match="gimvebo"):
        get_study("bode")
    assert all(entry.description for entry in STUDIES.values())


FIGURES = (
    "Acceleration in the rests, raw (as figure 4.2)",
    "Angular rate in the first turn, raw (as figure 4.3)",
    "Magnitude of the acceleration before and after calibration (as figure 4.4)",
    "Magnitude of the acceleration (as figure 4.5)",
    "Norm of the quaternion (as figure 4.6)",
    "Norm of the quaternion over the first turn, less 1 (as figure 4.7)",
    "Angle after the turn by RK4 (as figure 4.8)",
    "Angle after the turn by Crouch-Grossman 4 (as figure 4.9)",
    "Angle after the turn by Tustin (implicit) (as figure 4.10)",
    "Angle after the turn by RK4, rate constant or measured (as figure 4.11)",
)
"""Of the source, each with its counterpart in the report."""


def test_a_hostile_reader_finds_nothing_and_every_figure_of_the_source(study):
    assert complaints(study, one_part={"4.7", "parameters", "norms"}) == []
    assert missing(study, FIGURES) == []


def test_gravity_is_found_again_within_a_degree_on_turns_that_were_not_fitted(study):
    for number, published in (("4.3", 23.72), ("4.4", 22.67), ("4.5", 55.77)):
        both = study.table(number).rows[0]
        assert both.values[1] < 1.0 and both.spread[1] is not None
        assert both.published[1] == published and both.ratio(1) is None  # theirs were fitted
        assert study.table(number).rows[3].values[1] < 0.1  # with g-sensitivity
        assert study.table(number).rows[1].values[1] > 10 * both.values[1]


def test_the_heading_is_judged_by_the_gimbal_and_is_as_good_as_gravity(study, part):
    rows = {row.label: row.values for row in study.table("heading").rows}
    assert rows["RK4, with g-sensitivity"][1] < rows["RK4, nine parameters"][1] < 1.0
    calibration = gravity_turns(part.fit, g_sensitivity=True)
    found = heading_errors(part, calibration, "rk4")
    assert found.shape == (10,) and found.max() < 1
    turned = replace(
        part,
        held_out=replace(
            part.held_out,
            turns=[
                replace(turn, gyr=turn.gyr + np.radians(1.0) * np.array(turn.up_after))
                for turn in part.held_out.turns
            ],
        ),
    )
    # a degree a second about what ends upright, over 4 s of each turn
    assert np.median(heading_errors(turned, calibration, "rk4")) > 0.5


def test_every_way_is_judged_at_every_interval(study):
    rows = {row.label: row.values for row in study.table("intervals").rows}
    assert len(study.table("intervals").columns) == 3
    for label, values in rows.items():
        assert all(value is not None for value in values), label
    assert rows["RK4, rate measured"][0] < 0.1


def test_every_calibration_takes_less_than_a_second(study):
    rows = study.table("4.7").rows
    assert [row.label for row in rows] == [*(f"run {i}" for i in range(1, 6)), "mean"]
    assert all(0 < value < 1 for row in rows for value in row.values[::2])
    assert rows[-1].published[::2] == pytest.approx([105.97, 2116.012, 7105.61])


def test_the_parameters_are_those_the_part_was_born_with_within_their_uncertainty(study):
    rows = study.table("parameters").rows
    assert len(rows) == 21
    off = np.array([row.values[4] for row in rows], dtype=float)
    assert np.abs(off).max() < 4.5
    assert np.sqrt(np.mean(off**2)) < 2
    assert any(finding.startswith("Of 42 parameters of 2 parts") for finding in study.findings)


def test_the_accelerometer_is_judged_by_rests_it_was_not_fitted_to(study, part):
    raw, calibrated = study.table("4.1").rows[1], study.table("4.1").rows[3]
    assert calibrated.values[7] < 1e-3 * raw.values[7]
    assert len(part.held_out_rests) == 11 and all(len(rest) == 100 for rest in part.held_out_rests)
    means = [
        np.linalg.norm(part.accelerometer.apply(rest).mean(axis=0)) for rest in part.held_out_rests
    ]
    own = np.mean((np.array(means) - 9.7992) ** 2)  # one of two parts lies so far from their mean
    assert abs(own - calibrated.values[7]) == pytest.approx(calibrated.spread[7] / np.sqrt(2))


def test_the_turns_span_two_hundred_samples_from_rest_to_rest(part):
    for recording in (part.fit, part.held_out):
        assert len(recording.turns) == 10
        noise = np.concatenate([rest.gyr - rest.gyr.mean(axis=0) for rest in recording.rests]).std()
        bias = static_bias(recording).bias
        for turn in recording.turns:
            assert len(turn.gyr) == 200 and turn.interval == pytest.approx(0.02, rel=2e-4)
            assert np.abs(turn.gyr[[0, -1]] - bias).max() < 8 * noise + 0.01
            assert np.degrees(np.abs(turn.gyr - bias)).max() > 20


def test_correct_integrators_keep_the_norm(study):
    limits = (1e-5, 1e-3, 1e-12, 1e-4, 1e-12, 0.05)
    for row, limit in zip(study.table("4.2").rows, limits, strict=True):
        assert row.values[6] < limit, row.label
    tustin = study.table("4.2").rows[1]
    assert tustin.label == "Tustin (implicit)" and tustin.values[5] <= 1 + 1e-6
    assert tustin.values[7] < 1e-6  # at rest again after the turn, but for the noise


def test_every_hypothesis_of_the_norms_is_tried_turn_by_turn_and_told_as_what_it_is(study):
    table = study.table("norms")
    own = [row for row in table.rows if not row.published_alone]
    assert len(own) == len(RK4) + len(TUSTIN)
    verdicts = {reason.claim: reason.verdict for reason in table.reasons}
    assert len(verdicts) >= len(own)
    for row in own:
        inside = str(row.values[6])
        (verdict,) = {
            reason.verdict
            for reason in table.reasons
            if row.label.partition(", deg/s taken for rad/s, ")[2] + ":" in reason.claim
            and f"are those of {row.label.partition(',')[0]} with" in reason.claim
        }
        assert verdict == ("candidate" if inside.startswith("4 of 4") else "refuted"), row.label
    open_ones = [reason for reason in table.reasons if reason.verdict == "open"]
    for name in ("RK4", "Tustin (implicit)"):
        fitting = [
            r for r in table.reasons if f"norms of {name} are" in r.claim and r.verdict != "refuted"
        ]
        assert bool(fitting) != any(f"norms of {name};" in reason.claim for reason in open_ones)


def test_degrees_taken_for_radians_leave_angles_of_tens_of_degrees_told_by_quartiles(study):
    table = study.table("angles in degrees")
    rows = {row.label: row for row in table.rows}
    for name in ("RK4", "Crouch-Grossman 4", "Tustin (implicit)"):
        before, after = rows[f"{name}, before the fit"], rows[f"{name}, after the fit"]
        assert 10 < after.values[1] < before.values[1] < 130
    for reason in table.reasons:
        if reason.verdict == "open":
            continue
        row = rows[reason.claim.partition(":")[0]]
        inside = row.values[0] <= row.published[1] <= row.values[2]
        assert reason.verdict == ("candidate" if inside else "refuted")


def test_every_number_is_traceable_to_a_session_that_is_kept(study):
    assert len(study.sessions) == 2
    assert [Session(path).manifest.seed for path in study.sessions] == [3, 4]
    assert json.loads(json.dumps(study.to_dict(), allow_nan=False))["settings"]["seed"] == 3


def test_the_findings_say_the_numbers_of_the_tables(study):
    row = study.table("4.3").rows[0]
    decimals = decimals_by(row.spread[1])
    told = f"{row.values[1]:.{decimals}f} ± {row.spread[1]:.{decimals}f} deg (RK4)"
    assert told in study.findings[0] and "over 2 parts" in study.findings[0]
    assert "10 held-out turns" in study.findings[0]


def test_the_true_parameters_are_those_that_noiseless_turns_would_show():
    """Raw readings of the part's own errors, computed here, are corrected into one rotation of the
    truth.
    """
    plan = make_plan(run_of("gimvebo_gyro"))
    matrix, _, _ = true_parameters(plan, 3)
    from testbench.model.imu import TriadModel

    sheet = plan.protocol.spec.sensors["imu"].imu()
    A, S = (
        TriadModel(getattr(sheet, k).triad(), 50, 3, "imu", k).errors.matrix
        for k in ("accelerometer", "gyroscope")
    )
    R = matrix @ S  # corrected rate = R true rate
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12) and np.linalg.det(R) == pytest.approx(1)
    assert np.abs(np.tril(R @ np.linalg.inv(A), -1)).max() < 1e-12


def test_a_session_without_the_needed_rests_is_refused(part, study, tmp_path, altered_protocol):
    from testbench import plan

    path = altered_protocol("gimvebo_gyro", lambda content: content["variables"].update(rest_s=1.0))
    session = execute(plan(path), tmp_path, 1)
    with pytest.raises(SessionError, match="too soon"):
        read_part(session, estimate(session))


# --- data of one's own


def test_the_calibration_that_the_study_finds_best_is_made_by_command(study, tmp_path):
    session = Session(study.sessions[0])
    asked = CalibrationRequest(
        out=str(tmp_path / "a.yaml"),
        methods=("norm_only", "gravity_turns"),
        g_sensitivity=True,
        integrator="cg4",
        report=False,
    )
    found = calibrate(session, asked).result.calibration.triads["gyroscope"]
    assert found.validation["gravity_direction_median_deg"] < 0.08
    assert "integrated by cg4 with interpolated rates" in found.remarks
    plain = asked.model_copy(update={"out": str(tmp_path / "b.yaml"), "g_sensitivity": None})
    without = calibrate(session, plain).result.calibration.triads["gyroscope"]
    assert without.validation["gravity_direction_median_deg"] > 0.1
    slow = asked.model_copy(
        update={"out": str(tmp_path / "c.yaml"), "integrator": "euler", "every": 8}
    )
    coarse = calibrate(session, slow).result.calibration.triads["gyroscope"]
    assert coarse.validation["gravity_direction_median_deg"] > 0.1
    wrong = asked.model_copy(update={"methods": ("static_bias",), "out": str(tmp_path / "d.yaml")})
    with pytest.raises(InputError, match="for the methods gravity_turns and attitude"):
        calibrate(session, wrong)


def test_a_session_of_the_protocol_is_asked_as_the_users_own(study, tmp_path):
    bench = StudyBench(
        tmp_path / "logs",
        SystemClock(),
        session=study.sessions[1],
        options={"every": "2", "stages": "constant"},
    )
    own = get_study("reference-3").run(bench)
    assert published_words(own) == [] and complaints(own) == []
    assert own.settings == {"session": study.sessions[1], "every": "2", "stages": "constant"}
    assert {"4.1", "4.2", "4.3", "heading", "intervals"} <= {table.key for table in own.tables}
    assert "40 ms" in own.table("intervals").columns[0]
    assert missing(own, FIGURES) == [] and own.simulated and not (tmp_path / "logs").exists()
    for options in ({"every": "0"}, {"every": "two"}, {"stages": "halfway"}):
        with pytest.raises(InputError, match="--option"):
            get_study("reference-3").run(replace(bench, options=options))


def test_a_recording_without_an_arm_is_cut_at_its_rests(imu_tk, tmp_path):
    session = imu_tk
    own = get_study("reference-3").run(
        StudyBench(tmp_path / "logs", SystemClock(), session=session.path)
    )
    assert published_words(own) == [] and not own.simulated
    nine, with_g = (own.table("4.3").rows[i].values[1] for i in (0, 3))
    assert with_g < nine < own.table("4.3").rows[1].values[1]
    with pytest.raises(KeyError):
        own.table("heading")
    part = read_recording(session)
    assert len(part.fit.turns) + len(part.held_out.turns) == 37


def test_the_layout_of_the_publication_is_calibrated_and_asked(part, study, tmp_path):
    """Accelerations at rest alone, rates in motion alone, as their board kept them."""
    session = as_published(part, study, tmp_path / "parted")
    ready = prepare(CalibrationRecording.of(session, "imu"), None)
    assert ready.parted is not None and len(ready.rests) == 40 and len(ready.parted.turns) == 20
    asked = CalibrationRequest(out=str(tmp_path / "a.yaml"), report=False)
    triads = calibrate(session, asked).result.calibration.triads
    assert triads["accelerometer"].method == "norm_only"
    assert triads["gyroscope"].method == "gravity_turns"
    true = true_parameters(make_plan(run_of("gimvebo_gyro")), 3)
    off = np.degrees(np.abs(triads["gyroscope"].bias - true[1]))
    assert off.max() < 1.0  # by turns alone, of up to 20 deg/s
    assert triads["gyroscope"].validation["gravity_direction_median_deg"] < 1.5
    with pytest.raises(InputError, match="leave --segmentation out"):
        calibrate(
            session,
            asked.model_copy(update={"segmentation": "variance", "out": str(tmp_path / "b.yaml")}),
        )
    own = get_study("reference-3").run(
        StudyBench(tmp_path / "logs", SystemClock(), session=session.path)
    )
    assert published_words(own) == [] and own.table("4.3").rows[0].values[1] < 1.5
    assert not [f for f in own.findings if "response to gravity" in f]
    ten = as_published(part, study, tmp_path / "ten", 10)
    few = get_study("reference-3").run(StudyBench(tmp_path, SystemClock(), session=ten.path))
    assert "10 turns that were fitted" in few.findings[0]


def as_published(part, study, out, most=20) -> Session:
    """Rests of a hundred accelerations on either side of two hundred rates, row after row."""
    rows_acc, rows_gyr = [], []
    nothing = np.full((100, 3), np.nan)
    for turn in (*part.fit.turns, *part.held_out.turns)[:most]:
        up = [part.gravity * np.array(u) for u in (turn.up_before, turn.up_after)]
        noise = 0.02 * np.random.default_rng(1).standard_normal((2, 100, 3))
        raw = [np.linalg.solve(part.accelerometer.matrix, u) + part.accelerometer.bias for u in up]
        rows_acc += [raw[0] + noise[0], np.full(turn.gyr.shape, np.nan), raw[1] + noise[1]]
        rows_gyr += [nothing, turn.gyr, nothing]
    acc, gyr = np.concatenate(rows_acc), np.concatenate(rows_gyr)
    time = np.round(np.arange(len(acc)) * 2e7).astype(np.int64)
    samples = ImuSamples(
        time, time, gyr, acc, None, None, np.arange(len(acc)), np.zeros(len(acc), dtype=bool)
    )
    settings = Estimation(filters=["vqf_6d"], align="none", align_clock=False, calibrate="none")
    recording = Recording(
        out.name,
        "as published",
        {"imu": ImportedSensor([samples], 50.0, "made up", None)},
        Analysis(estimate=settings),
    )
    return write_recording(recording, [out], "made", out, SystemClock())


def test_a_recording_that_does_not_rest_is_refused_by_name(tmp_path):
    made = write_known(tmp_path / "known", 1)
    with pytest.raises(
        InputError, match=r"asks for 18 rests with 7 turns between them .*never rests"
    ):
        get_study("reference-3").run(
            StudyBench(tmp_path / "logs", SystemClock(), session=made.path)
        )


# --- hypotheses, on motions whose answer is known


def turns_at(rate_deg_s: float) -> list[Turn]:
    rates = np.zeros((201, 3))
    rates[1:-1, 0] = np.radians(rate_deg_s)
    return [Turn(rates, 0.02, np.array([0.0, 0, 1]), np.array([0.0, 0, 1]))]


EACH_HALF = NormHypothesis(
    "trapezoid", "interpolated", "each step from unit length", "before the bracket"
)


def test_a_step_as_printed_halves_the_norm_at_rest_and_grows_by_its_stability_function():
    assert EACH_HALF.norms(turns_at(0.0)[0]) == pytest.approx(0.5)
    z = 60 * 0.02  # deg/s taken for rad/s, and no half
    turning = EACH_HALF.norms(in_degrees(turns_at(60.0), np.zeros(3))[0])
    assert np.median(turning) == pytest.approx(0.5 * np.sqrt(1 + z**4 / 4))


def test_a_step_as_printed_is_that_of_the_formula():
    (turn,) = in_degrees(turns_at(37.0), np.zeros(3))
    for name in ("trapezoid", "rk4"):
        method = get_integrator(name)
        of = NormHypothesis(name, "interpolated", half="before the bracket")
        stages, _ = method.stages_from_samples(turn.gyr)
        printed = np.linalg.norm(steps_as_printed(method, stages[:50], turn.interval)[1:], axis=1)
        np.testing.assert_allclose(of.norms(turn)[:50], printed, rtol=1e-9)


def test_the_implicit_step_as_printed_solves_the_printed_equation():
    """q' = (q + h/2 (q w0 + q' w1)) / 2, by NumPy's solver."""
    of = NormHypothesis(
        "tustin", "interpolated", "each step from unit length", "before the bracket"
    )
    (turn,) = in_degrees(turns_at(50.0), np.zeros(3))
    h, found = turn.interval, of.norms(turn)
    for k in (0, 1, 100, 199):
        w0, w1 = (
            np.array(
                [[0, *-w], [w[0], 0, w[2], -w[1]], [w[1], -w[2], 0, w[0]], [w[2], w[1], -w[0], 0]]
            )
            for w in turn.gyr[k : k + 2]
        )
        q = np.linalg.solve(2 * np.eye(4) - h / 2 * w1, (np.eye(4) + h / 2 * w0)[:, 0])
        assert found[k] == pytest.approx(np.linalg.norm(q), rel=1e-12)


def test_norms_are_carried_on_from_step_to_step():
    z = 60 * 0.04 / 2
    growth = np.sqrt(1 - z**6 / 72 + z**8 / 576)
    (turn,) = in_degrees(turns_at(60.0), np.zeros(3))
    carried = NormHypothesis("rk4", "measured").norms(turn)
    assert len(carried) == 100
    assert carried[60] / carried[50] == pytest.approx(growth**10)
    each = NormHypothesis("rk4", "measured", "each step from unit length").norms(turn)
    assert each[50] == pytest.approx(growth)


def test_norms_of_the_implicit_rule_follow_its_law():
    (turn,) = in_degrees(turns_at(60.0), np.zeros(3))
    norms = NormHypothesis("tustin", "interpolated").norms(turn)
    assert np.median(norms) == pytest.approx(1 / np.sqrt(1 + (0.02 * 60 / 4) ** 2), rel=1e-12)
    assert norms[-1] == pytest.approx(1, abs=1e-12)


def test_a_hypothesis_that_made_a_box_plot_is_found_inside_and_another_is_not():
    rng = np.random.default_rng(3)
    rates = np.radians(rng.uniform(150, 250, (5, 1, 1)))
    shape = np.sin(np.linspace(0, np.pi, 201))[None, :, None] ** [0.5, 1, 2]
    up = np.array([0.0, 0, 1])
    turns = in_degrees([Turn(r, 0.02, up, up) for r in rates * shape], np.zeros(3))
    of = NormHypothesis("tustin", "interpolated")
    box = BoxNumbers.of(of.norms(turns[2], 0.8))
    found = try_norms(of, turns, box.median)
    assert len(found.factors) == found.turns == 5
    assert set(found.inside(box)) == {"q1", "q3", "lower", "upper"}
    assert found.factors[2] == pytest.approx(0.8, rel=0.05)
    other = try_norms(NormHypothesis("trapezoid", "interpolated"), turns, box.median)
    assert other.factors == () and other.inside(box) == []  # Heun's are never below one


def test_the_speed_factor_finds_what_was_put_in():
    (turn,) = in_degrees(turns_at(40.0), np.zeros(3))
    wanted = float(np.median(EACH_HALF.norms(turn, 1.37)))
    found = speed_factor(lambda f: EACH_HALF.norms(turn, f), wanted)
    assert found == pytest.approx(1.37, abs=1e-3)
    assert speed_factor(lambda f: np.array([f]), -1.0) is None


def test_a_fit_in_degrees_does_not_find_the_scale_that_is_right(part):
    wrong = fit_in_degrees(in_degrees(part.fit.turns, static_bias(part.fit).bias), "rk4")
    right = np.radians(np.diag(gravity_turns(part.fit).matrix))
    assert np.abs(np.diag(wrong.matrix) / right - 1).max() > 1
