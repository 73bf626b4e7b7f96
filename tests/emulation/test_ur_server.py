"""The emulated controller: by hand in lock step, through its client library over TCP."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from testbench.clock import SystemClock, seconds
from testbench.drivers.arms.rtde import RtdeStream
from testbench.drivers.arms.ur_client import VARIABLES
from testbench.emulation.server import CONTROL
from testbench.emulation.ur.script import SET_WATCHDOG, ControlScript
from testbench.emulation.ur.server import UrServer
from testbench.emulation.ur.setup import make_controller
from testbench.emulation.ur.state import RuntimeState
from testbench.exceptions import InputError
from tests.conftest import FakeClock
from tests.emulated_arms import Emulated, emulated_ur, free_address
from tests.lock_step.bench import VirtualArm, VirtualBench


@pytest.fixture
def robot(bench: VirtualBench) -> VirtualArm:
    return bench.ur()


@pytest.fixture(scope="module")
def real() -> Iterator[Emulated]:
    """A controller in a process of its own, for the real client library."""
    pytest.importorskip("rtde_control", reason="ur_rtde is not installed")
    with emulated_ur() as emulator:
        yield emulator


def rtde(address: str) -> socket.socket:
    return socket.create_connection((address, 30004), 5)


def ask(connection: socket.socket, kind: str, payload: bytes = b"") -> tuple[str, bytes]:
    connection.sendall(struct.pack(">HB", len(payload) + 3, ord(kind)) + payload)
    return take(connection)


def take(connection: socket.socket) -> tuple[str, bytes]:
    def exactly(count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = connection.recv(count - len(data))
            if not piece:
                raise EOFError
            data += piece
        return data

    size, kind = struct.unpack(">HB", exactly(3))
    return chr(kind), exactly(size - 3)


def test_rtde_negotiates_versions_recipes_and_sends_what_was_asked_for(robot):
    with rtde(robot.address) as connection:
        assert ask(connection, "V", struct.pack(">H", 2)) == ("V", b"\x01")
        assert ask(connection, "V", struct.pack(">H", 7)) == ("V", b"\x00")
        assert struct.unpack(">4I", ask(connection, "v")[1]) == (5, 17, 0, 128818)
        kind, answer = ask(
            connection,
            "O",
            struct.pack(">d", 125) + b"timestamp,actual_q,robot_mode,robot_status_bits",
        )
        assert (kind, answer[1:]) == ("O", b"DOUBLE,VECTOR6D,INT32,UINT32")
        kind, answer = ask(connection, "O", struct.pack(">d", 125) + b"timestamp,no_such_thing")
        assert b"NOT_FOUND" in answer
        ask(connection, "O", struct.pack(">d", 125) + b"timestamp,actual_q,robot_mode")
        assert ask(connection, "S") == ("S", b"\x01")
        stamps, angles = [], []
        while len(stamps) < 20:
            kind, data = take(connection)
            assert kind == "U"
            values = struct.unpack(">Bd6di", data)
            stamps.append(values[1])
            angles.append(values[2:8])
            assert values[8] == 7
        np.testing.assert_allclose(np.diff(stamps), 0.008, atol=1e-9)
        np.testing.assert_allclose(np.degrees(angles[-1]), [0, -90, -90, -90, 90, 0], atol=0.01)


@pytest.mark.parametrize(
    "bad",
    [
        b"\x00\x01U",
        b"\xff\xffU" + b"x" * 100,
        b"\x00\x05?ab",
        b"\x00\x09O1234xx",
        b"GET / HTTP/1.1\r\n\r\n" * 300,
    ],
)
def test_what_is_no_rtde_is_let_go_and_the_controller_goes_on(robot, bad):
    with rtde(robot.address) as connection:
        connection.sendall(bad)
        connection.settimeout(2)
        with contextlib.suppress(TimeoutError, ConnectionResetError):
            assert connection.recv(10) == b"" or len(bad) > 1000
    assert "RUNNING" in robot.control("status")


class Reports(RtdeStream):
    """Our own reports, of which the newest counts."""

    def __init__(self, address: str, clock: SystemClock):
        super().__init__(address, 500.0, VARIABLES, clock)
        self.newest: dict = {}

    def value(self, name: str):
        self.newest = ([self.newest] + [report for _, report in self.take()])[-1]
        return self.newest.get(name, [])

    def disconnect(self) -> None:
        self.close()


@pytest.mark.parametrize("library", ["ur_rtde", "its stand-in"])
def test_the_client_library_moves_servos_and_stops_as_its_stand_in_does(library, request):
    robot = request.getfixturevalue("real" if library == "ur_rtde" else "robot")
    import rtde_control

    clock = SystemClock()  # that of the lock step with the stand-in

    def wait_for(done: Callable[[], bool]) -> None:
        end = seconds(clock) + 30
        while not done() and seconds(clock) < end:
            clock.sleep(0.01)
        assert done()

    robot.control("clear")
    interface = rtde_control.RTDEControlInterface
    receive = Reports(robot.address, clock)
    flags = interface.FLAG_NO_WAIT | interface.FLAG_UPPER_RANGE_REGISTERS
    control = interface(robot.address, 500.0, flags | interface.FLAG_NO_EXT_FT)
    control.reuploadScript()
    wait_for(control.isProgramRunning)
    try:
        assert control.isProgramRunning()
        assert control.setPayload(0.3, [0, 0, 0.02])
        wait_for(lambda: receive.value("actual_q"))
        target = [*receive.value("actual_q")[:5], 0.4]
        assert control.moveJ(target, 1.0, 2.0)
        near = np.radians(0.01)
        wait_for(lambda: np.abs(np.array(receive.value("actual_q")) - target).max() < near)
        for _ in range(100):
            assert control.servoJ([*target[:5], 0.45], 0, 0, 0.002, 0.05, 300)
            clock.sleep(0.002)
        assert control.servoStop(5.0)
        assert abs(receive.value("actual_q")[5] - 0.45) < 0.05
        assert control.moveJ([*target[:5], 0.1], 1.0, 2.0, True)  # does not wait
        assert control.kickWatchdog()
        assert abs(receive.value("actual_q")[5] - 0.1) > 0.1
        control.stopJ(4.0, True)
        wait_for(lambda: np.abs(receive.value("actual_qd")).max() < np.radians(0.1))
        assert control.isSteady() in {True, False}
        robot.control("fault protective_stop")
        wait_for(lambda: receive.value("safety_status_bits") & 1 << 2)
        assert not control.moveJ(target, 1.0, 2.0)
        robot.control("clear")
        control.stopScript()
        wait_for(lambda: not control.isProgramRunning())
    finally:
        control.disconnect()
        receive.disconnect()


def test_the_dashboard_answers_as_the_client_expects(real):
    import dashboard_client

    real.control("clear")
    dashboard = dashboard_client.DashboardClient(real.address)
    dashboard.connect(2000)
    assert dashboard.polyscopeVersion() == "5.17.0.128818"
    assert dashboard.isInRemoteControl()
    assert dashboard.getRobotModel() == "UR3"
    assert dashboard.getSerialNumber().isdigit()
    assert dashboard.robotmode() == "Robotmode: RUNNING"
    assert dashboard.safetystatus() == "Safetystatus: NORMAL"
    real.control("fault local_control")
    assert not dashboard.isInRemoteControl()
    dashboard.disconnect()


def test_a_protective_stop_can_be_unlocked_only_after_a_while(robot):
    robot.control("fault protective_stop")
    assert "5s" in robot.dashboard("unlock protective stop")
    assert "PROTECTIVE_STOP" in robot.dashboard("safetystatus")
    robot.control("clear")
    assert "NORMAL" in robot.dashboard("safetystatus")


def test_an_unknown_fault_or_command_is_answered_with_what_there_is(robot):
    assert "faults: protective_stop" in robot.control("fault earthquake")
    assert "say: fault" in robot.control("hello")
    assert "could not understand" in robot.dashboard("make coffee")


def test_an_address_that_others_can_reach_needs_a_token():
    with pytest.raises(InputError, match="give a token"):
        UrServer(make_controller("ur3e"), "0.0.0.0")
    with pytest.raises(InputError, match="no IP address"):
        UrServer(make_controller("ur3e"), "somewhere")


def test_a_client_from_outside_must_say_the_token_before_any_port_answers_it():
    address = free_address()
    server = UrServer(make_controller("ur3e"), address, token="secret")
    server.loopback = False  # as if the address could be reached from elsewhere
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        with socket.create_connection((address, 29999), 5) as stranger:
            stranger.settimeout(5)
            assert stranger.recv(100) == b""
        with socket.create_connection((address, 29998), 5) as control:
            said = control.makefile("rw")

            def tell(line: str) -> str:
                said.write(f"{line}\n")
                said.flush()
                return said.readline().strip()

            assert "refused" in tell("fault power_off")
            assert "refused" in tell("token wrong")
            assert tell("token secret") == "ok"
            with socket.create_connection((address, 29999), 5) as friend:
                friend.settimeout(5)
                assert friend.recv(100).startswith(b"Connected")
            assert tell("quit") == "ok"
    finally:
        server.stop_asked = True
        thread.join(10)


def test_an_unknown_model_version_or_pose_is_refused():
    with pytest.raises(InputError, match="known: ur3e"):
        make_controller("panda")
    with pytest.raises(InputError, match="no version"):
        make_controller("ur3e", polyscope="latest")
    with pytest.raises(InputError, match="5 joint angles"):
        make_controller("ur3e", q_deg=[0.0] * 5)


def test_a_held_up_emulator_makes_up_the_time_before_it_hears_its_clients(bench, robot):
    with rtde(robot.address) as connection:
        ask(connection, "V", struct.pack(">H", 2))
        ask(connection, "O", struct.pack(">d", 125) + b"timestamp")
        ask(connection, "S")
        before = struct.unpack(">Bd", take(connection)[1])[1]
        bench.clock.now_ns += 1_000_000_000  # nobody had a turn meanwhile
        status = robot.control("status")
        stamps = [struct.unpack(">Bd", take(connection)[1])[1] for _ in range(62)]
        assert robot.server.controller.time == pytest.approx(before + 1.0, abs=0.01)
        np.testing.assert_allclose(np.diff(stamps), 0.008, atol=1e-9)  # the newest half second
        assert stamps[-1] == pytest.approx(before + 1.0, abs=0.01)
        assert "RUNNING" in status


def test_time_that_is_made_up_moves_the_joints_and_is_no_silence_of_the_client():
    robot = make_controller("ur3e")
    robot.script = script = ControlScript("")
    robot.runtime = RuntimeState.PLAYING
    script.begin(robot)
    robot.registers.input_double[0] = 2.0
    script._process(robot, SET_WATCHDOG)
    server = UrServer(robot, free_address())
    try:
        server.serve()
        robot.joints.move(robot.joints.q_reference + 0.5, 1.0, 5.0)
        server._advance(700)
        assert robot.time == pytest.approx(1.4)
        assert robot.joints.at_rest
        assert robot.script is script
        server.serve()
        server._advance(1)
        assert robot.script is None, "now it was heard that nothing came"
        server._advance(1_000_000)
        assert robot.time == pytest.approx(2001.402)
    finally:
        server.close()


def test_stamps_can_be_made_to_fall_behind():
    robot = make_controller("ur3e")
    for _ in range(500):
        robot.tick()
    robot.fault("clock_step", -0.25)
    assert robot.outputs()["timestamp"] == pytest.approx(0.75)
    robot.clear()
    assert robot.outputs()["timestamp"] == pytest.approx(0.75)


def test_what_a_client_asks_for_is_heard_at_the_present_time(monkeypatch):
    clock, robot = FakeClock(), make_controller("ur3e")
    server = UrServer(robot, free_address(), clock=clock)
    try:
        ours, theirs = socket.socketpair()
        with ours:
            server.take_in(theirs, CONTROL, "")
            ours.sendall(b"status\n")
            heard: list[float] = []
            monkeypatch.setattr(robot, "status", lambda: str(heard.append(robot.time)))
            clock.sleep(0.1)
            server.serve()
            assert heard == [pytest.approx(0.1)]
            assert server.due_ns == clock.now_ns + 2_000_000
    finally:
        server.close()
