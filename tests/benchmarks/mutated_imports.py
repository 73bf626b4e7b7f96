"""Hundreds of mutated files of each format and of each kind of truth."""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from testbench import estimate, evaluate
from testbench.clock import SystemClock
from testbench.exceptions import BenchError
from testbench.formats import import_recording
from testbench.formats.options import Options
from testbench.formats.truth.attach import TruthOptions
from tests.benchmarks.resuming import count_of, resumed
from tests.benchmarks.timing import Text, show
from tests.formats import mocap
from tests.formats.bags import Ros, write_bag
from tests.formats.conftest import G, turned
from tests.system.mutations import mutate_bytes, mutate_text

COUNT = 4500
SLOWEST_S = 30.0
"""C3D is read by a process that is given up after 20 s."""
MOTION = turned(600)
MARKERS = {"foot": mocap.NAMES}


@dataclass(frozen=True)
class Seed:
    """Whole files of one kind.

    Attributes:
        format: Of the recording.
        files: Their names in the folder of the seed.
        mutated: Which of them, or of the folder's other files, are changed.
        truth: Name of the file of the truth, if it has one.
        clusters: Of the truth.
    """

    format: str
    files: tuple[str, ...]
    mutated: tuple[str, ...]
    truth: str | None = None
    clusters: dict[str, list[str]] | None = None


def _table(path: Path, **columns: np.ndarray) -> None:
    titles = ",".join(name.replace("__", " ") for name in columns)
    values = np.column_stack(list(columns.values()))
    np.savetxt(path, values, delimiter=",", header=titles, comments="", fmt="%.9g")


def _vectors(title: str, values: np.ndarray, axes: str = "XYZ") -> dict[str, np.ndarray]:
    return {title.format(axis): values[:, i] for i, axis in enumerate(axes)}


_PHYSICAL = _vectors("Acc{} (m/s^2)", MOTION.acc) | _vectors("Gyr{} (rad/s)", MOTION.gyr)


def _ximu3(folder: Path) -> Seed:
    stamp = {"Timestamp (us)": np.round(1e6 * MOTION.t)}
    inertial = _vectors("Gyroscope {} (deg/s)", np.degrees(MOTION.gyr))
    inertial |= _vectors("Accelerometer {} (g)", MOTION.acc / G)
    _table(folder / "Inertial.csv", **stamp, **inertial)
    _table(folder / "Magnetometer.csv", **stamp, **_vectors("{} (a.u.)", MOTION.mag / 40))
    _table(folder / "Quaternion.csv", **stamp, **_vectors("{}", MOTION.q, "WXYZ"))
    names = ("Inertial.csv", "Magnetometer.csv", "Quaternion.csv")
    return Seed("ximu3", names, names)


def _technaid(folder: Path) -> Seed:
    stamp = {"Time (s)": MOTION.t}
    _table(folder / "w_phys.csv", **stamp, **_PHYSICAL)
    _table(folder / "w_quat.csv", **stamp, **_vectors("q{}", MOTION.q, "0123"))
    names = ("w_phys.csv", "w_quat.csv")
    return Seed("technaid", names, names)


def _apdm(folder: Path) -> Seed:
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("Sensors/1262")
        group["Accelerometer"], group["Gyroscope"] = MOTION.acc, MOTION.gyr
        group["Magnetometer"] = MOTION.mag
        group["Time"] = (1_600_000_000_000_000 + np.round(1e6 * MOTION.t)).astype("u8")
        group.create_group("Configuration").attrs["Label 0"] = np.bytes_(b"Foot\0\0")
        file["Processed/1262/Orientation"] = MOTION.q
    return Seed("apdm", ("a.h5",), ("a.h5",))


