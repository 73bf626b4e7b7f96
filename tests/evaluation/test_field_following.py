"""How much of the field's heading a filter follows: series of known shares, and filters with and
without the disturbance.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import t

from testbench.evaluation.field_following import GYROSCOPE_DEG, following, following_rows
from testbench.evaluation.magnetic import FieldDeviation
from testbench.evaluation.metrics import OrientationErrors
from testbench.evaluation.orientation import SensorErrors
from testbench.records.results.estimate import SensorEstimate
from testbench.records.results.evaluation import Evaluation

RATE_HZ = 10.0


def smooth(seconds: float, memory_s: float, rng: np.random.Generator) -> np.ndarray:
    """A stationary AR(1) process of unit variance."""
    keep = np.exp(-1 / (RATE_HZ * memory_s))
    before = round(10 * memory_s * RATE_HZ)
    noise = rng.standard_normal(round(seconds * RATE_HZ) + before)
    return lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], noise)[before:]


def times(n: int) -> np.ndarray:
    return (1_000_000_000 + np.arange(n) * 1e9 / RATE_HZ).astype(np.int64)


def drifting(field: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Heading error of a filter that follows so much of the field, and drifts: steadily, at random,
    and with noise.
    """
    n = len(field)
    steady = np.radians(0.5) / 60 * np.arange(n) / RATE_HZ
    walk = np.cumsum(rng.standard_normal(n)) * np.radians(0.3) / np.sqrt(60 * RATE_HZ)
    around = np.radians(0.3) * smooth(n / RATE_HZ, 3.0, rng) + np.radians(
        0.2
    ) * rng.standard_normal(n)
    return -share * field + steady + walk + around


@settings(max_examples=40)
@given(st.floats(-1, 2), st.floats(0.05, 3), st.floats(-3, 3), st.floats(-3, 3), st.integers(0, 99))
def test_a_share_without_noise_is_found_whatever_the_offset_and_the_size_of_the_field(
    share, size, offset, other, seed
):
    """A constant, and turns of a whole circle on the way, change nothing."""
    field = np.radians(5 * size) * smooth(200, 6.0, np.random.default_rng(seed))
    wrapped = (np.array([field + offset, other - share * field]) + np.pi) % (2 * np.pi) - np.pi
    found = following(times(len(field)), *wrapped)
    assert found.share == pytest.approx(share, abs=1e-6)
    assert found.error == pytest.approx(0, abs=1e-6)


