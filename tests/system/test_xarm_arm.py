"""Runs on an emulated UFACTORY xArm, in lock step: nothing here depends on how busy the machine is.
`test_real_clients` drives through the real client library.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from testbench.cli.app import app
from testbench.drivers.arms.link import SILENCE_S
from testbench.drivers.arms.remedies import XARM_REMEDIES
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.exceptions import ArmRefused, DriverError, InputError
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, Session
from tests.asking import run_of
from tests.benchmarks.real_arm import following
from tests.emulated_arms import faulted_session
from tests.lock_step.bench import COMMAND_PORT, VirtualArm, VirtualBench, virtual_bench
from tests.lock_step.xarm_library import TITLES

PROTOCOL = """\
name: {name}
purpose: For tests on an arm in real time
robot: xarm6
sensors:
  hand:
    preset: xsens_dot
    link: link6
    mounting: {{rotation_deg: {{XYZ: [90, 90, 0]}}, position_mm: [0, 0, 10]}}
motion: {{speed: 0.9, acceleration: 0.9, jerk: 0.9}}
arm: {{tool: {{mass_kg: 0.2, centre_mm: [0, 0, 30]}}}}
sections:
  - name: moves
    role: reference
    steps: [{steps}]
estimate: {{filters: [device], align: heading, calibrate: none}}
"""
POSES = """
      {name: first, move_to_deg: {joint6: 25, joint5: 75}, dwell_s: 0.3},
      {name: second, dwell_s: 0.3,
       move_to_deg: {joint1: 10, joint2: 5, joint3: -95, joint4: -15, joint6: 10}},
      {name: wave, dwell_s: 0.2,
       sweep: {joint6: {sine: {amplitude_deg: 5, frequency_hz: 1.2, cycles: 1}}}}"""
MOVES = """
      {name: out, move_to_deg: {joint6: 30}, dwell_s: 0.05},
      {name: back, move_to: home, dwell_s: 0.05}"""


def plan_of(folder: Path, name: str, steps: str) -> tuple[Path, Plan]:
    path = folder / f"{name}.yaml"
    path.write_text(PROTOCOL.format(name=name, steps=steps), encoding="utf-8")
    return path, make_plan(run_of(path))


@pytest.fixture(scope="module")
def moves(tmp_path_factory) -> tuple[Path, Plan]:
    return plan_of(tmp_path_factory.mktemp("moves"), "moves", MOVES)


@pytest.fixture
def robot(bench: VirtualBench) -> VirtualArm:
    return bench.xarm()


@pytest.fixture(scope="module")
def poses_plan(tmp_path_factory) -> Plan:
    return plan_of(tmp_path_factory.mktemp("poses"), "poses", POSES)[1]


@pytest.fixture(scope="module")
def told() -> list[str]:
    return []


@pytest.fixture(scope="module")
def done(poses_plan, told, tmp_path_factory) -> Session:
    """The poses and the sweep, run once; its files must not be changed."""
    logs = tmp_path_factory.mktemp("logs")
    with virtual_bench() as bench:
        robot = bench.xarm()
        session = bench.drive(poses_plan, robot, logs, notify=told.append)
        assert "STOPPED" in robot.control("status")  # an arm that is let go stays where it is
        return session


def test_static_poses_are_reached_to_a_hundredth_of_a_degree(done, poses_plan):
    arm = done.arm()
    assert len(done.steps) == 3
    for step in done.steps:
        rest = (arm.host_time_ns > step.settled_ns + 150_000_000) & (arm.host_time_ns < step.end_ns)
        assert rest.sum() > 5
        planned = poses_plan.trajectory.at(np.array([poses_plan.steps[step.index].settled_ns]))[0][
            0
        ]
        assert np.degrees(np.abs(np.median(arm.q_measured[rest], axis=0) - planned)).max() < 0.01


def test_a_sweep_is_followed_with_nothing_but_lag(done, poses_plan):
    lag, rest, _ = following(done, poses_plan)
    assert 0.055 < lag < 0.065  # filter 30 ms, servo 32 ms
    assert rest < 0.15  # of 5 deg


def test_the_session_says_that_the_driver_is_unverified_and_so_did_the_connection(done, told):
    arm = done.manifest.content["arm"]
    assert done.status is RunStatus.COMPLETED
    assert arm["driver"] == "xarm" and arm["model"] == "xArm 6" and arm["firmware"] == "2.5.0"
    assert arm["unverified_on_hardware"] is True
    assert len(told) == 1 and "UNVERIFIED ON HARDWARE" in told[0]
    assert [
        event.details["message"] for event in done.events if event.event == "arm_notice"
    ] == told


def test_measured_angles_states_and_the_controllers_time_are_recorded(done):
    import pandas as pd

    table = pd.read_parquet(done.path / "arm.parquet")
    assert set(np.diff(table["controller_time_ns"])) == {5_000_000}  # every report
    assert (table["error_code"] == 0).all() and (table["temperature_joint1_degC"] == 30).all()
    sweep = next(step for step in done.steps if step.kind == "sweep")
    inside = (table["host_time_ns"] > sweep.start_ns + 100_000_000) & (
        table["host_time_ns"] < sweep.settled_ns - 100_000_000
    )
    assert (table["mode"][inside] == 1).all() and (table["state"] <= 2).sum() > 0.95 * len(table)
    lag = np.abs(table["q_sent_joint6_rad"] - table["q_measured_joint6_rad"])[inside].max()
    assert lag > np.radians(0.3)  # what the encoders measured, not what was asked for


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("fault emergency_stop", "emergency stop is pressed"),
        ("fault protective_stop", r"error 31 \(Collision Caused Abnormal Current\)"),
        ("fault power_off", "motors of joints 1, 2, 3, 4, 5, 6 are not enabled"),
    ],
)
def test_an_arm_that_must_not_be_driven_is_refused_before_anything_moves(
    bench, robot, moves, fault, sentence
):
    robot.control(fault)
    before = robot.control("status")
    with pytest.raises(ArmRefused, match=sentence) as caught:
        bench.arm(moves[1], robot).connect()
    assert caught.value.exit_code == 2
    assert robot.control("status") == before  # nor is anything changed


@pytest.mark.parametrize(
    ("identity", "sentence"),
    [
        (
            {"claims": "lite6"},
            "the plan is for a xarm6, the controller says that it drives an Lite 6",
        ),
        ({"firmware": "1.12.0"}, r"has firmware 1\.12\.0; this driver needs 2\.1\.0"),
    ],
)
def test_another_model_or_an_old_controller_is_refused(bench, moves, identity, sentence):
    with pytest.raises(ArmRefused, match=sentence):
        bench.arm(moves[1], bench.xarm(**identity)).connect()


def test_what_cannot_be_driven_is_said_in_a_sentence(bench, moves):
    plan = moves[1]
    with pytest.raises(DriverError, match=r"no controller answers at 127\.99\.99\.98, port 1502"):
        bench.arm(plan, "127.99.99.98").connect()
    with pytest.raises(InputError, match="number of a port"):
        xarm_settings(plan, "127.0.0.1:http")
    other = make_plan(run_of("quick"))
    with pytest.raises(InputError, match="xarm6; the plan is for ur3e"):
        XArm(other.robot, xarm_settings(other, "127.0.0.1"))


def test_a_bench_that_plans_for_long_between_connection_and_motion_does_not_give_the_arm_up(
    bench, robot, moves
):
    arm = bench.arm(moves[1], robot)
    try:
        arm.connect()
        bench.clock.sleep(2 * SILENCE_S)  # as if it had looked at many ways
        arm.check_way(moves[1])
        arm.prepare(moves[1])
    finally:
        arm.close()


FAULTS = [
    ("fault emergency_stop", {"emergency_stop"}),
    ("fault protective_stop", {"protective_stop"}),
    ("fault power_off", {"power_off"}),
    ("fault program_stop", {"program_stopped"}),
    ("fault disconnect 3", {"disconnect"}),
    ("fault report_silence", {"report_silence"}),
    ("fault slow_response 4", {"slow_response"}),
]


@pytest.mark.parametrize(("fault", "kinds"), FAULTS, ids=[fault.split()[1] for fault, _ in FAULTS])
def test_a_fault_in_motion_ends_in_a_stopped_arm_and_a_closed_session_that_names_it(
    bench, robot, moves, tmp_path, fault, kinds
):
    struck: list[str] = []

    def strike(progress) -> None:
        if not struck and "MOVING" in robot.control("status"):
            struck.append(robot.control(fault))

    with pytest.raises(DriverError, match="the arm was stopped") as caught:
        bench.drive(moves[1], robot, tmp_path, progress=strike)
    assert struck == ["ok"]
    assert caught.value.exit_code == 3
    robot.wait_until("at rest", 5)
    session = faulted_session(tmp_path, kinds)
    (stopped,) = [event for event in session.events if event.event == "arm_fault"]
    (advice,) = [note for note in caught.value.__notes__ if note.startswith("what to do: ")]
    assert advice == f"what to do: {XARM_REMEDIES[stopped.details['fault']]}"


def test_without_confirmation_nothing_moves(robot, moves, tmp_path, monkeypatch):
    before = robot.control("status")
    asked = [
        "run",
        str(moves[0]),
        "--arm",
        "xarm",
        "--host",
        f"{robot.address}:{COMMAND_PORT}",
        "--logs",
        str(tmp_path / "logs"),
    ]
    result = CliRunner().invoke(app, [*asked, "--simulate-imus", "--no-report"])
    assert isinstance(result.exception, ArmRefused) and result.exception.exit_code == 2
    assert "--confirm-motion" in str(result.exception)
    assert "out" in result.output and "back" in result.output
    assert not (tmp_path / "logs").exists()
    assert robot.control("status") == before


def test_the_library_calls_errors_as_its_stand_in_does(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))  # it makes a folder there when it is imported
    codes = pytest.importorskip("xarm.core.config.x_code", reason="xarm-python-sdk is missing")
    known = codes.ControllerErrorCodeMap
    assert {code: known[code]["en"]["title"] for code in TITLES} == TITLES
