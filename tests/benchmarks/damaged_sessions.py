"""Sessions that were damaged, or made with bad intent, the whole way to a report and a verdict.

Their hashes are right, as those of whoever means to deceive are: what stands in tables and manifest
must be judged by itself.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.records.session.session_writer import file_hashes
from tests.benchmarks.commands import run_command
from tests.benchmarks.crash_points import write_recording
from tests.benchmarks.points import by, failed, tell_failures
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.conftest import TINY, FakeClock
from tests.system.mutations import mutate_bytes, mutate_json, mutate_text

COUNT = 10_000
SLOWER = 10.0
"""Times the unchanged session, in processor time."""
LEAST_ANALYSED = 0.3
STAGES = ("report", "evaluate")
PAIR = """\
name: pair
purpose: A short motion of two sensors with a joint between them
robot: ur3e
sensors:
  arm:
    preset: xsens_dot
    link: wrist_1_link
    segment: {name: upper_arm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 0, 0]}, position_mm: [0, 45, 0]}
  forearm:
    preset: xsens_dot
    link: wrist_3_link
    segment: {name: forearm, rotation_deg: {XYZ: [90, 0, 0]}}
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
joints:
  elbow: {proximal: arm, distal: forearm, sequence: ZXZ, flexion: second,
          reference_joint: wrist_3_joint}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
sections:
  - name: rest
    role: reference
    steps: [{name: start, dwell_s: 1}]
  - name: moves
    steps:
      - {name: out, move_to_deg: {wrist_3_joint: 60}, dwell_s: 0.8}
      - name: wave
        sweep: {wrist_3_joint: {sine: {amplitude_deg: 10, frequency_hz: 1, cycles: 1}}}
        dwell_s: 0.4
