"""Sensors on segments: known mountings, hinges and headings are found again, with honest
uncertainty. Rotations are SciPy's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.calibration.hinge_axis import axis_of_turn
from testbench.estimation.calibration.joint_heading import heading_1d, heading_2d
from testbench.estimation.calibration.sensor_to_segment import (
    SegmentMounting,
    from_arm_kinematics,
    from_directions,
)
from testbench.model import rotation
from testbench.model.statistics.least_squares import PoorExcitation
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


def hinge(n: int, noise: float, seed: int) -> tuple[np.ndarray, ...]:
    """Rates of two sensors beside a hinge, of which the lower segment turns; and the axis in its
    sensor.
    """
    draw, t = rng(seed), np.linspace(0, 20, n)
    speed = 0.9 * 1.3 * np.sin(1.3 * t)
    rates = [np.zeros((n, 3)), SECOND.inv().apply(speed[:, None] * AXIS)]
    rates = [rate + noise * draw.standard_normal((n, 3)) for rate in rates]
    return *rates, SECOND.inv().apply(AXIS)


def test_with_the_upper_arm_at_rest_the_axis_is_found_by_the_turn_of_the_lower():
    _, second_rate, second = hinge(300, 0.01, 1)
    turn = axis_of_turn(second_rate)
    assert abs(turn.values @ second) == pytest.approx(1, abs=1e-4)


def test_intervals_of_an_axis_of_turn_hold_it():
    _, rate, second = hinge(100, 0.0, 0)
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
    known = np.array([[0.0, 0, 1], [0.6, 0.8, 0.1]])
    found = from_directions(MOUNTING.inv().apply(known), known, np.array([0.01, 0.01]))
    x = rotation.rotate(found.q_segment_from_sensor, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(x, MOUNTING.apply([0, 0, 1]), atol=1e-9)