def _older_apdm(folder: Path) -> Seed:
    with h5py.File(folder / "b.h5", "w") as file:
        file.attrs["CaseIdList"] = np.array([b"SI-000133"])
        file.attrs["MonitorLabelList"] = np.array([b"Trunk\0\0"])
        group = file.create_group("SI-000133")
        group["Calibrated/Accelerometers"], group["Calibrated/Gyroscopes"] = MOTION.acc, MOTION.gyr
        group["Time"] = np.round(1e6 * MOTION.t).astype("u8")
    return Seed("apdm", ("b.h5",), ("b.h5",))


def _bag(name: str) -> Callable[[Path], Seed]:
    def make(folder: Path) -> Seed:
        ros = Ros.of(name.endswith(".bag"))
        messages = ros.imus(MOTION, "/foot/imu") + ros.fields(MOTION, "/foot/mag")
        messages += ros.transforms(MOTION.t, "map", "shank", MOTION.q)
        path = write_bag(folder / name, ros, messages)
        inside = [path] if path.is_file() else [p for p in path.iterdir() if p.is_file()]
        mutated = tuple(str(p.relative_to(folder)) for p in inside)
        own = str(path.relative_to(folder))
        return Seed("rosbag", (own,), mutated, own, {"foot": ["shank"]})

    return make


def _sto(folder: Path) -> Seed:
    _sto_file(folder / "a.sto")
    return Seed("opensim_sto", ("a.sto",), ("a.sto",))


def _sto_file(path: Path) -> None:
    head = "DataRate=100\nDataType=Quaternion\nversion=3\nendheader\ntime\tfoot_imu\n"
    rows = zip(MOTION.t, MOTION.q, strict=True)
    lines = (f"{t:.4f}\t" + ",".join(f"{x:.9f}" for x in row) for t, row in rows)
    path.write_text(head + "\n".join(lines) + "\n")


def _truth(name: str, write: Callable[[Path], object], clusters: dict) -> Callable[[Path], Seed]:
    def make(folder: Path) -> Seed:
        _ = write(folder / name)
        _table(folder / "foot.csv", **{"Time (s)": MOTION.t}, **_PHYSICAL)
        return Seed("technaid", ("foot.csv",), (name,), name, clusters)

    return make


PLACED = mocap.placed(MOTION.q, 0.1e-3)
BODY = {"foot": ["Shank"]}


def _trc_file(path: Path) -> None:
    names = "\t\t\t".join(mocap.NAMES)
    head = "PathFileType\t4\t(X/Y/Z)\tw.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    head += f"100\t100\t{len(PLACED)}\t4\tmm\nFrame#\tTime\t{names}\t\t\n"
    head += "\t\t" + "\t".join(f"{a}{i}" for i in range(1, 5) for a in "XYZ") + "\n\n"
    rows = enumerate(1000 * PLACED.reshape(len(PLACED), -1))
    lines = (f"{i + 1}\t{i / 100:.3f}\t" + "\t".join(f"{x:.4f}" for x in r) for i, r in rows)
    path.write_text(head + "\n".join(lines) + "\n")


SEEDS: dict[str, Callable[[Path], Seed]] = {
    "ximu3": _ximu3,
    "technaid": _technaid,
    "apdm": _apdm,
    "apdm, older": _older_apdm,
    "rosbag, .bag": _bag("a.bag"),
    "rosbag, .db3": _bag("folder"),
    "rosbag, .mcap": _bag("a.mcap"),
    "opensim_sto": _sto,
    "truth, .sto": _truth("t.sto", _sto_file, {}),
    "truth, C3D": _truth("t.c3d", lambda p: mocap.write_c3d(p, 100.0, PLACED), MARKERS),
    "truth, TRC": _truth("t.trc", _trc_file, MARKERS),
    "truth, Motive": _truth(
        "t.csv", lambda p: mocap.write_motive(p, 100.0, PLACED, MOTION.q, "Quaternion"), MARKERS
    ),
    "truth, Vicon": _truth(
        "t.csv", lambda p: mocap.write_vicon(p, 100.0, PLACED, MOTION.q), MARKERS
    ),
    "truth, Qualisys 3D": _truth(
        "t.tsv", lambda p: mocap.write_qualisys(p, 100.0, PLACED, True), MARKERS
    ),
    "truth, Qualisys 6D": _truth(
        "t.tsv", lambda p: mocap.write_bodies(p, 100.0, MOTION.q, False), BODY
    ),
}


