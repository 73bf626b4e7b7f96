"""What arms in real time share: the controller's clock, the reported motion, replayed logs."""

from __future__ import annotations

import numpy as np
import pytest

from testbench import plan
from testbench.clock import SystemClock
from testbench.drivers.arms.catalogue import REPLAY
from testbench.drivers.arms.controller_clock import ControllerClock
from testbench.drivers.arms.replay import ReplayArm
from testbench.drivers.arms.straight_path import StraightPaths
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.imus.following import ReportedMotion
from testbench.drivers.session_time import SessionTime
from testbench.exceptions import DriverError, InputError
from testbench.execution import RunOptions
from testbench.execution.devices import Devices
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.pipeline.arm import make_arm
from testbench.pipeline.request import ArmRequest, RunRequest
from testbench.records.session.samples import ArmSamples
from testbench.records.session.session import RunStatus
from testbench.records.specs.robot import Robot, load_robot
from tests.conftest import FakeClock

SECOND = 1_000_000_000


def test_the_controllers_clock_is_found_behind_delays_and_its_drift_followed():
    rng = np.random.default_rng(1)
    clock, errors, last = ControllerClock(), [], 0
    true_offset, drift = 123_456_789_000, 40e-6
    for k in range(25_000):  # 200 s at 125 Hz
        stamp = k * 8_000_000
        sampled = round(stamp * (1 + drift)) + true_offset
        arrival = sampled + 300_000 + int(rng.exponential(2_000_000))
        host = clock.host_ns(stamp, arrival)
        if k == 125:
            clock.begin()
        if k > 125:
            assert host > last
            errors.append(host - sampled)
        last = host
    assert np.abs(np.array(errors) - 300_000).max() < 1_000_000


def reported(times: np.ndarray, noise: float = 0.0) -> ArmSamples:
    rng = np.random.default_rng(0)
    t = times / SECOND
    q = np.stack([0.5 * np.sin(2 * np.pi * 0.4 * t), 0.2 * np.cos(2 * np.pi * 0.3 * t)], axis=1)
    v = np.stack(
        [0.5 * 0.8 * np.pi * np.cos(0.8 * np.pi * t), -0.2 * 0.6 * np.pi * np.sin(0.6 * np.pi * t)],
        axis=1,
    )
    return ArmSamples(["a", "b"], times, q, q + noise * rng.standard_normal(q.shape), v)


def test_the_reported_motion_is_known_between_reports_with_its_derivatives():
    motion = ReportedMotion(125)
    times = np.arange(1, 500) * 8_000_000 + np.random.default_rng(2).integers(0, 500_000, 499)
    for part in np.split(times, 20)[:-1] if len(times) % 20 == 0 else np.array_split(times, 20):
        motion.add(reported(part))
    at = np.arange(int(1.5 * SECOND), motion.known_until_ns, 3_000_001)
    q, v, a = motion.state(at)
    expected = reported(at)
    t = at / SECOND
    np.testing.assert_allclose(q, expected.q_measured, atol=2e-5)
    np.testing.assert_allclose(v, expected.v_measured, atol=5e-4)
    np.testing.assert_allclose(
        a[:, 0], -0.5 * (0.8 * np.pi) ** 2 * np.sin(0.8 * np.pi * t), atol=0.02
    )
    assert 3.85e9 < motion.known_until_ns < 4e9


def test_hissing_encoders_do_not_shake_the_simulated_sensors():
    motion = ReportedMotion(125)
    motion.add(reported(np.arange(1, 400) * 8_000_000, noise=np.radians(0.0007)))
    at = np.arange(SECOND, motion.known_until_ns, 1_700_001)
    a = motion.state(at)[2]
    assert np.std(a[:, 0] + 0.5 * (0.8 * np.pi) ** 2 * np.sin(0.8 * np.pi * at / SECOND)) < 0.1


def test_nothing_reported_is_an_error():
    with pytest.raises(DriverError, match="no motion"):
        ReportedMotion(125).state(np.array([0]))


def test_straight_ways_are_looked_at_for_collisions():
    robot = load_robot("ur3e")
    paths = StraightPaths(robot)
    assert paths.blocked(robot.home, robot.home + np.radians([90, 0, 0, 0, 0, 40])) is None
    nearest = paths.blocked(robot.home, np.radians([0, 60, -90, -90, 90, 0]))  # through the floor
    assert nearest is not None and nearest.distance <= paths.margin


