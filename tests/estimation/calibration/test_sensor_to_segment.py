"""Sensors on segments: known mountings, hinges and headings are found again, with honest
uncertainty. Rotations are SciPy's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.hinge_axis import axis_of_turn, hinge_axes
from testbench.estimation.calibration.joint_heading import heading_1d, heading_2d
from testbench.estimation.calibration.sensor_to_segment import (
    SegmentMounting,
    from_arm_kinematics,
    from_directions,
    from_rates,
    from_static_pose,
)
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
from tests.estimation.calibration.covering import as_often_as_stated
from tests.estimation.calibration.simulated import rng

MOUNTING = Rotation.from_rotvec([0.4, -1.1, 0.7])
"""segment from sensor."""


def quaternions(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def motion(n: int, seed: int, planar: bool = False) -> Rotation:
    """A smooth motion of a segment in the world."""
    t, phase = np.linspace(0, 10, n), rng(seed).uniform(0, 6, 3)
    angles = np.column_stack(
        [
            1.2 * np.sin(0.9 * t + phase[0]),
            0.8 * np.sin(1.3 * t + phase[1]),
            np.sin(0.5 * t + phase[2]),
        ]
    )
    return Rotation.from_euler("ZYX", angles * ([1, 0, 0] if planar else [1, 1, 1]))


def error_in_segment(found: SegmentMounting) -> np.ndarray:
    """Small rotation from what was found to the truth, about the axes of the segment [rad]."""
    return (
        MOUNTING * Rotation.from_quat(found.q_segment_from_sensor, scalar_first=True).inv()
    ).as_rotvec()


def test_a_static_pose_gives_the_mounting_and_takes_its_own_error_for_it():
    pose = Rotation.from_rotvec([0.1, 0.2, 0.3])
    draw, inside, sd = rng(1), np.zeros(3), 0.01
    exact = from_static_pose(np.tile(quaternions(pose * MOUNTING), (50, 1)), quaternions(pose), 50)
    assert np.abs(error_in_segment(exact)).max() < 1e-9
    for _ in range(1000):
        noisy = pose * Rotation.from_rotvec(0.02 * draw.standard_normal((20, 3))) * MOUNTING
        held = pose * Rotation.from_rotvec(sd * draw.standard_normal(3))
        at_rest = from_static_pose(quaternions(noisy), quaternions(held), 20, sd)
        inside += np.abs(error_in_segment(at_rest)) <= at_rest.fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside


def test_two_directions_give_the_mounting_with_their_uncertainty():
    known = np.array([[0.0, 0, 1], [0.6, 0.8, 0.1]])
    sd = np.array([0.002, 0.02])
    assert (
        np.abs(
            error_in_segment(from_directions(9.8 * MOUNTING.inv().apply(known), known, sd))
        ).max()
        < 1e-9
    )
    draw, inside = rng(2), np.zeros(3)
    unit = known / np.linalg.norm(known, axis=1, keepdims=True)
    for _ in range(1000):
        felt = MOUNTING.inv().apply(
            Rotation.from_rotvec(sd[:, None] * draw.standard_normal((2, 3))).apply(unit)
        )
        found = from_directions(felt, known, sd)
        inside += np.abs(error_in_segment(found)) <= found.fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside
    with pytest.raises(PoorExcitation, match="rotation_"):
        from_directions(known[[0, 0]], known[[0, 0]], sd)


def test_rates_of_the_arm_give_the_mounting():
    t = np.linspace(0, 10, 300)
    rate = np.column_stack([np.sin(t), 0.5 * np.cos(2 * t), 0.3 * np.sin(3 * t)])
    assert np.abs(error_in_segment(from_rates(MOUNTING.inv().apply(rate), rate))).max() < 1e-9
    draw, inside = rng(3), np.zeros(3)
    for _ in range(1000):
        found = from_rates(MOUNTING.inv().apply(rate) + 0.02 * draw.standard_normal((300, 3)), rate)
        inside += np.abs(error_in_segment(found)) <= found.fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside
    sparse = from_rates(
        MOUNTING.inv().apply(rate) + 0.02 * draw.standard_normal((300, 3)), rate, independent=75
    )
    np.testing.assert_allclose(sparse.fit.sd / found.fit.sd, 2, rtol=0.2)
    with pytest.raises(PoorExcitation):
        from_rates(*(rate * [1, 0, 0] + 1e-3 * draw.standard_normal((300, 3)) for _ in range(2)))


def test_the_arms_kinematics_give_the_mounting_whatever_the_filters_heading():
    segment = motion(400, 1)
    heading = Rotation.from_rotvec([0, 0, 1.9])
    draw = rng(4)
    seen = heading * segment * MOUNTING
    exact = from_arm_kinematics(quaternions(segment), quaternions(seen))
    assert np.abs(error_in_segment(exact)).max() < 1e-7
    inside = np.zeros(3)
    for _ in range(1000):
        noisy = seen * Rotation.from_rotvec(0.01 * draw.standard_normal((400, 3)))
        found = from_arm_kinematics(quaternions(segment), quaternions(noisy))
        inside += np.abs(error_in_segment(found)) <= found.fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside
    assert (found.fit.sd < 0.005).all()
    flat = motion(400, 1, planar=True)
    with pytest.raises(PoorExcitation, match="second axis"):
        from_arm_kinematics(quaternions(flat), quaternions(flat * MOUNTING))


AXIS = np.array([0.1, 0.97, -0.2]) / np.linalg.norm([0.1, 0.97, -0.2])
FIRST, SECOND = Rotation.from_rotvec([0.3, 0.1, -0.5]), Rotation.from_rotvec([-0.2, 0.9, 0.4])
"""Sensors on the two segments: segment from sensor."""


def hinge(n: int, noise: float, seed: int, upper_moves: bool = True) -> tuple[np.ndarray, ...]:
    """Rates and forces of two sensors beside a hinge, which feel the same force; and the axis in
    each.
    """
    draw, t = rng(seed), np.linspace(0, 20, n)
    upper = (
        np.column_stack([np.sin(1.1 * t), 0.6 * np.sin(0.7 * t + 1), 0.8 * np.cos(1.7 * t)])
        * upper_moves
    )
    angle, speed = 0.9 * (1 - np.cos(1.3 * t)), 0.9 * 1.3 * np.sin(1.3 * t)
    bend = Rotation.from_rotvec(angle[:, None] * AXIS)  # upper from lower
    lower = bend.inv().apply(upper) + speed[:, None] * AXIS
    force = np.column_stack([3 * np.sin(0.4 * t), 9 * np.cos(0.3 * t), 4 + np.sin(t)])
    rates = [FIRST.inv().apply(upper), SECOND.inv().apply(lower)]
    forces = [FIRST.inv().apply(force), SECOND.inv().apply(bend.inv().apply(force))]
    rates = [rate + noise * draw.standard_normal((n, 3)) for rate in rates]
    return *rates, *forces, FIRST.inv().apply(AXIS), SECOND.inv().apply(AXIS)


def test_a_hinge_is_found_from_the_motion_of_both_segments():
    *given, first, second = hinge(300, 0.0, 0)
    found = hinge_axes(*given)
    sign = np.sign(found.first @ first)
    np.testing.assert_allclose(found.first * sign, first, atol=1e-9)
    np.testing.assert_allclose(
        found.second * sign, second, atol=1e-9
    )  # with forces the signs agree
    assert found.signs_agree
    by_rates = hinge_axes(*given[:2])
    assert not by_rates.signs_agree
    assert abs(by_rates.first @ first) == pytest.approx(1, abs=1e-9)
    assert abs(by_rates.second @ second) == pytest.approx(1, abs=1e-9)


def test_intervals_of_a_hinges_axes_hold_them():
    inside, noise, draw = np.zeros(6), 0.01, rng(9)
    clean1, clean2, f1, f2, first, second = hinge(120, 0.0, 0)
    truth = np.concatenate([first, second])
    for _ in range(300):
        rates = [clean + noise * draw.standard_normal(clean.shape) for clean in (clean1, clean2)]
        # The difference of lengths across the axis has twice the variance of one rate, as that of
        # the forces has.
        forces = [f + 0.5 * draw.standard_normal(f.shape) for f in (f1, f2)]
        found = hinge_axes(*rates, *forces, force_weight=noise / 0.5)
        values = found.fit.values * np.sign(found.first @ first)
        inside += np.abs(values - truth) <= found.fit.half_width()
    assert as_often_as_stated(inside, 300), inside


def test_with_the_upper_arm_at_rest_its_axis_is_refused_and_the_other_found_by_its_turn():
    first_rate, second_rate, *_, second = hinge(300, 0.01, 1, upper_moves=False)
    with pytest.raises(PoorExcitation) as caught:
        hinge_axes(first_rate, second_rate)
    assert any(name.startswith("first") for name in caught.value.parameters)
    turn = axis_of_turn(second_rate)
    assert abs(turn.values @ second) == pytest.approx(1, abs=1e-4)


def test_intervals_of_an_axis_of_turn_hold_it():
    _, rate, *_, second = hinge(100, 0.0, 0, upper_moves=False)
    second = second * np.sign(second[np.argmax(np.abs(second))])
    draw, inside = rng(5), np.zeros(3)
    for _ in range(1000):
        fit = axis_of_turn(rate + 0.02 * draw.standard_normal(rate.shape))
        inside += np.abs(fit.values - second) <= fit.half_width()
    assert ((inside >= 930) & (inside <= 970)).all(), inside


def test_what_turns_about_no_single_axis_or_not_at_all_is_refused():
    draw = rng(6)
    with pytest.raises(PoorExcitation, match="axis_x"):
        axis_of_turn(draw.standard_normal((200, 3)))
    with pytest.raises(PoorExcitation):
        axis_of_turn(np.zeros((50, 3)))
    with pytest.raises(PoorExcitation):
        hinge_axes(np.zeros((50, 3)), np.zeros((50, 3)))


def joint(
    n: int, angles: np.ndarray, second_axis: np.ndarray | None = None
) -> tuple[Rotation, Rotation]:
    """Orientations of both sensors in one earth; a hinge about AXIS, or a 2D joint about AXIS and
    then another axis.
    """
    upper = motion(n, 3)
    bend = Rotation.from_rotvec(angles[:, :1] * AXIS)
    if second_axis is not None:
        bend = bend * Rotation.from_rotvec(angles[:, 1:] * second_axis)
    return upper * FIRST, upper * bend * SECOND


HEADING = 0.8
TIME = np.linspace(0, 10, 200)
ANGLES = np.column_stack([0.9 * (1 - np.cos(1.3 * TIME)), 0.7 * np.sin(0.9 * TIME)])
CARRYING = np.cross(AXIS, [1.0, 0, 0]) / np.linalg.norm(np.cross(AXIS, [1.0, 0, 0]))


def other_earth(
    turn: Rotation, draw: np.random.Generator | None = None, noise: float = 0.0
) -> np.ndarray:
    """As a filter sees it whose north is off by minus HEADING."""
    seen = Rotation.from_rotvec([0, 0, -HEADING]) * turn
    if draw is not None:
        seen = seen * Rotation.from_rotvec(noise * draw.standard_normal((len(turn), 3)))
    return quaternions(seen)


def test_the_heading_of_a_hinge_is_found():
    first, second = joint(200, ANGLES)
    axes = FIRST.inv().apply(AXIS), SECOND.inv().apply(AXIS)
    q1 = quaternions(first)
    assert heading_1d(q1, axes[0], other_earth(second), axes[1])["heading"] == pytest.approx(
        HEADING, abs=1e-9
    )
    draw, inside = rng(7), 0
    for _ in range(1000):
        fit = heading_1d(q1, axes[0], other_earth(second, draw, 0.03), axes[1])
        inside += abs(fit["heading"] - HEADING) <= fit.half_width()[0]
    assert 930 <= inside <= 970
    upright = np.tile(quaternions(Rotation.identity()), (50, 1))
    with pytest.raises(PoorExcitation, match="heading"):
        heading_1d(upright, np.array([0.0, 0, 1]), upright, np.array([0.0, 0, 1]))


def test_the_heading_of_a_joint_with_two_axes_is_found():
    first, second = joint(200, ANGLES, CARRYING)
    axes = FIRST.inv().apply(AXIS), SECOND.inv().apply(CARRYING)
    q1 = quaternions(first)
    assert heading_2d(q1, axes[0], other_earth(second), axes[1])["heading"] == pytest.approx(
        HEADING, abs=1e-9
    )
    draw, inside = rng(8), 0
    for _ in range(1000):
        fit = heading_2d(q1, axes[0], other_earth(second, draw, 0.03), axes[1])
        inside += abs(fit["heading"] - HEADING) <= fit.half_width()[0]
    assert 930 <= inside <= 970
    skew = np.radians(80)
    crossing = Rotation.from_rotvec((np.pi / 2 - skew) * np.cross(CARRYING, AXIS)).apply(CARRYING)
    assert np.arccos(crossing @ AXIS) == pytest.approx(skew)
    first, second = joint(200, ANGLES, crossing)
    fit = heading_2d(
        quaternions(first), axes[0], other_earth(second), SECOND.inv().apply(crossing), skew
    )
    assert fit["heading"] == pytest.approx(HEADING, abs=1e-9)


def test_a_joint_that_does_not_move_tells_no_heading():
    q = np.tile(quaternions(Rotation.from_rotvec([0.5, 0.2, 0.1])), (50, 1))
    with pytest.raises(PoorExcitation, match="heading"):
        heading_2d(q, AXIS, q, CARRYING)


def test_the_found_mounting_is_a_rotation_in_the_benchs_own_convention():
    segment = motion(50, 2)
    found = from_static_pose(quaternions(segment[:1] * MOUNTING), quaternions(segment[0]))
    x = rotation.rotate(found.q_segment_from_sensor, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(x, MOUNTING.apply([0, 0, 1]), atol=1e-9)
