"""Rotations against SciPy, and there and back again."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from testbench.model import rotation

PROPER = ["ZXZ", "XYX", "XZX", "YXY", "YZY", "ZYZ"]
TAIT_BRYAN = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]

components = st.floats(-1, 1, allow_subnormal=False)
quaternions = (
    st.tuples(components, components, components, components)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)
vectors = st.tuples(*[st.floats(-10, 10, allow_subnormal=False)] * 3).map(np.array)


def scipy_rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(q, -1, axis=-1))  # x, y, z, w


def same(p: np.ndarray, q: np.ndarray, tolerance: float = 1e-12) -> bool:
    """Whether two quaternions are the same rotation."""
    return bool(min(np.abs(p - q).max(), np.abs(p + q).max()) < tolerance)


@given(quaternions, quaternions)
def test_the_product_of_quaternions_is_the_product_of_rotations(p, q):
    product = rotation.multiply(p, q)
    np.testing.assert_allclose(
        scipy_rotation(product).as_matrix(),
        scipy_rotation(p).as_matrix() @ scipy_rotation(q).as_matrix(),
        atol=1e-12,
    )


@given(quaternions, vectors)
def test_rotating_coordinates_agrees_with_scipy_and_with_the_matrix(q, x):
    expected = scipy_rotation(q).apply(x)
    np.testing.assert_allclose(rotation.rotate(q, x), expected, atol=1e-11)
    np.testing.assert_allclose(rotation.to_matrix(q) @ x, expected, atol=1e-11)


@given(quaternions, vectors)
def test_the_conjugate_undoes_a_rotation(q, x):
    np.testing.assert_allclose(
        rotation.rotate(rotation.conjugate(q), rotation.rotate(q, x)), x, atol=1e-11
    )


@given(quaternions)
def test_a_matrix_gives_its_quaternion_back_with_a_positive_first_part(q):
    back = rotation.from_matrix(rotation.to_matrix(q))
    assert same(back, q)
    assert back[0] >= 0


@given(vectors)
def test_a_rotation_vector_turns_by_its_length(vector):
    q = rotation.from_rotation_vector(vector / 10)
    np.testing.assert_allclose(
        scipy_rotation(q).as_matrix(), Rotation.from_rotvec(vector / 10).as_matrix(), atol=1e-12
    )
    np.testing.assert_allclose(
        rotation.angle(q), Rotation.from_rotvec(vector / 10).magnitude(), atol=1e-9
    )


@given(quaternions)
def test_a_quaternion_gives_the_rotation_vector_that_scipy_gives_whatever_its_sign(q):
    expected = scipy_rotation(q).as_rotvec()
    if rotation.angle(q) < 3.14:  # beyond, the vector may point either way
        for signed in (q, -q):
            np.testing.assert_allclose(rotation.to_rotation_vector(signed), expected, atol=1e-9)


@pytest.mark.parametrize("sequence", PROPER + TAIT_BRYAN)
@given(q=quaternions)
@settings(max_examples=30)
def test_euler_angles_lead_back_to_their_rotation_in_every_sequence(sequence, q):
    assert same(rotation.from_euler(sequence, rotation.to_euler(sequence, q)), q, 1e-7)


@pytest.mark.parametrize("sequence", PROPER + TAIT_BRYAN)
def test_euler_angles_are_intrinsic_turns_about_the_axes_in_the_order_they_are_written(sequence):
    angles = np.array([0.3, 0.7, -0.4])
    matrix = np.eye(3)
    for axis, angle in zip(sequence, angles, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        matrix = matrix @ turn  # each about the axes as the former left them
    np.testing.assert_allclose(
        rotation.to_matrix(rotation.from_euler(sequence, angles)), matrix, atol=1e-15
    )
    np.testing.assert_allclose(
        rotation.to_euler(sequence, rotation.from_matrix(matrix)), angles, atol=1e-14
    )


@pytest.mark.parametrize("sequence", PROPER + TAIT_BRYAN)
def test_euler_angles_give_the_quaternions_of_scipy_sign_and_all(sequence):
    angles = np.random.default_rng(3).uniform(-7, 7, (200, 3))
    angles[:8] = [[a, b, c] for a in (0.0, np.pi) for b in (-0.0, np.pi / 2) for c in (0.0, -np.pi)]
    expected = Rotation.from_euler(sequence, angles).as_quat(scalar_first=True)
    np.testing.assert_allclose(rotation.from_euler(sequence, angles), expected, atol=1e-15)
    np.testing.assert_array_equal(
        rotation.from_euler(sequence, angles.reshape(20, 10, 3)),
        rotation.from_euler(sequence, angles).reshape(20, 10, 4),
    )


@pytest.mark.parametrize(
    ("sequence", "locked"), [("ZXZ", 0.0), ("ZXZ", np.pi), ("XYZ", np.pi / 2), ("YXZ", -np.pi / 2)]
)
def test_gimbal_lock_gives_no_warning_and_keeps_the_middle_angle(sequence, locked):
    q = rotation.from_euler(sequence, np.array([0.4, locked, 0.2]))
    angles = rotation.to_euler(sequence, q)
    assert angles[1] == pytest.approx(locked, abs=1e-7)
    assert rotation.gimbal_margin(sequence, angles) == pytest.approx(0, abs=1e-7)
    assert same(rotation.from_euler(sequence, angles), q, 1e-7)


@pytest.mark.parametrize("sequence", PROPER + TAIT_BRYAN)
def test_euler_angles_are_those_of_scipy_branch_and_all(sequence):
    q = np.random.default_rng(4).normal(size=(500, 4))
    expected = Rotation.from_quat(q, scalar_first=True).as_euler(sequence)
    np.testing.assert_allclose(rotation.to_euler(sequence, q), expected, atol=1e-15)


def test_matrices_of_half_turns_give_the_quaternions_that_scipy_gives_sign_and_all():
    parts = [0.0, -0.0, 1.0, -1.0, 1e-9]
    q = np.array([p for p in itertools.product(parts, repeat=4) if np.linalg.norm(p) > 0.5])
    matrices = Rotation.from_quat(q, scalar_first=True).as_matrix()
    expected = Rotation.from_matrix(matrices).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(rotation.to_matrix(q), matrices, atol=1e-15)
    np.testing.assert_allclose(rotation.from_matrix(matrices), expected, atol=1e-15)


def test_a_matrix_that_is_not_quite_a_rotation_gives_the_nearest_one_and_a_mirror_none():
    matrix = rotation.to_matrix(rotation.from_rotation_vector([0.3, -0.2, 0.9]))
    bent = np.stack([matrix, matrix + 1e-6 * np.arange(9).reshape(3, 3)])
    expected = Rotation.from_matrix(bent).as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(rotation.from_matrix(bent), expected, atol=1e-15)
    with pytest.raises(ValueError, match="left-handed"):
        rotation.from_matrix(np.stack([matrix, matrix * [1.0, 1.0, -1.0]]))


def test_the_gimbal_margin_is_the_distance_of_the_middle_angle_from_lock():
    assert rotation.gimbal_margin("ZXZ", np.radians([10, 70, 20])) == pytest.approx(np.radians(70))
    assert rotation.gimbal_margin("ZXZ", np.radians([10, 170, 20])) == pytest.approx(np.radians(10))
    assert rotation.gimbal_margin("XYZ", np.radians([10, -70, 20])) == pytest.approx(np.radians(20))


@given(quaternions)
def test_heading_and_inclination_put_together_are_the_total_angle(q):
    heading, inclination, total = (
        rotation.heading_angle(q),
        rotation.inclination_angle(q),
        rotation.angle(q),
    )
    assert np.cos(total / 2) == pytest.approx(
        np.cos(heading / 2) * np.cos(inclination / 2), abs=1e-12
    )


@given(quaternions)
def test_taking_the_heading_away_leaves_the_inclination_and_no_heading(q):
    left = rotation.multiply(rotation.from_heading(-rotation.heading_angle(q)), q)
    if np.hypot(q[0], q[3]) > 1e-3:  # at half a turn about a level axis the heading is not defined
        assert rotation.heading_angle(left) == pytest.approx(0, abs=1e-9)
        assert rotation.angle(left) == pytest.approx(rotation.inclination_angle(q), abs=1e-7)


@given(quaternions)
def test_the_inclination_is_the_angle_by_which_the_vertical_is_tilted(q):
    up = rotation.rotate(q, np.array([0.0, 0.0, 1.0]))
    assert rotation.inclination_angle(q) == pytest.approx(
        np.arctan2(np.hypot(up[0], up[1]), up[2]), abs=1e-7
    )


@given(st.floats(-3.1, 3.1), quaternions)
def test_the_sign_of_a_quaternion_changes_none_of_its_angles(heading, q):
    turned = rotation.multiply(rotation.from_heading(heading), q)
    if np.hypot(turned[0], turned[3]) < 1e-3:
        return  # half a turn about a level axis has no heading
    for of in (rotation.heading_angle, rotation.inclination_angle, rotation.angle):
        assert of(-turned) == pytest.approx(of(turned), abs=1e-9) or abs(
            of(turned)
        ) == pytest.approx(np.pi, abs=1e-6)


def test_small_angles_keep_their_precision():
    for size in (1e-3, 1e-6, 1e-9, 1e-12):
        assert rotation.angle(
            rotation.from_rotation_vector(np.array([0.0, size, 0.0]))
        ) == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0, 0), (190, -170), (-190, 170), (359, -1), (720 + 5, 5), (180, -180), (-180, -180)],
)
def test_angles_are_wrapped_into_half_a_turn_to_either_side(angle, wrapped):
    assert np.degrees(rotation.wrap(np.radians(angle))) == pytest.approx(wrapped, abs=1e-9)


@given(quaternions, st.lists(st.booleans(), min_size=40, max_size=40))
def test_the_mean_of_quaternions_does_not_care_about_their_signs(q, flips):
    rng = np.random.default_rng(3)
    spread = rng.normal(0, 0.05, (20, 3))
    around = rotation.multiply(rotation.from_rotation_vector(np.vstack([spread, -spread])), q)
    signs = np.where(flips, -1.0, 1.0)[:, None]
    assert same(rotation.mean(around * signs), q, 1e-3)


def test_the_mean_agrees_with_scipys():
    q = rotation.normalise(np.random.default_rng(5).normal([3, 0, 0, 1], 1, (50, 4)))
    assert same(rotation.mean(q), scipy_rotation(q).mean().as_quat(scalar_first=True), 1e-9)


def test_interpolation_agrees_with_scipys_slerp_whatever_the_signs():
    rng = np.random.default_rng(8)
    times = np.cumsum(rng.integers(1_000_000, 30_000_000, 60))  # uneven, int64 nanoseconds
    q = rotation.from_rotation_vector(np.cumsum(rng.normal(0, 0.3, (60, 3)), axis=0))
    at = np.sort(rng.integers(times[0], times[-1], 500))
    expected = Slerp(times / 1e9, scipy_rotation(q))(at / 1e9).as_quat(scalar_first=True)
    found = rotation.interpolate(times, q * rng.choice([-1.0, 1.0], (60, 1)), at)
    error = rotation.angle(rotation.multiply(found, rotation.conjugate(expected)))
    assert error.max() < 1e-9


def test_interpolation_holds_the_ends_and_meets_the_knots():
    q = rotation.from_rotation_vector(np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.5, 0]]))
    found = rotation.interpolate(np.array([10, 20, 30]), q, np.array([0, 10, 20, 30, 99]))
    np.testing.assert_allclose(found, q[[0, 0, 1, 2, 2]], atol=1e-15)


def test_interpolation_between_nearly_equal_orientations_is_still_a_unit_quaternion():
    q = rotation.from_rotation_vector(np.array([[0.0, 0, 0], [1e-9, 0, 0]]))
    found = rotation.interpolate(np.array([0, 10]), q, np.array([5]))
    assert np.linalg.norm(found) == pytest.approx(1, abs=1e-15)
    assert rotation.angle(found[0]) == pytest.approx(5e-10, rel=1e-6)


def test_leading_axes_are_kept():
    q = rotation.normalise(np.random.default_rng(1).normal(size=(2, 3, 4)))
    assert rotation.to_matrix(q).shape == (2, 3, 3, 3)
    assert rotation.from_matrix(rotation.to_matrix(q)).shape == (2, 3, 4)
    assert rotation.to_euler("ZXZ", q).shape == (2, 3, 3)
    assert rotation.rotate(q, np.ones(3)).shape == (2, 3, 3)