def test_a_compass_turns_against_the_field_and_a_steady_drift_follows_nothing():
    time = np.arange(3000) / RATE_HZ
    field = 0.1 * np.sin(2 * np.pi * time / 7)
    assert following(times(3000), field, -field).share == pytest.approx(1)
    assert following(times(3000), field + 1e-3 * time, -1e-2 * time).share == pytest.approx(
        0, abs=1e-9
    )


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_the_interval_covers_the_share_although_the_filter_drifts(share):
    inside, found, stated = 0, [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        field = np.radians(2) * smooth(400, 8.0, rng)
        seen = following(times(len(field)), field, drifting(field, share, rng))
        inside += abs(seen.share - share) < t.ppf(0.975, seen.blocks - 1) * seen.error
        found.append(seen.share)
        stated.append(seen.error)
    assert inside > 90
    assert np.std(found) == pytest.approx(np.mean(stated), rel=0.15)
    assert np.mean(found) == pytest.approx(share, abs=0.01)


def test_levels_against_levels_would_have_followed_a_field_that_the_filter_does_not_see():
    """Two slow series resemble each other by chance: why changes are looked at, and not levels."""
    plain, found = [], []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        field = np.radians(1) * smooth(600, 200.0, rng) + np.radians(1) * smooth(600, 5.0, rng)
        error = np.radians(3) * smooth(600, 200.0, rng)
        plain.append(-np.polyfit(field, error, 1)[0])
        found.append(following(times(len(field)), field, error).share)
    assert np.std(plain) > 5 * np.std(found)


def judged_by(
    field: np.ndarray, errors: dict[str, np.ndarray]
) -> tuple[SensorErrors, FieldDeviation]:
    """A sensor of which only the headings matter."""
    n = len(field)
    estimate = SensorEstimate(
        host_time_ns=times(n),
        static=np.ones(n, bool),
        orientation={},
        flagged=np.zeros(n, bool),
    )
    split = {key: OrientationErrors(np.abs(e), e, np.zeros(n)) for key, e in errors.items()}
    sensor = SensorErrors(
        "hand", estimate, np.tile([1.0, 0, 0, 0], (n, 1)), np.ones(n, bool), None, split
    )
    return sensor, FieldDeviation(45.0, 1.0, np.zeros(n), np.zeros(n), field)


def test_rows_say_nothing_where_the_field_hardly_changes_or_too_short():
    rng = np.random.default_rng(1)
    field = np.radians(3) * smooth(600, 6.0, rng)
    errors = {"compass": -field, "half": drifting(field, 0.5, rng)}
    compass, half = following_rows(*judged_by(field, errors))
    assert compass.followed == pytest.approx(1)
    gyroscope = GYROSCOPE_DEG / compass.field_change_deg
    assert compass.followed_ci95 == pytest.approx([1 - gyroscope, 1 + gyroscope], abs=1e-6)
    assert half.followed_ci95 is not None and half.followed_ci95[0] < 0.5 < half.followed_ci95[1]
    assert half.n == pytest.approx(1200, abs=1) and half.field_change_deg == pytest.approx(
        3, rel=0.2
    )
    still = following_rows(*judged_by(field / 30, errors))
    short = following_rows(*judged_by(field[:1700], {key: e[:1700] for key, e in errors.items()}))
    for row in still + short:
        assert (row.followed, row.followed_ci95) == (None, None)
    assert following_rows(*judged_by(np.full(len(field), np.nan), errors)) == []


def reduced(name: str, disturbed: bool) -> Any:
    """A change to a shipped elbow protocol: few poses or sweeps, four filters, with the arm's
    magnetism or without.
    """
    variables = {
        "elbow_flexion": {"misalignment_deg": [-20, 20], "flexion_deg": [0, 35, 70]},
        "elbow_dynamic": {"amplitude_deg": [30], "frequency_hz": [0.2, 0.5]},
    }

    def change(content: dict[str, Any]) -> None:
        content["variables"] = variables[name]
        content["environment"] = {"arm_magnetism": disturbed}
        content["sections"] = [
            section for section in content["sections"] if section["name"] != "calibration_2d"
        ]
        content["estimate"]["filters"] = ["ecompass", "triad", "vqf_6d", "vqf_9d"]
        content["estimate"].pop("filter_parameters", None)
        content.pop("accept", None)
        content["joints"]["elbow"].pop("compare", None)
        content["joints"]["elbow"].pop("published", None)

    return change


@pytest.fixture(scope="module", params=["elbow_dynamic"])
def pair(request, altered_protocol, run_protocol) -> tuple[Evaluation, Evaluation]:
    """The same protocol and seed with the arm's magnetic disturbance and without it: the noise is
    the same.
    """
    found = [
        run_protocol(altered_protocol(request.param, reduced(request.param, on)), seed=0)
        for on in (True, False)
    ]
    return found[0].evaluation, found[1].evaluation


def joint_total(evaluation: Evaluation, key: str) -> float:
    series = evaluation.series["joint_elbow"]
    return float(
        np.degrees(np.sqrt(np.mean(np.square(series[f"{key}_total_error_rad"][series["judged"]]))))
    )


def test_the_arms_disturbance_costs_compasses_their_heading_and_vqf_no_inclination(pair):
    disturbed, clean = pair
    for key in ("ecompass", "triad"):
        assert joint_total(disturbed, key) > 1.4 * joint_total(clean, key)
    with_it, without = disturbed.series["joint_elbow"], clean.series["joint_elbow"]
    for column in ("vqf_6d_total_error_rad", "vqf_6d_ZXZ_error_rad"):
        np.testing.assert_allclose(with_it[column], without[column], rtol=0, atol=1e-9)
    judged = with_it["judged"]
    flexion = [series["vqf_9d_ZXZ_error_rad"][judged] for series in (with_it, without)]
    assert (
        np.degrees(np.abs(flexion[0] - flexion[1])).max() < 0.002
    )  # a heading tells on it where the arm is not level
    for sensor in ("arm", "forearm"):
        with_it, without = (
            disturbed.series[f"orientation_{sensor}"],
            clean.series[f"orientation_{sensor}"],
        )
        for column in ("vqf_6d_heading_rad", "vqf_6d_inclination_rad"):
            np.testing.assert_allclose(with_it[column], without[column], rtol=0, atol=1e-9)
        # of quaternions turned by another heading: equal but for rounding
        column = "vqf_9d_inclination_rad"
        np.testing.assert_allclose(with_it[column], without[column], rtol=0, atol=1e-6)
        assert not np.allclose(
            with_it["vqf_9d_heading_rad"], without["vqf_9d_heading_rad"], atol=1e-5
        )


def followed_of_the_difference(pair: tuple[Evaluation, Evaluation], sensor: str, key: str) -> float:
    """How much of what the disturbance did to the field's heading it did to a filter's."""
    fields = [evaluation.series[f"magnetic_{sensor}"] for evaluation in pair]
    errors = [
        evaluation.series[f"orientation_{sensor}"][f"{key}_heading_rad"] for evaluation in pair
    ]
    judged = fields[0]["judged"] & fields[1]["judged"]
    field, error = (
        values[0][judged].astype(float) - values[1][judged]
        for values in ([f["heading_rad"] for f in fields], errors)
    )
    return following(fields[0]["host_time_ns"][judged], field, error).share


def test_compasses_follow_the_disturbance_wholly_and_vqf_without_a_magnetometer_not_at_all(pair):
    """The difference of the two runs is what the disturbance did, and nothing else."""
    for sensor in ("arm", "forearm"):
        followed = {
            key: followed_of_the_difference(pair, sensor, key)
            for key in ("ecompass", "triad", "vqf_6d", "vqf_9d")
        }
        assert followed["ecompass"] == pytest.approx(1, abs=0.1)
        assert followed["triad"] == pytest.approx(followed["ecompass"], abs=1e-6)
        assert followed["vqf_6d"] == pytest.approx(0, abs=1e-9)
        assert -0.5 < followed["vqf_9d"] < 0.8


def test_what_a_run_says_of_its_filters_is_kept_and_holds_what_is_known_of_them(pair, tmp_path):
    disturbed, _ = pair
    rows = {(row.sensor, row.filter): row for row in disturbed.magnetic_following}
    assert {key for _, key in rows} == {"ecompass", "triad", "vqf_6d", "vqf_9d"}
    disturbed.save(tmp_path)
    assert Evaluation.load(tmp_path).magnetic_following == disturbed.magnetic_following
