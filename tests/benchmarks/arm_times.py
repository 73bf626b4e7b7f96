"""Arm time on a busy machine: runs on an emulated UR arm through its client library, beside two
processes that want a core each.

The emulator knows the true offset between its clock and the host's. No step may be told that never
happened, every true one must be; the offset must lie within what the session states of it, or the
run be told as doubtful.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from testbench.clock import SystemClock
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.session_time import SessionTime
from testbench.evaluation.arm_time import UNSURE_S
from testbench.exceptions import BenchError
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session, list_sessions
from tests.asking import run_of
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, busy_loops, show
from tests.emulated_arms import SHORT, Emulated, emulated_ur

RUNS, STEPPED = 200, 20
LOOPS = 2
SURE_SHARE = 0.95
"""So many of the runs state an uncertainty of no more than `UNSURE_S`."""
CLOSE_S = 0.01
"""A step is found that is told to within so much [s]."""
BUSY = {"slow_response", "host_silence", "report_silence", "tracking_error", "driver"}
"""Causes that a busy machine has."""


def step_of(number: int) -> float:
    """The step of the controller's clock in a trial [s], 0 in most."""
    if number % (RUNS // STEPPED + 1):
        return 0.0
    sizes = np.linspace(0.02, 0.2, STEPPED)
    k = number // (RUNS // STEPPED + 1)
    return float(sizes[k % STEPPED] * (1 if k % 2 else -1))


def one(number: int, plan: Plan, robot: Emulated, folder: Path) -> dict[str, Any]:
    """What the times of one run are worth."""
    time = SessionTime(SystemClock())
    arm = UrArm(plan.robot, ur_settings(plan, robot.address), time)
    step, struck = step_of(number), list[str]()

    def strike(progress: Any) -> None:
        if step and not struck and progress.step == "out" and not progress.doing:
            struck.append(robot.control(f"fault clock_step {step:.4f}"))

    offset_ns, error = int(robot.control("clock")), ""
    sensors = Sensors.simulated(plan, 1)
    try:
        execute_on_arm(plan, arm, sensors, RunOptions(folder, 1, progress=strike))
    except BenchError as failure:
        error = str(failure).partition("\n")[0]
    (session,) = list_sessions(folder)
    offset_ns = int(robot.control("clock")) if step else offset_ns
    told = [event for event in session.events if event.event == "arm_time_step"]
    by = [float(event.details["by_s"]) for event in told]
    faults = [e.details["fault"] for e in session.events if e.event == "arm_fault"]
    timing = session.manifest.content["arm"].get("timing") or {}
    return {
        "step_s": step if struck else 0.0,
        "steps": by,
        "off_s": _off(session, arm._origin_ns, offset_ns, told[-1].host_time_ns if told else 0),
        "unsure_s": timing.get("clock_unsure_s", 0.0),
        "missed": timing.get("samples_missed", 0),
        "late_max_s": timing.get("late_max_s", 0.0),
        "cause": faults[0] if faults else "",
        "error": error,
    }


def _off(session: Session, origin_ns: int, offset_ns: int, since_ns: int) -> float:
    """Largest error of the host times that the session has of the controller's stamps [s]."""
    path = session.path / "arm.parquet"
    if not path.is_file():
        return 0.0
    table = pd.read_parquet(path, columns=["host_time_ns", "controller_time_ns"])
    table = table[table["host_time_ns"] >= since_ns]
    errors = table["host_time_ns"] + origin_ns - table["controller_time_ns"] - offset_ns
    return float(np.abs(errors).max()) * 1e-9 if len(errors) else 0.0


def trials(numbers: range) -> Iterator[dict[str, Any]]:
    """Runs by their numbers."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "short.yaml"
        path.write_text(SHORT, encoding="utf-8")
        plan = make_plan(run_of(path))
        for number in numbers:
            with emulated_ur() as robot, busy_loops(LOOPS):
                found = one(number, plan, robot, folder / str(number))
            print(f"{number}: {found}", flush=True)
            yield found


def bench_arm_times(count: int = RUNS + STEPPED) -> bool:
    """Print what the times are worth; whether all is as it must be."""
    found = resumed("arm_times", count, trials)
    plain = [run for run in found if not run["step_s"]]
    stepped = [run for run in found if run["step_s"]]
    false = sum(bool(run["steps"]) for run in plain)
    missed = [run for run in stepped if not _found(run)]
    outside = [run for run in plain if run["off_s"] > run["unsure_s"]]
    sure = sum(run["unsure_s"] <= UNSURE_S for run in plain)
    wrong = [run for run in found if run["cause"] and run["cause"] not in BUSY]
    rows: list[list[str | Text]] = [
        [Text("runs without a step of the clock"), str(len(plain))],
        [Text("steps told that never happened"), str(false)],
        [Text("true offset outside of the stated uncertainty"), str(len(outside))],
        [Text(f"stated to within {1e3 * UNSURE_S:g} ms"), str(sure)],
        [Text("largest error of the offset [ms]"), f"{1e3 * max(r['off_s'] for r in plain):.2f}"],
        [Text("runs with a step of 20 to 200 ms"), str(len(stepped))],
        [Text("steps that were not told"), str(len(missed))],
        [Text("runs that the busy machine ended"), str(sum(bool(run["cause"]) for run in found))],
        [Text("ends with a cause that this machine cannot have"), str(len(wrong))],
        [Text("samples missed"), str(sum(run["missed"] for run in found))],
    ]
    show("Arm time beside two busy loops", ["", "value"], rows)
    for run in [*outside, *missed, *wrong]:
        print(f"  {run}")
    enough = sure >= SURE_SHARE * len(plain)
    return enough and not (false or missed or outside or wrong)


def _found(run: dict[str, Any]) -> bool:
    """Whether a step was told; of a run that was over before the next motion nobody could."""
    return bool(run["cause"]) or abs(sum(run["steps"]) + run["step_s"]) < CLOSE_S


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        sys.exit(not bench_arm_times(count_of(RUNS + STEPPED, __doc__)))
