"""Truth and ideal samples against MuJoCo, from the maker's DH parameters.

Neither shares code with the bench: the arm is built here of the maker's numbers, its servo is
simulated here, and MuJoCo says what a sensor on it feels.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.model.kinematics import Kinematics, Pose
from testbench.pipeline.analyse import analyse
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from testbench.records.specs.robot import Robot, load_robot
from tests.asking import analysis
from tests.conftest import FakeClock
from tests.model.test_robot_truth import ALPHA, DH

ARMS = list(DH)
LEVER_MM, TURNED_DEG = [120.0, -80.0, 140.0], [35.0, -50.0, 110.0]  # intrinsic XYZ
PROTOCOL = """\
name: oracle
purpose: A move at once, and a sweep of three joints
robot: {robot}
sensors:
  lever:
    preset: ideal
    parameters: {{rate_hz: {rate}, sampling: {sampling}}}
    link: tool0
    mounting: {{rotation_deg: {{XYZ: {turned}}}, position_mm: {lever}}}
environment: {{joint_errors: false}}
motion: {{speed: 0.6, acceleration: 0.6, jerk: 0.6}}
sections:
  - name: moves
    steps:
      - {{move_to_deg: [20, -100, -70, -40, 60, 30], dwell_s: 0.6}}
      - sweep:
          shoulder_pan_joint: {{sine: {{amplitude_deg: 12, frequency_hz: 0.6, cycles: 2}}}}
          wrist_1_joint: {{sine: {{amplitude_deg: 10, frequency_hz: 0.9, cycles: 3}}}}
          wrist_3_joint: {{sine: {{amplitude_deg: 30, frequency_hz: 0.5, cycles: 2}}}}
        dwell_s: 0.4
estimate: {{filters: [gyro], align: reference_pose, calibrate: none}}
"""


class Oracle:
    """A sensor on an arm in MuJoCo.

    Args:
        robot: Of `DH`.
        position: Of the sensor in the flange [m].
        turned: Its axes in the flange.
    """

    def __init__(self, robot: str, position: np.ndarray, turned: Rotation):
        w_first = {"scalar_first": True}
        text = "<site name='sensor' pos='{} {} {}' quat='{} {} {} {}'/>".format(
            *position, *turned.as_quat(**w_first)
        )
        # frame i of the maker is that of joint i + 1: behind it stand d, a and alpha
        for i in reversed(range(7)):
            if i == 0:
                # the maker's Base is turned by half a turn against the URDF's
                place, quat = "0 0 0", "0 0 0 1"
            else:
                d, a = DH[robot][0][i - 1], DH[robot][1][i - 1]
                place = f"{a} 0 {d}"
                quat = " ".join(map(str, Rotation.from_euler("X", ALPHA[i - 1]).as_quat(**w_first)))
            joint = f"<joint name='j{i}' type='hinge' axis='0 0 1'/>" if i < 6 else ""
            mass = "<inertial pos='0 0 0' mass='1' diaginertia='.01 .01 .01'/>"
            text = f"<body pos='{place}' quat='{quat}'>{joint}{mass}{text}</body>"
        self.model = mujoco.MjModel.from_xml_string(
            "<mujoco><option gravity='0 0 -9.80665'/>"
            f"<worldbody>{text}</worldbody><sensor><gyro site='sensor'/>"
            "<accelerometer site='sensor'/><framequat objtype='site' objname='sensor'/>"
            "<framepos objtype='site' objname='sensor'/></sensor></mujoco>"
        )
        self.data = mujoco.MjData(self.model)

    def feels(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Rate [rad/s], force [m/s^2], q_world_from_sensor and position [m], shape (n, 13)."""
        found = np.empty((len(q), 13))
        for i in range(len(q)):
            self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q[i], v[i], a[i]
            mujoco.mj_inverse(self.model, self.data)
            found[i] = self.data.sensordata
        return found


