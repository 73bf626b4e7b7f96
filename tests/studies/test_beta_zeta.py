"""The study beta_zeta: its identity, its published figures, what walking does, and that no verdict
is wider than its spread.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.clock import SystemClock
from testbench.estimation.filters import UniformSamples, get_filter
from testbench.records.results.study import StudyRecord
from testbench.records.session.session import Session
from testbench.records.specs.published import load_published_tables
from testbench.studies import get_study
from testbench.studies.beta_zeta.gains import MARG, TEXT, UPSTREAM
from testbench.studies.beta_zeta.study import angle_of, step_difference
from testbench.studies.beta_zeta.takes import takes_of
from tests.studies.hostile import complaints, missing
from tests.studies.shorter import ShortBench

pytestmark = pytest.mark.slow

FIGURES = [
    f"{what}, {sensor}, {motion}"
    for sensor, motion in (
        ("thigh", "walking"),
        ("foot", "walking"),
        ("thigh", "sitting"),
        ("thigh", "standing"),
    )
    for what in ("Quaternions", "Difference of the quaternions")
] + [
    f"{what}, thigh, {motion}"
    for motion in ("walking", "sitting")
    for what in ("Euler angles", "Difference of the Euler angles")
]
FIGURES += ["qw by several gains", "Jumps of the yaw", "Total error of the first part"]
"""Figures 26, 27, 30 to 44 of the source, and the errors that it could not have."""


@pytest.fixture(scope="module")
def study(altered_protocol, tmp_path_factory) -> StudyRecord:
    """Ten strides of twenty, one sitting down of three."""

    def shorter(spec):
        spec["variables"] |= {"strides": 10, "again": [1]}

    files = {"beta_zeta": altered_protocol("beta_zeta", shorter)}
    logs = tmp_path_factory.mktemp("logs")
    return get_study("beta_zeta").run(ShortBench(logs, SystemClock(), parts=2, shorter=files))


def test_published_gains_are_those_of_the_source():
    rows = {
        row.label: row.values for row in load_published_tables("reference_2").tables["gains"].rows
    }
    assert rows == {
        "noise": [0.35, 0.07, None],
        "sweep 1": [0.34, 0.01, 0.11546],
        "sweep 2": [0.33, 0.05, 0.11535],
    }


def test_one_step_of_the_upstream_form_is_one_step_with_a_larger_beta():
    assert step_difference(10_000, 1 / 60) < 1e-14
    rng = np.random.default_rng(1)  # and so it is in the filter, whatever the samples
    n = 200
    samples = UniformSamples(
        1 / 60, rng.normal(0, 1, (n, 3)), rng.normal(0, 5, (n, 3)), rng.normal(0, 30, (n, 3))
    )
    upstream, alone = (
        get_filter(UPSTREAM, {"beta": 0.2, "zeta": 0.6}),
        get_filter(MARG, {"beta": 0.21}),
    )
    np.testing.assert_allclose(upstream.run(samples), alone.run(samples), rtol=0, atol=1e-10)
    for name in (MARG, TEXT):  # a true bias state, and the text's form, are something else
        other = get_filter(name, {"beta": 0.2, "zeta": 0.6}).run(samples)
        assert np.abs(other - alone.run(samples)).max() > 1e-3


def test_the_identity_holds_in_every_state_of_a_take(study):
    rows = study.table("identity").rows
    assert rows[0].values[3] < 1e-14
    by = {(row.printed, row.values[:2]): row.values for row in rows[1:]}
    assert len(by) == 6
    for (printed, (beta, zeta)), (_, _, together, largest) in by.items():
        assert largest < (1e-12 if printed == "upstream code" else 1e-8)
        if printed == "upstream code":
            assert together == pytest.approx(beta + zeta / 60, rel=1e-4)
        else:  # the gradient is small
            assert beta < together < beta + 0.5 * zeta / 60


def test_a_length_of_a_difference_is_an_angle():
    for degrees in (0.3, 13.2, 120.0):
        a = Rotation.random(rng=np.random.default_rng(3))
        b = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])) * a
        p, q = a.as_quat(), b.as_quat()
        assert angle_of(min(np.linalg.norm(p - q), np.linalg.norm(p + q))) == pytest.approx(
            degrees, rel=1e-9
        )
    assert angle_of(0.1154) == pytest.approx(13.2, abs=0.05)


def test_a_leg_that_walks_feels_metres_a_second_squared_and_standing_does_not(study):
    force = {row.label: row.values[0] for row in study.table("errors").rows}
    assert 1 < force["thigh, walking"] < 5 and 2 < force["foot, walking"] < 8
    assert force["thigh, standing"] < 0.3


def test_the_difference_to_the_device_is_that_of_two_rotations(study):
    take = next(
        take
        for take in takes_of([Session(study.sessions[0])])
        if (take.sensor, take.motion) == ("foot", "walking")
    )
    kind = get_filter(UPSTREAM, {"beta": 0.35, "zeta": 0.07})
    ours, device = (Rotation.from_quat(q, scalar_first=True) for q in (take.run(kind), take.device))
    mean = np.mean(2 * np.sin((ours * device.inv()).magnitude() / 4))
    assert take.difference(kind) == pytest.approx(mean, rel=1e-6)
    rows = {row.label: row for row in study.table("difference").rows}
    ours_of_all = rows["foot, walking, gains by noise"]
    assert ours_of_all.values[2] == pytest.approx(mean, rel=0.5)
    assert rows["sweep 2"].published[2] == 0.11535 and rows["sweep 2"].published_alone
    assert rows["foot, walking, sweep 2, best"].values[4] < 0.02 * ours_of_all.values[2]


def test_errors_of_a_take_are_angles_between_filter_and_truth(study):
    session = Session(study.sessions[0])
    take = next(t for t in takes_of([session]) if (t.sensor, t.motion) == ("thigh", "walking"))
    kind = get_filter(MARG, {"beta": 0.1})
    known = np.isfinite(take.q_true).all(axis=1)
    ours, true = (
        Rotation.from_quat(q[known], scalar_first=True) for q in (take.run(kind), take.q_true)
    )
    angle = np.degrees((ours * true.inv()).magnitude())
    assert take.error(kind) == pytest.approx(np.sqrt(np.mean(angle**2)), rel=1e-6)


def test_gains_are_held_out_over_motions(study):
    table = study.table("gains")
    assert table.columns[4:] == (
        "by the other motions' gains [deg]",
        "walking [deg]",
        "standing [deg]",
        "sitting [deg]",
    )
    for row in table.rows:
        tuned, held = row.values[3:5]
        assert held >= tuned - 1e-9, row.label
        assert row.spread[3] is not None
    by = {row.label: row.values for row in table.rows}
    assert by["zeta of the upstream code"][3] == pytest.approx(by["beta alone"][3], rel=0.03)
    bias = study.table("bias")
    assert {row.values[1] for row in bias.rows} == {0}


def test_every_filter_is_timed(study):
    times = {row.label: row.values for row in study.table("time").rows}
    assert {"madgwick_marg", "ekf", "mekf", "vqf_9d", "device"} <= set(times)
    for median, least, most in times.values():
        assert 0 < least <= median <= most


def test_a_critical_reader_finds_nothing(study, tmp_path):
    assert complaints(study, ("identity", "bias", "time")) == []
    assert missing(study, FIGURES) == []
    study.save(tmp_path)
    assert StudyRecord.load(tmp_path).to_dict() == study.to_dict()
    text, upstream = (study.table("identity").rows[i].values[2] for i in (1, 2))
    assert 0.35 < text < upstream == pytest.approx(0.35 + 0.07 / 60, rel=1e-4)
    assert f"{text:.5f}" in study.findings[0] and "0.35117" in study.findings[0]
