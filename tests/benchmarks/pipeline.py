"""The whole way of the 315-pose protocol, stage by stage, alone and on a busy machine."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbench import estimate, evaluate, execute, plan, report
from testbench.execution import RunOptions
from tests.benchmarks.bars import Bar
from tests.benchmarks.timing import Text, busy_loops, duration, show

PROTOCOL = "elbow_flexion"
TARGET = 300
"""Robot-seconds for each second that the bench is meant to reach, alone by the clock on the wall,
beside busy loops in processor time.
"""
LARGEST_MB = 90
"""What the session is meant to stay below."""
LARGEST_REPORT_MB, SLOWEST_REPORT_S = 6, 1
"""And its report, in size and in the time that it takes."""
REPEATS = 3


@dataclass
class _Run:
    """One run of the protocol.

    Attributes:
        wall: Time of each stage by the clock on the wall [s].
        processor: Time that all threads of this process took [s].
        robot_seconds: Length of the motion [s].
        session_mb: Of all files of the session.
        report_mb: Of its report.
    """

    wall: dict[str, float] = field(default_factory=dict)
    processor: dict[str, float] = field(default_factory=dict)
    robot_seconds: float = 0.0
    session_mb: float = 0.0
    report_mb: float = 0.0

    def stage(self, name: str, call: Callable[[], Any]) -> Any:
        """Time a stage; gives what it returned."""
        wall, processor = time.perf_counter(), time.process_time()
        result = call()
        self.wall[name] = time.perf_counter() - wall
        self.processor[name] = time.process_time() - processor
        return result


def bench_pipeline() -> list[Bar]:
    """Time each stage in the best of some runs after the first, which compiles and fills caches."""
    with tempfile.TemporaryDirectory() as folder:
        _run(Path(folder) / "cold")
        alone = min(
            (_run(Path(folder) / f"alone_{i}") for i in range(REPEATS)),
            key=lambda run: sum(run.wall.values()),
        )
        with busy_loops(2):
            beside = min(
                (_run(Path(folder) / f"beside_{i}") for i in range(REPEATS)),
                key=lambda run: sum(run.processor.values()),
            )
    robot_seconds = alone.robot_seconds
    columns = (alone.wall, alone.processor, beside.processor)
    totals = [sum(times.values()) for times in columns]
    rows: list[list[str | Text]] = [
        [
            Text(stage),
            *(duration(times[stage]) for times in columns),
            f"{100 * alone.wall[stage] / totals[0]:.0f} %",
        ]
        for stage in alone.wall
    ]
    rows.append([Text("total"), *(duration(total) for total in totals), "100 %"])
    rows.append([Text("robot-seconds a second"), *(f"{robot_seconds / t:.0f}" for t in totals), ""])
    show(
        f"Pipeline: {PROTOCOL}, {robot_seconds:.0f} s of robot time, in the process, best of "
        f"{REPEATS} runs",
        ["stage", "time", "processor time", "beside two busy loops", "share"],
        rows,
    )
    speed = f"{PROTOCOL} in the process, robot time over"
    return [
        Bar(f"{speed} time", robot_seconds / totals[0], TARGET, "s/s", at_least=True),
        Bar(
            f"{speed} processor time beside two busy loops",
            robot_seconds / totals[2],
            TARGET,
            "s/s",
            at_least=True,
        ),
        Bar(f"session of {PROTOCOL}", alone.session_mb, LARGEST_MB, "MB"),
        Bar(f"report of {PROTOCOL}", alone.report_mb, LARGEST_REPORT_MB, "MB"),
        Bar(f"report of {PROTOCOL}, time", alone.wall["report"], SLOWEST_REPORT_S, "s"),
    ]


def _run(folder: Path) -> _Run:
    run = _Run()
    the_plan = run.stage("plan and check", lambda: plan(PROTOCOL))
    session = run.stage(
        "execute", lambda: execute(the_plan, folder, options=RunOptions(session_name="session"))
    )
    estimated = run.stage("estimate", lambda: estimate(session))
    run.stage("save estimate", lambda: estimated.save(session.path))
    evaluated = run.stage("evaluate", lambda: evaluate(session, estimated))
    run.stage("save evaluation", lambda: evaluated.save(session.path))
    page = run.stage("report", lambda: report(session, estimated, evaluated))
    run.robot_seconds = the_plan.duration
    files = (file for file in session.path.rglob("*") if file.is_file())
    run.report_mb = page.stat().st_size / 1e6
    run.session_mb = sum(file.stat().st_size for file in files) / 1e6
    return run
