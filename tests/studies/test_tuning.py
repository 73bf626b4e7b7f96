"""Tuning: planted optima are found, the objective is what evaluate states, and what was tuned on
never tests.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from testbench.estimation import estimate
from testbench.estimation.filters import get_filter
from testbench.estimation.filters.base import OrientationFilter, Parameter
from testbench.evaluation import evaluate
from testbench.evaluation.objective import Objective
from testbench.exceptions import FileProblems, InputError, NotFoundError, SessionError
from testbench.model import rotation
from testbench.pipeline.parameter_space import Effort
from testbench.pipeline.tune import SearchWanted, Sessions, SessionTrials, find_parameters
from testbench.records.results.tuning import load_tunings
from testbench.records.session.layout import MANIFEST
from testbench.records.session.session import Session
from tests.studies.known_recordings import write_known

NOW = "2026-01-02T03:04:05+00:00"


class Planted(OrientationFilter):
    """The device's orientation, turned back by 10 deg for each decade of `gain`: its error vanishes
    at one gain.
    """

    name, needs, source = "planted", ("device_q",), "made up"
    PARAMETERS = (Parameter("gain", 1.0, "1", "decades of ten degrees", "made up", 1e-3, 1e3),)

    def run(self, samples):
        turn = np.array([np.radians(-10 * np.log10(self.parameters["gain"])), 0.0, 0.0])
        return rotation.multiply(rotation.from_rotation_vector(turn), samples.device_q)


@pytest.fixture(scope="module")
def turned(tmp_path_factory) -> list[Session]:
    """Sessions whose best gains are 0.1, 10^0.55 and 100: short, and without noise where it
    matters.
    """
    folder = tmp_path_factory.mktemp("turned")
    wanted = (-10.0, 5.5, 20.0)
    return [
        write_known(folder / f"turned_{i}", i, 5.0, device_turn_deg=turn)
        for i, turn in enumerate(wanted)
    ]


@pytest.fixture(scope="module")
def noisy(tmp_path_factory) -> list[Session]:
    """Sessions with known noise and a biased gyroscope."""
    folder = tmp_path_factory.mktemp("noisy")
    return [
        write_known(folder / f"noisy_{i}", 10 + i, 40.0, bias=(0.02, -0.01, 0.015))
        for i in range(3)
    ]


def test_planted_optima_are_found_for_each_session_and_for_all(turned):
    found = find_parameters(
        Planted(), Sessions.given(turned, []), SearchWanted("total_rmse_deg"), NOW
    )
    for entry, planted in zip(found.sessions, (-1.0, 0.55, 2.0), strict=True):
        assert np.log10(entry.own_parameters["gain"]) == pytest.approx(planted, abs=0.01)
        assert entry.own_value == pytest.approx(0, abs=0.1)
        assert entry.default_value == pytest.approx(10 * abs(planted), abs=1e-6)
    # the mean of |x - x_i| is least at the median
    assert np.log10(found.parameters["gain"]) == pytest.approx(0.55, abs=0.01)
    assert found.value == pytest.approx(10 * (1.55 + 0 + 1.45) / 3, abs=0.05)
    assert found.search.converged
    assert found.at_edge == []


def test_leaving_one_out_gives_the_set_of_the_others(turned):
    found = find_parameters(
        Planted(),
        Sessions.given(turned, []),
        SearchWanted("total_rmse_deg", leave_one_out=True),
        NOW,
    )
    gains = [np.log10(entry.left_out_parameters["gain"]) for entry in found.sessions]
    for gain, (low, high) in zip(
        gains, ((0.55, 2.0), (-1.0, 2.0), (-1.0, 0.55)), strict=True
    ):  # anything between the two
        assert low - 0.01 <= gain <= high + 0.01
    for entry, gain, planted in zip(found.sessions, gains, (-1.0, 0.55, 2.0), strict=True):
        assert entry.left_out_value == pytest.approx(10 * abs(gain - planted), abs=1e-3)
    with pytest.raises(InputError, match="needs two sessions"):
        find_parameters(
            Planted(),
            Sessions.given(turned[:1], []),
            SearchWanted("total_rmse_deg", leave_one_out=True),
            NOW,
        )


def total_by_evaluate(session: Session, beta: float) -> float:
    kind = get_filter("madgwick_marg", {"beta": beta})
    (row,) = evaluate(session, estimate(session, [kind])).orientation
    return row.total_rmse_deg


def test_madgwicks_beta_is_tuned_to_a_minimum_that_evaluate_confirms(noisy):
    found = find_parameters(
        get_filter("madgwick_marg"),
        Sessions.given(noisy[:2], noisy[2:]),
        SearchWanted("total_rmse_deg", ["beta"], Effort(values=7)),
        NOW,
    )
    beta = found.parameters["beta"]
    assert found.parameters | {"beta": 0} == get_filter("madgwick_marg").parameters | {"beta": 0}

    def mean(beta):
        return np.mean([total_by_evaluate(session, beta) for session in noisy[:2]])

    assert mean(beta) == pytest.approx(found.value, rel=1e-12)
    assert found.value < mean(0.041) == pytest.approx(found.default_value, rel=1e-12)
    assert found.value < min(mean(beta / 1.2), mean(beta * 1.2))
    (test,) = found.of_role("test")
    assert (
        test.own_parameters is None
    )  # a test session has no optimum of its own: that would be tuning on it
    assert test.value == pytest.approx(total_by_evaluate(noisy[2], beta), rel=1e-12)
    assert test.value < test.default_value  # the same noise: what was tuned holds
    for entry in found.of_role("tuning"):
        assert entry.own_value <= entry.value <= entry.default_value


def test_the_set_does_not_depend_on_what_is_tested(noisy, turned):
    def parameters(test):
        sessions = Sessions.given(noisy[:1], test)
        return find_parameters(
            get_filter("madgwick_marg"),
            sessions,
            SearchWanted("total_rmse_deg", ["beta"], Effort(values=3)),
            NOW,
        ).parameters

    assert parameters([]) == parameters(noisy[1:]) == parameters(turned[:1])


@pytest.mark.parametrize("metric", ["total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"])
@pytest.mark.parametrize("owner", ["", "forearm."])
def test_the_objective_of_sensors_is_the_metric_of_evaluate(quick, metric, owner):
    kind = get_filter("vqf_6d", {"tau_acc_s": 1.3})
    trials = SessionTrials(quick.session, Objective.parse(owner + metric), kind, ["tau_acc_s"])
    metrics = evaluate(quick.session, estimate(quick.session, [kind])).metrics
    wanted = [
        m.value for m in metrics if m.name.endswith(f".{metric}") and m.name.startswith(owner)
    ]
    assert len(wanted) == (1 if owner else 2)
    assert trials((1.3,)) == pytest.approx(np.mean(wanted), rel=1e-12)


@pytest.mark.parametrize("metric", ["flexion_rmse_deg", "flexion_mean_abs_error_deg"])
def test_the_objective_of_joints_is_the_metric_of_evaluate(quick, metric):
    kind = get_filter("vqf_6d", {"tau_acc_s": 1.3})
    trials = SessionTrials(quick.session, Objective.parse(f"elbow.{metric}"), kind, ["tau_acc_s"])
    metrics = evaluate(quick.session, estimate(quick.session, [kind])).metrics
    own = quick.session.analysis.joints["elbow"].sequence
    mine = [m for m in metrics if m.filter == "vqf_6d" and m.sequence == own]
    wanted = [m.value for m in mine if m.name == f"elbow.{metric}"]
    assert len(wanted) == 2  # static and sweep, which count alike
    assert trials((1.3,)) == pytest.approx(np.mean(wanted), rel=1e-12)


def test_objectives_that_a_session_lacks_are_refused(quick, noisy, tmp_path):
    sessions = Sessions.given(noisy[:1], [])
    for objective, error, match in (
        ("total_rms_deg", NotFoundError, "known: total_rmse_deg"),
        ("hand.total_rmse_deg", NotFoundError, "known: imu"),
        ("elbow.flexion_rmse_deg", NotFoundError, "unknown joint"),
        ("flexion_rmse_deg", InputError, "defines no joint"),
    ):
        with pytest.raises(error, match=match):
            find_parameters(
                get_filter("vqf_6d"), sessions, SearchWanted(objective, ["tau_acc_s"]), NOW
            )
    no_field = without_field(noisy[0], tmp_path / "no_field")
    with pytest.raises(InputError, match="the sensor gives no mag"):
        find_parameters(
            get_filter("madgwick_marg"),
            Sessions.given([no_field], []),
            SearchWanted("total_rmse_deg", ["beta"]),
            NOW,
        )
    blind = Session(shutil.copytree(noisy[0].path, tmp_path / "blind"))
    (blind.path / "truth_imu.parquet").unlink()
    with pytest.raises(SessionError, match=r"truth_imu\.parquet is missing"):
        find_parameters(
            get_filter("madgwick_marg"),
            Sessions.given([blind], []),
            SearchWanted("total_rmse_deg", ["beta"]),
            NOW,
        )


def without_field(session: Session, folder: Path) -> Session:
    shutil.copytree(session.path, folder)
    table = pq.read_table(folder / "imu_imu.parquet")
    pq.write_table(
        table.drop_columns([name for name in table.column_names if name.startswith("mag")]),
        folder / "imu_imu.parquet",
    )
    return Session(folder)


def reanalysed(session: Session, folder: Path) -> Session:
    """The same samples under another name, analysed in another way: another manifest."""
    shutil.copytree(session.path, folder)
    manifest = json.loads((folder / MANIFEST).read_text())
    manifest["analysis"]["estimate"]["align"] = "heading"
    (folder / MANIFEST).write_text(json.dumps(manifest))
    return Session(folder)


def test_one_recording_is_never_both_tuned_on_and_tested(turned, tmp_path):
    copied = Session(shutil.copytree(turned[0].path, tmp_path / "copied"))
    other = reanalysed(turned[0], tmp_path / "other")
    assert other.fingerprint != turned[0].fingerprint
    for same in (turned[0], copied, other):
        with pytest.raises(InputError, match="given for tuning and for the test"):
            find_parameters(
                Planted(), Sessions.given(turned[:2], [same]), SearchWanted("total_rmse_deg"), NOW
            )
        with pytest.raises(InputError, match="given twice"):
            find_parameters(
                Planted(),
                Sessions.given([turned[0], same], []),
                SearchWanted("total_rmse_deg"),
                NOW,
            )
        with pytest.raises(InputError, match="given twice"):
            find_parameters(
                Planted(),
                Sessions.given(turned[1:], [turned[0], same]),
                SearchWanted("total_rmse_deg"),
                NOW,
            )


def test_a_drawn_split_holds_whole_sessions_and_does_not_depend_on_their_order(turned):
    for seed in range(5):
        split = Sessions.drawn(turned, 0.4, seed)
        assert len(split.tuning) == 2
        assert len(split.test) == 1
        assert {s.name for s in split.tuning + split.test} == {s.name for s in turned}
        assert {s.name for s in Sessions.drawn(turned[::-1], 0.4, seed).test} == {
            s.name for s in split.test
        }
    assert len({Sessions.drawn(turned, 0.4, seed).test[0].name for seed in range(20)}) == 3
    for share in (0.0, 1.0, -0.2):
        with pytest.raises(InputError, match="cannot be divided"):
            Sessions.drawn(turned, share, 0)
    with pytest.raises(InputError, match="cannot be divided"):
        Sessions.drawn(turned[:1], 0.5, 0)


def test_a_tuning_is_kept_read_back_and_never_replaced(turned, tmp_path):
    found = find_parameters(
        Planted(),
        Sessions.drawn(turned, 0.4, 3),
        SearchWanted("total_rmse_deg", effort=Effort(values=3)),
        NOW,
    )
    file = tmp_path / "tuned.json"
    found.save(file)
    assert load_tunings([file]) == [found]
    assert found.split.seed == 3
    assert found.software["imu-testbench"]
    with pytest.raises(InputError, match="not replaced"):
        found.save(file)
    content = json.loads(file.read_text())
    content["parameters"]["gain"], content["schema_version"] = "big", 2
    file.write_text(json.dumps(content, indent=2))
    with pytest.raises(FileProblems) as refused:
        load_tunings([file])
    assert {problem.path.split(".")[0] for problem in refused.value.problems} == {
        "parameters",
        "schema_version",
    }
    with pytest.raises(FileProblems):
        load_tunings([tmp_path / "none.json"])


def test_an_estimate_says_what_was_tuned_and_marks_the_sessions_it_was_tuned_on(turned, tmp_path):
    found = find_parameters(
        Planted(),
        Sessions.given(turned[:2], turned[2:]),
        SearchWanted("total_rmse_deg", effort=Effort(values=3)),
        NOW,
    )
    again = reanalysed(turned[0], tmp_path / "again")
    for session, here in ((turned[0], True), (again, True), (turned[2], False)):
        estimated = estimate(session, [Planted()], tunings=[found])
        assert estimated.filter_parameters["planted"] == found.parameters
        assert estimated.tuned["planted"].on_this_session is here
        evaluation = evaluate(session, estimated)
        (row,) = evaluation.tuned
        assert row.on_this_session is here
        assert row.parameters == found.parameters
        assert any(
            "planted ran with gain" in note and "turned_0, turned_1" in note
            for note in evaluation.notes
        )
        assert any("tuned on this session" in note for note in evaluation.notes) is here
    with pytest.raises(InputError, match="not among those to run"):
        estimate(turned[0], ["gyro"], tunings=[found])
    with pytest.raises(InputError, match="two tunings"):
        estimate(turned[0], [Planted()], tunings=[found, found])


def test_a_filter_without_parameters_cannot_be_tuned(turned):
    with pytest.raises(InputError, match="no parameter"):
        find_parameters(
            get_filter("gyro"), Sessions.given(turned, []), SearchWanted("total_rmse_deg"), NOW
        )
    with pytest.raises(InputError, match="no session is left"):
        find_parameters(Planted(), Sessions.given([], turned), SearchWanted("total_rmse_deg"), NOW)