def test_an_arm_of_another_maker_is_refused_before_anything_is_connected():
    arm = load_robot("ur3e")
    other = Robot(arm.spec.model_copy(update={"name": "panda"}), arm.urdf, arm.text)
    with pytest.raises(InputError, match="e-series"):
        UrArm(other, ur_settings(plan("quick"), "127.0.0.1"))


@pytest.fixture(scope="module")
def recorded(run_protocol, tiny):
    return run_protocol(tiny, seed=4).session


def replay(the_plan, log, logs):
    time = SessionTime(FakeClock())
    return execute_on_arm(
        the_plan,
        ReplayArm(the_plan.robot, log, time),
        Sensors.simulated(the_plan, 1),
        RunOptions(logs),
    )


def test_a_recorded_session_drives_the_bench_as_if_live(recorded, tiny, tmp_path):
    the_plan = plan(tiny)
    session = replay(the_plan, recorded.path, tmp_path)
    assert session.status is RunStatus.COMPLETED
    assert session.manifest.arm.driver == "replay"
    np.testing.assert_allclose(
        session.arm().q_measured, recorded.arm().q_measured[: len(session.arm().q_measured)]
    )
    for found, original in zip(session.steps, recorded.steps, strict=True):
        assert found.index == original.index
        assert abs(found.settled_ns - original.settled_ns) < 0.5 * SECOND
    assert len(session.imu("hand")) > 200


def test_a_foreign_log_in_degrees_is_taken_too(recorded, tiny, tmp_path):
    arm = recorded.arm()
    log = tmp_path / "log.csv"
    header = ["time_s", *(f"q_{joint}_deg" for joint in arm.joint_names)]
    rows = np.column_stack([arm.host_time_ns / SECOND + 5, np.degrees(arm.q_measured)])[::2]
    log.write_text(
        ",".join(header) + "\n" + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows)
    )
    replayed = ReplayArm(load_robot("ur3e"), log, SessionTime(SystemClock()))
    replayed.connect()
    replayed.check_way(plan(tiny))
    assert replayed.describe() == REPLAY.record.to_dict() | {"log": "log.csv"}
    assert replayed.describe()["driver"] == "replay"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("time_s,q_elbow_joint_deg\n0,1\n1,2\n", "has no column q_shoulder_pan_joint"),
        ("a,b\n1,2\n3,4\n", "neither time_s nor host_time_ns"),
        ("time_s\n0\n", "no motion"),
        ("time_s,x\n0\n1,2\n", "another length"),
        ("time_s,x\n0,zero\n", "cannot be read"),
        (
            "time_s,"
            + ",".join(f"q_{j}_rad" for j in load_robot("ur3e").joint_names)
            + "\n"
            + "1,0,0,0,0,0,0\n" * 3,
            "do not increase",
        ),
    ],
)
def test_a_log_that_is_none_is_refused_in_a_sentence(tmp_path, content, sentence):
    log = tmp_path / "log.csv"
    log.write_text(content)
    with pytest.raises(InputError, match=sentence):
        ReplayArm(load_robot("ur3e"), log, SessionTime(SystemClock())).connect()


def test_a_log_that_is_none_is_told_before_a_missing_sensor(tmp_path, tiny):
    log = tmp_path / "log.csv"
    log.write_text("a,b\n1,2\n3,4\n")
    asked = RunRequest(arm=ArmRequest(driver="replay", log=log))
    with pytest.raises(InputError, match="neither time_s nor host_time_ns"):
        make_arm(plan(tiny), asked, SystemClock())


def test_a_log_that_never_reaches_a_pose_is_refused(recorded, tmp_path):
    arm = ReplayArm(load_robot("ur3e"), recorded.path, SessionTime(SystemClock()))
    arm.connect()
    with pytest.raises(InputError, match="never rests in the pose"):
        arm.check_way(plan("quick"))


class MuteDevices(Devices):
    """A board that is there and delivers nothing."""

    def listen(self) -> None:
        raise DriverError("sensor hand delivers no sample")


def test_a_sensor_that_delivers_nothing_ends_the_run_before_the_arm_is_even_connected(
    recorded, tiny, tmp_path, monkeypatch
):
    the_plan, time = plan(tiny), SessionTime(SystemClock())
    arm = ReplayArm(the_plan.robot, recorded.path, time)
    monkeypatch.setattr(arm, "connect", lambda: pytest.fail("the arm was connected"))
    sensors = Sensors(dict(Sensors.simulated(the_plan, 1).imus), MuteDevices({}, time))
    with pytest.raises(DriverError, match="delivers no sample"):
        execute_on_arm(the_plan, arm, sensors, RunOptions(tmp_path / "logs"))
    assert not (tmp_path / "logs").exists()
