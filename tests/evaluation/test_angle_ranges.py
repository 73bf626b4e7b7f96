"""Euler angles of a recording: their sequence, their turns, and where they are not defined."""

from __future__ import annotations

import numpy as np
import pytest

from testbench.evaluation.angle_ranges import sensor_angles, unwrapped_beside, usual_sequence
from testbench.model import rotation
from tests.evaluation.test_differences import sensor

COUNT = 600


def oriented(sequence: str, first=0.0, second=0.0, third=0.0) -> np.ndarray:
    """Orientations of three angles [deg], each constant or of shape (600,)."""
    angles = [np.broadcast_to(np.asarray(a, float), COUNT) for a in (first, second, third)]
    return rotation.from_euler(sequence, np.radians(np.column_stack(angles)))


def test_the_sequence_is_the_one_that_is_less_in_gimbal_lock():
    assert usual_sequence(sensor(device=oriented("ZYX", second=30))) == "ZYX"
    upright = oriented("ZYX", second=88)  # the x axis points down
    assert usual_sequence(sensor(device=upright)) == "ZXY"


def test_ranges_are_those_of_the_motion_and_turns_are_counted():
    turning = np.linspace(0, 900, COUNT)
    q = oriented("ZYX", turning, 20 * np.sin(np.radians(turning)), 15)
    tables = sensor_angles("imu", sensor(device=q), None)
    heading, pitch, roll = tables.angle_ranges
    assert (heading.angle, heading.sequence) == ("first", "ZYX")
    assert heading.range_deg == pytest.approx(900, abs=1e-4)
    assert (pitch.lowest_deg, pitch.highest_deg) == pytest.approx((-20, 20), abs=0.01)
    assert roll.range_deg == pytest.approx(0, abs=1e-4)
    shown = np.degrees(tables.series["euler_imu"]["device_ZYX_first_rad"])
    assert shown[-1] - shown[0] == pytest.approx(900, abs=1e-3)


def test_the_sequence_that_is_asked_for_is_taken():
    tables = sensor_angles("imu", sensor(device=oriented("XYZ", 10, 20, 30)), "XYZ")
    middles = [row.lowest_deg for row in tables.angle_ranges]
    assert middles == pytest.approx([10, 20, 30], abs=1e-4)


def test_in_gimbal_lock_the_outer_angles_are_neither_drawn_nor_stated():
    q = oriented("ZYX", np.linspace(0, 50, COUNT), 89)
    tables = sensor_angles("imu", sensor(device=q), "ZYX")
    assert [row.range_deg is None for row in tables.angle_ranges] == [True, False, True]
    assert tables.angle_ranges[0].locked_percent == 100
    series = tables.series["euler_imu"]
    assert np.isnan(series["device_ZYX_first_rad"]).all()
    assert np.isfinite(series["device_ZYX_second_rad"]).all()


def test_two_estimates_of_one_motion_stay_together_across_a_gap():
    true = np.radians(np.linspace(0, 500, COUNT))
    gap = slice(200, 320)
    beside, angle = true.copy(), rotation.wrap(true + 0.1)
    beside[gap], angle[gap] = np.nan, np.nan
    alone = np.unwrap(np.delete(angle, gap))
    found = unwrapped_beside(angle, beside)
    known = np.isfinite(found)
    assert np.abs(found[known] - true[known] - 0.1).max() < 1e-9
    assert abs(alone[-1] - true[-1]) < 7  # by itself it may be off by a turn and no more


def test_the_angles_of_samples_that_were_left_out_are_gaps():
    q = oriented("ZYX", second=np.linspace(0, 40, COUNT))
    q[100:110] = np.nan
    (_, pitch, _), series = (
        (tables := sensor_angles("imu", sensor(device=q), None)).angle_ranges,
        tables.series["euler_imu"],
    )
    assert pitch.n == COUNT - 10
    assert np.isnan(series["device_ZYX_second_rad"][100:110]).all()
