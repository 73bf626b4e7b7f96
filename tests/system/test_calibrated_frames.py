"""A crooked sensor calibrated in one session and used in another: all triads and the device's own
orientation in one frame.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbench.drivers.imus.simulated import SimulatedImu
from testbench.estimation.calibration.gyroscope import matrix_of
from testbench.estimation.calibration.session_calibration import calibrate
from testbench.estimation.calibration.session_mounting import axes_sd
from testbench.estimation.estimator import estimate
from testbench.model import rotation
from testbench.model.kinematics import Kinematics
from testbench.model.truth import truth_at
from testbench.records.specs.protocol import Environment
from tests.asking import recorded

pytestmark = pytest.mark.slow

CROOKED_DEG = [6.0, -5.0, 8.0]
JUDGED = [
    [0, -90, -90, -60, 120, 150],
    [0, -90, -90, 30, 70, 100],
    [0, -90, -90, -30, 30, 200],
    [0, -90, -90, -100, 160, 110],
]
CHOICES = {
    "best": (),
    "arm": ("attitude_aided", "attitude", "ellipsoid"),
    "gyroscope only": ("rate_table",),
    "other arm methods": ("axis_model", "gravity_turns", "ellipsoid"),
    "map with gyroscope": ("rotational_3d_bias", "static_bias", "ellipsoid_dip"),
    "own mounting beside the arm": ("attitude_aided", "attitude", "ellipsoid", "mounting_rates"),
    "own axes": ("norm_only", "gravity_turns", "ellipsoid_dip"),
}


@pytest.fixture(scope="module")
def crooked_sessions(altered_protocol, tmp_path_factory):
    """The calibration, and another session of the same part with its own calibration poses."""
    logs = tmp_path_factory.mktemp("logs")

    def crook(data):
        data["environment"] = {
            "arm_magnetism": False
        }  # whose disturbance would hide what a frame is off
        data["sensors"]["forearm"]["mounting_error"] = {"rotation_deg": {"XYZ": CROOKED_DEG}}
        data["estimate"] = {
            "filters": ["device", "vqf_9d"],
            "align": "rates",
            "calibrate": "static_poses",
        }

    def later(data):
        crook(data)
        steps = [{"move_to_deg": pose, "dwell_s": 8} for pose in JUDGED]
        data["sections"].append({"name": "judged", "role": "evaluation", "steps": steps})

    protocols = (
        altered_protocol("calibration_optimal", crook),
        altered_protocol("calibration_3d", later),
    )
    return tuple(recorded(protocol, 5, logs) for protocol in protocols)


def rms_deg(session, calibrations):
    """Root mean square of the whole error of each filter in the judged poses, once settled
    [deg].
    """
    found = estimate(session, calibrations=calibrations).sensors["forearm"]
    q_true = truth_at(session.truth("forearm"), found.host_time_ns)
    judged = np.isfinite(q_true[:, 0]) & np.any(
        [
            (found.host_time_ns > step.settled_ns + 2e9) & (found.host_time_ns < step.end_ns)
            for step in session.steps
            if step.role == "evaluation"
        ],
        axis=0,
    )
    errors = {}
    for name, q in found.orientation.items():
        left = rotation.to_rotation_vector(
            rotation.multiply(q[judged], rotation.conjugate(q_true[judged]))
        )
        errors[name] = float(np.degrees(np.sqrt((left**2).sum(axis=1).mean())))
    return errors


@pytest.fixture(scope="module")
def uncalibrated_deg(crooked_sessions):
    """Errors of the later session without a stored calibration [deg]."""
    return rms_deg(crooked_sessions[1], None)


@pytest.mark.parametrize("choice", CHOICES)
def test_a_stored_calibration_leaves_no_triad_in_another_frame(
    crooked_sessions, uncalibrated_deg, choice
):
    calibrated, later = crooked_sessions
    stored = calibrate(calibrated, "forearm", CHOICES[choice]).calibration
    before, after = uncalibrated_deg, rms_deg(later, [stored])
    for name in ("device", "vqf_9d"):
        assert after[name] < before[name] + 0.1, (choice, name, before, after)
        assert after[name] < 1.0


def test_the_mounting_is_told_apart_from_the_triads_with_its_uncertainty(crooked_sessions):
    """Oracle: the polar decomposition of the simulated part's own response, turned by the error
    that the protocol states.
    """
    session = crooked_sessions[0]
    imu = SimulatedImu(
        "forearm",
        session.analysis.sensors["forearm"],
        Kinematics(session.robot),
        Environment(),
        lambda t: None,
        5,
    )
    crooked = Rotation.from_euler("XYZ", CROOKED_DEG, degrees=True).as_matrix()
    u, _, vt = np.linalg.svd(crooked @ np.linalg.inv(imu._accelerometer.errors.matrix))
    result = calibrate(session, "forearm")
    found = result.calibration
    assert found.mounting.method == "from attitude_aided"
    left = Rotation.from_matrix(found.mounting.R_believed_from_sensor @ (u @ vt).T).as_rotvec()
    assert (np.abs(left) < 4 * found.mounting.fit.sd).all()
    assert np.degrees(found.mounting.fit.sd).max() < 0.3  # most of it the arm's joints
    for triad in ("accelerometer", "gyroscope"):  # nothing of it is left in the matrices
        near = Rotation.from_matrix(rotation.nearest_rotation(found.triads[triad].matrix))
        assert np.degrees(near.magnitude()) < 0.5
    gyroscope = found.triads["gyroscope"]
    whole = found.mounting.R_believed_from_sensor @ gyroscope.matrix
    np.testing.assert_allclose(whole, matrix_of(gyroscope.fits[0].values)[0], atol=1e-12)
    np.testing.assert_allclose(result.poses.corrected, result.poses.expected, atol=0.02)


def test_the_response_to_force_is_the_same_in_the_new_axes(crooked_sessions):
    """Raw readings are corrected as the methods alone would have corrected them, into the axes as
    believed.
    """
    found = calibrate(crooked_sessions[0], "forearm").calibration
    rng = np.random.default_rng(1)
    gyr, acc = rng.standard_normal((2, 20, 3))
    rate, force, _ = found.apply(gyr, acc, None)
    fit = found.triads["accelerometer"].fits[0]
    alone = (acc - fit.values[9:12]) @ np.linalg.inv(fit.values[:9].reshape(3, 3)).T
    np.testing.assert_allclose(force, alone, atol=1e-12)
    values = found.triads["gyroscope"].fits[0].values
    by_force = alone @ values[12:21].reshape(3, 3).T
    np.testing.assert_allclose(
        rate, (gyr - values[9:12] - by_force) @ matrix_of(values)[0].T, atol=1e-12
    )


def test_a_mounting_named_beside_the_arms_methods_replaces_the_one_they_contain(crooked_sessions):
    result = calibrate(
        crooked_sessions[0], "forearm", ["attitude_aided", "attitude", "mounting_rates"]
    )
    assert (
        "the mounting by mounting_rates takes the place of the one from attitude_aided"
        in result.remarks
    )
    real = Rotation.from_euler("XYZ", CROOKED_DEG, degrees=True)
    left = Rotation.from_matrix(result.calibration.mounting.R_believed_from_sensor) * real.inv()
    assert np.degrees(left.magnitude()) < 0.6


def test_the_uncertainty_of_a_mounting_holds_that_of_the_axes_it_turns(crooked_sessions):
    """The gyroscope's axes by gravity alone are known to some 0.1 deg; rates corrected by them
    cannot say more.
    """
    found = calibrate(
        crooked_sessions[0], "forearm", ["norm_only", "gravity_turns", "mounting_rates"]
    ).calibration
    axes = axes_sd(found.triads["gyroscope"])
    misalignments = found.triads["gyroscope"].fits[0].sd[3:9]
    assert misalignments.min() <= axes <= misalignments.max()
    assert (found.mounting.fit.sd > axes).all()


def test_a_magnetometer_alone_by_the_arm_is_remarked(crooked_sessions):
    result = calibrate(
        crooked_sessions[0], "forearm", ["known_field"], field=np.array([0.0, 24.0, -39.0])
    )
    assert result.calibration.mounting is None
    assert any(
        remark.startswith("the magnetometer is in the axes as believed")
        for remark in result.remarks
    )


def test_stated_uncertainties_hold_the_arms_own_joints(altered_protocol, tmp_path):
    """Each session has another arm, its joints' zeros off by the 0.1 deg that the robot file
    states.
    """

    def wrong_zeros(data):
        data.setdefault("environment", {})["joint_errors"] = True

    protocol = altered_protocol("calibration_optimal", wrong_zeros)
    off = []
    for seed in range(20, 24):
        session = recorded(protocol, seed, tmp_path)
        imu = SimulatedImu(
            "forearm",
            session.analysis.sensors["forearm"],
            Kinematics(session.robot),
            Environment(),
            lambda t: None,
            seed,
        )
        result = calibrate(session, "forearm", ["attitude_aided", "attitude"])
        assert any("of the arm's joints" in remark for remark in result.remarks)
        acc, gyr = (
            result.calibration.triads[name].fits[0] for name in ("accelerometer", "gyroscope")
        )
        off.append((acc.values[:9] - imu._accelerometer.errors.matrix.reshape(-1)) / acc.sd[:9])
        M = np.linalg.inv(imu._gyroscope.errors.matrix)
        off[-1] = np.append(off[-1], (gyr["gyr_misalignment_xz"] - M[1, 0] / M[0, 0]) / gyr.sd[5])
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.4  # without the joints' part: several
