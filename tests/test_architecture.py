"""The shape of the source: which way imports point, and who may read a clock or print."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "testbench"
MODULES = sorted(PACKAGE.rglob("*.py"))

# Where the outside world comes in: the command line, the pipeline it starts, and the one module
# that wraps the clock.
OUTERMOST = {"cli", "pipeline", "clock"}

WALL_CLOCK = {
    "datetime.date.today",
    "datetime.datetime.now",
    "datetime.datetime.today",
    "datetime.datetime.utcnow",
    "time.localtime",
    "time.time",
    "time.time_ns",
}
# What numpy.random offers besides functions that share one hidden state.
EXPLICIT_RANDOM = {
    "BitGenerator",
    "Generator",
    "PCG64",
    "PCG64DXSM",
    "Philox",
    "SFC64",
    "SeedSequence",
    "default_rng",
}


def part_of(module: Path) -> str:
    """The part of the package that a module belongs to: `cli` for both cli.py and cli/run.py."""
    return module.relative_to(PACKAGE).with_suffix("").parts[0]


def place(module: Path, node: ast.AST) -> str:
    return f"{module.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"


def imported_names(tree: ast.AST) -> dict[str, str]:
    """From each name that an import binds anywhere in the module to what it stands for."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                top = alias.name.split(".")[0]
                names[alias.asname or top] = alias.name if alias.asname else top
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                names[alias.asname or alias.name] = f"{node.module}.{alias.name}"
    return names


def dotted_uses(tree: ast.AST) -> Iterator[tuple[ast.expr, str]]:
    """Every use of an imported name with its full dotted path: `np.random.seed` gives
    `numpy.random.seed`.
    """
    names = imported_names(tree)
    for node in ast.walk(tree):
        parts: list[str] = []
        inner = node
        while isinstance(inner, ast.Attribute):
            parts.append(inner.attr)
            inner = inner.value
        if isinstance(inner, ast.Name) and inner.id in names and isinstance(node, ast.expr):
            yield node, ".".join([names[inner.id], *reversed(parts)])


def reads_wall_clock(path: str) -> bool:
    return path in WALL_CLOCK


def uses_hidden_random_state(path: str) -> bool:
    if path.startswith("numpy.random."):
        return path.split(".")[2] not in EXPLICIT_RANDOM
    return path.startswith("random.")


def unseeded_generators(tree: ast.AST) -> Iterator[ast.Call]:
    generators = {
        id(node) for node, path in dotted_uses(tree) if path == "numpy.random.default_rng"
    }
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and id(node.func) in generators
            and not node.args
            and not node.keywords
        ):
            yield node


def test_imports_point_in_the_agreed_direction() -> None:
    command = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    result = subprocess.run(
        [sys.executable, "-c", command, "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_nothing_public_is_named_like_a_test() -> None:
    found = []
    for module in MODULES:
        for node in ast.parse(module.read_text(encoding="utf-8")).body:
            names = []
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                names = [node.name]
            elif isinstance(node, ast.Assign):
                names = [target.id for target in node.targets if isinstance(target, ast.Name)]
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                names = [node.target.id]
            found += [f"{place(module, node)} {name}" for name in names if name.startswith("Test")]
    assert found == []


def test_only_the_command_line_prints() -> None:
    found = []
    for module in MODULES:
        if part_of(module) == "cli":
            continue
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in {"print", "input"}
            ):
                found.append(place(module, node))
    assert found == []


def test_nothing_below_the_pipeline_reads_the_wall_clock() -> None:
    found = []
    for module in MODULES:
        if part_of(module) not in OUTERMOST:
            uses = dotted_uses(ast.parse(module.read_text(encoding="utf-8")))
            found += [
                f"{place(module, node)} {path}" for node, path in uses if reads_wall_clock(path)
            ]
    assert found == []


def test_nothing_below_the_pipeline_draws_from_hidden_random_state() -> None:
    found = []
    for module in MODULES:
        if part_of(module) not in OUTERMOST:
            tree = ast.parse(module.read_text(encoding="utf-8"))
            found += [
                f"{place(module, node)} {path}"
                for node, path in dotted_uses(tree)
                if uses_hidden_random_state(path)
            ]
            found += [
                f"{place(module, call)} default_rng() without a seed"
                for call in unseeded_generators(tree)
            ]
    assert found == []


@pytest.mark.parametrize(
    ("source", "clock", "random"),
    [
        ("import time\ntime.time()", 1, 0),
        ("from time import time as now\nnow()", 1, 0),
        ("from datetime import datetime\ndatetime.now(tz=None)", 1, 0),
        ("import datetime as dt\ndt.datetime.utcnow()", 1, 0),
        ("import time\ntime.monotonic_ns()", 0, 0),
        ("import numpy as np\nnp.random.normal()", 0, 1),
        ("from numpy import random\nrandom.seed(1)", 0, 1),
        ("import random\nrandom.random()", 0, 1),
        ("import numpy as np\nnp.random.default_rng()", 0, 1),
        (
            "import numpy as np\nrng: np.random.Generator = np.random.default_rng(7)\nrng.normal()",
            0,
            0,
        ),
    ],
)
def test_the_search_for_clocks_and_random_state_finds_them(
    source: str, clock: int, random: int
) -> None:
    tree = ast.parse(source)
    paths = [path for _, path in dotted_uses(tree)]
    assert sum(map(reads_wall_clock, paths)) == clock
    assert (
        sum(map(uses_hidden_random_state, paths)) + len(list(unseeded_generators(tree))) == random
    )
