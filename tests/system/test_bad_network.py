"""A network that goes bad while an arm moves: whatever it does, the arm comes to rest and that is
known, the cause is told as it is, and nothing of the session is lost. One moment of each
disturbance, in lock step; `tests.benchmarks.networks` has every one at every moment, through the
real client libraries.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.emulation.disturbances import Disturbance
from testbench.exceptions import DriverError
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from tests.asking import run_of
from tests.emulated_arms import faulted_session
from tests.lock_step.bench import VirtualArm, VirtualBench

MOTION = """\
name: out
purpose: One move, so that a network may go bad in it
robot: {robot}
sensors: {{hand: {{preset: xsens_dot, link: {link}}}}}
motion: {{speed: 0.8, acceleration: 0.8, jerk: 0.8}}
sections:
  - name: moves
    role: reference
    steps: [{{name: out, move_to_deg: {{{joint}: 40}}, dwell_s: 0.1}}]
estimate: {{filters: [device], align: none, calibrate: none}}
"""


@pytest.fixture(scope="module")
def plans(tmp_path_factory) -> dict[str, Plan]:
    folder, made = tmp_path_factory.mktemp("plans"), {}
    for robot, link, joint in (
        ("ur3e", "wrist_3_link", "wrist_3_joint"),
        ("xarm6", "link6", "joint6"),
    ):
        path = folder / f"{robot}.yaml"
        path.write_text(MOTION.format(robot=robot, link=link, joint=joint), encoding="utf-8")
        made[robot] = make_plan(run_of(path))
    return made


def struck(
    bench: VirtualBench, robot: VirtualArm, plan: Plan, logs: Path, disturbance: Disturbance
) -> str:
    """How a run ended whose network went bad in its move."""
    when: list[int] = []

    def strike(progress) -> None:
        if not when and progress.time > 0 and ", moving" in robot.control("status"):
            bench.network.strike(disturbance)
            when.append(bench.clock.now_ns)

    with pytest.raises(DriverError) as caught:
        bench.drive(plan, robot, logs, progress=strike)
    assert caught.value.exit_code == 3 and when
    robot.wait_until("at rest", max(2.0 - 1e-9 * (bench.clock.now_ns - when[0]), 0.0))
    assert "PLAYING" not in robot.control("status")
    return str(caught.value)


UR = [
    (Disturbance("reset", None, 30004), "disconnect", "at rest"),
    (Disturbance("half_close", None, 30004, "down"), "disconnect", "at rest"),
    (Disturbance("stall", None, 30004, "down"), "report_silence", "halted"),
    (Disturbance("delay", 1.0), "report_silence", "at rest"),
    # the library's connection for commands, or the bench's own for reports, is the first to be hit
    (Disturbance("corrupt", 0.01, 30004, "down"), "garbled disconnect", "at rest"),
    (Disturbance("reorder", 0.5, 30004, "down"), "garbled", "halted"),
    (Disturbance("refuse"), "disconnect", "unknown"),
]


@pytest.mark.parametrize(
    ("disturbance", "cause", "seen"), UR, ids=[disturbance.fault for disturbance, *_ in UR]
)
def test_a_ur_arm_comes_to_rest(bench, plans, tmp_path, disturbance, cause, seen):
    robot = bench.ur()
    said = struck(bench, robot, plans["ur3e"], tmp_path, disturbance)
    (told,) = [
        event
        for event in faulted_session(tmp_path, set(cause.split())).events
        if event.event == "arm_fault"
    ]
    assert (told.details["arm"], "nobody saw the arm" in said) == (seen, seen == "unknown")


XARM = [
    (Disturbance("reset", None, 1502), "disconnect", "at rest"),
    (Disturbance("corrupt", 0.01, 30000, "down"), "garbled", "at rest"),
]


@pytest.mark.parametrize(
    ("disturbance", "cause", "seen"), XARM, ids=[disturbance.fault for disturbance, *_ in XARM]
)
def test_an_xarm_comes_to_rest(bench, plans, tmp_path, disturbance, cause, seen):
    robot = bench.xarm()
    struck(bench, robot, plans["xarm6"], tmp_path, disturbance)
    (told,) = [
        event
        for event in faulted_session(tmp_path, set(cause.split())).events
        if event.event == "arm_fault"
    ]
    assert told.details["arm"] == seen
