"""Runs through the makers' own client libraries, against emulated controllers over TCP, on the
machine's time: what only these libraries and real processes can show. Nothing here asserts how fast
this machine is.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from importlib.util import find_spec
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

import pytest

from testbench.drivers.arms.controller_lock import ControllerLock
from testbench.exceptions import DriverError
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, list_sessions
from tests.asking import run_of
from tests.benchmarks.real_arm import worst_pose
from tests.emulated_arms import Emulated, drive, emulated_ur, emulated_xarm, faulted_session
from tests.processes import FORKS, forked

MOTION = """\
name: short
purpose: A pose, a sweep and the way back, through a real client library
robot: {robot}
sensors: {{hand: {{preset: xsens_dot, link: {link}}}}}
motion: {{speed: 0.5, acceleration: 0.5, jerk: 0.5}}
arm: {{tool: {{mass_kg: 0.2, centre_mm: [0, 0, 30]}}}}
sections:
  - name: moves
    role: reference
    steps:
      - {{name: out, move_to_deg: {{{joint}: 40}}, dwell_s: 0.3}}
      - name: wave
        sweep: {{{joint}: {{sine: {{amplitude_deg: 4, frequency_hz: 1.5, cycles: 1}}}}}}
        dwell_s: 0.2
      - {{name: back, move_to: home, dwell_s: 0.2}}
