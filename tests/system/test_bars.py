"""What the bench promises, measured: geometry of the shipped protocols, ideal sensors, presets,
clocks.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench import execute, plan
from testbench.estimation import estimate
from testbench.evaluation import evaluate
from testbench.exceptions import CollisionError, LimitError, SensorRangeError
from testbench.model import rotation
from testbench.model.imu import TriadModel
from testbench.model.joint_angle import joint_angles, segment_orientation
from testbench.model.kinematics import Kinematics, Pose
from testbench.planning.expansion import expand
from tests.asking import planned

G = 9.80665
# Castellanos Alonso (2023), table 5.6: mean |flexion error| of the vendor's filter at flexions of
# 0, 5, ..., 70 deg.
PUBLISHED_DEVICE_DEG = [
    0,
    0.09,
    0.13,
    0.15,
    0.18,
    0.21,
    0.21,
    0.22,
    0.24,
    0.27,
    0.29,
    0.33,
    0.36,
    0.41,
    0.46,
]


@pytest.fixture(scope="module")
def elbow_flexion(run_protocol):
    """The protocol, run once; its files must not be changed."""
    return run_protocol("elbow_flexion")


@pytest.fixture(scope="module")
def the_plan():
    return planned("elbow_flexion")


@pytest.fixture(scope="module")
def commanded(the_plan):
    """Every pose of the protocol's evaluation section: variables and joint angles [rad]."""
    commands = [c for c in expand(the_plan.protocol, the_plan.robot) if c.section == "evaluation"]
    return [c.variables for c in commands], np.array([c.target for c in commands])


