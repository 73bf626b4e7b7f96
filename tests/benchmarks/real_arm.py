"""Runs through the real client libraries against the emulated controllers: poses, following,
deadlines.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from testbench.clock import SystemClock
from testbench.drivers.arms.base import SteppingArm
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.drivers.session_time import SessionTime
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from testbench.records.specs.shipped import shipped_folder
from tests.asking import run_of
from tests.benchmarks.timing import Text, show
from tests.emulated_arms import COMMAND_PORT, emulated_ur, emulated_xarm


def flexion_of_40_poses(folder: Path) -> Plan:
    """elbow_flexion with 5 misalignments and 8 flexions, and no calibration."""
    content = yaml.safe_load(
        (shipped_folder("protocols") / "elbow_flexion.yaml").read_text(encoding="utf-8")
    )
    content["variables"] |= {
        "misalignment_deg": {"start": -20, "stop": 20, "step": 10},
        "flexion_deg": {"start": 0, "stop": 70, "step": 10},
    }
    content["sections"] = [section for section in content["sections"] if "include" not in section]
    for section in content["sections"]:
        for step in section.get("steps", []):
            step["dwell_s"] = min(step.get("dwell_s", 0.5), 0.5)
    content["estimate"] = {"filters": ["device"], "align": "heading", "calibrate": "none"}
    content["accept"] = []
    path = folder / "elbow_flexion.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return make_plan(run_of(path))


XARM = """\
name: xarm_benchmark
purpose: 40 poses and a sweep
robot: xarm6
sensors: {hand: {preset: xsens_dot, link: link6}}
variables:
  misalignment_deg: {start: -20, stop: 20, step: 10}
  flexion_deg: {start: 0, stop: 70, step: 10}
sections:
  - name: poses
    role: reference
    for_each: [misalignment_deg, flexion_deg]
    steps:
      - move_to_deg: [misalignment_deg, 0, -90, 0, 90 - misalignment_deg, flexion_deg]
        dwell_s: 0.5
  - name: sweep
    steps:
      - {move_to: home, dwell_s: 0.5}
      - {sweep: {joint6: {sine: {amplitude_deg: 20, frequency_hz: 0.5, cycles: 3}}}, dwell_s: 0.5}
estimate: {filters: [device], align: heading, calibrate: none}
"""


def run(plan: Plan, address: str, logs: Path) -> Session:
    """A run with simulated sensors, on the arm that the plan is for."""
    time = SessionTime(SystemClock())
    if plan.robot.name == "xarm6":
        arm: SteppingArm = XArm(plan.robot, xarm_settings(plan, f"{address}:{COMMAND_PORT}"), time)
    else:
        arm = UrArm(plan.robot, ur_settings(plan, address), time)
    return execute_on_arm(plan, arm, Sensors.simulated(plan, 1), RunOptions(logs))


def worst_pose(session: Session, plan: Plan) -> tuple[int, float]:
    """Number of poses, and the largest error of any joint in any of them [deg]."""
    arm, worst = session.arm(), 0.0
    assert arm is not None
    steps = [step for step in session.steps if step.kind != "sweep"]
    for step in steps:
        rest = (arm.host_time_ns >= step.settled_ns) & (arm.host_time_ns <= step.end_ns)
        planned = plan.trajectory.at(np.array([plan.steps[step.index].settled_ns]))[0][0]
        worst = max(
            worst,
            float(np.degrees(np.abs(np.median(arm.q_measured[rest], axis=0) - planned)).max()),
        )
    return len(steps), worst


def following(session: Session, plan: Plan) -> tuple[float, float, float]:
    """Lag of a sweep [s], and the error that lag does not explain: RMS and largest [deg]."""
    arm = session.arm()
    assert arm is not None
    step = next(step for step in session.steps if step.kind == "sweep")
    inside = (arm.host_time_ns >= step.start_ns) & (arm.host_time_ns <= step.settled_ns)
    times = arm.host_time_ns[inside] - step.start_ns + plan.steps[step.index].start_ns

    def errors(lag: float) -> np.ndarray:
        return np.asarray(
            np.degrees(
                np.abs(arm.q_measured[inside] - plan.trajectory.at(times - round(lag * 1e9))[0])
            )
        ).max(axis=1)

    lags = np.arange(0, 0.2, 0.001)
    lag = float(lags[np.argmin([np.mean(errors(lag) ** 2) for lag in lags])])
    return lag, float(np.sqrt(np.mean(errors(lag) ** 2))), float(errors(lag).max())


def show_figures(title: str, poses: tuple[Session, Plan], sweep: tuple[Session, Plan]) -> bool:
    """Print the figures of an arm; whether every pose was within a hundredth of a degree."""
    count, worst = worst_pose(*poses)
    lag, rms, largest = following(*sweep)
    arm = sweep[0].manifest.content["arm"]
    timing = arm["timing"]
    rows: list[list[str | Text]] = [
        [Text("static poses"), str(count)],
        [Text("largest error of a joint in a pose [deg]"), f"{worst:.4f}"],
        [Text("lag of the sweep [ms]"), f"{1e3 * lag:.0f}"],
        [Text("error that lag does not explain, RMS [deg]"), f"{rms:.3f}"],
        [Text("the same, largest [deg]"), f"{largest:.3f}"],
        [Text(f"turns of the {arm['control_hz']:g} Hz loop"), str(timing["cycles"])],
        [Text("late by, median [ms]"), f"{1e3 * timing['late_median_s']:.2f}"],
        [Text("late by, 99 % [ms]"), f"{1e3 * timing['late_p99_s']:.2f}"],
        [Text("later than 1 ms [%]"), f"{100 * timing['overruns'] / timing['cycles']:.2f}"],
        [Text("samples missed"), str(timing["samples_missed"])],
    ]
    show(title, ["", "value"], rows)
    return worst < 0.01


def bench_real_arm() -> bool:
    """A Universal Robots arm."""
    with tempfile.TemporaryDirectory() as name, emulated_ur() as emulator:
        folder = Path(name)
        poses, sweep = flexion_of_40_poses(folder), make_plan(run_of("quick"))
        first = run(poses, emulator.address, folder / "logs")
        second = run(sweep, emulator.address, folder / "logs")
        return show_figures(
            "ur_rtde against the emulated controller", (first, poses), (second, sweep)
        )


def bench_xarm() -> bool:
    """A UFACTORY xArm."""
    with tempfile.TemporaryDirectory() as name, emulated_xarm() as emulator:
        folder = Path(name)
        (folder / "xarm.yaml").write_text(XARM, encoding="utf-8")
        plan = make_plan(run_of(folder / "xarm.yaml"))
        done = run(plan, emulator.address, folder / "logs")
        return show_figures(
            "xarm-python-sdk against the emulated controller", (done, plan), (done, plan)
        )


if __name__ == "__main__":
    sys.exit(not all([bench_real_arm(), bench_xarm()]))