def apart_deg(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Angles between rotations w, x, y, z, shape (n,) [deg]."""
    first, second = (Rotation.from_quat(each, scalar_first=True) for each in (q, p))
    return np.degrees((first.inv() * second).magnitude())


@pytest.mark.parametrize("robot", ARMS)
def test_a_sensor_moves_as_in_mujoco_wherever_it_is_mounted(robot):
    rng = np.random.default_rng(2)
    kinematics = Kinematics(load_robot(robot))
    for _ in range(5):
        place, turned = rng.uniform(-0.3, 0.3, 3), Rotation.random(rng=rng)
        q, v, a = rng.uniform(-3, 3, (40, 6)), rng.normal(0, 2, (40, 6)), rng.normal(0, 9, (40, 6))
        wanted = Oracle(robot, place, turned).feels(q, v, a)
        found = kinematics.frame_motion("tool0", q, v, a, Pose(turned.as_matrix(), place))
        np.testing.assert_allclose(found.angular_velocity_in_frame, wanted[:, :3], atol=1e-6)
        force = found.specific_force_in_frame(np.array([0, 0, -9.80665]))
        np.testing.assert_allclose(force, wanted[:, 3:6], atol=1e-5)
        assert apart_deg(found.q_world_from_frame, wanted[:, 6:10]).max() < 1e-5
        np.testing.assert_allclose(found.position, wanted[:, 10:], atol=1e-7)


@dataclass(frozen=True)
class Ran:
    """A run of an arm whose readings have no noise, with a servo of our own beside it."""

    plan: Plan
    session: Session
    oracle: Oracle

    @cached_property
    def _servo(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Times [s] and angles, rates and accelerations of the joints behind their servo, by the
        classical Runge-Kutta method; the reference is linear between control instants.
        """
        servo = self.plan.robot.spec.servo
        omega, damping = 2 * np.pi * servo.natural_frequency_hz, servo.damping_ratio
        control_ns = round(1e9 / self.plan.robot.spec.rates.control_hz)
        instants = np.arange(0, self.plan.trajectory.time_ns[-1] + 2 * control_ns, control_ns)
        sent = self.plan.trajectory.at(instants)[0]
        h = control_ns / 1e9
        states = [np.stack([sent[0], 0 * sent[0]])]

        def change(x, u):
            return np.stack([x[1], omega**2 * (u - x[0]) - 2 * damping * omega * x[1]])

        for u, following in pairwise(sent):
            x, middle = states[-1], (u + following) / 2
            k1 = change(x, u)
            k2 = change(x + h / 2 * k1, middle)
            k3 = change(x + h / 2 * k2, middle)
            k4 = change(x + h * k3, following)
            states.append(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        q, v = np.array(states).transpose(1, 0, 2)
        a = omega**2 * (sent - q) - 2 * damping * omega * v
        return instants / 1e9, q, v, a

    def joints(self, time_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, rates and accelerations of the joints behind their servo, at some instants."""
        t, q, v, a = self._servo
        at = time_ns / 1e9
        between = CubicHermiteSpline(t, v, a)(at)
        return CubicHermiteSpline(t, q, v)(at), between, CubicHermiteSpline(t, v, a)(at, 1)


def run(folder, robot: str, rate: float = 120.0, sampling: str = "instantaneous") -> Ran:
    file = folder / f"{robot}_{sampling}.yaml"
    file.write_text(
        PROTOCOL.format(
            robot=robot, rate=rate, sampling=sampling, turned=TURNED_DEG, lever=LEVER_MM
        )
    )
    planned = plan(file)
    exact = {"repeatability_deg": 0.0, "encoder_noise_deg": 0.0}
    exact |= {"velocity_noise_deg_s": 0.0, "encoder_resolution_deg": 0.0}
    spec = planned.robot.spec
    spec = spec.model_copy(update={"servo": spec.servo.model_copy(update=exact)})
    own = planned.robot
    planned = dataclasses.replace(planned, robot=Robot(spec, own.urdf, own.text, own.file))
    session = execute(planned, folder, 1, RunOptions(clock=FakeClock(), session_name=file.stem))
    turned = Rotation.from_euler("XYZ", TURNED_DEG, degrees=True)
    return Ran(planned, session, Oracle(robot, np.array(LEVER_MM) / 1000, turned))


@pytest.fixture(scope="module", params=ARMS)
def ran(request, tmp_path_factory) -> Iterator[Ran]:
    return run(tmp_path_factory.mktemp("oracle"), request.param)


def test_the_truth_is_what_mujoco_says_of_the_measured_joints(ran):
    truth, arm = ran.session.truth("lever"), ran.session.arm()
    wanted = ran.oracle.feels(arm.q_measured, arm.v_measured, np.zeros_like(arm.q_measured))
    np.testing.assert_array_equal(truth.host_time_ns, arm.host_time_ns)
    assert apart_deg(truth.q_world_from_sensor, wanted[:, 6:10]).max() < 1e-5
    np.testing.assert_allclose(truth.rate, wanted[:, :3], atol=1e-6)
    # what was sent is another thing
    sent = ran.oracle.feels(arm.q_sent, arm.v_measured, np.zeros_like(arm.q_measured))
    assert apart_deg(sent[:, 6:10], wanted[:, 6:10]).max() > 0.1


def test_the_truths_force_is_what_mujoco_feels_from_the_first_row_on(ran):
    truth = ran.session.truth("lever")
    inside = truth.host_time_ns < ran.plan.trajectory.time_ns[-1]
    wanted = ran.oracle.feels(*ran.joints(truth.host_time_ns[inside]))[:, 3:6]
    off = np.linalg.norm(truth.force[inside] - wanted, axis=1)
    assert off.max() < 0.05
    assert np.ptp(wanted, axis=0).max() > 1


def test_an_ideal_sensor_reads_what_mujoco_feels(ran):
    imu = ran.session.imu("lever")
    wanted = ran.oracle.feels(*ran.joints(imu.host_time_ns))
    np.testing.assert_allclose(imu.gyr, wanted[:, :3], atol=1e-4)
    np.testing.assert_allclose(imu.acc, wanted[:, 3:6], atol=5e-3)


def test_an_integrating_sensor_reads_means_seen_in_its_axes_at_the_end(tmp_path):
    ran = run(tmp_path, "ur3e", 50.0, "integrated")
    imu = ran.session.imu("lever")
    many = 100
    fine = imu.host_time_ns[0] + np.arange(many * 199 + 1) * 20_000_000 // many
    felt = ran.oracle.feels(*ran.joints(fine))
    axes = Rotation.from_quat(felt[:, 6:10], scalar_first=True)
    in_world = axes.apply(felt[:, 3:6])
    mean = np.array([in_world[i * many : (i + 1) * many + 1].mean(axis=0) for i in range(199)])
    ends = axes[many::many]
    n = slice(1, 200)
    np.testing.assert_allclose(imu.acc[n], ends.inv().apply(mean), atol=0.05)
    turned = (axes[:-1:many].inv() * ends).as_rotvec() * 50.0
    np.testing.assert_allclose(imu.gyr[n], turned, atol=1e-4)
    # neither the end of the interval, nor means in turning axes
    assert np.abs(felt[many::many, 3:6] - ends.inv().apply(mean)).max() > 0.1


@pytest.mark.parametrize("sampling", ["instantaneous", "integrated"])
def test_an_ideal_sensor_neither_leads_nor_lags(tmp_path, sampling):
    ran = run(tmp_path, "ur3e", 60.0, sampling)
    evaluation = analyse(ran.session, analysis("gyro")).evaluation
    (row,) = [
        row.errors
        for row in evaluation.orientation_summary
        if (row.motion, row.part) in {("dynamic", "total"), ("all", "total")}
        and row.errors.latency_ms is not None
    ]
    assert abs(row.latency_ms) < 0.5
