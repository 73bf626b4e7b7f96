"""A long campaign on the simulated arm: memory and speed from its plan to its report, killed in the
middle and resumed.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from testbench.records.specs.shipped import shipped_folder
from tests.benchmarks.timing import Text, duration, show

ROOT = Path(__file__).resolve().parents[2]
RECORD_HZ = 500
ROUND_S = 60.0
STAGES = ("plan", "run", "resume", "estimate", "evaluate", "report")

PROTOCOL = """\
name: campaign
purpose: The same elbow sweeps for hours
robot: robot/robot.yaml
sensors:
  arm:
    preset: xsens_dot
    link: wrist_1_link
    segment: {{name: upper_arm, rotation_deg: {{XYZ: [90, 0, 0]}}}}
    mounting: {{rotation_deg: {{XYZ: [90, 0, 0]}}, position_mm: [0, 45, 0]}}
  forearm:
    preset: xsens_dot
    link: wrist_3_link
    segment: {{name: forearm, rotation_deg: {{XYZ: [90, 0, 0]}}}}
    mounting: {{rotation_deg: {{XYZ: [90, 90, 0]}}, position_mm: [0, 0, 10]}}
joints:
  elbow:
    proximal: arm
    distal: forearm
    sequence: ZXZ
    flexion: second
    reference_joint: wrist_3_joint
variables:
  lap: {{start: 1, stop: {rounds}, step: 1}}
sections:
  - name: reference
    role: reference
    steps:
      - {{move_to_deg: [180, -90, -90, 0, 90, 0], dwell_s: 15}}
      - {{move_to_deg: [180, -90, -90, 0, 90, 35], dwell_s: 2}}
  - name: sweeps
    for_each: [lap]
    steps: # a minute: ramps of a cycle at either end, and rests
      - sweep: {{wrist_3_joint: {{sine: {{amplitude_deg: 30, frequency_hz: 0.25, cycles: 4}}}}}}
        dwell_s: 2
      - sweep: {{wrist_3_joint: {{sine: {{amplitude_deg: 20, frequency_hz: 0.5, cycles: 8}}}}}}
        dwell_s: 2
      - sweep: {{wrist_3_joint: {{sine: {{amplitude_deg: 10, frequency_hz: 1, cycles: 7}}}}}}
        dwell_s: 3
estimate: {{filters: [device, vqf_6d, vqf_9d], align: reference_pose, calibrate: none}}
"""

PROGRAM = """
import json, resource, sys, time
from pathlib import Path
stage, folder, block = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
from testbench.execution import truth
truth.BLOCK = block or truth.BLOCK
path = folder / "logs" / "campaign"
begun = time.perf_counter()
found = {}
def tell(progress):
    print(progress.time / progress.duration, flush=True)
if stage in {"plan", "run"}:
    from testbench import plan
    from testbench.execution import RunOptions, execute
    the_plan = plan(folder / "campaign.yaml")
    found = {"duration_s": the_plan.duration, "knots": len(the_plan.trajectory.time_ns)}
    if stage == "run":
        execute(the_plan, folder / "logs", 1, RunOptions(progress=tell, session_name="campaign"))
elif stage == "resume":
    from testbench import plan
    from testbench.execution import RunOptions, execute
    from testbench.execution.executor import simulated_sensors
    from testbench.execution.resume import (
        open_for_resume,
        refuse_differences,
        stored_protocol,
        stored_robot,
    )
    session = open_for_resume(path)
    found = {"had_s": session.manifest.duration_s}
    with stored_protocol(session) as protocol:
        the_plan = plan(protocol, stored_robot(session))
        refuse_differences(session, the_plan, simulated_sensors(the_plan))
        session = execute(the_plan, seed=1, options=RunOptions(resumed=session))
    found |= {"status": session.status, "duration_s": session.manifest.duration_s}
else:
    from testbench.estimation import estimate
    from testbench.evaluation import evaluate
    from testbench.records.results.estimate import Estimate
    from testbench.records.session.session import Session
    session = Session(path)
    if stage == "estimate":
        made = estimate(session)
        made.save(path)
        found = {"samples": sum(session.sample_count(name) for name in session.sensor_names)}
    elif stage == "evaluate":
        made = evaluate(session, Estimate.load(path))
        made.save(path)
        rows = made.orientation
        found = {"errors": {f"{r.sensor} {r.filter}": r.inclination_rmse_deg for r in rows}}
        found["rows"] = len(made.joint_angle)
    else:
        from testbench.records.results.evaluation import Evaluation
        from testbench.reporting.report import report
        found = {"report_mb": report(session).stat().st_size / 1e6}
took = time.perf_counter() - begun
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"took_s": took, "peak_mb": peak, **found}))
"""


@dataclass(frozen=True)
class Measured:
    """One stage: wall-clock time without the start of Python [s], largest resident memory [MB], and
    what came of it.
    """

    took_s: float
    peak_mb: float
    found: dict


def write_campaign(folder: Path, hours: float) -> None:
    """The protocol and its arm, which is recorded at the controller's full rate."""
    shutil.copytree(shipped_folder("robots") / "ur3e", folder / "robot")
    robot = folder / "robot" / "robot.yaml"
    text = robot.read_text(encoding="utf-8")
    assert "record_hz: 125" in text
    robot.write_text(text.replace("record_hz: 125", f"record_hz: {RECORD_HZ}"), encoding="utf-8")
    rounds = max(round(hours * 3600 / ROUND_S), 1)
    (folder / "campaign.yaml").write_text(PROTOCOL.format(rounds=rounds), encoding="utf-8")


def measure(folder: Path, stage: str, block: int = 0) -> Measured:
    """Run a stage of the campaign in a folder, in a process of its own; `block` is in place of
    `truth.BLOCK` unless 0.
    """
    words = [sys.executable, "-c", PROGRAM, stage, str(folder), str(block)]
    result = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{stage} failed:\n{result.stderr}")
    found = json.loads(result.stdout.splitlines()[-1])
    return Measured(found.pop("took_s"), found.pop("peak_mb"), found)


def break_off(folder: Path, part: float = 0.5) -> None:
    """Run the campaign, and kill it once this part of it is recorded."""
    words = [sys.executable, "-c", PROGRAM, "run", str(folder), "0"]
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if float(line) >= part:
                os.kill(process.pid, signal.SIGKILL)
                break
        process.stdout.read()


def bench_long_campaign(hours: float = 0.25) -> None:
    """Elbow sweeps; eight hours take a quarter of an hour and 10 GB of disk: `python -m
    tests.benchmarks.long_campaign 8`.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(folder, hours)
        measured = {}
        for stage in STAGES:
            if (
                stage == "resume"
            ):  # the whole run was measured; another one is broken off and gone on with
                shutil.rmtree(folder / "logs")
                break_off(folder)
            measured[stage] = measure(folder, stage)
    rows: list[list[str | Text]] = [
        [Text(stage), duration(m.took_s), f"{3600 * hours / m.took_s:.0f}", f"{m.peak_mb:.0f} MB"]
        for stage, m in measured.items()
    ]
    show(
        f"Long campaign: {hours:g} h, the arm at {RECORD_HZ} Hz, two sensors at 60 Hz",
        ["stage", "time", "times real time", "peak memory"],
        rows,
        "resume: of a run killed half-way; target: below 2 GB",
    )


if __name__ == "__main__":
    bench_long_campaign(float(sys.argv[1]) if len(sys.argv) > 1 else 0.25)
