"""Errors of orientations and their summaries: known errors give their numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from testbench.evaluation.metrics import correlation, orientation_errors, rms, summarise
from testbench.evaluation.orientation import judged_rows, sensor_errors, sensor_rows, truth_at
from testbench.model import rotation
from testbench.records.results.estimate import SensorEstimate
from testbench.records.session.samples import Truth

N = 500


def true_orientations(n: int = N) -> np.ndarray:
    return rotation.from_rotation_vector(
        np.cumsum(np.random.default_rng(0).normal(0, 0.02, (n, 3)), axis=0)
    )


def truth(n: int = N) -> Truth:
    return Truth(np.arange(n) * 8_000_000, true_orientations(n))


def estimate(q: np.ndarray) -> SensorEstimate:
    time = np.arange(len(q)) * 8_000_000
    return SensorEstimate(
        host_time_ns=time,
        static=np.ones(len(q), bool),
        orientation={"vqf_6d": q},
        flagged=np.zeros(len(q), bool),
    )


def evaluate_sensor(estimated: SensorEstimate, true: Truth):
    """Rows and error signals of a sensor."""
    found = sensor_errors("hand", estimated, true, None)
    return sensor_rows(found), found.series()


@pytest.mark.parametrize(
    ("error_deg", "total", "heading", "inclination"),
    [
        ((0, 0, 3), 3, 3, 0),
        ((0, 0, -3), 3, -3, 0),
        ((2, 0, 0), 2, 0, 2),
        ((0, -1.5, 0), 1.5, 0, 1.5),
        ((0, 0, 179), 179, 179, 0),
    ],
)
def test_an_error_about_one_axis_of_the_world_is_split_into_heading_and_inclination(
    error_deg, total, heading, inclination
):
    true = true_orientations()
    errors = orientation_errors(
        rotation.multiply(rotation.from_rotation_vector(np.radians(error_deg)), true), true
    )
    np.testing.assert_allclose(np.degrees(errors.total), total, atol=1e-9)
    np.testing.assert_allclose(np.degrees(errors.heading), heading, atol=1e-9)
    np.testing.assert_allclose(np.degrees(errors.inclination), inclination, atol=1e-9)


def test_an_error_of_both_kinds_is_told_apart():
    true = true_orientations()
    heading, tilt = (
        rotation.from_heading(np.radians(10)),
        rotation.from_rotation_vector(np.radians([3, 4, 0])),
    )
    errors = orientation_errors(rotation.multiply(rotation.multiply(heading, tilt), true), true)
    np.testing.assert_allclose(np.degrees(errors.heading), 10, atol=1e-9)
    np.testing.assert_allclose(np.degrees(errors.inclination), 5, atol=1e-9)


def test_the_rows_of_a_sensor_hold_root_mean_squares_in_degrees():
    size = np.radians(np.where(np.arange(N) % 2, 4.0, 2.0))
    vectors = np.column_stack([0 * size, 0 * size, size])
    q = rotation.multiply(rotation.from_rotation_vector(vectors), true_orientations())
    (row,), series = evaluate_sensor(estimate(q), truth())
    assert (row.sensor, row.filter, row.n) == ("hand", "vqf_6d", N)
    assert row.total_rmse_deg == pytest.approx(np.sqrt(10), abs=1e-9)
    assert row.heading_rmse_deg == pytest.approx(np.sqrt(10), abs=1e-9)
    assert row.inclination_rmse_deg == pytest.approx(0, abs=1e-6)
    assert row.total_max_deg == pytest.approx(4, abs=1e-9)
    np.testing.assert_allclose(series["vqf_6d_heading_rad"], size, atol=1e-9)


def test_only_what_the_recording_marks_is_judged():
    marks = np.arange(N) < 100
    q = rotation.multiply(rotation.from_heading(np.where(marks, 0.01, 1.0)), true_orientations())
    marked = Truth(truth().host_time_ns, truth().q_world_from_sensor, judged=marks)
    (row,), _ = evaluate_sensor(estimate(q), marked)
    assert row.n == 100
    assert row.total_rmse_deg == pytest.approx(np.degrees(0.01), rel=1e-9)
    np.testing.assert_array_equal(
        judged_rows(None, marked, marked.host_time_ns, np.ones(N, bool)), marks
    )


def test_where_nobody_knows_the_truth_nothing_is_judged():
    lost = true_orientations()
    lost[200:300] = np.nan
    times = truth().host_time_ns
    q = rotation.multiply(rotation.from_heading(0.02), true_orientations())
    q[200:300] = rotation.from_rotation_vector(
        np.array([2.0, 0, 0])
    )  # nonsense where it cannot be seen
    (row,), series = evaluate_sensor(estimate(q), Truth(times, lost))
    assert 395 <= row.n <= 400
    assert row.total_max_deg == pytest.approx(np.degrees(0.02), rel=1e-6)
    assert np.isnan(series["vqf_6d_total_rad"][210:290]).all()


def test_the_truth_is_interpolated_over_a_breath_and_never_beyond_its_ends():
    q = true_orientations()
    q[100:110] = np.nan  # 80 ms
    known = truth_at(
        Truth(truth().host_time_ns, q),
        np.array([-1, 0, 105 * 8_000_000, 499 * 8_000_000, 500 * 8_000_000]),
    )
    np.testing.assert_array_equal(np.isfinite(known[:, 0]), [False, True, True, True, False])


def test_without_any_truth_there_is_no_row():
    nothing = Truth(truth().host_time_ns, np.full((N, 4), np.nan))
    rows, _ = evaluate_sensor(estimate(true_orientations()), nothing)
    assert rows == []


def test_a_summary_of_errors_has_the_textbook_numbers():
    summary = summarise(np.array([1.0, -1.0, 3.0, 1.0]))
    assert (summary.n, summary.mean, summary.mean_abs, summary.max_abs) == (4, 1.0, 1.5, 3.0)
    assert summary.sd == pytest.approx(np.std([1, -1, 3, 1], ddof=1))
    assert summary.rmse == pytest.approx(np.sqrt(3))
    assert rms(np.array([3.0, 4.0])) == pytest.approx(np.sqrt(12.5))


def test_one_error_has_no_spread():
    summary = summarise(np.array([-2.0]))
    assert (summary.mean, summary.mean_abs, summary.sd, summary.rmse) == (-2.0, 2.0, 0.0, 2.0)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50))
def test_a_summary_is_what_numpy_says(values):
    as_numpy_says(np.array(values))


@pytest.mark.parametrize("size", [1999, 2000, 2001, 2003])
def test_a_summary_of_many_errors_is_what_numpy_says(size):
    as_numpy_says(np.random.default_rng(size).standard_normal(size))


def as_numpy_says(errors):
    found = summarise(errors)
    low, middle, high = np.quantile(errors, [0.25, 0.5, 0.75])
    wanted = {
        "mean": errors.mean(),
        "mean_abs": np.abs(errors).mean(),
        "rmse": np.sqrt(np.mean(errors**2)),
        "median": middle,
        "iqr": high - low,
        "p95_abs": np.quantile(np.abs(errors), 0.95),
        "max_abs": np.abs(errors).max(),
        "sd": errors.std(ddof=1) if len(errors) > 1 else 0.0,
    }
    for name, value in wanted.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-9, abs=1e-9), name


def test_a_correlation_is_pearsons_and_none_where_the_truth_rests():
    rng = np.random.default_rng(0)
    true = rng.normal(0, 0.3, 400)
    estimated = 0.8 * true + rng.normal(0, 0.1, 400)
    assert correlation(estimated, true) == pytest.approx(np.corrcoef(estimated, true)[0, 1])
    assert correlation(true, true) == pytest.approx(1)
    assert correlation(estimated, np.full(400, 0.3)) is None
