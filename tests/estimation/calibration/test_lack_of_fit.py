"""What a model lacks is found in its residuals, and counts in the uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from testbench.estimation.calibration.attitude_aided import attitude_aided
from testbench.estimation.calibration.ellipsoid import ellipsoid
from testbench.estimation.calibration.examined import examined_gyroscope, examined_magnetometer
from testbench.estimation.calibration.force_scale import with_force_scale
from testbench.estimation.calibration.gyroscope_trend import bias_trend
from testbench.estimation.calibration.lack_of_fit import (
    LackOfFit,
    findings_of,
    lack_of_fit,
    trend_at,
    trend_of,
    widened,
)
from testbench.estimation.calibration.methods import METHODS
from testbench.estimation.calibration.norm_only import norm_only
from testbench.estimation.calibration.poses import StaticPoses
from testbench.estimation.calibration.turns import GyroscopeRecording, Rest
from testbench.model.statistics.added_terms import with_terms
from testbench.model.statistics.linear import widened_by_misfit
from testbench.records.findings.finding import Severity
from testbench.records.results.calibration import TriadCalibration
from testbench.records.results.evidence import Evidence
from testbench.records.results.fit import Fit
from tests.estimation.calibration.simulated import GRAVITY, UP, part, poses_of, turned

NOISE = 1e-3
SETTLING = 3e-4
COUNT = 24
MIDDLE = 6.0 * np.arange(COUNT)


def drawn(seed: int, **known: object) -> StaticPoses:
    """Poses of 4 s, one every 6 s, that lack nothing."""
    times = {"start": MIDDLE - 2, "end": MIDDLE + 2}
    draw = np.random.default_rng([7, seed])
    return poses_of(turned(UP, COUNT), *part(), NOISE, draw, **times, **known)


def lacking(poses: StaticPoses, method=attitude_aided) -> LackOfFit:
    lack = lack_of_fit(method(poses), poses, "accelerometer", SETTLING)
    assert lack is not None
    return lack


def test_a_term_is_what_least_squares_with_it_gives():
    rng = np.random.default_rng(1)
    design, observed = rng.standard_normal((30, 5)), rng.standard_normal(30)
    terms = rng.standard_normal((10, 3, 2))
    whole = np.hstack([design, terms.reshape(30, 2)])
    values, squares, *_ = np.linalg.lstsq(whole, observed, rcond=None)
    alone = np.linalg.lstsq(design, observed, rcond=None)[0]
    evidence = Evidence(design @ alone - observed, design, np.tile(np.eye(3), (10, 1, 1)))
    found = with_terms(evidence, terms)
    np.testing.assert_allclose(found.values, values[5:], rtol=1e-9)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(whole.T @ whole)[5:, 5:], rtol=1e-9)
    assert found.left.squares == pytest.approx(float(squares[0]))
    fallen = evidence.squares - float(squares[0])
    assert found.chance == pytest.approx(chi2.sf(fallen, 2))


def test_terms_that_the_parameters_imitate_are_not_asked_for():
    design = np.eye(30)[:, :6]
    evidence = Evidence(np.ones(30), design, np.tile(np.eye(3), (10, 1, 1)))
    assert with_terms(evidence, design[:, 2:4].reshape(10, 3, 2)) is None


@pytest.mark.parametrize("method", [attitude_aided, norm_only])
def test_nothing_is_said_of_a_part_that_lacks_nothing(method):
    told = [findings_of(lacking(drawn(seed), method), "accelerometer") for seed in range(40)]
    assert sum(bool(said) for said in told) <= 2


@pytest.mark.parametrize("method", [attitude_aided, norm_only])
@pytest.mark.parametrize("constant", [15.0, 60.0, np.inf])
def test_a_part_that_warms_up_is_told_by_its_trend(method, constant):
    poses = drawn(3)
    shape = MIDDLE / 140 if np.isinf(constant) else -np.expm1(-MIDDLE / constant)
    size = np.array([0.05, -0.03, 0.04])
    warm = replace(poses, mean=poses.mean + shape[:, None] * size)
    lack = lacking(warm, method)
    assert [own.term.kind for own in lack.terms] == ["trend"]
    assert not lack.unexplained
    own = trend_of(lack)
    drift = trend_at(own, MIDDLE, warm)
    np.testing.assert_allclose(drift, (shape - shape.mean())[:, None] * size, atol=8 * NOISE)
    (told,) = findings_of(lack, "accelerometer")
    assert told.code == "calibration.trend" and told.severity == Severity.WARNING
    known = replace(warm, temperature=20 + 10 * shape)  # a thermometer saw it
    assert not lacking(known, method).terms


@pytest.mark.parametrize(("power", "kind"), [(3, "cubic"), (2, "square")])
def test_a_response_that_is_no_straight_line_is_told_and_widens(power, kind):
    poses, size = drawn(4), 0.02
    bent = replace(poses, mean=poses.mean + size * (poses.expected / GRAVITY) ** power)
    lack = lacking(bent)
    assert [own.term.kind for own in lack.terms] == [kind]
    own = lack.terms[0]
    np.testing.assert_allclose(own.size, size, atol=4 * own.sd.max())
    plain = attitude_aided(bent)
    fit = widened(plain, lack, bent, attitude_aided).fits[0]
    truth = np.concatenate([part()[0].reshape(-1), part()[1]])
    assert np.abs((plain.fits[0].values - truth) / plain.fits[0].sd).max() > 4
    off = (fit.values - truth) / fit.sd
    assert np.abs(off).max() < 3
    together = (fit.values - truth) @ np.linalg.solve(fit.covariance, fit.values - truth)
    assert together < chi2.ppf(0.999, 12)


def test_errors_of_the_arm_that_all_poses_share_are_in_the_covariance_as_a_whole():
    rng = np.random.default_rng(5)
    forces, (response, bias) = turned(UP, COUNT), part()
    causes = np.cross(rng.standard_normal((COUNT, 4, 3)), forces[:, None, :]) * 2e-3
    truth, sums = np.concatenate([response.reshape(-1), bias]), []
    for seed in range(60):
        draw = np.random.default_rng([8, seed])
        real = forces + np.einsum("q,mqi->mi", draw.standard_normal(4), causes)
        poses = poses_of(real, response, bias, NOISE, draw)
        poses = replace(poses, expected=forces, shared=causes, direction_sd=1e-7)
        found = attitude_aided(poses)
        fit = found.fits[0]
        assert len(fit.names) == 12 and found.evidence.dof == 3 * COUNT - 12
        off = fit.values - truth
        sums.append(off @ np.linalg.solve(fit.covariance, off) / 12)
        blind = attitude_aided(replace(poses, shared=None))
        assert blind.evidence.squares > 5 * found.evidence.squares
    assert np.mean(sums) == pytest.approx(1.0, abs=0.2)


def test_what_nothing_explains_is_said_with_birges_ratio():
    poses = drawn(6)
    rough = replace(
        poses, mean=poses.mean + 5 * NOISE * np.random.default_rng(6).normal(size=(COUNT, 3))
    )
    lack = lacking(rough)
    (told,) = findings_of(lack, "accelerometer")
    assert told.code == "calibration.residuals"
    assert told.values["ratio"] == pytest.approx(5.1, rel=0.25)


def field(disturbed: float) -> StaticPoses:
    """A field in the sensor, and one pose after the other nearer to iron [uT]."""
    rng = np.random.default_rng(9)
    seen = turned(np.array([3.0, 22.0, -40.0]), COUNT)
    near = disturbed * rng.standard_normal((COUNT, 3))
    noise = 0.05 * rng.standard_normal((COUNT, 3))
    return StaticPoses(seen + near + noise, np.full((COUNT, 3), 0.05**2), float("nan"))


def test_a_field_that_is_not_one_refuses_a_magnetometer_that_nobody_asked_for():
    method = METHODS["ellipsoid"]
    found, said = examined_magnetometer(method, field(0.0), named=False)
    assert found is not None and not said
    found, said = examined_magnetometer(method, field(2.0), named=False)
    assert found is None and [own.code for own in said] == ["calibration.field_refused"]
    found, said = examined_magnetometer(method, field(2.0), named=True)
    assert [own.code for own in said] == ["calibration.field"]
    plain = ellipsoid(field(2.0))
    dof = plain.evidence.dof
    np.testing.assert_allclose(found.fits[0].sd, plain.fits[0].sd * np.sqrt(dof))


def test_gravity_and_the_sheets_nonlinearity_are_lines_of_the_scales():
    poses = drawn(2)
    plain = attitude_aided(poses)
    found, said = with_force_scale(plain, poses, attitude_aided, 0.015, None)
    codes = [own.code for own in said]
    assert codes == ["calibration.at_one_g", "calibration.gravity"]
    scale, more = (calibration.fits[0].covariance[0, 0] for calibration in (plain, found))
    response = plain.fits[0]["response_xx"]
    assert more - scale == pytest.approx((response * 0.015 / GRAVITY) ** 2, rel=0.01)
    np.testing.assert_allclose(found.fits[0].values, plain.fits[0].values)
    bent, said = with_force_scale(plain, poses, attitude_aided, 0.0, 1e-3)
    assert [own.code for own in said] == ["calibration.sheet", "calibration.gravity_simulated"]
    assert bent.fits[0].sd[0] > 3e-4 > 2 * plain.fits[0].sd[0]


def test_a_gyroscope_that_drifts_at_its_rests_has_a_trend():
    rng, force = np.random.default_rng(3), turned(UP, 12)
    times = [12.0 * i + np.arange(100) / 50 for i in range(12)]
    bias, noise = np.radians([0.2, -0.1, 0.3]), np.radians(0.05)

    def recording(drift_deg_s: float) -> GyroscopeRecording:
        return GyroscopeRecording(
            [
                Rest(
                    bias
                    - np.radians(drift_deg_s) * np.exp(-t / 40)[:, None]
                    + noise * rng.standard_normal((100, 3)),
                    f,
                    time=t,
                )
                for t, f in zip(times, force, strict=True)
            ]
        )

    assert bias_trend(recording(0.0)) is None
    found = bias_trend(recording(0.2))
    change = found.at(np.array([0.0, 100.0]))
    expected = 0.2 * (1 - np.exp(-100 / 40))
    np.testing.assert_allclose(np.degrees(change[1] - change[0]), expected, atol=0.03)
    assert found.told().code == "calibration.gyroscope_trend"


def test_residuals_of_a_gyroscope_that_known_errors_explain_are_not_remarked():
    rng = np.random.default_rng(2)
    zero, unit = rng.standard_normal(200), "standard deviations"
    fit = Fit(("a",), ("1",), np.ones(1), np.eye(1), residuals=2 * zero, residual_unit=unit)
    bare = widened_by_misfit(fit)
    assert bare.covariance[0, 0] == pytest.approx(4, rel=0.2)
    with_zero = replace(bare, covariance=bare.covariance + 0.5)
    found = TriadCalibration("attitude", fits=(with_zero,))
    same, (said,) = examined_gyroscope(found, bare, [])
    assert said.values["ratio"] == pytest.approx(2, rel=0.15)
    np.testing.assert_allclose(same.fits[0].covariance, with_zero.covariance)
    explained, said = examined_gyroscope(found, bare, [zero])
    assert not said
    np.testing.assert_allclose(explained.fits[0].covariance, [[1.5]])
    assert np.isinf(explained.fits[0].dof)