def test_the_six_calibration_poses_turn_the_faces_up_that_the_reference_names(the_plan):
    kinematics = Kinematics(the_plan.robot)
    sensor = the_plan.protocol.spec.sensors["forearm"]
    poses = [
        c.target for c in expand(the_plan.protocol, the_plan.robot) if c.section == "calibration_3d"
    ]
    motion = kinematics.frame_motion(
        sensor.link, np.array(poses), offset=Pose.from_placement(sensor.mounting)
    )
    force = motion.specific_force_in_frame(the_plan.robot.gravity) / G
    rows = [[0, -1, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [-1, 0, 0], [1, 0, 0]]  # matrix (3.3)
    np.testing.assert_allclose(force, rows, atol=1e-9)


def test_the_protocol_on_its_own_agrees_with_the_one_that_includes_it(the_plan):
    own = plan("calibration_3d")
    included = [
        c.target for c in expand(the_plan.protocol, the_plan.robot) if c.section == "calibration_3d"
    ]
    np.testing.assert_array_equal([c.target for c in expand(own.protocol, own.robot)], included)
    assert (
        own.protocol.spec.sensors["forearm"].mounting
        == the_plan.protocol.spec.sensors["forearm"].mounting
    )


def test_the_315_poses_are_the_references(commanded):
    variables, targets = commanded
    expected = [(d, f) for d in range(-20, 21, 2) for f in range(0, 71, 5)]
    assert [(v["misalignment_deg"], v["flexion_deg"]) for v in variables] == expected
    for (d, f), target in zip(expected, targets, strict=True):
        np.testing.assert_allclose(
            np.degrees(target), [180 + d, -90, -90, 0, 90 - d, f], atol=1e-12
        )


def ideal_angles(the_plan, targets: np.ndarray, sequence: str) -> np.ndarray:
    """Euler angles that sensors without errors would give [rad]."""
    kinematics = Kinematics(the_plan.robot)
    segments = {}
    for name, sensor in the_plan.protocol.spec.sensors.items():
        motion = kinematics.frame_motion(
            sensor.link, targets, offset=Pose.from_placement(sensor.mounting)
        )
        segments[name] = segment_orientation(motion.q_world_from_frame, sensor)
    return joint_angles(segments["arm"], segments["forearm"], sequence)


def test_zxz_gives_the_commanded_flexion_in_all_315_poses_whatever_the_misalignment(
    the_plan, commanded
):
    variables, targets = commanded
    flexion = np.radians([v["flexion_deg"] for v in variables])
    np.testing.assert_allclose(
        ideal_angles(the_plan, targets, "ZXZ")[:, 1], flexion, rtol=0, atol=1e-9
    )


def test_yxz_mixes_misalignment_into_the_flexion_as_the_reference_found(the_plan, commanded):
    variables, targets = commanded
    middle = np.degrees(ideal_angles(the_plan, targets, "YXZ")[:, 1])
    by_pose = {
        (v["misalignment_deg"], v["flexion_deg"]): angle
        for v, angle in zip(variables, middle, strict=True)
    }
    assert by_pose[20, 70] == pytest.approx(-62.01, abs=0.005)
    assert by_pose[20, 30] == pytest.approx(-28.02, abs=0.005)
    assert by_pose[0, 70] == pytest.approx(-70, abs=1e-7)
    # the law behind it, from the reference: sin(angle) = sin(flexion) cos(misalignment)
    for (d, f), angle in by_pose.items():
        expected = -np.degrees(np.arcsin(np.sin(np.radians(f)) * np.cos(np.radians(d))))
        assert angle == pytest.approx(expected, abs=1e-7)


def test_the_misalignment_turns_the_upper_arm_about_the_vertical_and_nothing_else(the_plan):
    kinematics = Kinematics(the_plan.robot)
    d = np.arange(-20, 21, 2.0)
    targets = np.radians(
        np.column_stack([180 + d, *[np.full_like(d, x) for x in (-90, -90, 0)], 90 - d, 0 * d])
    )
    for link, heading in (("wrist_1_link", d), ("wrist_2_link", 0 * d), ("wrist_3_link", 0 * d)):
        R = Rotation.from_matrix(kinematics.frame_motion(link, targets).R_world_from_frame)
        turn = (R * R[10].inv()).as_rotvec(degrees=True)
        np.testing.assert_allclose(
            turn, np.column_stack([0 * d, 0 * d, heading]), atol=1e-9, err_msg=link
        )


def mean_abs_error_deg(evaluation, name: str, misalignment_deg: float | None = None) -> float:
    rows = [
        row.flexion_mean_abs_error_deg
        for row in evaluation.joint_angle
        if row.filter == name
        and row.sequence == "ZXZ"
        and misalignment_deg in (None, row.misalignment_deg)
    ]
    assert len(rows) == (315 if misalignment_deg is None else 15)
    return float(np.mean(rows))


def test_ideal_sensors_show_the_commanded_flexion_to_two_hundredths_of_a_degree(
    altered_protocol, run_protocol
):
    """In every flexion at the middle and the two ends of the misalignments, between which the
    theory above holds.
    """

    def make_ideal(spec):
        spec["variables"]["misalignment_deg"] = [-20, 0, 20]
        spec["estimate"] |= {"filters": ["device"], "filter_parameters": {}}
        spec["accept"] = [row for row in spec["accept"] if row["filter"] == "device"]
        for sensor in spec["sensors"].values():
            sensor["preset"] = "ideal"

    result = run_protocol(altered_protocol("elbow_flexion", make_ideal))
    rows = [row for row in result.evaluation.joint_angle if row.sequence == "ZXZ"]
    assert len(rows) == 3 * 15
    assert all(row.n > 60 for row in rows)
    assert max(row.flexion_max_abs_error_deg for row in rows) < 0.02
    # and the other sequence is as wrong as geometry makes it
    yxz = {
        (row.misalignment_deg, row.flexion_deg): row
        for row in result.evaluation.joint_angle
        if row.sequence == "YXZ"
    }
    assert yxz[20, 70].flexion_mean_error_deg == pytest.approx(62.01 - 70, abs=0.03)
    assert yxz[0, 70].flexion_mean_error_deg == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize("name", ["device", "vqf_6d", "vqf_9d"])
def test_the_presets_stay_at_or_below_the_published_error_in_the_mean(elbow_flexion, name):
    assert mean_abs_error_deg(elbow_flexion.evaluation, name) <= np.mean(PUBLISHED_DEVICE_DEG)
    assert mean_abs_error_deg(elbow_flexion.evaluation, name, 0.0) <= np.mean(PUBLISHED_DEVICE_DEG)


def test_a_protocol_with_the_calibration_poses_finds_the_errors_its_simulated_sensor_has(
    elbow_flexion,
):
    sensor = elbow_flexion.session.analysis.sensors["forearm"]
    parameters = sensor.imu()
    real = TriadModel(
        parameters.accelerometer.triad(), parameters.rate_hz, 1, "forearm", "accelerometer"
    ).errors
    fit = elbow_flexion.estimate.sensors["forearm"].calibration
    assert fit.poses >= 6
    assert np.abs(real.bias).max() > 0.03
    np.testing.assert_allclose(fit.acc_bias, real.bias, atol=0.02)
    np.testing.assert_allclose(fit.acc_matrix @ real.matrix, np.eye(3), atol=3e-3)


def test_every_pose_of_the_protocol_is_judged_on_most_of_its_dwell(elbow_flexion):
    rows = [
        row
        for row in elbow_flexion.evaluation.joint_angle
        if row.filter == "vqf_6d" and row.sequence == "ZXZ"
    ]
    assert len(rows) == 315
    assert min(row.n for row in rows) > 60 * 1.2  # of 2 s at 60 Hz


def test_the_unknown_headings_of_the_devices_are_taken_out_by_the_reference_pose(elbow_flexion):
    headings = {
        name: sensor.frames["device"].heading_deg
        for name, sensor in elbow_flexion.estimate.sensors.items()
    }
    assert abs(headings["arm"] - headings["forearm"]) > 5  # each power-up has its own
    rows = [row for row in elbow_flexion.evaluation.orientation if row.filter == "device"]
    assert len(rows) == 2
    for row in rows:
        assert row.heading_rmse_deg < 2 and row.inclination_rmse_deg < 0.5


@pytest.fixture(scope="module")
def skewed_clocks(altered_protocol, tmp_path_factory):
    """`elbow_flexion` by other parts, at 60 Hz, whose clocks are 50 ms ahead and 100 ppm fast."""

    def skew(spec):
        for sensor in spec["sensors"].values():
            sensor["parameters"] = {
                "clock": {"offset_ms": 50, "drift_ppm": 100, "offset_sd_ms": 0, "drift_sd_ppm": 0}
            }

    session = execute(
        plan(altered_protocol("elbow_flexion", skew)), tmp_path_factory.mktemp("logs"), seed=2
    )
    return session, estimate(session, ["device", "vqf_6d", "vqf_9d"])


@pytest.mark.parametrize("sensor", ["arm", "forearm"])
def test_an_offset_of_50_ms_and_a_drift_of_100_ppm_are_recovered(skewed_clocks, sensor):
    session, estimated = skewed_clocks
    assert session.manifest.sensors[sensor].rate_hz == 60
    fit = estimated.sensors[sensor].clock
    assert fit.offset_s * 1e3 == pytest.approx(50, abs=2)
    assert fit.drift_ppm == pytest.approx(100, abs=20)
    # and what is stated is neither a boast nor a shrug
    assert abs(fit.offset_s - 0.05) < 6 * fit.offset_sd_s
    assert abs(fit.drift_ppm - 100) < 6 * fit.drift_sd_ppm
    assert fit.offset_sd_s < 2e-3 and fit.drift_sd_ppm < 20


@pytest.mark.slow
def test_the_presets_stay_at_or_below_the_published_error_with_other_parts_and_clocks_too(
    skewed_clocks,
):
    evaluation = evaluate(*skewed_clocks)
    errors = [mean_abs_error_deg(evaluation, name) for name in ("device", "vqf_6d", "vqf_9d")]
    assert np.max(errors) <= np.mean(PUBLISHED_DEVICE_DEG)


def test_a_pose_that_folds_the_forearm_into_the_base_is_refused_by_name(altered_protocol):
    def fold(spec):
        pose = {"name": "folded", "move_to_deg": [0, -60, -160, -90, 90, 0]}
        spec["sections"].append({"name": "too_far", "steps": [pose]})

    with pytest.raises(CollisionError) as caught:
        plan(altered_protocol("quick", fold))
    error = caught.value
    assert {error.first, error.second} & {"base_link_inertia", "shoulder_link", "upper_arm_link"}
    assert error.step == "folded"
    assert error.clearance <= error.margin
    assert error.exit_code == 2
    for part in (error.first, error.second, "folded", "quick.yaml:"):
        assert part in str(error)


def test_a_joint_beyond_its_limit_is_refused_with_joint_time_value_and_limit(altered_protocol):
    def turn_too_far(spec):
        spec["sections"].append(
            {
                "name": "far",
                "steps": [{"name": "round", "move_to_deg": {"shoulder_pan_joint": 361}}],
            }
        )

    with pytest.raises(
        LimitError,
        match=r"joint shoulder_pan_joint: position 36\d\.\d\d deg exceeds 360\.00 deg.*'round'",
    ):
        plan(altered_protocol("quick", turn_too_far))


def test_a_motion_that_would_saturate_a_gyroscope_is_refused_by_sensor(altered_protocol):
    def dull(spec):
        spec["sensors"]["forearm"]["parameters"] = {"gyroscope": {"range_deg_s": 30}}

    with pytest.raises(
        SensorRangeError, match=r"sensor forearm: angular rate .* exceeds its range of 30\.00 deg/s"
    ):
        plan(altered_protocol("quick", dull))


@pytest.mark.parametrize(
    "name",
    [
        "calibration_2d",
        "calibration_3d",
        "elbow_dynamic",
        "elbow_flexion",
        "magnetic_passage",
        "orthogonality",
        "quick",
        "static_noise",
    ],
)
def test_every_shipped_protocol_passes_its_checks(name):
    check = plan(name).check
    assert check.clearance is not None and check.clearance.distance_mm > 5
    assert all(joint.peak_speed_deg_s <= joint.speed_limit_deg_s for joint in check.joints)
    assert name != "quick" or check.duration_s < 30


def test_the_true_orientation_of_a_run_is_the_commanded_one_to_the_arms_precision(
    elbow_flexion, the_plan
):
    """Truth against the plan, at the middle of each dwell: what is left is encoder noise, not
    geometry.
    """
    session, kinematics = elbow_flexion.session, Kinematics(the_plan.robot)
    sensor = session.analysis.sensors["forearm"]
    truth = session.truth("forearm")
    middles = np.array(
        [(s.settled_ns + s.end_ns) // 2 for s in session.steps if s.section == "evaluation"]
    )
    q, _, _ = the_plan.trajectory.at(middles)
    planned = kinematics.frame_motion(
        sensor.link, q, offset=Pose.from_placement(sensor.mounting)
    ).q_world_from_frame
    found = rotation.interpolate(truth.host_time_ns, truth.q_world_from_sensor, middles)
    error = np.degrees(rotation.angle(rotation.multiply(found, rotation.conjugate(planned))))
    assert error.max() < 0.005
