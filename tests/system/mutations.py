"""Mutated files: protocols, robots and sessions that were damaged or made with bad intent, by a
seed.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import time
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from testbench.exceptions import BenchError
from testbench.execution.recovery import recover
from testbench.pipeline.analyse import analyse
from testbench.pipeline.bring_in import bring_in, guess_mapping
from testbench.pipeline.prepared import make_plan
from testbench.pipeline.request import ImportRequest
from testbench.records.session.session import Session
from testbench.records.specs.arm_calibration import load_arm_calibration
from tests.asking import analysis, run_of
from tests.formats.conftest import turned
from tests.formats.foreign_arrays import mat73_with_objects, mat_with_objects

NASTY = [
    "../../../../etc/passwd",
    "/etc/passwd",
    "..",
    "\x00",
    "a" * 5000,
    "1e999",
    "-1",
    "0",
    "null",
    "{}",
    "[]",
    "NaN",
    "9" * 400,
    "!!python/object/apply:os.system [touch hacked]",
    "&a [*a, *a]",
    "__import__('os')",
    "x: " * 50,
    "\u202e",
    "<script>",
    "%s",
    "(" * 300,
    "1" + "+1" * 200,
    "2 ** 99999",
    "true",
    "2021-01-01",
    "0x10",
    "- " * 100,
    "\t",
    "'",
    "|",
    "file:///etc/passwd",
]
SLOWEST_S = 2.0
SLOWEST_WITH_ANALYSIS_S = 6.0


@dataclass
class Found:
    """What a campaign of mutations found."""

    tried: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    failures: list[str] = field(default_factory=list)


def mutate_text(text: str, rng: random.Random) -> str:
    """A text with one to four changes."""
    for _ in range(rng.randint(1, 4)):
        lines = text.split("\n")
        at = rng.randrange(len(text) + 1)
        kind = rng.randrange(9)
        if kind == 0:
            text = text[:at] + rng.choice(NASTY) + text[at:]
        elif kind == 1:
            text = text[:at] + text[at + rng.randint(1, 30) :]
        elif kind == 2:
            text = (
                text[:at]
                + chr(rng.choice([0, 9, 10, 32, 45, 58, 91, 123, 233, 0x1F600]))
                + text[at + 1 :]
            )
        elif kind == 3:
            i = rng.randrange(len(lines))
            lines[i] = lines[i].partition(":")[0] + ": " + rng.choice(NASTY)
            text = "\n".join(lines)
        elif kind == 4:
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            text = "\n".join(lines)
        elif kind == 5:
            i = rng.randrange(len(lines))
            text = "\n".join(lines[:i] + [lines[i]] * rng.randint(1, 5) + lines[i:])
        elif kind == 6:
            text = text[:at]
        elif kind == 7:
            digits = [i for i, c in enumerate(text) if c.isdigit()]
            if digits:
                i = rng.choice(digits)
                text = (
                    text[:i]
                    + rng.choice(["-5", "1e308", "0", "99999999", "0.0000001"])
                    + text[i + 1 :]
                )
        else:
            i = rng.randrange(len(lines))
            lines[i] = " " * rng.randint(0, 60) + lines[i]
            text = "\n".join(lines)
    return text


def mutate_json(value: Any, rng: random.Random, depth: int = 0) -> Any:
    """A JSON value of which one part, somewhere, is another."""
    if (depth > 0 and rng.random() < 0.25) or not isinstance(value, dict | list) or not value:
        return rng.choice(
            [
                None,
                -1,
                1e300,
                "",
                "../../x",
                [],
                {},
                True,
                "x" * 3000,
                [[[[]]]],
                {"a": {"b": 1}},
                2**70,
            ]
        )
    if isinstance(value, dict):
        key = rng.choice(list(value))
        changed = dict(value)
        if rng.random() < 0.2:
            changed[rng.choice(["../../evil", "/abs", "x", "", key + "\x00"])] = changed.pop(key)
        elif rng.random() < 0.2:
            del changed[key]
        else:
            changed[key] = mutate_json(value[key], rng, depth + 1)
        return changed
    i = rng.randrange(len(value))
    return [*value[:i], mutate_json(value[i], rng, depth + 1), *value[i + 1 :]]


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Bytes with some flipped, cut or put in."""
    array = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(array) + 1) if array else 0
        if rng.random() < 0.6 and at < len(array):
            array[at] ^= 1 << rng.randrange(8)
        elif rng.random() < 0.5:
            del array[at : at + rng.randint(1, 200)]
        else:
            array[at:at] = rng.randbytes(rng.randint(1, 50))
    return bytes(array)


