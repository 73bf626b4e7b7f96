"""What is said of sessions without a truth, and that none of it is a judgement."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.records.session.session import Session
from testbench.records.specs.protocol import Estimation
from tests import without_truth as made

DESCRIBED = ("comparison", "angle_ranges", "found_cycles", "rests", "orientation_changes")


@pytest.fixture(scope="module")
def dots(tmp_path_factory):
    session = made.two_dots(tmp_path_factory.mktemp("dots"))
    return evaluate(session, estimate(session))


@pytest.fixture(scope="module")
def imu(tmp_path_factory):
    session = made.one_imu(tmp_path_factory.mktemp("imu"))
    return session, estimate(session)


@pytest.fixture(scope="module")
def described(imu):
    return evaluate(*imu)


@pytest.fixture(scope="module")
def chest(tmp_path_factory):
    session = made.accelerometer_alone(tmp_path_factory.mktemp("acc"))
    return evaluate(session, estimate(session))


def test_a_knee_without_truth_has_its_range_and_its_cycles(dots):
    flexion = next(row for row in dots.angle_ranges if row.kind == "joint" and row.flexion)
    assert (flexion.owner, flexion.name, flexion.sequence) == ("knee", "flexion", "isb_knee")
    assert flexion.range_deg == pytest.approx(made.FLEXION_DEG, abs=0.05)
    cycle = next(row for row in dots.found_cycles if row.kind == "joint")
    assert cycle.frequency_hz == pytest.approx(1.0, rel=0.02)
    assert 7 <= cycle.cycles <= 9
    assert cycle.range == pytest.approx(made.FLEXION_DEG, abs=0.5)
    table = dots.series["found_cycles"]
    row = dots.found_cycles.index(cycle)
    assert np.ptp(table["mean"][table["row"] == row]) == pytest.approx(cycle.range, abs=0.5)
    flexed = np.degrees(dots.series["motion_knee"]["device_isb_knee_first_rad"])
    assert np.ptp(flexed) == pytest.approx(made.FLEXION_DEG, abs=0.05)


def test_a_sensor_that_does_not_move_has_no_cycles_and_that_is_said(dots):
    assert {row.owner for row in dots.found_cycles if row.kind == "sensor"} == {"shank"}
    (told,) = (own for own in dots.findings if own.code == "cycles.none_found")
    assert told.where == "thigh"


def test_nothing_was_judged_is_said_once_with_its_cause(dots, described, chest):
    for evaluation in (dots, described):
        told = [note for note in evaluation.notes if "nothing was evaluated" in note]
        assert told == ["nothing was evaluated: no truth is known of any sensor"]
        assert not evaluation.judged
    (why,) = (note for note in chest.notes if "nothing was evaluated" in note)
    assert why.endswith("no truth is known of any sensor and no filter could run")


def test_filters_are_compared_with_one_another_and_the_device(described):
    row = next(r for r in described.comparison if (r.first, r.second) == ("vqf_6d", "device"))
    assert row.heading_offset_deg == pytest.approx(-40, abs=3)
    assert row.rms_deg < 2
    assert len(described.comparison) == 6
    assert "vqf_6d_device_total_rad" in described.series["difference_wrist"]


def test_a_comparison_is_of_one_filter_with_all_others_and_said_to_be_no_truth(imu):
    session, estimated = imu
    settings = session.analysis.estimate.model_copy(update={"compare": "device"})
    found = evaluate(session, estimated, settings)
    assert {row.second for row in found.comparison} == {"device"}
    assert len(found.comparison) == 3
    assert any("a comparison and no truth" in note for note in found.notes)
    assert not found.orientation and not found.ranking
    assert found.to_dict()["comparison"][0]["second"] == "device"


def test_a_change_between_two_rests_is_an_error_only_where_it_was_stated(imu, described):
    assert {row.returned for row in described.orientation_changes} == {False}
    by = {row.filter: row for row in described.orientation_changes}
    assert by["device"].total_deg == pytest.approx(0, abs=1e-3)
    assert by["accelerometer"].total_deg is None
    assert by["accelerometer"].inclination_deg == pytest.approx(0, abs=0.1)
    settings = Estimation(returned=True)
    stated = evaluate(*imu, settings).orientation_changes
    assert {row.returned for row in stated} == {True}


def test_an_accelerometer_alone_has_rests_noise_cycles_and_a_lean(chest):
    (rest,) = chest.rests
    assert (rest.by, rest.rests) == ("acc", 2)
    assert 3.0 < rest.total_s <= 2 * made.REST_S  # the borders are drawn in by a second each
    (cycle,) = chest.found_cycles
    assert cycle.signal.startswith("acc_")
    assert cycle.frequency_hz == pytest.approx(1.0, rel=0.02)
    (change,) = chest.orientation_changes
    assert change.filter == "accelerometer"
    assert not chest.angle_ranges and not chest.comparison


def test_what_is_judged_is_not_described(quick):
    for name in DESCRIBED:
        assert not getattr(quick.evaluation, name), name
    assert not any(key.startswith(("euler_", "difference_")) for key in quick.evaluation.series)


def test_a_judged_session_can_be_compared_too(quick):
    settings = quick.session.analysis.estimate.model_copy(update={"compare": "device"})
    found = evaluate(quick.session, quick.estimate, settings)
    assert {row.second for row in found.comparison} == {"device"}
    assert found.orientation == quick.evaluation.orientation
    assert not found.angle_ranges


def test_what_is_described_is_read_back_as_it_was_written(imu, described, tmp_path):
    folder = tmp_path / "session"
    folder.mkdir()
    described.save(folder)
    again = type(described).load(folder)
    for name in DESCRIBED:
        assert getattr(again, name) == getattr(described, name)
    assert set(again.series) == set(described.series)


def test_the_sequence_of_a_session_is_stated_in_its_settings(tmp_path):
    session: Session = made.one_imu(tmp_path, euler_sequence="XYZ")
    assert session.analysis.estimate.euler_sequence == "XYZ"
