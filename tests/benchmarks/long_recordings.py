"""Long recordings: memory and speed from a CSV of hours to its report, stage by stage, each in a
process of its own.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np
import pyarrow as pa
from pyarrow import csv
from scipy.spatial.transform import Rotation

from tests.benchmarks.timing import Text, duration, show

TRUTH_HZ = 50.0
OFFSET_S, DRIFT_PPM = 0.35, 40.0
"""The sensors' clocks against that of the truth."""
CHUNK = 250_000
STAGES = ("import", "estimate", "evaluate", "report")

PROGRAM = """
import json, resource, sys, time
from pathlib import Path
import numpy as np
from testbench.clock import SystemClock
from testbench.consistency import Consistency
from testbench.estimation import estimate
from testbench.estimation.signals import access
from testbench.evaluation import evaluate
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.model import rotation
from testbench.records.results.estimate import Estimate
from testbench.records.session.session import Session
from testbench.reporting.report import report

stage, kept = sys.argv[1], int(sys.argv[2])
access.MOST_KEPT = kept or access.MOST_KEPT
checking = 0.0


def timed(name):
    plain = getattr(Consistency, name)

    def call(*given):
        global checking
        begun = time.process_time()
        try:
            return plain(*given)
        finally:
            checking += time.process_time() - begun

    setattr(Consistency, name, call)


timed("look")
timed("findings")


def run(folder):
    path = folder / "session"
    if stage == "import":
        files = sorted(folder.glob("sensor*.csv"))
        options = Options(str(folder / "map.yaml"))
        manifest = import_recording("generic", files, path, SystemClock(), options).manifest
        samples = sum(manifest.samples.values())
        return {"duration_s": manifest.duration_s, "samples": samples}
    session = Session(path)
    if stage == "estimate":
        made = estimate(session)
        made.save(path)
        sensors = made.sensors.values()
        return {"clock": [s.clock.offset_s for s in sensors],
                "drift_ppm": [s.clock.drift_ppm for s in sensors],
                "frames": [f.method for s in sensors for f in s.frames.values()]}
    if stage == "evaluate":
        made = evaluate(session, Estimate.load(path))
        made.save(path)
        rows = made.orientation
        return {"errors": {f"{r.sensor} {r.filter}": r.inclination_rmse_deg for r in rows},
                "samples": {r.sensor: r.n for r in rows}, "noise": len(made.noise)}
    return {"report_mb": report(session).stat().st_size / 1e6}


for name in sys.argv[3:]:
    begun, processor, checking = time.perf_counter(), time.process_time(), 0.0
    rotation.multiply(*np.ones((2, 1, 4)))  # the first compiled kernel loads numba, whosever it is
    found = run(Path(name))
    took = time.perf_counter() - begun
    part = checking / (time.process_time() - processor)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    told = {"took_s": took, "cpu_s": time.process_time(), "peak_mb": peak, "checks": part}
    print(json.dumps({**told, **found}))
"""


@dataclass(frozen=True)
class Measured:
    """One stage: wall-clock time without the start of Python, processor time with it [s], largest
    resident memory [MB], share of the processor time that went into checks of self-consistency [1].
    """

    took_s: float
    cpu_s: float
    peak_mb: float
    checks: float
    found: dict


def orientation(time: np.ndarray, seed: int) -> Rotation:
    """A hand-held motion about all three axes: twenty seconds of rest, then half a minute of
    motion, over and over.
    """
    rng = np.random.default_rng(seed)
    angles = np.zeros((len(time), 3))
    phase = time % 50.0
    envelope = np.clip((phase - 20) / 3, 0, 1) * np.clip((50 - phase) / 3, 0, 1)
    envelope = envelope**2 * (3 - 2 * envelope)  # no jerk at the ends
    for axis in range(3):
        for frequency in rng.uniform(0.1, 0.5, 3):
            angles[:, axis] += rng.uniform(0.2, 0.4) * np.sin(
                2 * np.pi * (frequency * time + rng.random())
            )
    return Rotation.from_euler("XYZ", angles * envelope[:, None])


def write_sensor(path: Path, seconds: float, rate: float, seed: int) -> None:
    """A CSV of a sensor with a clock of its own: time in us, rate in deg/s as means over each
    interval, force in m/s^2.
    """
    rng = np.random.default_rng(seed)
    bias = np.radians([0.3, -0.2, 0.1])
    total = int(seconds * rate)
    with path.open("wb") as file:
        for start in range(0, total, CHUNK):
            index = np.arange(start, min(start + CHUNK, total))
            host = (index / rate) / (1 + DRIFT_PPM * 1e-6)
            before = host - 1 / rate
            now = orientation(host, seed)
            gyr = (
                (orientation(before, seed).inv() * now).as_rotvec() * rate
                + bias
                + 0.002 * rng.standard_normal((len(index), 3))
            )
            acc = now.inv().apply([0.0, 0.0, 9.80665]) + 0.02 * rng.standard_normal((len(index), 3))
            columns: dict[str, np.ndarray] = {
                "time_us": np.round((index / rate + OFFSET_S) * 1e6).astype(np.int64)
            }
            columns |= {
                f"gyr_{axis}": np.round(np.degrees(gyr[:, i]), 5) for i, axis in enumerate("xyz")
            }
            columns |= {f"acc_{axis}": np.round(acc[:, i], 5) for i, axis in enumerate("xyz")}
            csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=start == 0))


