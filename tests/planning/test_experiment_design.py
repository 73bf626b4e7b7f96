import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from testbench import plan
from testbench.exceptions import CollisionError, Contact, InputError, NotFoundError
from testbench.model.calibration_information import (
    ObservationNoise,
    pose_information,
    predicted_sd,
    turn_information,
)
from testbench.planning import designed
from testbench.planning.designed import _gain, design_protocol
from testbench.planning.experiment_design import ACCELEROMETER_SIZE, Designer, Wanted
from testbench.planning.optimal_design import choose, efficiency, merit
from testbench.records.specs.protocol_file import load_protocol
from testbench.records.specs.robot import load_robot
from testbench.records.specs.shipped import shipped_folder

NOISE = ObservationNoise(0.001, np.radians(0.03), np.radians(0.01), np.radians(10 / 3600))


def test_predicted_uncertainty_is_that_of_repeated_fits():
    """Against plain linear regression of simulated poses, weighed as they scatter."""
    rng = np.random.default_rng(1)
    force = Rotation.random(20, rng=rng).apply([0, 0, 9.80665])
    noise = ObservationNoise(0.01, np.radians(0.2), 1.0, 1.0)
    stated = predicted_sd(pose_information(force, noise).sum(axis=0), ACCELEROMETER_SIZE)
    design = np.zeros((20, 3, 12))
    for i in range(3):
        design[:, i, 3 * i : 3 * i + 3] = force
        design[:, i, 9 + i] = 1
    information = pose_information(force, noise).sum(axis=0)
    found = []
    for _ in range(2000):
        turned = Rotation.from_rotvec(noise.direction * rng.standard_normal((20, 3))).apply(force)
        reading = turned + noise.force * rng.standard_normal((20, 3)) - force
        weighed = np.zeros(12)
        for f, X, y in zip(force, design, reading, strict=True):
            u = f / np.linalg.norm(f)
            across = np.eye(3) - np.outer(u, u)
            cov = noise.force**2 * np.eye(3) + (np.linalg.norm(f) * noise.direction) ** 2 * across
            weighed += X.T @ np.linalg.solve(cov, y)
        found.append(np.linalg.solve(information, weighed))
    np.testing.assert_allclose(np.std(found, axis=0), stated, rtol=0.08)


def test_what_nothing_shows_has_no_uncertainty():
    one_way = pose_information(np.array([[0, 0, 9.8], [0, 0, -9.8]]), NOISE).sum(axis=0)
    sd = predicted_sd(one_way, ACCELEROMETER_SIZE)
    assert np.isinf(sd[[0, 1, 3, 4, 6, 7]]).all()  # x and y were never felt
    assert np.isfinite(sd[[8, 11]]).all()
    turns = turn_information(
        np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.ones(2), np.zeros((2, 3)), NOISE
    )
    assert turns.shape == (2, 7, 7)


@settings(max_examples=15)
@given(st.integers(0, 1000), st.sampled_from(["D", "A"]))
def test_the_choice_beats_random_choices(seed, criterion):
    rng = np.random.default_rng(seed)
    force = Rotation.random(60, rng=rng).apply([0, 0, 9.80665])
    information = pose_information(force, NOISE)
    chosen = choose(information, 8, ACCELEROMETER_SIZE, criterion)
    scale = np.outer(ACCELEROMETER_SIZE, ACCELEROMETER_SIZE)

    def value(picks):
        return merit(np.eye(12) + information[picks].sum(axis=0) * scale, criterion)

    assert all(value(chosen) >= value(rng.choice(60, 8)) for _ in range(50))


def test_the_six_faces_are_found_where_only_they_and_their_like_are_offered():
    """With an exactly known direction the six faces are D-optimal among the 26 directions of a
    cube.
    """
    grid = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
    force = 9.80665 * grid / np.linalg.norm(grid, axis=1, keepdims=True)
    exact = ObservationNoise(0.01, 0.0, 1.0, 1.0)
    information = pose_information(force, exact)
    chosen = choose(information, 6, ACCELEROMETER_SIZE, "D")
    faces = [i for i, v in enumerate(grid) if np.abs(v).sum() == 1]
    ratio = efficiency(
        information[chosen].sum(axis=0), information[faces].sum(axis=0), ACCELEROMETER_SIZE, "D"
    )
    assert ratio == pytest.approx(1.0, abs=0.02) or ratio > 1


def test_gains_over_the_six_poses_of_the_reference(tmp_path):
    found = design_protocol(tmp_path / "better.yaml", "ur3e", "calibration_3d", None, Wanted())
    assert found.efficiency == pytest.approx(1.65, abs=0.02)
    assert "1.65 times against calibration_3d with as many visits" in found.sentence
    assert "known to 0.03 deg in each" in found.sentence
    ratio = {row.parameter: row.ratio for row in found.rows}
    assert ratio["acc_response_xy"] > 1.8
    assert (
        next(row for row in found.rows if row.parameter == "gyr_response_x").compared is None
    )  # six rests show no scale
    assert plan(tmp_path / "better.yaml").duration == found.plan.duration


