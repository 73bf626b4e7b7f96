"""What every shipped protocol comes to at one commit, held against another: no frozen numbers.

    python -m tests.benchmarks.golden make FOLDER [--only quick,gait] [--tree DIR]
    python -m tests.benchmarks.golden compare FOLDER FOLDER

`make` runs the shipped protocols of a source tree, seed 1, in this environment, and keeps a digest
of every raw column and every number of evaluation.json. `compare` wants raw columns equal to the
last bit and evaluation values within 1e-9 deg (any other unit: 1e-9 of it, or of the value).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parent.parent.parent
TOLERANCE = 1e-9
"""Absolute, and relative for values above one: what a change of the order of sums may come to."""

PROGRAM = """
import sys
from testbench import estimate, evaluate, execute, plan
the_plan = plan(sys.argv[1])
session = execute(the_plan, logs=sys.argv[2], seed=1)
estimated = estimate(session)
estimated.save(session.path)
evaluate(session, estimated).save(session.path)
"""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.golden")
    commands = parser.add_subparsers(required=True)
    make = commands.add_parser("make")
    make.add_argument("folder", type=Path)
    make.add_argument(
        "--only", default="", help="protocols, by a comma; all that ship if left away"
    )
    make.add_argument("--tree", type=Path, default=ROOT, help="source tree to run")
    make.set_defaults(run=lambda given: make_all(given.folder, given.tree, given.only))
    compare = commands.add_parser("compare")
    compare.add_argument("base", type=Path)
    compare.add_argument("new", type=Path)
    compare.set_defaults(run=lambda given: compare_all(given.base, given.new))
    given = parser.parse_args()
    sys.exit(min(given.run(given), 1))


def make_all(folder: Path, tree: Path, only: str) -> int:
    """Run the protocols of a tree and keep what they come to; the number that failed."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [name for name in only.split(",") if name] or sorted(
        path.stem for path in (tree / "protocols").glob("*.yaml")
    )
    failed = 0
    for name in names:
        with tempfile.TemporaryDirectory() as logs:
            result = subprocess.run(
                [sys.executable, "-c", PROGRAM, str(tree / "protocols" / f"{name}.yaml"), logs],
                cwd=tree,
                env={"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "PATH": ""},
                capture_output=True,
                text=True,
                check=False,
            )
            if result.returncode:
                failed += 1
                print(f"{name}: {result.stderr.strip().splitlines()[-1]}")
                continue
            (session,) = Path(logs).iterdir()
            found = {"raw": raw_digests(session), "evaluation": numbers(session)}
            (folder / f"{name}.json").write_text(json.dumps(found), encoding="utf-8")
            print(f"{name}: {len(found['raw'])} columns, {len(found['evaluation'])} values")
    return failed


def raw_digests(session: Path) -> dict[str, str]:
    """SHA-256 of every column of every raw table, by `file:column`."""
    found = {}
    for file in sorted(session.glob("*.parquet")):
        table = pq.read_table(file)
        for name in table.column_names:
            values = table[name].to_pylist()
            text = "\n".join(x.hex() if isinstance(x, float) else str(x) for x in values)
            found[f"{file.name}:{name}"] = hashlib.sha256(text.encode()).hexdigest()
    return found


def numbers(session: Path) -> dict[str, Any]:
    """Every value of evaluation.json by its path, but those that name the session."""
    document = json.loads((session / "evaluation.json").read_text(encoding="utf-8"))
    found: dict[str, Any] = {}

    def walk(value: Any, path: str) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(inner, f"{path}.{key}")
        elif isinstance(value, list):
            for index, inner in enumerate(value):
                walk(inner, f"{path}[{index}]")
        else:
            found[path] = value

    walk(document, "")
    ignored = (".session", ".fingerprint", ".created", ".versions", ".software")
    return {path: value for path, value in found.items() if not path.startswith(ignored)}


def compare_all(base: Path, new: Path) -> int:
    """Say where the protocols of `new` differ from those of `base`; the number that do."""
    differing = 0
    files = sorted(new.glob("*.json"))
    for file in files:
        old = json.loads((base / file.name).read_text(encoding="utf-8"))
        now = json.loads(file.read_text(encoding="utf-8"))
        columns = sorted(
            name for name in old["raw"] | now["raw"] if old["raw"].get(name) != now["raw"].get(name)
        )
        values, worst = [], 0.0
        for path in old["evaluation"] | now["evaluation"]:
            a, b = old["evaluation"].get(path), now["evaluation"].get(path)
            distance = difference(a, b)
            worst = max(worst, 0.0 if math.isinf(distance) else distance)
            if distance > TOLERANCE:
                values.append(f"{path}: {a} -> {b}")
        print(
            f"{file.stem}: {len(columns)} of {len(old['raw'])} raw columns and {len(values)} of "
            f"{len(old['evaluation'])} values differ; largest difference within {worst:.1e}"
        )
        for line in [*columns[:10], *values[:10]]:
            print(f"  {line}")
        differing += bool(columns or values)
    missing = {file.name for file in base.glob("*.json")} - {file.name for file in files}
    if missing:
        print(f"not compared: {', '.join(sorted(name[:-5] for name in missing))}")
    if not files:
        print(f"nothing to compare in {new}")
    return differing + len(missing) + (not files)


def difference(a: Any, b: Any) -> float:
    """Distance of two values, relative above one; infinite where they are no two numbers."""
    if isinstance(a, bool) or isinstance(b, bool) or not isinstance(a, int | float):
        return 0.0 if a == b else math.inf
    if not isinstance(b, int | float):
        return math.inf
    return 0.0 if a == b else abs(a - b) / max(1.0, abs(a))


if __name__ == "__main__":
    main()