MAPPING = """\
description: a small recording
time: {column: imu/t, unit: s}
sensors:
  imu:
    acc: {columns: [ax, ay, az], unit: m/s^2, full_scale: 16 g}
    gyr: {columns: [wx, wy, wz], unit: rad/s}
    mag: {columns: [mx, my, mz], unit: uT}
    quaternion: {columns: [qw, qx, qy, qz], order: wxyz}
    sampling: integrated
segments: {imu: forearm}
exclude: [{from_s: 0.5, to_s: 0.7, reason: touched}]
"""


def foreign_files(folder: Path) -> dict[str, bytes]:
    """One small recording in every form that a mapping reads, by the name of the file.

    Args:
        folder: To write in; what is written is removed again.
    """
    m = turned(300)
    values = np.column_stack([m.t, m.acc, m.gyr, m.mag, m.q])
    titles = ["imu/t", *(f"{kind}{axis}" for kind in "awm" for axis in "xyz")]
    titles += [f"q{part}" for part in "wxyz"]
    columns = dict(zip(titles, values.T, strict=True))
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in values)
    written = {"d.csv": (",".join(titles) + "\n" + rows + "\n").encode()}
    plain = {title: column for title, column in columns.items() if title != "imu/t"}
    with TemporaryDirectory(dir=folder) as name:
        place = Path(name)
        pq.write_table(pa.table(columns), place / "d.parquet")
        mat_with_objects(place / "d.mat", {"imu": {"t": m.t}, **plain})
        mat_with_objects(place / "packed.mat", {"imu": {"t": m.t}, **plain}, packed=True)
        mat73_with_objects(place / "new.mat", columns)
        with h5py.File(place / "d.h5", "w") as file:
            for title, column in columns.items():
                file.create_dataset(title, data=column, chunks=True, compression="gzip")
        return written | {path.name: path.read_bytes() for path in place.iterdir()}


