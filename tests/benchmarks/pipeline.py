"""The whole way of the 315-pose protocol, stage by stage."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from testbench import estimate, evaluate, execute, plan, report
from testbench.execution import RunOptions
from tests.benchmarks.timing import Text, duration, once, show

PROTOCOL = "elbow_flexion"
TARGET = 100
"""Robot-seconds for each wall-clock second that the bench is meant to reach."""


def bench_pipeline() -> None:
    """Time each stage in the second run, when everything is compiled and cached."""
    with tempfile.TemporaryDirectory() as folder:
        _run(Path(folder) / "cold")
        times, robot_seconds = _run(Path(folder) / "warm")
    total = sum(times.values())
    rows: list[list[str | Text]] = [
        [Text(stage), duration(time), f"{100 * time / total:.0f} %", f"{robot_seconds / time:.0f}"]
        for stage, time in times.items()
    ]
    rows.append([Text("total"), duration(total), "100 %", f"{robot_seconds / total:.0f}"])
    show(
        f"Pipeline: {PROTOCOL}, {robot_seconds:.0f} s of robot time, second run",
        ["stage", "time", "share", "robot-seconds per second"],
        rows,
        f"target: at least {TARGET} robot-seconds per second in total",
    )


def _run(folder: Path) -> tuple[dict[str, float], float]:
    """Times of the stages [s], and the length of the motion [s]."""
    times: dict[str, float] = {}

    def timed(stage: str, call: Callable[[], Any]) -> Any:
        times[stage], result = once(call)
        return result

    the_plan = timed("plan and check", lambda: plan(PROTOCOL))
    session = timed(
        "execute", lambda: execute(the_plan, folder, options=RunOptions(session_name="session"))
    )
    estimated = timed("estimate", lambda: estimate(session))
    timed("save estimate", lambda: estimated.save(session.path))
    evaluated = timed("evaluate", lambda: evaluate(session, estimated))
    timed("save evaluation", lambda: evaluated.save(session.path))
    timed("report", lambda: report(session, estimated, evaluated))
    return times, the_plan.duration
