"""The emulated xArm controller: frames over TCP, reports against the client library's own layouts,
moves and faults.
"""

from __future__ import annotations

import contextlib
import socket
import struct

import numpy as np
import pytest

from testbench.emulation.xarm.controller import Controller
from testbench.emulation.xarm.server import XArmServer
from testbench.emulation.xarm.setup import make_controller
from testbench.exceptions import InputError
from tests.emulated_arms import COMMAND_PORT, free_address
from tests.lock_step.bench import VirtualArm, VirtualBench


@pytest.fixture
def robot(bench: VirtualBench) -> VirtualArm:
    return bench.xarm()


@pytest.fixture
def address(robot: VirtualArm) -> str:
    return robot.address


@pytest.fixture
def controller(robot: VirtualArm) -> Controller:
    return robot.server.controller


def ask(
    connection: socket.socket, register: int, data: bytes = b"", transaction: int = 7
) -> tuple[int, bytes]:
    connection.sendall(struct.pack(">3HB", transaction, 2, len(data) + 1, register) + data)
    head = connection.recv(6, socket.MSG_WAITALL)
    number, protocol, length = struct.unpack(">3H", head)
    assert (number, protocol) == (transaction, 2)
    body = connection.recv(length, socket.MSG_WAITALL)
    assert body[0] == register
    return body[1], body[2:]


def test_commands_are_answered_with_their_number_and_the_state_of_the_controller(
    address, controller
):
    with socket.create_connection((address, COMMAND_PORT), 5) as connection:
        assert ask(connection, 1)[1].startswith(b"6,6,XI")
        assert ask(connection, 13) == (0, bytes([2]))
        assert ask(connection, 12, bytes([4])) == (0x10, b"")  # stopped: takes no moves
        assert ask(connection, 13) == (0x10, bytes([4]))
        assert ask(connection, 19, bytes([1, 0]))[0] == 0x10
        assert ask(connection, 12, bytes([0])) == (0, b"")
        assert (
            ask(connection, 23, struct.pack("<10f", *[0.0] * 7, 1, 1, 0))[0] & 0x08
        )  # a move in servo mode
        controller.fault("protective_stop")
        assert ask(connection, 15) == (0x50, bytes([31, 0]))
        assert ask(connection, 12, bytes([0])) == (0x50, b"")  # an error must be cleared first
        assert ask(connection, 99)[0] & 0x08


@pytest.mark.parametrize(
    "bad",
    [
        b"\x00\x01\x00\x02\x00\x00\x0d",
        b"\x00\x01\x00\x02\xff\xff\x0d",
        b"GET / HTTP/1.1\r\n\r\n" * 300,
    ],
)
def test_what_is_no_command_is_let_go_and_the_controller_goes_on(address, controller, bad):
    with socket.create_connection((address, COMMAND_PORT), 5) as connection:
        connection.sendall(bad)
        connection.settimeout(5)
        with contextlib.suppress(ConnectionResetError):
            assert connection.recv(10) == b""
    with socket.create_connection((address, COMMAND_PORT), 5) as connection:
        assert ask(connection, 13) == (0, bytes([2]))


@pytest.fixture
def layouts(monkeypatch, tmp_path):
    """The client library's reading of reports; importing it prints, and makes a folder in the home
    directory.
    """
    monkeypatch.setenv("HOME", str(tmp_path))
    return pytest.importorskip(
        "xarm.x3.report", reason="xarm-python-sdk is not installed"
    ).ReportDataStructure


def test_the_client_library_reads_the_timely_reports_as_they_are_meant(layouts):
    controller = make_controller("xarm6")
    controller.joints.move(controller.robot.home + 0.2, 1.0, 2.0)
    for _ in range(60):
        controller.tick()
    report, data = layouts.create(30000), controller.timely_report()
    assert len(data) == len(report)
    report.update(data)
    assert report.data_size == len(data) and report.timestamp == 300_000
    assert (report.state, report.mode, report.cmd_num) == (1, 0, 0)
    for name, values in {
        "actual_joint_angle": controller.joints.q_measured,
        "actual_joint_velocity": controller.joints.v_measured,
        "target_joint_angle": controller.joints.q_reference,
    }.items():
        np.testing.assert_allclose(getattr(report, name)[:6], values, atol=1e-6)
        assert getattr(report, name)[6] == 0
    assert np.abs(
        np.array(report.actual_joint_angle) - report.target_joint_angle
    ).max() > np.radians(0.5)


def test_the_client_library_reads_the_rich_reports_as_they_are_meant(layouts):
    controller = make_controller("xarm6")
    controller.fault("emergency_stop")
    report, data = layouts.create(30002), controller.rich_report()
    assert len(data) == len(report)
    report.update(data)
    assert (report.robot_axis, report.robot_type, report.error_code) == (6, 6, 1)
    assert (report.motor_enable_status, report.motor_brake_status, report.state) == (0, 0, 4)
    assert report.temperatures[:6] == [30] * 6
    controller.clear()
    report.update(controller.rich_report())
    assert (
        report.motor_enable_status,
        report.motor_brake_status,
        report.state,
        report.error_code,
    ) == (0x3F, 0x3F, 2, 0)