estimate: {filters: [device, vqf_6d], align: reference_pose, calibrate: none}
accept: [{metric: elbow.flexion_mean_abs_error_deg, filter: device, section: moves, max: 1.0}]
"""
Column = np.ndarray
INT64 = np.iinfo(np.int64)


def bench_damaged_sessions(count: int = COUNT) -> bool:
    """Print the figures; whether every session was analysed or refused in a sentence, in time."""
    found = resumed("damaged_sessions", count, _trials)
    rows: list[list[str | Text]] = []
    for kind, own in sorted(by(found, "kind").items()):
        reached = Counter(one["reached"] for one in own)
        numbers = [str(sum(reached[n] for n in range(k, 3))) for k in (1, 2)]
        slowest = max(one["slower"] for one in own)
        rows.append([Text(kind), str(len(own)), *numbers, str(failed(own)), f"{slowest:.1f}"])
    titles = ["damage", "sessions", "reported", "evaluated", "failed", "times the unchanged"]
    show("Damaged sessions", titles, rows)
    analysed = sum(one["reached"] == len(STAGES) for one in found)
    print(f"{analysed} analysed ({100 * analysed / len(found):.0f} %)")
    sound = tell_failures(found, "{number}, {kind}", "sessions tried")
    return sound and analysed >= LEAST_ANALYSED * len(found)


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        seeds = Seeds(Path(name))
        here = Path.cwd()
        try:
            for number in numbers:
                yield seeds.trial(number)
        finally:
            os.chdir(here)


class Seeds:
    """Unchanged sessions: of one sensor, of two with a joint, and an import with its truth.

    Args:
        folder: To work in.
        only: Names of those that are damaged.
    """

    def __init__(self, folder: Path, only: tuple[str, ...] = ("brought", "pair", "tiny")):
        self.folder = folder
        os.chdir(folder)
        for name, text in (("tiny", TINY), ("pair", PAIR)):
            (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
            options = RunOptions(clock=FakeClock(), session_name=name)
            execute(plan(folder / f"{name}.yaml"), folder / "seeds", 5, options)
        write_recording(folder)
        words = ("import", "generic", "d.csv", "--mapping", "map.yaml", "--out", "seeds/brought")
        assert run_command(*words) == (0, "")
        self.seeds = [folder / "seeds" / name for name in only]
        self.usual: dict[str, float] = {}
        for seed in self.seeds:
            for _ in range(2):  # the first loads modules
                shutil.copytree(seed, folder / "session")
                reached, failure, spent = _analysed(())
                assert reached == len(STAGES) and not failure, f"{seed.name}: {failure}"
                shutil.rmtree(folder / "session")
            self.usual[seed.name] = spent

    def trial(self, number: int) -> dict[str, Any]:
        """A damage, by its number: how far the session came, and what should not have been."""
        rng = random.Random(number)
        seed = self.seeds[number % len(self.seeds)]
        session = Path(shutil.copytree(seed, self.folder / "session"))
        kind = damage(session, rng)
        reached, failure, spent = _analysed(("--json",) if number % 7 == 0 else ())
        slower = spent / self.usual[seed.name]
        if not failure and slower > SLOWER:
            failure = f"took {slower:.1f} times as long as the unchanged session"
        shutil.rmtree(session)
        left = {path.name for path in self.folder.iterdir()}
        if left != {"seeds", "tiny.yaml", "pair.yaml", "d.csv", "map.yaml"}:
            failure = failure or f"something was written elsewhere: {left}"
        return {
            "number": number,
            "kind": f"{seed.name}: {kind}",
            "reached": reached,
            "failure": failure,
            "slower": slower,
        }


def _analysed(more: tuple[str, ...]) -> tuple[int, str, float]:
    """Stages that the session comes through, what should not be, and the processor time [s].

    The report is made first: `evaluate` then reads what it left.
    """
    begin = time.process_time()
    for reached, stage in enumerate(STAGES):
        code, failure = run_command(stage, "session", *more, codes=(0, 1, 2))
        if failure or code == 2:
            return reached, failure, time.process_time() - begin
    return len(STAGES), "", time.process_time() - begin


def damage(session: Path, rng: random.Random) -> str:
    """Damage a session; what was done, in a word or two."""
    file = rng.choice(sorted(path for path in session.iterdir() if path.is_file()))
    if file.suffix == ".parquet":
        kind = _damage_table(file, rng) if rng.random() < 0.9 else _damage_bytes(file, rng)
    elif file.name == "manifest.json":
        return _damage_manifest(file, rng)
    elif file.name == "events.jsonl":
        kind = _damage_events(file, rng)
    else:
        text = file.read_text(encoding="utf-8")
        file.write_text(mutate_text(text, rng), encoding="utf-8", errors="replace")
        kind = "text"
    manifest = json.loads((session / "manifest.json").read_text(encoding="utf-8"))
    manifest["files"] = file_hashes(session)
    (session / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    return kind


def _damage_bytes(file: Path, rng: random.Random) -> str:
    file.write_bytes(mutate_bytes(file.read_bytes(), rng))
    return "bytes"


RATES = (0, -60, 1e-9, 1e12, 5.0, 1e5, "x", None, float("nan"), 2**70)
DELAYS = (1e9, -5.0, 0.5, "x", float("inf"), 1e300)


def _damage_manifest(file: Path, rng: random.Random) -> str:
    content = json.loads(file.read_text(encoding="utf-8"))
    sensor = content["sensors"][rng.choice(sorted(content["sensors"]))]
    chance = rng.random()
    if chance < 0.2:
        sensor["rate_hz"] = rng.choice(RATES)
    elif chance < 0.3:
        sensor["rate_delay_s"] = rng.choice(DELAYS)
    elif chance < 0.6:
        content["analysis"] = mutate_json(content["analysis"], rng)
    elif chance < 0.75:
        content["sensors"] = mutate_json(content["sensors"], rng)
    else:
        content = mutate_json(content, rng)
    file.write_text(json.dumps(content), encoding="utf-8")
    return "manifest"


def _damage_events(file: Path, rng: random.Random) -> str:
    lines = file.read_text(encoding="utf-8").splitlines()
    if not lines or rng.random() < 0.2:
        text = mutate_text("\n".join(lines) + "\n", rng)
        file.write_text(text, encoding="utf-8", errors="replace")
        return "events"
    i = rng.randrange(len(lines))
    event = json.loads(lines[i])
    if rng.random() < 0.5:
        event["host_time_ns"] = rng.choice([-(10**9), 0, 10**12, INT64.max, 2**70, 1.5, "x", None])
        lines[i] = json.dumps(event)
    elif rng.random() < 0.5:
        lines[i] = json.dumps(mutate_json(event, rng))
    else:
        rng.shuffle(lines)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return "events"


def _damage_table(file: Path, rng: random.Random) -> str:
    """One of the damages below, of a whole table, a column, or one cell."""
    table = pq.read_table(file)
    columns = {name: table[name].to_numpy().copy() for name in table.column_names}
    kind = rng.choice(sorted(DAMAGES))
    changed = DAMAGES[kind](columns, rng)
    notes = table.schema.metadata
    try:
        written = pa.table(changed)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        written, kind = table.slice(0, 3), "few rows"
    pq.write_table(written.replace_schema_metadata(notes), file)
    return kind


Columns = dict[str, Any]


def _some(columns: Columns, rng: random.Random, times: bool) -> list[str]:
    """Some columns: of times, or of all others."""
    own = [name for name in columns if name.endswith("_ns") == times]
    return rng.sample(own, rng.randint(1, max(len(own) // 2, 1))) if own else []


def _rows(columns: Columns, rng: random.Random) -> Any:
    """A row, some in a row, or all of a table."""
    count = len(next(iter(columns.values())))
    begin = rng.randrange(max(count, 1))
    return slice(begin, rng.choice([begin + 1, begin + 1, begin + 40, count]))


def _put(columns: Columns, rng: random.Random, times: bool, values: tuple[Any, ...]) -> Columns:
    rows, value = _rows(columns, rng), rng.choice(values)
    for name in _some(columns, rng, times):
        kind = columns[name].dtype.kind
        if kind in "iu" and isinstance(value, float):
            columns[name] = columns[name].astype(float)
        columns[name][rows] = value
    return columns


def _moved(columns: Columns, rng: random.Random) -> Columns:
    """Times that are others from a row on."""
    rows, by = _rows(columns, rng), rng.choice([-(10**15), -(10**9), 5 * 10**6, 10**10, 10**14])
    for name in _some(columns, rng, times=True):
        columns[name][rows] += by
    return columns


def _ordered(columns: Columns, rng: random.Random) -> Columns:
    count = len(next(iter(columns.values())))
    order = np.arange(count)[::-1] if rng.random() < 0.3 else np.arange(count)
    if rng.random() < 0.7:
        rows = rng.choice([2, 50, count])
        begin = rng.randrange(max(count - rows, 1))
        order[begin : begin + rows] = np.random.default_rng(rng.randrange(99)).permutation(
            order[begin : begin + rows]
        )
    return {name: values[order] for name, values in columns.items()}


def _cut(columns: Columns, rng: random.Random) -> Columns:
    kept = rng.choice([0, 1, 2, 3, 10, 100])
    begin = rng.choice([0, 100])
    return {name: values[begin : begin + kept] for name, values in columns.items()}


def _doubled(columns: Columns, rng: random.Random) -> Columns:
    return {name: np.repeat(values, 2) for name, values in columns.items()}


def _typed(columns: Columns, rng: random.Random) -> Columns:
    for name in _some(columns, rng, times=rng.random() < 0.3):
        kind = rng.choice([str, np.float32, np.int32, np.float16, bool, object, "nulls", "lists"])
        values = columns[name]
        if kind == "nulls":
            columns[name] = pa.nulls(len(values), pa.float64())
        elif kind == "lists":
            columns[name] = pa.array([[1.0]] * len(values))
        else:
            with np.errstate(all="ignore"):
                columns[name] = values.astype(kind)
    return columns


def _left_out(columns: Columns, rng: random.Random) -> Columns:
    for name in _some(columns, rng, times=rng.random() < 0.3):
        del columns[name]
    return columns


def _scaled(columns: Columns, rng: random.Random) -> Columns:
    by = rng.choice([-1.0, 0.0, 1e-30, 2.0, 57.3, 1e30, 1e200, 1e300])
    for name in _some(columns, rng, times=False):
        if columns[name].dtype.kind == "f":
            columns[name] = columns[name] * by
    return columns


def _exchanged(columns: Columns, rng: random.Random) -> Columns:
    names = [name for name in columns if columns[name].dtype.kind == "f"]
    if len(names) > 1:
        one, other = rng.sample(names, 2)
        columns[one], columns[other] = columns[other], columns[one]
    return columns


NO_NUMBERS = (float("nan"), float("inf"), -float("inf"))
LARGE = (1e30, -1e6, 1e300, 1e154, 0.0)
TIMES = (0, -1, 5, INT64.max, INT64.min, 10**18, 4 * 10**18)
DAMAGES: dict[str, Callable[[Columns, random.Random], Columns]] = {
    "no numbers": lambda columns, rng: _put(columns, rng, False, NO_NUMBERS),
    "zeros and large numbers": lambda columns, rng: _put(columns, rng, False, LARGE),
    "times that are none": lambda columns, rng: _put(columns, rng, True, TIMES),
    "times moved": _moved,
    "rows in another order": _ordered,
    "few rows": _cut,
    "rows twice": _doubled,
    "other types": _typed,
    "columns left out": _left_out,
    "scaled": _scaled,
    "columns exchanged": _exchanged,
}


if __name__ == "__main__":
    sys.exit(not bench_damaged_sessions(count_of(COUNT, __doc__)))
