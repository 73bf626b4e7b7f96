"""The swung shank: exact counts, small errors, and the yaw drift of the two Euler filters against
geometry.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from testbench.estimation.gait import PUBLISHED
from testbench.exceptions import InputError
from testbench.model import rotation
from testbench.records.specs.published import load_published_tables
from testbench.studies.pedestrian.study import pedestrian_study, swing_results

G = 9.80665


def euler_filter(gyr, acc, dt, improved: bool, gate=0.1, q_sd=1.56e-4, r_sd=0.0014):
    """Cabezuelo 2019 as its equations say: 4.4 to 4.6 or 4.7, 2.11 to 2.15, roll and pitch from a
    force of gravity's size.

    Right-handed axes with z up, so the sign of the force is that of what an accelerometer reads at
    rest.
    """
    x = np.array(
        [
            np.arctan2(acc[0, 1], acc[0, 2]),
            np.arctan2(-acc[0, 0], np.hypot(acc[0, 1], acc[0, 2])),
            0.0,
        ]
    )
    P = np.eye(3) * q_sd**2
    H = np.eye(3)[:2]
    angles = np.zeros((len(gyr), 3))
    angles[0] = x
    for i in range(1, len(gyr)):
        wx, wy, wz = gyr[i]
        s, c, t, sec = np.sin(x[0]), np.cos(x[0]), np.tan(x[1]), 1 / np.cos(x[1])
        A = np.eye(3)
        if improved:
            rate = np.array(
                [wx + wy * s * t + wz * c * t, wy * c - wz * s, (wy * s + wz * c) * sec]
            )
            A[0, :2] += dt * np.array([(wy * c - wz * s) * t, (wy * s + wz * c) * sec**2])
            A[1, 0] = -dt * (wy * s + wz * c)
            A[2, :2] = dt * np.array([(wy * c - wz * s) * sec, (wy * s + wz * c) * sec * t])
        else:
            rate = gyr[i]
        x = x + dt * rate
        P = A @ P @ A.T + q_sd**2 * np.eye(3)
        if abs(np.linalg.norm(acc[i]) - G) < gate:
            z = np.array(
                [
                    np.arctan2(acc[i, 1], acc[i, 2]),
                    np.arctan2(-acc[i, 0], np.hypot(acc[i, 1], acc[i, 2])),
                ]
            )
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.eye(2) * r_sd**2)
            x = x + K @ (z - x[:2])
            P = P - K @ (H @ P @ H.T + np.eye(2) * r_sd**2) @ K.T
        angles[i] = x
    return rotation.from_euler("ZYX", angles[:, ::-1])


@pytest.fixture(scope="module")
def swung(run_protocol):
    """A run of the shipped protocol, and its estimate with both Euler filters beside the others."""
    result = run_protocol("shank_swing", filters=["device", "vqf_6d"])
    samples, own = result.session.imu("shank"), result.estimate.sensors["shank"]
    gyr, acc, _ = own.calibration.apply(samples.gyr, samples.acc, None)
    dt = float(np.median(np.diff(samples.device_time_ns))) / 1e9
    begin = next(step for step in result.session.steps if step.section == "level")
    from_level = own.host_time_ns >= begin.settled_ns
    orientation = dict(own.orientation)
    for name, improved in (("euler_ekf_simple", False), ("euler_ekf", True)):
        q = np.full((len(gyr), 4), np.nan)
        q[from_level] = euler_filter(gyr[from_level], acc[from_level], dt, improved)
        orientation[name] = q
    with_both = replace(result.estimate, sensors={"shank": replace(own, orientation=orientation)})
    return result.session, with_both


def test_the_cycles_are_exactly_those_commanded_by_every_filter(swung):
    results = swing_results(*swung, PUBLISHED["universal"])
    assert {r.cycles for r in results} == {14, 109}
    assert {r.filter for r in results} == {"device", "vqf_6d", "euler_ekf_simple", "euler_ekf"}
    assert {(r.filter, r.cycles): r.cycle_error for r in results} == {
        (r.filter, r.cycles): 0 for r in results
    }


def test_the_true_motion_is_as_long_as_the_published_walks(swung):
    lengths = {
        r.cycles: r.true_walk.distance for r in swing_results(*swung, PUBLISHED["universal"])
    }
    assert lengths[14] == pytest.approx(17.5, rel=0.15)
    assert lengths[109] == pytest.approx(151.72, rel=0.02)


def test_the_simple_filter_loses_the_area_of_pitch_and_roll_and_the_improved_one_does_not(swung):
    results = {
        (r.filter, r.cycles, r.step.variables["roll_deg"]): np.degrees(r.drift.drift)
        for r in swing_results(*swung, PUBLISHED["universal"])
    }
    # pi A B a cycle at full amplitude; the two halves that fade in and out enclose a fifth of a
    # cycle less each
    area = np.degrees(np.pi * np.radians(20) * np.radians(3))
    assert abs(results["euler_ekf_simple", 14, 3]) == pytest.approx(13.4 * area, abs=3)
    assert 40 < abs(results["euler_ekf_simple", 14, 3]) < 50  # the size that was published
    assert abs(results["euler_ekf_simple", 109, 3]) == pytest.approx(
        108.4 * area, rel=0.05
    )  # more than half a turn
    assert abs(results["euler_ekf", 14, 3]) < 10  # as published
    assert abs(results["euler_ekf_simple", 14, 0]) < 2  # no roll, no drift but the gyroscope's
    assert abs(results["euler_ekf", 14, 0]) < 2


def test_the_drift_bends_the_path_and_leaves_its_length(swung):
    by = {
        (r.filter, r.cycles, r.step.variables["roll_deg"]): r
        for r in swing_results(*swung, PUBLISHED["universal"])
    }
    simple, improved = by["euler_ekf_simple", 14, 3], by["euler_ekf", 14, 3]
    assert simple.position_error > 5 * improved.position_error
    assert abs(simple.distance_error) < 0.05 * simple.true_walk.distance


def test_the_tables_hold_ours_beside_the_published(swung):
    study = pedestrian_study(*swung)
    cycles, drift = study.table("cycles"), study.table("drift")
    assert {row.values[2] for row in cycles.rows} == {0}
    rolling = {row.label: row.published for row in drift.rows if "14, roll_deg 3" in row.label}
    published = {label.rpartition(", ")[2]: values[:1] for label, values in rolling.items()}
    assert published == {"device": (), "vqf_6d": (), "euler_ekf_simple": (50,), "euler_ekf": (10,)}
    assert {row.published for row in drift.rows if "roll_deg 0" in row.label} == {()}
    simple = next(
        row for row in drift.rows if row.published[:1] == (50,) and "cycles 14" in row.label
    )
    assert simple.ratio(0) is None and "a walk" in simple.published_title
    # what was published of walks stands beside walks (test_walks), not beside swings
    assert [table.key for table in study.tables] == ["cycles", "drift"]
    assert ["gait_cycles 14, roll_deg 3" in figure.caption for figure in study.curves] == [
        True,
        True,
        False,
        False,
    ]
    assert [figure.plane for figure in study.curves] == [False, True, False, True]
    assert "gait_cycles 109, roll_deg 3" in study.curves[2].caption
    for figure, least in zip(
        study.curves[::2], (40, 340), strict=True
    ):  # beyond half a turn nothing wraps
        curves = {curve.name: curve for curve in figure.curves}
        assert set(curves) == {"device", "vqf_6d", "euler_ekf_simple", "euler_ekf"}
        assert all(len(curve.x) <= 800 for curve in figure.curves)
        assert abs(curves["euler_ekf_simple"].y[-1]) > least
        assert np.abs(np.diff(curves["euler_ekf_simple"].y)).max() < 10
    assert study.source == "Cabezuelo Gutiérrez, Universidad de Alcalá, 2019"


def test_a_session_without_swings_or_truth_is_refused(quick):
    session = quick.session
    still = SimpleNamespace(
        name="still",
        sensor_names=["arm"],
        truth=session.truth,
        steps=[step for step in session.steps if step.kind != "sweep"],
    )
    with pytest.raises(InputError, match="still has no sweep that is evaluated"):
        swing_results(still, quick.estimate, PUBLISHED["universal"])
    blind = SimpleNamespace(
        name="blind", sensor_names=["arm"], truth=lambda name: None, steps=session.steps
    )
    with pytest.raises(InputError, match="sensor 'arm' has no truth"):
        swing_results(blind, quick.estimate, PUBLISHED["universal"])


# What was published


def test_the_means_of_table_14_are_those_of_table_12_but_for_the_misprint():
    tables = load_published_tables("reference_4").tables
    for mean_row in tables["14"].rows:
        own = np.array(
            [
                row.values
                for row in tables["12"].rows
                if row.label.startswith(f"{mean_row.label}, ")
            ],
            dtype=float,
        )
        assert own.shape == (3, 4)
        _, cycles, distance, end = own.mean(axis=0)
        if mean_row.label != "NGIMU, chest":
            assert mean_row.values[0] == pytest.approx(cycles, abs=0.04)
        assert mean_row.values[2] == pytest.approx(distance, abs=0.11)
        assert mean_row.values[4] == pytest.approx(end, abs=0.02)
    assert all(row.values[1] == abs(109 - row.values[0]) for row in tables["12"].rows)
