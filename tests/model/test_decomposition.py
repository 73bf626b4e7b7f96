"""Every definition of a joint's angles: there and back, against other ways to the same numbers, and
across range ends.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from testbench.model import rotation
from testbench.model.decomposition import (
    AxisAngle,
    Euler,
    Hinge,
    RotationVector,
    SwingTwist,
    across,
    follow,
)
from testbench.model.joint_angle import decomposition_of
from testbench.records.specs.joint_definition import FlexionAngle

SEQUENCES = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ"]
TILTED = (0.6, 0.0, 0.8)
DEFINITIONS = {
    **{sequence: Euler(sequence) for sequence in SEQUENCES},
    **{
        f"isb {joint} {side}": decomposition_of(
            FlexionAngle(definition={"isb": joint, "side": side})
        )
        for joint in ("elbow", "wrist", "hip", "knee", "ankle")
        for side in ("right", "left")
    },
    "grood_suntay right": decomposition_of(FlexionAngle(definition={"grood_suntay": "knee"})),
    "grood_suntay left": decomposition_of(
        FlexionAngle(definition={"grood_suntay": "knee", "side": "left"})
    ),
    "hinge": Hinge((0.0, 0.0, 1.0)),
    "tilted hinge": Hinge(TILTED),
    "swing_twist": SwingTwist((0.0, 1.0, 0.0)),
    "tilted swing_twist": SwingTwist(TILTED),
    "axis_angle": AxisAngle(),
    "rotation_vector": RotationVector(),
}
EVERY = pytest.mark.parametrize("definition", DEFINITIONS.values(), ids=DEFINITIONS.keys())
FLOOR_MARGIN = np.radians(1.0)


def random(n: int, seed: int) -> np.ndarray:
    return rotation.normalise(np.random.default_rng(seed).normal(size=(n, 4)))


def between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    return rotation.angle(rotation.multiply(p, rotation.conjugate(q)))


# There and back


@EVERY
def test_random_rotations_come_back_to_a_billionth_of_a_radian(definition):
    q = random(5000, 1)
    angles = definition.angles(q)
    assert between(definition.rotation(angles), q).max() < 1e-9


@EVERY
def test_angles_away_from_the_singularity_come_back_themselves(definition):
    angles = definition.angles(random(5000, 2))
    kept = angles[definition.margins(angles).min(axis=1) > FLOOR_MARGIN]
    assert len(kept) > 4000
    again = definition.angles(definition.rotation(kept))
    difference = np.where(definition.periodic, rotation.wrap(again - kept), again - kept)
    assert np.abs(difference).max() < 1e-9


@EVERY
def test_the_sign_of_a_quaternion_does_not_matter(definition):
    q = random(1000, 3)
    one, other = definition.angles(q), definition.angles(-q)
    np.testing.assert_allclose(
        np.where(definition.periodic, rotation.wrap(one - other), one - other), 0, atol=1e-9
    )


@EVERY
def test_alternatives_are_the_same_rotation(definition):
    q = random(500, 4)
    for angles in definition.alternatives(definition.angles(q)):
        assert between(definition.rotation(angles), q).max() < 1e-9


def test_in_gimbal_lock_the_rotation_still_comes_back_though_its_outer_angles_do_not():
    for sequence in SEQUENCES:
        definition = Euler(sequence)
        middle = 0.0 if definition.symmetric else np.pi / 2
        q = definition.rotation(np.array([[0.7, middle, -0.4]]))
        angles = definition.angles(q)
        assert definition.margins(angles)[0, 0] < 1e-6
        assert between(definition.rotation(angles), q)[0] < 1e-7


@pytest.mark.parametrize(
    "definition", [Hinge(TILTED), SwingTwist(TILTED)], ids=["hinge", "swing_twist"]
)
def test_a_turned_over_axis_is_where_twist_and_hinge_end(definition):
    turned_over = rotation.from_rotation_vector(np.pi * across(TILTED)[:1])
    assert definition.margins(definition.angles(turned_over))[0, 0] < 1e-6


def test_a_rotation_that_is_none_has_an_angle_and_no_axis():
    angles = AxisAngle().angles(np.array([[1.0, 0, 0, 0]]))
    assert angles[0, 0] == 0.0
    assert AxisAngle().margins(angles)[0, 0] == np.inf
    assert AxisAngle().margins(angles)[0, 2] == 0.0


# Against other ways to the same numbers


@given(st.integers(0, 2**32 - 1))
def test_the_twist_is_the_nearest_rotation_about_the_axis(seed):
    q = random(1, seed)
    twist = float(SwingTwist(TILTED).angles(q)[0, 0])
    relative = Rotation.from_quat(q[0], scalar_first=True)

    def distance(angle: float) -> float:
        return float((relative * Rotation.from_rotvec(angle * np.array(TILTED)).inv()).magnitude())

    found = minimize_scalar(
        distance, bounds=(twist - 1.0, twist + 1.0), method="bounded", options={"xatol": 1e-10}
    )
    assert distance(twist) <= found.fun + 1e-9
    assert all(
        distance(twist) <= distance(angle) + 1e-9 for angle in np.linspace(-np.pi, np.pi, 37)
    )


def test_the_tilt_of_a_hinge_is_the_angle_between_the_two_axes():
    q = random(200, 5)
    tilt = Hinge(TILTED).angles(q)[:, 1]
    cosine = Rotation.from_quat(q, scalar_first=True).apply(TILTED) @ np.array(TILTED)
    np.testing.assert_allclose(np.cos(tilt), cosine, atol=1e-12)


def test_a_pure_hinge_gives_its_angle_and_no_tilt():
    angle = np.linspace(-3.1, 3.1, 63)
    angles = Hinge(TILTED).angles(rotation.from_rotation_vector(angle[:, None] * np.array(TILTED)))
    np.testing.assert_allclose(angles[:, 0], angle, atol=1e-12)
    np.testing.assert_allclose(angles[:, 1], 0, atol=1e-7)


def test_axis_and_angle_are_those_of_the_rotation_vector():
    q = random(200, 6)
    angle, azimuth, elevation = AxisAngle().angles(q).T
    vector = Rotation.from_quat(q, scalar_first=True).as_rotvec()
    x, y, z = vector.T / np.linalg.norm(vector, axis=1)
    np.testing.assert_allclose(angle, np.linalg.norm(vector, axis=1), atol=1e-9)
    np.testing.assert_allclose(np.cos(elevation) * np.cos(azimuth), x, atol=1e-9)
    np.testing.assert_allclose(np.cos(elevation) * np.sin(azimuth), y, atol=1e-9)
    np.testing.assert_allclose(np.sin(elevation), z, atol=1e-9)


def joint_coordinate_system(matrix: np.ndarray, side: str) -> tuple[float, float, float]:
    """Flexion, adduction and external rotation by the unit vectors of Grood & Suntay (1983),
    without Euler angles.

    e1 is the femur's x (to the right), e3 the tibia's z (up), e2 = e3 x e1 between them.
    """
    femur_x, femur_y, femur_z = np.eye(3)
    tibia_x, tibia_y, tibia_z = matrix.T
    floating = np.cross(tibia_z, femur_x) / np.linalg.norm(np.cross(tibia_z, femur_x))
    outwards = 1.0 if side == "right" else -1.0
    flexion = np.arctan2(-floating @ femur_z, floating @ femur_y)
    # The foot of an adducted shank points inwards: its upward axis leans outwards, to the right of
    # a right knee.
    adduction = np.arcsin(outwards * (tibia_z @ femur_x))
    # Toes, along the tibia's y, are turned outwards from the floating axis.
    external = outwards * np.arctan2(floating @ -tibia_x, floating @ tibia_y)
    return flexion, adduction, external


@pytest.mark.parametrize("side", ["right", "left"])
def test_grood_and_suntays_knee_is_that_of_its_unit_vectors(side):
    q = random(500, 7)
    found = DEFINITIONS[f"grood_suntay {side}"].angles(q)
    expected = [
        joint_coordinate_system(matrix, side)
        for matrix in Rotation.from_quat(q, scalar_first=True).as_matrix()
    ]
    np.testing.assert_allclose(rotation.wrap(found - np.array(expected)), 0, atol=1e-9)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_knee_of_the_isb_is_grood_and_suntays_with_other_names_of_the_axes(side):
    q = random(200, 8)
    own = Rotation.from_quat(q, scalar_first=True).as_matrix()
    grood_from_isb = np.array(
        [[0, 0, 1], [1, 0, 0], [0, 1, 0.0]]
    )  # x right, y forward, z up of x forward, y up, z right
    grood = DEFINITIONS[f"grood_suntay {side}"].angles(
        rotation.from_matrix(grood_from_isb @ own @ grood_from_isb.T)
    )
    isb = DEFINITIONS[f"isb knee {side}"].angles(q)
    np.testing.assert_allclose(rotation.wrap(grood - isb * [1, 1, -1]), 0, atol=1e-9)


# What each ISB angle means, by where it moves a body: x forward, y up, z to the right
FORWARD, UP, RIGHT = np.eye(3)
LIMB = -UP  # what hangs below the joint
MOVES = {
    ("elbow", 0): (LIMB, FORWARD),
    ("elbow", 2): (
        FORWARD,
        -RIGHT,
    ),  # pronation turns a right palm that faces forward towards the body
    ("wrist", 0): (LIMB, FORWARD),  # towards the palm
    ("wrist", 1): (
        LIMB,
        -RIGHT,
    ),  # ulnar: the little finger's side, inwards where the palm faces forward
    ("wrist", 2): (FORWARD, -RIGHT),
    ("hip", 0): (LIMB, FORWARD),
    ("hip", 1): (LIMB, -RIGHT),
    ("hip", 2): (FORWARD, -RIGHT),
    ("knee", 0): (LIMB, -FORWARD),
    ("knee", 1): (LIMB, -RIGHT),
    ("knee", 2): (FORWARD, -RIGHT),
    ("ankle", 0): (FORWARD, UP),
    ("ankle", 1): (LIMB, -RIGHT),  # the sole turns inwards
    ("ankle", 2): (FORWARD, -RIGHT),
}


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize(("joint", "which"), MOVES)
def test_a_positive_angle_of_the_isb_moves_the_limb_as_its_name_says(joint, which, side):
    what, where = MOVES[joint, which]
    mirror = np.array(
        [1, 1, 1 if side == "right" else -1]
    )  # the left limb is the right one in a mirror
    angles = np.zeros((1, 3))
    angles[0, which] = np.radians(30)
    moved = rotation.rotate(DEFINITIONS[f"isb {joint} {side}"].rotation(angles), what * mirror)[0]
    assert (moved - what * mirror) @ (where * mirror) > 0.4


# Across the ends of ranges


def smooth_motion(definition, seed: int, n: int = 4000) -> np.ndarray:
    """Angles that swing far beyond their principal ranges, slowly from sample to sample."""
    generator = np.random.default_rng(seed)
    t = np.linspace(0, 1, n)
    turns = np.where(definition.periodic, 2.5 * np.pi, 0.6)
    waves = sum(
        generator.normal(size=3)
        * turns
        * np.sin(2 * np.pi * (k * t[:, None] + generator.uniform(size=3)))
        / k
        for k in (1, 2, 3)
    )
    return np.asarray(waves)


@EVERY
def test_a_smooth_motion_has_no_jump_when_it_is_followed(definition):
    wanted = smooth_motion(definition, 9)
    q = definition.rotation(wanted)
    angles = follow(definition, definition.angles(q))
    assert between(definition.rotation(angles), q).max() < 1e-9  # still the same rotations
    defined = definition.margins(angles).min(axis=1) > np.radians(5)
    steps = np.abs(np.diff(angles, axis=0))[defined[1:] & defined[:-1]]
    assert steps.max() < 0.3  # a turn is 6.3, half of one 3.1
    principal = np.abs(np.diff(definition.angles(q), axis=0))[defined[1:] & defined[:-1]]
    assert principal.max() > 3 or not any(
        definition.periodic
    )  # and without following there are jumps to avoid


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_a_followed_middle_angle_passes_through_the_lock_instead_of_turning_back(sequence):
    definition = Euler(sequence)
    lock = 0.0 if definition.symmetric else np.pi / 2
    middle = lock + np.radians(np.linspace(-40, 41, 200))
    wanted = np.column_stack([np.full(200, 0.4), middle, np.full(200, -0.9)])
    followed = follow(definition, definition.angles(definition.rotation(wanted)))
    direct = np.abs(followed[:, 1] - middle).max()
    mirrored = np.abs(
        followed[:, 1] - (2 * lock - middle)
    ).max()  # the other way of writing the same motion
    assert min(direct, mirrored) < 1e-7
    assert (
        np.abs(definition.angles(definition.rotation(wanted))[:, 1] - middle).max() > 0.5
    )  # which the principal one does not


def test_a_hinge_that_turns_and_turns_is_counted_on():
    turns = np.linspace(0, 20, 500)
    definition = Hinge((0.0, 1.0, 0.0))
    angles = follow(
        definition,
        definition.angles(rotation.from_rotation_vector(turns[:, None] * [0.0, 1.0, 0.0])),
    )
    np.testing.assert_allclose(np.ptp(angles[:, 0]), 20, atol=1e-9)
    assert np.diff(angles[:, 0]).min() > 0


def test_a_rotation_vector_grows_through_half_a_turn():
    definition, angle = RotationVector(), np.linspace(2.0, 3.6, 50)
    vectors = angle[:, None] * np.array(TILTED)
    np.testing.assert_allclose(
        follow(definition, definition.angles(definition.rotation(vectors))), vectors, atol=1e-9
    )


def test_gaps_are_passed_over():
    definition = Euler("ZXZ")
    wanted = np.column_stack([np.linspace(0, 9, 100), np.full(100, 1.0), np.linspace(0, -5, 100)])
    angles = definition.angles(definition.rotation(wanted))
    angles[40:45] = np.nan
    followed = follow(definition, angles)
    assert np.isnan(followed[40:45]).all()
    known = np.isfinite(followed[:, 0])
    np.testing.assert_allclose(np.diff((followed - wanted)[known], axis=0), 0, atol=1e-9)


def test_the_two_directions_across_an_axis_make_a_right_handed_frame():
    for axis in [(1.0, 0, 0), (0, -1.0, 0), (0, 0, 1.0), TILTED]:
        frame = np.vstack([across(axis), axis])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)
    np.testing.assert_array_equal(across((0.0, 0.0, 1.0)), np.eye(3)[:2])