def write_truth(path: Path, seconds: float, seed: int) -> None:
    """A CSV of the sensor's true orientation on another clock."""
    with path.open("wb") as file:
        total = int(seconds * TRUTH_HZ)
        for start in range(0, total, CHUNK):
            time = np.arange(start, min(start + CHUNK, total)) / TRUTH_HZ
            q = orientation(time, seed).as_quat(scalar_first=True)
            columns = {"time_s": np.round(time, 6)} | {
                f"q_{axis}": np.round(q[:, i], 7) for i, axis in enumerate("wxyz")
            }
            csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=start == 0))


def write_case(folder: Path, sensors: int, seconds: float, rate: float) -> None:
    """The files of a recording and the mapping that reads them."""
    lines = ["description: a long recording", "time: {column: time_us, unit: us}", "sensors:"]
    for i in range(1, sensors + 1):
        write_sensor(folder / f"sensor{i}.csv", seconds, rate, i)
        write_truth(folder / f"truth{i}.csv", seconds, i)
        lines += [
            f"  imu{i}:",
            f"    file: sensor{i}.csv",
            "    gyr: {columns: [gyr_x, gyr_y, gyr_z], unit: deg/s}",
            "    acc: {columns: [acc_x, acc_y, acc_z], unit: m/s^2}",
            (
                f"    truth: {{file: truth{i}.csv, columns: [q_w, q_x, q_y, q_z], order: wxyz, "
                "time: "
                f"{{column: time_s, unit: s}}}}"
            ),
        ]
    (folder / "map.yaml").write_text("\n".join(lines) + "\n")


def measure(folders: Sequence[Path], stage: str, kept: int = 0) -> list[Measured]:
    """Run a stage on the cases in some folders, one after the other in a process of its own;
    `kept` is in place of `access.MOST_KEPT` unless 0.

    The peak of a case is that of all before it, too: give them from short to long.
    """
    words = [sys.executable, "-c", PROGRAM, stage, str(kept), *map(str, folders)]
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{stage} failed:\n{result.stderr}")
    told = [json.loads(line) for line in result.stdout.splitlines()]
    return [
        Measured(f.pop("took_s"), f.pop("cpu_s"), f.pop("peak_mb"), f.pop("checks"), f)
        for f in told
    ]


def bench_long_recordings(hours_of_one: float = 8.0, hours_of_four: float = 1.0) -> None:
    """Four sensors at 400 Hz for an hour, the median of three rounds, and one at 1 kHz for eight;
    takes some ten minutes and 6 GB of disk.
    """
    for sensors, hours, rate, rounds in (
        (4, hours_of_four, 400.0, 3),
        (1, hours_of_one, 1000.0, 1),
    ):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            write_case(folder, sensors, 3600 * hours, rate)
            found = [_round(folder) for _ in range(rounds)]
        measured = sorted(found, key=lambda stages: sum(m.cpu_s for m in stages.values()))[
            rounds // 2
        ]
        rows = [_row(stage, 3600 * hours, [m]) for stage, m in measured.items()]
        rows.append(_row("total", 3600 * hours, list(measured.values())))
        share = median(stages["estimate"].checks for stages in found)
        show(
            f"Long recording: {sensors} x {hours:g} h at {rate:g} Hz, "
            f"{sensors * hours * 3600 * rate / 1e6:.1f} M samples",
            ["stage", "time", "times real time", "processor", "times", "peak memory"],
            rows,
            "target: below 2 GB; more than 100 times real time\n"
            f"  checks of self-consistency: {100 * share:.1f} % of the processor time of estimate, "
            "in the same run; target: below 10 %",
        )


def _round(folder: Path) -> dict[str, Measured]:
    """All stages of a case, one after the other, from its files."""
    shutil.rmtree(folder / "session", ignore_errors=True)
    return {stage: measure([folder], stage)[0] for stage in STAGES}


def _row(title: str, real_s: float, some: Sequence[Measured]) -> list[str | Text]:
    took, processor = sum(m.took_s for m in some), sum(m.cpu_s for m in some)
    return [
        Text(title),
        duration(took),
        f"{real_s / took:.0f}",
        duration(processor),
        f"{real_s / processor:.0f}",
        f"{max(m.peak_mb for m in some):.0f} MB",
    ]


if __name__ == "__main__":
    bench_long_recordings()