estimate: {{filters: [device], align: heading, calibrate: none}}
"""
LAST = "move_to: home, dwell_s: 0.2"
LIBRARIES = {"ur": "rtde_control", "xarm": "xarm"}


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Plan]:
    folder, made = tmp_path_factory.mktemp("plans"), {}
    for maker, robot, link, joint in (
        ("ur", "ur3e", "wrist_3_link", "wrist_3_joint"),
        ("xarm", "xarm6", "link6", "joint6"),
    ):
        path = folder / f"{maker}.yaml"
        path.write_text(MOTION.format(robot=robot, link=link, joint=joint), encoding="utf-8")
        made[maker] = make_plan(run_of(path))
    return made


@pytest.fixture(scope="module", params=["ur", "xarm"])
def maker(request: pytest.FixtureRequest) -> str:
    if find_spec(LIBRARIES[request.param]) is None:
        pytest.skip(f"the client library {LIBRARIES[request.param]} is not installed")
    return request.param


@pytest.fixture(scope="module")
def emulator(maker: str) -> Iterator[Emulated]:
    """One controller for all tests of its maker."""
    with emulated_ur() if maker == "ur" else emulated_xarm() as robot:
        yield robot


@pytest.fixture
def robot(emulator: Emulated) -> Emulated:
    """The emulated arm at rest, without a fault."""
    emulator.control("clear")
    emulator.wait_until("at rest")
    return emulator


def test_a_run_through_the_real_library_reaches_its_poses(maker, robot, plans, tmp_path):
    session = drive(plans[maker], robot.address, tmp_path)
    assert session.status is RunStatus.COMPLETED
    assert [step.index for step in session.steps] == [0, 1, 2]
    assert worst_pose(session, plans[maker])[1] < 0.01
    arm = session.manifest.content["arm"]
    assert (arm["driver"], arm["model"]) == (maker, {"ur": "UR3", "xarm": "xArm 6"}[maker])
    assert arm["timing"]["cycles"] > 200


SEEN_AS = {
    "ur": {
        "disconnect": {"disconnect"},
        "slow_response": {"slow_response", "refused", "host_silence"},
    },
    "xarm": {"disconnect": {"disconnect"}, "slow_response": {"slow_response"}},
}


# A connection that is cut for so short that a library which tried could come back at once.
@pytest.mark.parametrize("fault", ["disconnect 0.05", "slow_response 4"])
def test_a_fault_that_the_real_library_waits_or_raises_for_ends_in_a_stopped_arm(
    maker, robot, plans, tmp_path, fault
):
    struck: list[str] = []

    def strike(progress) -> None:
        if not struck and ", moving" in robot.control("status"):
            struck.append(robot.control(f"fault {fault}"))

    with pytest.raises(DriverError, match="the arm was stopped"):
        drive(plans[maker], robot.address, tmp_path, progress=strike)
    assert struck == ["ok"]
    assert "at rest" in robot.control("status") and "STOPPED" in robot.control("status")
    session = faulted_session(tmp_path, SEEN_AS[maker][fault.split()[0]])
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    assert told.details["arm"] == "at rest"


def run_to_its_end(
    protocol: Path,
    address: str,
    logs: Path,
    tell: Connection,
    patience: dict[str, float] | None = None,
) -> None:
    """A run in a process of its own, which tells how it ended."""
    try:
        tell.send(str(drive(make_plan(run_of(protocol)), address, logs, patience).status))
    except DriverError as error:
        tell.send(str(error))


def lasting(plan: Plan, folder: Path) -> Path:
    """The file of the same protocol with a long rest at its end: it is not over while a bench is
    held, for the driving process knows some steps in advance.
    """
    path, text = folder / "lasting.yaml", plan.protocol.document.text
    assert text.count(LAST) == 1
    path.write_text(text.replace(LAST, "move_to: home, dwell_s: 60"), encoding="utf-8")
    return path


def wait_for_recorded_motion(
    robot: Emulated, bench: BaseProcess, said: Connection, logs: Path
) -> None:
    """Wait until a bench has seen a step begin, and the arm has moved for 50 periods since.

    An arm that another test left elsewhere goes to the start of the plan first, of which nothing is
    recorded.
    """
    begun_at, end = None, time.monotonic() + 120
    while begun_at is None or _moved(robot) < begun_at + 50:
        assert not said.poll(), f"it ended before it moved: {said.recv()}"
        assert bench.is_alive() and time.monotonic() < end, "it never moved"
        if begun_at is None and "step_started" in _happened(logs):
            begun_at = _moved(robot)
        time.sleep(0.02)


def _moved(robot: Emulated) -> int:
    """For how many control periods the arm has moved; of a UR each is 2 ms, of an xArm 4."""
    return int(robot.control("status").split()[-2])


def _happened(logs: Path) -> list[str]:
    """Names of all events of the sessions of a folder, so far."""
    return [event.event for session in list_sessions(logs) for event in session.events]


def test_a_bench_that_is_stopped_by_a_signal_for_longer_than_it_may_finds_its_arm_at_rest(
    maker, robot, plans, tmp_path
):
    said, tell = FORKS.Pipe(duplex=False)
    protocol, logs = lasting(plans[maker], tmp_path), tmp_path / "logs"
    bench = forked(run_to_its_end, protocol, robot.address, logs, tell, {"host_silence": 5.0})
    tell.close()
    try:
        wait_for_recorded_motion(robot, bench, said, logs)
        os.kill(bench.pid, signal.SIGSTOP)
        robot.wait_until("STOPPED")  # while it is held
        robot.wait_until("at rest")
        os.kill(bench.pid, signal.SIGCONT)
        assert said.poll(60) and "the bench was silent for 5 s" in said.recv()
        bench.join(60)
    finally:
        bench.kill()
    faulted_session(logs, {"host_silence"})


@pytest.mark.parametrize(
    ("maker", "whom"),
    [("ur", "bench"), ("ur", "driving process"), ("xarm", "driving process")],
    indirect=["maker"],
)
def test_a_kill_in_motion_stops_the_arm(maker, robot, plans, tmp_path, whom):
    said, tell = FORKS.Pipe(duplex=False)
    protocol, logs = lasting(plans[maker], tmp_path), tmp_path / "logs"
    bench = forked(run_to_its_end, protocol, robot.address, logs, tell)
    tell.close()
    try:
        wait_for_recorded_motion(robot, bench, said, logs)
        if whom == "bench":
            bench.kill()
        else:
            children = Path(f"/proc/{bench.pid}/task/{bench.pid}/children").read_text().split()
            os.kill(int(children[0]), signal.SIGKILL)
        robot.wait_until("at rest")
        robot.wait_until("STOPPED")
        bench.join(60)
    finally:
        bench.kill()
    lock, end = ControllerLock(robot.address), time.monotonic() + 60
    while not (free := lock.take()) and time.monotonic() < end:
        time.sleep(0.05)
    lock.release()
    assert free, "a process still drives the arm"
    (session,) = list_sessions(logs)
    if whom == "bench":
        assert session.status is RunStatus.RUNNING and not session.is_being_recorded
    else:
        assert "the arm was stopped: the process that drives the arm has ended" in said.recv()
        assert session.status is RunStatus.ERROR
