"""The study gimvebo: its bars, its tables, the published ones, and the faults that it feeds to
correct integrators.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from testbench import estimate, execute
from testbench.clock import SystemClock
from testbench.estimation.calibration.gyroscope import gravity_turns, static_bias
from testbench.estimation.calibration.turns import Turn
from testbench.exceptions import NotFoundError, SessionError
from testbench.model.integrators import get_integrator, steps_as_printed
from testbench.pipeline.prepared import make_plan
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.records.specs.published import load_published_tables
from testbench.studies import STUDIES, get_study
from testbench.studies.bench import StudyBench
from testbench.studies.gimvebo.faults import (
    as_printed,
    fit_in_degrees,
    in_degrees,
    norms,
    norms_as_printed,
    speed_factor,
)
from testbench.studies.gimvebo.recording import read_part
from testbench.studies.gimvebo.study import true_parameters
from testbench.studies.gimvebo.words import agreement, tustin_angle
from tests.asking import run_of

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
    assert len(said) == 3
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


def test_gravity_is_found_again_within_a_degree_on_turns_that_were_not_fitted(study):
    for number, published in (("4.3", 23.72), ("4.4", 22.67), ("4.5", 55.77)):
        both = study.table(number).rows[0]
        assert both.values[1] < 1.0
        assert both.published[1] == published
        assert study.table(number).rows[3].values[1] < 0.1  # with g-sensitivity
        assert study.table(number).rows[1].values[1] > 10 * both.values[1]


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


def test_the_accelerometer_is_judged_by_rests_it_was_not_fitted_to(study, part):
    raw, calibrated = study.table("4.1").rows[1], study.table("4.1").rows[3]
    assert calibrated.values[7] < 1e-3 * raw.values[7]
    assert len(part.held_out_rests) == 11 and all(len(rest) == 100 for rest in part.held_out_rests)
    means = [
        np.linalg.norm(part.accelerometer.apply(rest).mean(axis=0)) for rest in part.held_out_rests
    ]
    assert calibrated.values[7] == pytest.approx(np.mean((np.array(means) - 9.7992) ** 2))


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
    for row, limit in zip(study.table("4.2").rows, (1e-5, 1e-4, 1e-12, 1e-12, 0.05), strict=True):
        assert float(row.values[6]) < limit, row.label


def test_degrees_taken_for_radians_give_norms_and_angles_like_the_published_ones(study):
    rows = {row.label: row for row in study.table("faults").rows}
    at_speed = [row for label, row in rows.items() if label.startswith("the same at")]
    assert len(at_speed) == 2
    for row in at_speed:
        assert row.ratio(1) == pytest.approx(1, abs=1e-3)
    speeds = [float(row.label.split()[3]) for row in at_speed]
    assert speeds[0] == pytest.approx(speeds[1], rel=0.15)
    assert at_speed[0].values[4] < 0.05 and at_speed[0].values[5] > 0.99
    for label, row in rows.items():
        if label.endswith("after the fit"):
            before = rows[label.replace("after", "before")]
            assert 10 < row.values[1] < before.values[1] < 130


def test_the_misplaced_half_is_said_of_both_equations_and_the_angle_of_tustin_is_not_claimed(study):
    table = study.table("faults")
    rows = {row.label: row for row in table.rows}
    plain = rows["angle [deg], Tustin (trapezoid), deg/s, after the fit"]
    printed = rows["angle [deg], Tustin as printed, deg/s, after the fit"]
    assert plain.published == printed.published and plain.published[1] == 55.77
    assert max(plain.values[1], printed.values[1]) < 0.9 * 55.77
    assert (
        "Eq. 2.38 prints the same 1/2 for RK4" in table.why
        and "third quartile of 1 excludes it" in table.why
    )
    assert (
        "do not explain the factor of two in the angle of Tustin: with rates in deg/s "
        f"{plain.values[1]:.1f} deg" in table.why
    )
    assert f"{printed.values[1]:.1f} deg with the 1/2" in table.why
    assert "does not tell why" in study.table("4.5").why


def test_twice_the_rate_leads_where_the_formula_as_printed_leads(part):
    method, turn = get_integrator("trapezoid"), part.held_out.turns[0]
    (doubled,) = as_printed([turn])
    stages, _ = method.stages_from_samples(turn.gyr)
    twice, _ = method.stages_from_samples(doubled.gyr)
    printed, correct = (
        steps_as_printed(method, stages, turn.interval),
        method.steps(twice, turn.interval),
    )
    for q in (printed, correct):
        q /= np.linalg.norm(q, axis=1)[:, None]
    np.testing.assert_allclose(printed, correct, atol=1e-12)


@pytest.mark.parametrize(
    ("factors", "word"),
    [((1.69, 1.67), "nearly the same"), ((1.5, 1.72), "similar"), ((2.0, 1.2), "different")],
)
def test_the_word_for_two_speeds_follows_their_ratio(factors, word):
    assert f"ask for {word} speed" in agreement(*factors)
    assert f"ask for {word} speed" in agreement(*factors[::-1])


def test_an_angle_as_large_as_the_published_one_would_be_called_so():
    assert tustin_angle(30.0, 54.0, 55.77).startswith("The two together may explain")
    assert tustin_angle(30.0, 45.0, 55.77).startswith("The two together do not explain")


def test_every_number_is_traceable_to_a_session_that_is_kept(study):
    assert len(study.sessions) == 2
    assert [Session(path).manifest.seed for path in study.sessions] == [3, 4]
    assert [row.label for row in study.table("parts").rows] == [
        Session(path).name for path in study.sessions
    ]
    assert json.loads(json.dumps(study.to_dict(), allow_nan=False))["settings"]["seed"] == 3


def test_the_findings_say_the_numbers_of_the_tables(study):
    median = study.table("4.3").rows[0].values[1]
    assert f"within {median:.2f} deg (RK4)" in study.findings[0]


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


# --- faults, on motions whose answer is known


def turns_at(rate_deg_s: float) -> list[Turn]:
    rates = np.zeros((201, 3))
    rates[1:-1, 0] = np.radians(rate_deg_s)
    return [Turn(rates, 0.02, np.array([0.0, 0, 1]), np.array([0.0, 0, 1]))]


def test_a_step_as_printed_halves_the_norm_at_rest_and_grows_by_its_stability_function():
    still = norms_as_printed(turns_at(0.0), "trapezoid")
    assert still == pytest.approx(0.5)
    z = 60 * 0.02  # deg/s taken for rad/s, and no half
    turning = norms_as_printed(in_degrees(turns_at(60.0), np.zeros(3)), "trapezoid")
    assert np.median(turning) == pytest.approx(0.5 * np.sqrt(1 + z**4 / 4))


def test_norms_are_carried_on_from_step_to_step():
    z = 60 * 0.04 / 2
    growth = np.sqrt(1 - z**6 / 72 + z**8 / 576)
    carried = norms(in_degrees(turns_at(60.0), np.zeros(3)), "rk4", "measured")
    assert len(carried) == 100
    assert carried[60] / carried[50] == pytest.approx(growth**10)


def test_the_speed_factor_finds_what_was_put_in():
    turns = in_degrees(turns_at(40.0), np.zeros(3))
    wanted = float(np.median(norms_as_printed(turns, "trapezoid", 1.37)))
    assert speed_factor(lambda f: norms_as_printed(turns, "trapezoid", f), wanted) == pytest.approx(
        1.37, abs=1e-3
    )
    assert speed_factor(lambda f: np.array([f]), -1.0) is None


def test_a_fit_in_degrees_does_not_find_the_scale_that_is_right(part):
    wrong = fit_in_degrees(in_degrees(part.fit.turns, static_bias(part.fit).bias), "rk4")
    right = np.radians(np.diag(gravity_turns(part.fit).matrix))
    assert np.abs(np.diag(wrong.matrix) / right - 1).max() > 1
