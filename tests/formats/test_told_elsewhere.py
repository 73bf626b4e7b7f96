"""What goes out to other programs and comes in from them: places, times, numbers, sides."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from scipy.spatial.transform import Rotation

from testbench.estimation.signals.uniform import fill_gaps
from testbench.formats.exporters import ExportSource
from testbench.formats.exporters.frame_tree import frame_tree
from testbench.formats.truth.robot_log import RobotLog, logged_truth
from testbench.model.joint_angle import decomposition_of
from testbench.model.kinematics import Kinematics, Pose
from testbench.records.disk.tables import to_arrow
from testbench.records.results.estimate import ClockFit
from testbench.records.results.numbers import show_number
from testbench.records.specs.joint_definition import FlexionAngle
from testbench.records.specs.robot import load_robot
from tests.estimation.test_uniform import samples
from tests.model.test_robot_truth import dh_frames


def chained(frame: str, moment: int, fixed, groups) -> tuple[np.ndarray, Rotation]:
    """Place [m] and axes of a frame in the world, as a reader of the tree chains them."""
    place, turned = np.zeros(3), Rotation.identity()
    while frame != "world":
        group, i = next(
            (group, i)
            for group in (fixed, *groups)
            for i, (_, child) in enumerate(group.frames)
            if child == frame
        )
        row = 0 if group is fixed else int(np.searchsorted(group.time_ns, moment))
        own = Rotation.from_quat(group.q_parent_from_child[i][row], scalar_first=True)
        place, turned = own.apply(place) + group.translation[i][row], own * turned
        frame = group.frames[i][0]
    return place, turned


def test_the_tree_of_frames_leads_to_where_the_makers_numbers_say_the_flange_is(quick):
    source = ExportSource(quick.session, quick.estimate, "vqf_6d")
    fixed, groups = frame_tree(source)
    arm = source.arm
    base = Rotation.from_euler("z", np.pi)  # the maker's Base is turned against the URDF's
    moving = next(group for group in groups if len(group.frames) > 1)
    for moment in moving.time_ns[:: len(moving.time_ns) // 7]:
        row = int(np.searchsorted(arm.host_time_ns, moment))
        flange = dh_frames("ur3e", arm.q_measured[row : row + 1])[6][0]
        place, turned = chained("tool0", moment, fixed, groups)
        np.testing.assert_allclose(place, base.apply(flange[:3, 3]), atol=1e-6)
        wanted = base * Rotation.from_matrix(flange[:3, :3])
        assert (turned.inv() * wanted).magnitude() < 1e-6


@pytest.mark.parametrize("sensor", ["arm", "forearm"])
def test_sensors_stand_in_the_tree_where_they_are_mounted(quick, sensor):
    source = ExportSource(quick.session, quick.estimate, "vqf_6d")
    fixed, groups = frame_tree(source)
    mounted, kinematics = quick.session.analysis.sensors[sensor], Kinematics(load_robot("ur3e"))
    assert np.linalg.norm(mounted.mounting.position_mm) > 5
    moving = next(group for group in groups if len(group.frames) > 1)
    moment = moving.time_ns[len(moving.time_ns) // 2]
    row = int(np.searchsorted(source.arm.host_time_ns, moment))
    q, pose = source.arm.q_measured[row : row + 1], Pose.from_placement(mounted.mounting)
    wanted = kinematics.frame_motion(mounted.link, q, offset=pose).position[0]
    np.testing.assert_allclose(
        chained(f"imu_{sensor}", moment, fixed, groups)[0], wanted, atol=1e-6
    )
    own = next(g for g in groups if g.frames == [("world", f"imu_{sensor}_estimated")])
    near = int(np.searchsorted(own.time_ns, moment))
    assert np.linalg.norm(own.translation[0][near] - wanted) < 0.02
    assert np.linalg.norm(own.translation[0], axis=1).min() > 0.1


@pytest.mark.parametrize("jittered", [False, True])
def test_a_logs_times_are_shifted_by_what_is_added_to_them(jittered):
    kinematics = Kinematics(load_robot("ur3e"))
    t = np.arange(200) * 0.01
    if jittered:
        t = t + 0.004 * np.random.default_rng(0).random(200)
    q = np.tile(np.radians([10.0, -90, 20, 0, 30, 0]), (200, 1))
    q[:, 5] = 0.4 * np.sin(3 * t)
    time_ns = np.round(t * 1e9).astype(np.int64)
    log = RobotLog(time_ns, q)
    lever = Pose(np.eye(3), np.array([0.2, 0.0, 0.1]))
    truth = logged_truth(kinematics, log, "wrist_3_link", lever, 7_000_000_000)
    np.testing.assert_array_equal(truth.host_time_ns, time_ns + 7_000_000_000)
    motion = kinematics.frame_motion("wrist_3_link", q, offset=lever)
    np.testing.assert_allclose(truth.q_world_from_sensor, motion.q_world_from_frame, atol=1e-6)
    assert (truth.rate is None) == jittered
    if not jittered:
        v, a = np.zeros_like(q), np.zeros_like(q)
        v[:, 5], a[:, 5] = 1.2 * np.cos(3 * t), -3.6 * np.sin(3 * t)
        moved = kinematics.frame_motion("wrist_3_link", q, v, a, lever)
        force = moved.specific_force_in_frame(np.array([0, 0, -9.80665]))
        np.testing.assert_allclose(truth.force[10:-10], force[10:-10], atol=0.02)


@pytest.mark.parametrize("kind", ["hip", "knee", "ankle"])
def test_what_is_inwards_for_one_side_is_outwards_for_the_other(kind):
    """A right leg and its mirror image (x forward, y up, z to the right) have the same angles."""
    turn = Rotation.from_euler("ZXY", [30, 12, -7], degrees=True)
    mirror = np.diag([1.0, 1.0, -1.0])
    mirrored = Rotation.from_matrix(mirror @ turn.as_matrix() @ mirror)
    found = []
    for side, own in (("right", turn), ("left", mirrored)):
        definition = FlexionAngle(definition={"isb": kind, "side": side})
        q = own.as_quat(scalar_first=True)[None]
        found.append(decomposition_of(definition).angles(q)[0])
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    assert np.abs(found[0][1:]).min() > 0.1


def test_a_force_is_not_invented_over_a_hole_longer_than_a_quarter_of_a_second():
    for missing, invented in ((10, True), (40, False)):
        kept = np.setdiff1d(np.arange(100), np.arange(30, 30 + missing))
        uniform, _ = fill_gaps(samples(kept), ClockFit())
        assert np.isfinite(uniform.gyr).all()
        assert np.isfinite(uniform.acc[30 : 30 + missing]).all() == invented
        assert np.isfinite(uniform.acc[:30]).all()


def test_a_number_that_a_column_cannot_hold_is_refused():
    assert to_arrow(np.array([1, 255]), pa.int16()).to_pylist() == [1, 255]
    with pytest.raises(OverflowError):
        to_arrow(np.array([1, 40_000]), pa.int16())


def test_a_small_number_is_not_shown_as_nothing():
    assert show_number(0.0001234) == "0.00012"
    assert show_number(0.0) == "0.000"
    assert show_number(3.14159) == "3.142"
    assert show_number(1234.5) == "1234.5"