class Campaign:
    """Feeds mutated files to the doors that read them.

    Args:
        folder: To work in; it must be empty.
        protocol: What is mutated.
        robot: What is mutated.
        session: What is mutated.
    """

    def __init__(self, folder: Path, protocol: Path, robot: Path, session: Path, calibration: str):
        self.folder, self.found = folder, Found()
        self.protocol, self.robot, self.session, self.calibration = (
            protocol,
            robot,
            session,
            calibration,
        )
        self.work = folder / "work"
        self.work.mkdir()
        self.recordings: dict[str, bytes] = {}
        self.before = self._around()

    def _around(self) -> set[str]:
        """What lies beside the folder that mutated files are read from."""
        return {path.name for path in [*self.folder.iterdir(), *self.folder.parent.iterdir()]}

    def one(self, number: int) -> None:
        """One mutation, chosen by its number."""
        rng = random.Random(number)
        kind = ["protocol", "recording", "robot", "session", "calibration"][number % 5]
        case = self.work / f"case{number}"
        case.mkdir()
        try:
            begin = time.perf_counter()
            try:
                getattr(self, f"_{kind}")(case, rng)
            except BenchError as error:
                self.found.refused += 1
                if not str(error).strip():
                    self._fail(number, kind, "an empty message")
            except Exception as error:
                self._fail(number, kind, f"{type(error).__name__}: {error}"[:300])
            spent = time.perf_counter() - begin
            self.found.slowest_s = max(self.found.slowest_s, spent)
            if spent > (SLOWEST_WITH_ANALYSIS_S if kind == "recording" else SLOWEST_S):
                self._fail(number, kind, f"took {spent:.1f} s")
        finally:
            self.found.tried += 1
            shutil.rmtree(case, ignore_errors=True)
        if self._around() != self.before or {path.name for path in self.work.iterdir()}:
            self._fail(number, kind, "something was written elsewhere")

    def _fail(self, number: int, kind: str, what: str) -> None:
        self.found.failures.append(f"mutation {number} of a {kind}: {what}")

    def _protocol(self, case: Path, rng: random.Random) -> None:
        file = case / "protocol.yaml"
        file.write_text(
            mutate_text(self.protocol.read_text(), rng), encoding="utf-8", errors="replace"
        )
        os.chdir(case)
        make_plan(run_of(file))

    def _robot(self, case: Path, rng: random.Random) -> None:
        for name in ("robot.yaml", "ur3e.urdf"):
            text = (self.robot / name).read_text()
            changed = (
                mutate_text(text, rng) if (name == "robot.yaml") == (rng.random() < 0.6) else text
            )
            (case / name).write_text(changed, encoding="utf-8", errors="replace")
        os.chdir(case)
        make_plan(run_of(self.protocol, robot=case / "robot.yaml"))

    def _calibration(self, case: Path, rng: random.Random) -> None:
        file = case / "calibration.yaml"
        file.write_text(mutate_text(self.calibration, rng), encoding="utf-8", errors="replace")
        os.chdir(case)
        load_arm_calibration(file)

    def _recording(self, case: Path, rng: random.Random) -> None:
        """A foreign file or its mapping, imported or guessed at, and analysed where it imports."""
        if not self.recordings:
            self.recordings = foreign_files(self.folder)
            self.before = self._around()
        name = rng.choice(sorted(self.recordings))
        content, text = self.recordings[name], MAPPING
        if rng.random() < 0.25:
            text = mutate_text(text, rng)
        elif name.endswith(".csv") and rng.random() < 0.7:
            changed = mutate_text(content.decode("utf-8"), rng)
            content = changed.encode(rng.choice(["utf-8", "utf-16-le", "cp1252"]), "replace")
        else:
            content = mutate_bytes(content, rng)
        (case / name).write_bytes(content)
        mapping = case / "map.yaml"
        mapping.write_text(text, encoding="utf-8", errors="replace")
        os.chdir(case)
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            if rng.random() < 0.3:
                mapping.unlink()
                guess_mapping([str(case / name)], str(mapping))
                if not mapping.exists():
                    return
            asked = ImportRequest(
                format="generic", files=(name,), out="session", mapping="map.yaml"
            )
            try:
                session = bring_in(asked)
            except BenchError:
                if (case / "session").exists():
                    raise AssertionError("a refused import left a session") from None
                raise
            analyse(session, analysis("vqf_6d"))

    def _session(self, case: Path, rng: random.Random) -> None:
        copy = case / "session"
        shutil.copytree(self.session, copy)
        os.chdir(case)
        file = rng.choice(sorted(path for path in copy.iterdir() if path.is_file()))
        if file.suffix == ".json":
            file.write_text(json.dumps(mutate_json(json.loads(file.read_text()), rng)))
        elif file.suffix in {".yaml", ".jsonl", ".urdf"}:
            file.write_text(mutate_text(file.read_text(), rng), encoding="utf-8", errors="replace")
        else:
            file.write_bytes(mutate_bytes(file.read_bytes(), rng))
        session = recover(Session(copy))
        _ = session.events, session.steps, session.analysis, session.robot
        session.arm()
        for name in session.sensor_names:
            session.imu(name)
            session.truth(name)
