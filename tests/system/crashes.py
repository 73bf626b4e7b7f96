"""Kill simulated runs at random moments, and compare what becomes of them with an undisturbed
one.
"""

from __future__ import annotations

import random
import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Literal

import numpy as np

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.execution.recovery import recover
from testbench.pipeline.analyse import analyse
from testbench.pipeline.run import run
from testbench.pipeline.watcher import Watcher
from testbench.records.disk.tables import read_parquet
from testbench.records.results.evaluation import Evaluation
from testbench.records.session.session import Session
from tests.asking import analysis, going_on
from tests.conftest import FakeClock
from tests.processes import FORKS, forked, virtual_time

SEED = 5


@dataclass
class Outcome:
    """What became of a killed run; times in seconds of the session."""

    reached: float
    recorded: float
    opened: bool
    same_files: bool
    same_evaluation: bool
    was_session: bool = True

    @property
    def lost(self) -> float:
        return max(self.reached - self.recorded, 0.0)


@dataclass
class Undisturbed:
    """The same run without a kill, its evaluation, and how long it took at each speed [s]."""

    session: Session
    evaluation: Evaluation
    took: dict[str, float]


def undisturbed(protocol: Path, logs: Path) -> Undisturbed:
    """Run a protocol to its end, at either speed."""
    took = {}
    for speed in ("realtime", "fast"):
        process, said = started(protocol, logs / speed, speed)
        begin = time.perf_counter()
        process.join()
        took[speed] = time.perf_counter() - begin
        assert process.exitcode == 0 and told(said) > 0
    session = Session(logs / "fast" / "run")
    return Undisturbed(session, analyse(session, analysis()).evaluation, took)


def started(
    protocol: Path, logs: Path, speed: str, struck_s: float | None = None
) -> tuple[BaseProcess, Connection]:
    """A run on virtual time in a process of its own that has made its plan, and what it tells of
    its progress; killed at a time of the run, if there is one.
    """
    said, tell = FORKS.Pipe(duplex=False)
    process = forked(_run, protocol, logs, speed, tell, struck_s)
    tell.close()
    assert said.recv() == "planned"
    return process, said


def _run(
    protocol: Path,
    logs: Path,
    speed: Literal["fast", "realtime"],
    tell: Connection,
    struck_s: float | None,
) -> None:
    the_plan = plan(protocol)
    tell.send("planned")
    with virtual_time(struck_s, signal.SIGKILL):
        execute(
            the_plan,
            logs,
            seed=SEED,
            options=RunOptions(
                speed=speed, progress=lambda progress: tell.send(progress.time), session_name="run"
            ),
        )


def told(said: Connection) -> float:
    """How far a process that is gone said that it had come [s]."""
    reached = 0.0
    try:
        while True:
            reached = said.recv()
    except (EOFError, OSError):
        return reached


def killed_at(protocol: Path, logs: Path, struck_s: float) -> tuple[Path, float]:
    """The folder of a session whose run was killed at a time of its own [s], and how far it said
    it had come [s].
    """
    process, said = started(protocol, logs, "realtime", struck_s)
    process.join()
    assert process.exitcode == -signal.SIGKILL
    return logs / "run", told(said)


def killed(protocol: Path, logs: Path, speed: str, after_s: float) -> float:
    """Kill a run some time after its plan was made; how far it said it had come [s]."""
    process, said = started(protocol, logs, speed)
    process.join(after_s)
    process.kill()
    process.join()
    return told(said)


def crash(protocol: Path, logs: Path, speed: str, part: float, whole: Undisturbed) -> Outcome:
    """One kill after a part of the time that an undisturbed run takes, recovery, resumption, and
    the comparison.
    """
    reached = killed(protocol, logs, speed, part * whole.took[speed])
    if not (logs / "run" / "manifest.json").is_file():
        # killed before the folder became a session: nothing had been recorded
        return Outcome(reached, reached, True, True, True, was_session=False)
    session = recover(Session(logs / "run"))
    recorded = float(session.manifest.duration_s or 0.0)
    _ = session.events, session.steps
    finished = session
    if session.status != "completed":
        finished = run(going_on(session.path), Watcher(clock=FakeClock())).session
    evaluation = analyse(finished, analysis()).evaluation
    names = [
        "arm",
        *(f"imu_{name}" for name in whole.session.sensor_names),
        *(f"truth_{name}" for name in whole.session.sensor_names),
    ]
    same = all(
        _equal(whole.session.path / f"{name}.parquet", finished.path / f"{name}.parquet")
        for name in names
    )
    same_evaluation = comparable(evaluation) == comparable(whole.evaluation)
    return Outcome(reached, recorded, True, same, same_evaluation)


def _equal(first: Path, second: Path) -> bool:
    one, two = read_parquet(first), read_parquet(second)
    return list(one) == list(two) and all(
        np.array_equal(one[key], two[key], equal_nan=one[key].dtype == float) for key in one
    )


def comparable(evaluation: Evaluation) -> str:
    """All of an evaluation but the folder that it belongs to."""
    data = evaluation.to_dict()
    for key in ("session", "fingerprint", "estimate"):
        data.pop(key, None)
    return repr(data)


def moments(count: int, seed: int = 0) -> list[tuple[str, float]]:
    """Random moments, as parts of the time that a run takes; every other run writes second by
    second, where the kill hits the recording, the others as fast as they can, where it hits the
    writing of the session.
    """
    rng = random.Random(seed)
    return [("realtime" if i % 2 else "fast", rng.uniform(0.25, 1.1)) for i in range(count)]