def test_coming_back_to_the_same_poses_is_no_gain():
    designer = Designer(load_robot("ur3e"), load_protocol("calibration_3d").spec.sensors["forearm"])
    q, dwell = designer.poses_of(plan("calibration_3d"))
    for visits in (1, 2, 3):
        again = designer.judged(np.tile(q, (visits, 1)), [], dwell)
        assert _gain(designer, q, dwell, designer, again, Wanted(criterion="D")) == pytest.approx(
            1.0, abs=1e-9
        )


def test_the_shipped_design_is_what_the_command_makes(tmp_path):
    file = tmp_path / "calibration_optimal.yaml"
    design_protocol(file, "ur3e", "calibration_3d", None, Wanted())
    assert (
        file.read_text() == (shipped_folder("protocols") / "calibration_optimal.yaml").read_text()
    )


def test_another_arm_and_few_joints_will_do(tmp_path):
    found = design_protocol(
        tmp_path / "ur5e.yaml",
        "ur5e",
        "calibration_3d",
        None,
        Wanted(8, 3, ("wrist_1_joint", "wrist_2_joint")),
    )
    q, _ = Designer(
        found.plan.robot, load_protocol("calibration_3d").spec.sensors["forearm"]
    ).poses_of(found.plan)
    assert len(q) == 8
    np.testing.assert_allclose(
        q[:, [0, 1, 2, 5]], np.tile(found.plan.robot.home[[0, 1, 2, 5]], (8, 1)), atol=1e-9
    )


def test_an_arm_with_other_links_is_designed_for_and_compared_with_the_protocol_on_its_own_arm(
    tmp_path,
):
    """The GIMVEBO has three joints and three links, none of the names of the protocol's arm."""
    out = tmp_path / "gimbal.yaml"
    with pytest.raises(
        InputError, match=r"known: base_link, y_arm, x_arm, z_arm; .*--link, such as z_arm"
    ):
        design_protocol(out, "gimvebo", "calibration_3d", None, Wanted())
    found = design_protocol(out, "gimvebo", "calibration_3d", None, Wanted(8, 0), "z_arm")
    assert (found.compared, found.compared_on) == ("calibration_3d", "ur3e")
    assert "against calibration_3d on ur3e" in found.sentence
    written = load_protocol(out)
    assert written.spec.sensors["forearm"].link == "z_arm"
    assert "in the link z_arm: correct it" in out.read_text()
    own = Designer(load_robot("ur3e"), load_protocol("calibration_3d").spec.sensors["forearm"])
    q, dwell = own.poses_of(plan("calibration_3d"))
    before = own.judged(
        q, [], dwell
    ).accelerometer  # the six poses tell the same of the sensor, whatever arm is designed for
    assert {
        row.parameter: row.compared for row in found.rows if row.parameter in before
    } == pytest.approx(before)
    elsewhere = Designer(load_robot("gimvebo"), written.spec.sensors["forearm"])
    q, _ = elsewhere.poses_of(plan(written))
    force = elsewhere.force(q) / 9.80665
    assert (
        np.linalg.eigvalsh(force.T @ force / len(force))[0] > 0.1
    )  # every axis of the sensor feels gravity


def test_a_pose_that_no_clear_way_leads_to_is_replaced(tmp_path, monkeypatch):
    refused = []

    def checked(draft):
        planned = check(draft)
        if not refused:
            refused.append(tuple(Designer(planned[1].robot, sensor).poses_of(planned[1])[0][2]))
            contact = Contact("base_link", "z_arm", -0.001, 1.0, "pose 3")
            raise designed._NoWay(2, CollisionError(contact, 0.005, contact))
        return planned

    check, sensor = designed._checked, load_protocol("gimvebo_gyro").spec.sensors["imu"]
    monkeypatch.setattr(designed, "_checked", checked)
    found = design_protocol(
        tmp_path / "gimbal.yaml", "gimvebo", "calibration_3d", None, Wanted(8, 0), "z_arm"
    )
    poses = Designer(found.plan.robot, sensor).poses_of(found.plan)[0]
    assert len(poses) == 8
    assert not np.isclose(poses, refused[0], atol=1e-9).all(axis=1).any()


def test_refusals(tmp_path):
    out = tmp_path / "x.yaml"
    with pytest.raises(NotFoundError, match="known: shoulder_pan_joint"):
        design_protocol(out, "ur3e", "calibration_3d", None, Wanted(joints=("knee",)))
    with pytest.raises(InputError, match="say which with --sensor"):
        design_protocol(out, "ur3e", "elbow_flexion", None, Wanted())
    with pytest.raises(InputError, match="no static pose"):
        design_protocol(out, "ur3e", "static_noise", "dot", Wanted())
    with pytest.raises(InputError, match="called after its file"):
        design_protocol(tmp_path / "no name.yaml", "ur3e", "calibration_3d", None, Wanted())
    with pytest.raises(InputError, match=r"is a \.yaml file"):
        design_protocol(tmp_path / "x.txt", "ur3e", "calibration_3d", None, Wanted())
    assert not list(tmp_path.iterdir())
    out.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        design_protocol(out, "ur3e", "calibration_3d", None, Wanted())
