"""What places the sensors of a body: the pose, the joint's centre, the way it faces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.joints.angle_sd import INCLINATION_SD, AngleBudget, angle_sd
from testbench.estimation.joints.facing import Facing, Relative, Unknown, find_facing
from testbench.estimation.joints.heading_drift import heading_drift
from testbench.estimation.joints.joint_centre import heading_by_centre
from testbench.estimation.joints.limb import Limb, limbs_of
from testbench.estimation.joints.placement import by_pose
from testbench.estimation.joints.standing import find_standing
from testbench.model import rotation
from testbench.model.decomposition import Euler
from testbench.records.specs.anatomy import kind_of, side_of
from testbench.records.specs.protocol import BodyJoint

HZ = 50.0
TIME = np.arange(0, 20, 1 / HZ)
TIME_NS = np.round(1e9 * TIME).astype(np.int64)
MOVING = np.clip((TIME - 2) / 2, 0, 1)
G = np.array([0.0, 0.0, 9.80665])


def quaternions(turns: Rotation) -> np.ndarray:
    return turns.as_quat(scalar_first=True)


def leg(heading: float, sign: int = 1, carried: float = 0.3) -> Limb:
    """Thigh and shank that face along x, their hinge to the right (-y); the shank's earth is turned
    so that `heading` brings it to the thigh's.
    """
    swing = 0.5 * MOVING * np.sin(2 * np.pi * 0.7 * TIME)
    bent = sign * MOVING * (0.6 - 0.6 * np.cos(2 * np.pi * 0.7 * TIME))
    lean = carried * MOVING * np.sin(2 * np.pi * 0.31 * TIME)
    right = np.array([0.0, -1.0, 0.0])
    thigh = Rotation.from_euler("Z", 0.3 * lean[:, None]) * Rotation.from_rotvec(
        np.outer(swing, right)
    )
    shank = thigh * Rotation.from_rotvec(np.outer(-bent, right))
    hip = np.column_stack([0.15 * MOVING * np.sin(2 * np.pi * 1.1 * TIME), lean * 0.2, 0 * TIME])
    knee = hip + thigh.apply([0, 0, -0.4])
    places = {
        "thigh": hip + thigh.apply([0.05, 0, -0.2]),
        "shank": knee + shank.apply([0, 0, -0.2]),
    }
    draw = np.random.default_rng(1)
    q, acc = {}, {}
    for name, turns, apart in (("thigh", thigh, 0.0), ("shank", shank, -heading)):
        own = Rotation.from_euler("Z", apart) * turns * Rotation.random(rng=draw)
        a = np.gradient(np.gradient(places[name], axis=0), axis=0) * HZ**2
        acc[name] = own.inv().apply(Rotation.from_euler("Z", apart).apply(a) + G)
        q[name] = quaternions(own)
    return Limb(TIME_NS, q, acc)


KNEE = {"knee_r": BodyJoint(proximal="thigh", distal="shank", definition="knee")}
KINDS = {"knee_r": kind_of("knee_r")}


@pytest.mark.parametrize("heading", [0.0, 2.0, -2.9])
def test_the_centre_of_a_joint_tells_how_the_earths_of_its_sensors_are_turned(heading):
    found = heading_by_centre(leg(heading), "thigh", "shank")
    assert found is not None
    assert np.degrees(abs(np.angle(np.exp(1j * (found.heading - heading))))) < 3 * np.degrees(
        found.sd
    )
    assert np.degrees(found.sd) < 4


def test_a_limb_that_hardly_moves_tells_no_heading():
    limb = leg(1.0)
    still = {name: np.repeat(own[:1], len(own), axis=0) for name, own in limb.q.items()}
    acc = {name: np.repeat(own[:1], len(own), axis=0) for name, own in limb.acc.items()}
    assert heading_by_centre(Limb(TIME_NS, still, acc), "thigh", "shank") is None


def faced(limb: Limb, heading: float = 0.0, **more) -> Facing | Unknown:
    standing = find_standing(limb, None)
    assert standing is not None
    relative = {"knee_r": Relative(heading, 0.05, "told")}
    return find_facing(limb, KNEE, KINDS, standing, more.get("forward", {}), relative)


@pytest.mark.parametrize("heading", [0.0, 1.3])
def test_a_knee_that_flexes_shows_which_way_its_owner_faces(heading):
    found = faced(leg(heading), heading)
    assert isinstance(found, Facing)
    assert np.degrees(abs(found.heading["thigh"])) < 5
    assert np.degrees(abs(np.angle(np.exp(1j * (found.heading["shank"] + heading))))) < 5


def test_a_knee_that_seems_to_flex_forwards_faces_the_other_way():
    found = faced(leg(0.0, sign=-1))
    assert isinstance(found, Facing)
    assert np.degrees(abs(found.heading["thigh"])) > 170


def test_a_stated_axis_counts_more_than_the_motion_and_must_not_be_upright():
    limb = leg(0.0)
    standing = find_standing(limb, None)
    forwards = Rotation.from_quat(standing.q["thigh"], scalar_first=True).inv()
    found = faced(limb, forward={"thigh": forwards.apply([0.0, 1.0, 0.0])})
    assert isinstance(found, Facing)
    assert np.degrees(found.heading["thigh"]) == pytest.approx(90, abs=1)
    upright = faced(limb, forward={"thigh": forwards.apply([0.0, 0.0, 1.0])})
    assert isinstance(upright, Unknown) and "vertical" in upright.why


def test_in_the_standing_pose_segments_are_upright_and_face_forwards():
    limb = leg(0.7)
    standing, facing = find_standing(limb, None), faced(limb, 0.7)
    assert standing.begin_ns < 0.5e9 and standing.end_ns > 1.5e9
    for name in ("thigh", "shank"):
        placed = by_pose(name, standing, facing, np.radians(2))
        axes = Rotation.from_quat(placed.segment(standing.q[name][None])[0], scalar_first=True)
        np.testing.assert_allclose(axes.apply([0, 1, 0]), [0, 0, 1], atol=1e-6)
        np.testing.assert_allclose(axes.apply([1, 0, 0]), [1, 0, 0], atol=1e-6)


def test_joints_that_share_sensors_belong_to_one_limb():
    ends = {"a": ("p", "q"), "b": ("r", "s"), "c": ("q", "r"), "d": ("x", "y")}
    joints = {
        name: BodyJoint(proximal=one, distal=two, sequence="ZXY")
        for name, (one, two) in ends.items()
    }
    assert sorted(sorted(own) for own in limbs_of(joints)) == [["a", "b", "c"], ["d"]]


def test_the_uncertainty_of_angles_is_that_of_the_segments_drawn_at_random():
    draw = np.random.default_rng(3)
    upright = Rotation.from_euler("X", 90, degrees=True)
    thigh = upright * Rotation.from_euler("ZXY", [[0.4, 0.1, 0.2]])
    shank = thigh * Rotation.from_euler("ZXY", [[-1.0, 0.15, 0.1]])
    sd, turn, euler = np.radians(2.0), np.radians(3.0), Euler("ZXY")
    budget = AngleBudget(
        sd**2 * np.eye(3), sd**2 * np.eye(3), np.zeros((3, 3)), turn, 0.0, None, False
    )
    stated = angle_sd(np.zeros(1), quaternions(thigh), quaternions(shank), euler, budget)[0]
    n = 4000
    off = [Rotation.from_rotvec(sd * draw.standard_normal((n, 3))) for _ in range(2)]
    away = Rotation.from_euler("Z", turn * draw.standard_normal((n, 1)))
    level = [
        Rotation.from_rotvec(INCLINATION_SD * draw.standard_normal((n, 3)) * [1, 1, 0])
        for _ in range(2)
    ]
    drawn = (level[0] * thigh * off[0]).inv() * (level[1] * away * shank * off[1])
    spread = euler.angles(quaternions(drawn)).std(axis=0)
    np.testing.assert_allclose(stated, spread, rtol=0.06)


def drawn_hinges(off_deg: float, beside_deg: float, n: int = 150) -> tuple[np.ndarray, np.ndarray]:
    """Knees of n persons, by rotations of SciPy: errors of the three angles and what is stated of
    them [deg], RMS over the persons, at each of 300 instants of 12 s.

    An axis lies 2 deg off anatomy about each axis across it, a zero of either segment 2 deg off;
    what filters are wrong by comes and goes with `off_deg` (RMS about each axis across).

    Args:
        off_deg: Of the filters.
        beside_deg: Amplitude that the knees really adduct by [deg].
        n: Persons.
    """
    draw, time = np.random.default_rng(8), np.arange(300) / 25
    bent = Rotation.from_euler("Z", np.radians(-30 + 30 * np.cos(2 * np.pi * time))[:, None])
    posture, euler = np.radians(2.0), Euler("ZXY")
    small = np.radians(0.3) ** 2 * np.diag([1.0, 1.0, 0.0])
    zero, lie = posture**2 * np.diag([0.0, 0.0, 1.0]), posture**2 * np.diag([1.0, 1.0, 0.0])
    stamps, errors, stated = np.round(1e9 * time).astype(np.int64), [], []
    upright = Rotation.from_euler("X", 90, degrees=True)
    budget = AngleBudget(small + zero, small + zero, lie, 0.0, 0.0, None, False, hinged=True)
    for _ in range(n):
        axis = Rotation.from_rotvec(posture * np.append(draw.standard_normal(2), 0.0))
        phases, rates = draw.uniform(0, 2 * np.pi, 2), draw.uniform(0.2, 0.7, 2)
        waves = np.sin(2 * np.pi * np.outer(time, rates) + phases) * np.sqrt(2)
        wrong = Rotation.from_rotvec(np.radians(off_deg) * np.column_stack([waves, 0 * time]))
        adducts = np.radians(beside_deg) * np.sin(2 * np.pi * 0.9 * time + phases[0])
        beside = Rotation.from_euler("X", adducts[:, None])
        apart = Rotation.from_euler("Z", np.sqrt(2) * posture * draw.standard_normal())
        true = axis * bent * beside * axis.inv()
        found = apart * bent * beside * wrong
        angles = [euler.angles(quaternions(own)) for own in (found, true)]
        errors.append(angles[0] - angles[1])
        poses = quaternions(upright * Rotation.identity(300)), quaternions(upright * found)
        stated.append(angle_sd(stamps, *poses, euler, budget))
    rms = [np.degrees(np.sqrt(np.mean(np.square(own), axis=0))) for own in (errors, stated)]
    return rms[0], rms[1]


@pytest.mark.parametrize("off_deg", [0.02, 0.2])
def test_errors_across_the_axis_of_a_hinge_are_stated_as_the_recording_shows_them(off_deg):
    spread, stated = drawn_hinges(off_deg, 0.0)
    assert np.abs(stated / spread - 1)[:, 0].max() < 0.15  # 150 persons: 6 % standard deviation
    bent = spread[:, 1:] > 0.05  # unbent, an axis off anatomy changes next to nothing
    assert np.abs(stated[:, 1:] / spread[:, 1:] - 1)[bent].mean() < 0.12
    assert stated[:, 1:].min() > 0.8 * off_deg


def test_a_knee_that_moves_beside_its_axis_is_no_surer_than_filters_and_skin_let_it_be():
    _, stated = drawn_hinges(0.02, 4.0)
    unbent = stated[:, 1:].min(axis=0)
    # 0.3 deg of axis in either sensor, and of inclination of either filter (about level axes)
    assert (unbent > 0.3 * np.sqrt(2) * 0.95).all() and (unbent < 0.7).all()


def test_names_tell_joints_and_sides():
    assert kind_of("RKnee") == "knee" and kind_of("left_hip") == "hip" and kind_of("bend") is None
    assert side_of("RFemur") == "right" and side_of("knee_l") == "left"
    assert side_of("knee", "LTibia") == "left" and side_of("knee", "shank") is None


def test_a_heading_astray_is_seen_from_the_bias_that_a_rest_shows():
    bias, believed = np.array([0.004, -0.003, 0.01]), np.array([0.0, 0.0, 0.002])
    rate = 0.3 * np.sin(TIME)[:, None] * [1.0, 0.5, 0.7] * (TIME < 15)[:, None]
    q = [np.array([1.0, 0.0, 0.0, 0.0])]
    for own in rate[1:] + bias - believed:
        turn = rotation.from_rotation_vector(own / HZ)
        q.append(rotation.normalise(rotation.multiply(q[-1], turn)))
    read = rate + bias + np.random.default_rng(2).normal(0, 0.005, rate.shape)
    found = heading_drift(TIME_NS, np.array(q), read, TIME > 15.2)
    assert found is not None
    level = rotation.rotate(np.array(q)[1:], believed - bias)[:, 2]
    wanted = np.sum(level) / HZ
    sd = np.hypot(found.rate_sd * TIME[-1], found.walk * np.sqrt(TIME[-1]))
    assert abs(found.astray[-1] - wanted) < 3 * sd and sd < 0.5 * abs(wanted)
    assert found.rate_sd == pytest.approx(0.005 / np.sqrt(HZ * 4.8), rel=0.6)
    assert heading_drift(TIME_NS, np.array(q), read, TIME > 19.5) is None


def test_what_headings_drifted_apart_by_widens_angles_on_both_sides_of_the_pose():
    upright = np.tile(quaternions(Rotation.from_euler("X", 90, degrees=True)), (3, 1))
    budget = AngleBudget(
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        0.0,
        0.0,
        int(1e9),
        True,
        drifted=np.radians([20.0, 0.0, 5.0]) ** 2,
    )
    times = np.round(1e9 * np.arange(3)).astype(np.int64)
    stated = angle_sd(times, upright, upright, Euler("ZXY"), budget)
    np.testing.assert_allclose(np.degrees(stated[:, 2]), [20.0, 0.0, 5.0], atol=1e-6)
