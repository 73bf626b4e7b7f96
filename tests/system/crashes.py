"""Kill simulated runs at random moments, and compare what becomes of them with an undisturbed
one.
"""

from __future__ import annotations

import os
import random
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.arm_pipeline import resume
from testbench.execution.recovery import recover
from testbench.pipeline import analyse
from testbench.records.evaluation import Evaluation
from testbench.records.session import Session
from testbench.records.storage import read_parquet

ROOT = Path(__file__).resolve().parents[2]

RUN = """\
import sys
from testbench import plan
from testbench.execution import RunOptions, execute

def tell(progress):
    print(progress.time, flush=True)

the_plan = plan(sys.argv[1])
print("ready", flush=True)
execute(the_plan, sys.argv[2], 5, RunOptions(speed=sys.argv[3], progress=tell, session_name="run"))
"""


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


def undisturbed(protocol: Path, logs: Path) -> tuple[Session, Evaluation]:
    """The same run without a kill, and its evaluation."""
    command = [sys.executable, "-c", RUN, str(protocol), str(logs), "fast"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    session = Session(logs / "run")
    return session, analyse(session, with_report=False).evaluation


def killed(protocol: Path, logs: Path, speed: str, after_s: float) -> float:
    """Kill a run some time after its plan was made; how far it said it had come [s]."""
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, str(protocol), str(logs), speed],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    time.sleep(after_s)
    os.kill(process.pid, signal.SIGKILL)
    said, _ = process.communicate()
    return float(said.split()[-1]) if said.split() else 0.0


def crash(
    protocol: Path, logs: Path, speed: str, after_s: float, whole: Session, expected: Evaluation
) -> Outcome:
    """One kill, recovery, resumption, and the comparison."""
    reached = killed(protocol, logs, speed, after_s)
    if not (
        logs / "run" / "manifest.json"
    ).is_file():  # killed before the folder became a session: nothing had been recorded
        return Outcome(reached, reached, True, True, True, was_session=False)
    session = recover(Session(logs / "run"))
    recorded = float(session.manifest.get("duration_s") or 0.0)
    _ = session.events, session.steps
    finished = session
    if session.status != "completed":
        finished = resume(session.path, with_report=False).session
    evaluation = analyse(finished, with_report=False).evaluation
    names = [
        "arm",
        *(f"imu_{name}" for name in whole.sensor_names),
        *(f"truth_{name}" for name in whole.sensor_names),
    ]
    same = all(
        _equal(whole.path / f"{name}.parquet", finished.path / f"{name}.parquet") for name in names
    )
    return Outcome(reached, recorded, True, same, comparable(evaluation) == comparable(expected))


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


def moments(count: int, longest_s: float, seed: int = 0) -> list[tuple[str, float]]:
    """Random moments; every other run in real time, where the kill hits the recording, the others
    fast, where it hits the writing of the session.
    """
    rng = random.Random(seed)
    begin = (
        0.4,
        0.2,
    )  # imports and compiled code are loaded before, when there is nothing to lose yet
    return [
        ("realtime", rng.uniform(begin[0], longest_s))
        if i % 2
        else ("fast", rng.uniform(begin[1], 2.5))
        for i in range(count)
    ]


def on_a_small_disk(
    command: list[str], folder: Path, size_kb: int
) -> subprocess.CompletedProcess[str]:
    """Run a command with a folder on a file system of its own that is soon full (in a mount
    namespace of its own).
    """
    folder.mkdir()
    mount = f"mount -t tmpfs -o size={size_kb}k tmpfs {folder}"
    script = f"{mount} && {shlex.join(command)}; code=$?; cp -r {folder} {folder}_kept; exit $code"
    return subprocess.run(
        ["unshare", "--mount", "sh", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=100,
    )