def bench_mutated_imports(count: int = COUNT) -> bool:
    """Print the figures; whether every file was read and analysed, or refused in a sentence."""
    found = resumed("mutated_imports", count, _trials)
    rows: list[list[str | Text]] = []
    for kind in SEEDS:
        own = [one for one in found if one["kind"] == kind]
        outcomes = [one["outcome"] for one in own]
        slowest = max((one["spent_s"] for one in own), default=0.0)
        numbers = [str(outcomes.count(word)) for word in ("read", "refused")]
        failed = str(sum(word not in {"read", "refused"} for word in outcomes))
        rows.append([Text(kind), str(len(own)), *numbers, failed, f"{slowest:.2f}"])
    titles = ["", "files", "read", "refused", "other outcomes", "slowest [s]"]
    show("Mutated recordings and truths", titles, rows)
    failures = [one for one in found if one["outcome"] not in {"read", "refused"}]
    for one in failures[:20]:
        print(f"  {one['number']}, {one['kind']}: {one['outcome']}")
    return not failures and all(one["spent_s"] <= SLOWEST_S for one in found)


def _trials(numbers: range) -> Iterator[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seeds: dict[str, Seed] = {}
        for number in numbers:
            kind = list(SEEDS)[number % len(SEEDS)]
            own = folder / "seeds" / kind.replace(" ", "_")
            if kind not in seeds:
                own.mkdir(parents=True)
                seeds[kind] = SEEDS[kind](own)
            case = folder / f"case{number}"
            shutil.copytree(own, case / "in")
            _mutate(case / "in", seeds[kind], random.Random(number))
            begin = time.perf_counter()
            outcome = _outcome(seeds[kind], case)
            spent = time.perf_counter() - begin
            shutil.rmtree(case)
            yield {"number": number, "kind": kind, "outcome": outcome, "spent_s": spent}


def _mutate(folder: Path, seed: Seed, rng: random.Random) -> None:
    """A change of one of the files that the seed names: of one bit or digit, or several."""
    file = folder / rng.choice(seed.mutated)
    raw = file.read_bytes()
    gentle, binary = rng.random() < 0.5, b"\0" in raw[:2000]
    if gentle:
        size = len(raw) if rng.random() < 0.5 else min(1200, len(raw))
        array, at = bytearray(raw), rng.randrange(size)
        array[at] = array[at] ^ (1 << rng.randrange(8)) if binary else rng.choice(b"0159.-, \tnae")
        file.write_bytes(bytes(array))
    elif binary or rng.random() < 0.3:
        size = rng.choice([1200, 5000, len(raw)])
        file.write_bytes(mutate_bytes(raw[:size], rng) + raw[size:])
    else:
        text = raw.decode("utf-8", "replace")
        size = len(text) if rng.random() < 0.5 else 600
        changed = mutate_text(text[:size], rng) + text[size:]
        file.write_text(changed, encoding="utf-8", errors="replace")


def _outcome(seed: Seed, case: Path) -> str:
    """ "read", "refused", or what should not be."""
    out = case / "session"
    truth = None
    if seed.truth is not None:
        truth = TruthOptions(case / "in" / seed.truth, clusters=seed.clusters or {})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            files = [case / "in" / file for file in seed.files]
            session = import_recording(seed.format, files, out, SystemClock(), Options(), truth)
            evaluate(session, estimate(session, ["device", "vqf_6d"]))
    except BenchError as error:
        return "refused" if str(error).strip() else "an empty message"
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:300]
    return "read"


if __name__ == "__main__":
    sys.exit(not bench_mutated_imports(count_of(COUNT, __doc__)))