def test_angles_that_are_asked_for_are_wanted_ones_unless_measured_ones_are_meant(controller):
    controller.joints.move(controller.robot.home + 0.2, 1.0, 2.0)
    for _ in range(60):
        controller.tick()
    wanted = np.frombuffer(controller.execute(42, b"")[1], "<f4")
    measured, rates = np.frombuffer(controller.execute(42, b"\x02")[1], "<f4").reshape(2, 7)
    np.testing.assert_allclose(wanted[:6], controller.joints.q_reference, atol=1e-6)
    np.testing.assert_allclose(measured[:6], controller.joints.q_measured, atol=1e-6)
    np.testing.assert_allclose(rates[:6], controller.joints.v_measured, atol=1e-6)


def test_moves_wait_their_turn_and_a_stop_forgets_them(controller):
    def move(angle: float) -> None:
        q = controller.robot.home + np.array([0, 0, 0, 0, 0, angle])
        controller.execute(23, struct.pack("<10f", *q, 0, 1.5, 4, 0))

    move(0.3)
    move(-0.2)
    for _ in range(400):
        controller.tick()
    np.testing.assert_allclose(controller.joints.q_reference[5], -0.2, atol=1e-6)
    move(0.3)
    move(0.1)
    for _ in range(20):
        controller.tick()
    controller.execute(12, bytes([4]))
    for _ in range(400):
        controller.tick()
    assert controller.joints.steady
    assert (
        -0.2 < controller.joints.q_reference[5] < 0.1
    )  # neither the rest of the one nor the other
    controller.execute(12, bytes([0]))
    for _ in range(100):
        controller.tick()
    assert controller.joints.steady


@pytest.mark.parametrize(
    ("step", "way", "error"), [(0.004, 1.62, 23), (1.0, -2.0, 24)], ids=["range", "speed"]
)
def test_a_target_beyond_a_joints_range_or_speed_is_an_error_of_the_makers_number(
    controller, step, way, error
):
    controller.execute(19, bytes([1, 0]))
    controller.execute(12, bytes([0]))
    q = controller.robot.home.copy()
    target = q[4] + way  # joint 5 may go to 180 deg, 90 deg from home
    for _ in range(1500):
        q[4] += np.clip(target - q[4], -step, step)
        controller.execute(29, struct.pack("<10f", *q, 0, 0, 0, 0))
        controller.tick()
    assert controller.error == error
    assert controller.joints.steady and controller.state_now == 4


def test_faults_come_by_the_port_for_faults_too(robot, bench):
    tell = robot.control
    assert tell("status").startswith("STANDBY ENABLED error 0 mode 0, at rest, moved 0")
    assert "faults: protective_stop" in tell("fault earthquake")
    assert tell("fault power_off") == "ok"
    assert tell("status").startswith("STOPPED DISABLED")
    assert tell("clear") == "ok"
    assert tell("fault disconnect 0.5") == "ok"
    bench.clock.sleep(0.1)
    with socket.create_connection((robot.address, COMMAND_PORT), 5) as client:
        assert client.recv(1) == b""
    bench.clock.sleep(0.5)
    with socket.create_connection((robot.address, COMMAND_PORT), 5) as client:
        assert ask(client, 13) == (0, bytes([2]))


def test_a_scenario_with_a_fault_of_another_makers_arm_is_refused(tmp_path):
    path = tmp_path / "faults.yaml"
    path.write_text("faults:\n  - {fault: slider, at_s: 1}\n")
    with pytest.raises(
        InputError, match="unknown fault 'slider'; known: protective_stop, emergency_stop"
    ):
        make_controller("xarm6", scenario=path)
    path.write_text("faults:\n  - {fault: servo_error, at_s: 0.1, for_s: 0.2}\n")
    controller = make_controller("xarm6", scenario=path)
    errors = []
    for _ in range(80):
        controller.tick()
        errors.append(controller.error)
    assert set(errors) == {0, 11} and errors[-1] == 0


def test_an_unknown_model_claim_version_or_pose_is_refused():
    with pytest.raises(InputError, match="known: xarm6"):
        make_controller("ur3e")
    with pytest.raises(InputError, match="there is no arm 'panda'"):
        make_controller("xarm6", claims="panda")
    with pytest.raises(InputError, match="no version"):
        make_controller("xarm6", firmware="new")
    with pytest.raises(InputError, match="5 joint angles"):
        make_controller("xarm6", q_deg=[0.0] * 5)
    for port in (29998, 30000, 30002):
        with pytest.raises(InputError, match="is taken"):
            XArmServer(make_controller("xarm6"), free_address(), command_port=port)
