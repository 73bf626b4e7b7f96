"""The study beta_zeta: its identity, its published figures, and that a bias state gains what it
says.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.clock import SystemClock
from testbench.estimation import estimate
from testbench.estimation.filters import UniformSamples, get_filter
from testbench.evaluation import evaluate
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.records.specs.published import load_published_tables
from testbench.studies import get_study
from testbench.studies.bench import StudyBench
from testbench.studies.beta_zeta.study import (
    BETAS,
    MARG,
    PRINTED,
    STATE_ZETAS,
    Part,
    angle_of,
    step_difference,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> StudyRecord:
    return get_study("beta_zeta").run(
        StudyBench(tmp_path_factory.mktemp("logs"), SystemClock(), seed=0, parts=2)
    )


def test_published_gains_are_those_of_the_source():
    rows = {
        row.label: row.values for row in load_published_tables("reference_2").tables["gains"].rows
    }
    assert rows == {
        "noise": [0.35, 0.07, None],
        "sweep 1": [0.34, 0.01, 0.11546],
        "sweep 2": [0.33, 0.05, 0.11535],
    }


def test_one_step_as_printed_is_one_step_with_a_larger_beta():
    assert step_difference(10_000, 1 / 60) < 1e-14
    rng = np.random.default_rng(1)  # and so it is in the filter, whatever the samples
    n = 200
    samples = UniformSamples(
        1 / 60, rng.normal(0, 1, (n, 3)), rng.normal(0, 5, (n, 3)), rng.normal(0, 30, (n, 3))
    )
    printed, alone = (
        get_filter(PRINTED, {"beta": 0.2, "zeta": 0.6}),
        get_filter(MARG, {"beta": 0.21}),
    )
    np.testing.assert_allclose(printed.run(samples), alone.run(samples), rtol=0, atol=1e-10)
    with_state = get_filter(MARG, {"beta": 0.2, "zeta": 0.6}).run(samples)
    assert (
        np.abs(with_state - alone.run(samples)).max() > 0.1
    )  # a true bias state is something else


def test_the_identity_holds_in_every_state_of_the_session(study):
    rows = study.table("identity").rows
    assert rows[0].values[3] < 1e-14
    steps = [row for row in rows if row.label.startswith("one step")]
    assert len(steps) == 3
    for row in steps:
        beta, zeta, together, largest = row.values
        assert together == pytest.approx(beta + zeta / 60, rel=1e-4)
        assert largest < 1e-12
    for whole, control in zip(
        rows[4::2], rows[5::2], strict=True
    ):  # left alone they part no farther than rounding parts one
        assert whole.values[3] < max(3 * control.values[3], 1e-9)


def test_a_length_of_a_difference_is_an_angle():
    for degrees in (0.3, 13.2, 120.0):
        a = Rotation.random(rng=np.random.default_rng(3))
        b = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])) * a
        p, q = a.as_quat(), b.as_quat()
        assert angle_of(min(np.linalg.norm(p - q), np.linalg.norm(p + q))) == pytest.approx(
            degrees, rel=1e-9
        )
    assert angle_of(0.1154) == pytest.approx(13.2, abs=0.05)


def test_zeta_hardly_moves_the_difference_to_the_device_and_the_published_ones_stand_beside(study):
    rows = {row.label: row for row in study.table("difference").rows}
    assert rows["sweep 2, best"].published[:3] == (0.33, 0.05, 0.11535)
    assert rows["sweep 1, best"].published[:3] == (0.34, 0.01, 0.11546)
    assert rows["sweep 2, best"].values[4] < 0.01 * rows["sweep 2, best"].values[2]
    session = Session(study.sessions[0])
    part = Part.of(session)
    kind = get_filter(PRINTED)
    assert kind.parameters["beta"] == 0.35
    ours, device = (
        Rotation.from_quat(k.run(part.samples)[part.moving]) for k in (kind, get_filter("device"))
    )
    mean = np.mean(2 * np.sin((ours * device.inv()).magnitude() / 4))
    assert rows["gains by noise"].values[2] == pytest.approx(mean, rel=1e-9)


def test_the_maps_are_what_evaluate_states(study):
    session = Session(study.sessions[0])
    for name, key, column, zeta in (
        (MARG, "state", STATE_ZETAS.index(1e-3), 1e-3),
        (PRINTED, "printed", 2, 0.07),
    ):
        i = BETAS.index(0.1)
        evaluated = evaluate(
            session, estimate(session, [get_filter(name, {"beta": 0.1, "zeta": zeta})])
        )
        assert study.table(key).rows[i].values[column] == pytest.approx(
            evaluated.orientation[0].total_rmse_deg, rel=1e-9
        )


def test_a_bias_state_gains_and_the_printed_zeta_does_not(study):
    gains = {row.label: row.values for row in study.table("gains").rows}
    held_out = {label: values[-1] for label, values in gains.items()}
    assert held_out["zeta as printed"] == pytest.approx(held_out["beta alone"], rel=0.05)
    assert held_out["with a bias state"] < 0.6 * held_out["beta alone"]
    assert (
        held_out["with a bias state, without magnetometer"]
        < 0.6 * held_out["beta alone, without magnetometer"]
    )
    for row in study.table("bias").rows:
        at_rest, printed, marg, imu = row.values
        assert printed == 0
        assert marg == pytest.approx(
            at_rest, abs=0.25
        )  # the response to gravity, 0.1 deg/s/g, turns with the pose
        assert imu == pytest.approx(at_rest, abs=0.25)


def test_the_study_is_kept_and_read_back(study, tmp_path):
    study.save(tmp_path)
    assert StudyRecord.load(tmp_path) == replace(study, settings=dict(study.settings))
    assert len(study.findings) == 3
    assert "13.2 deg" in study.findings[1]
    assert "not tuned on" in study.findings[2]
