"""The shape of the source: which way imports point, who may read a clock or print, and who knows
the makers of arms.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from testbench.estimation.filters import FILTERS, get_filter
from tests.house import ROOT, comments, nodes, parsed

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

# Makers of arms, their products, libraries and interfaces, as words of identifiers, strings and
# comments.
MAKERS = re.compile(
    r"(?<![a-z])(?:ur(?:\d+e?)?|urscript|rtde|polyscope|dashboard|teach pendant|move[jl]|servo[jl]"
    r"|universal[ -]?robots?|xarm(?:\d+)?|lite ?6|ufactory)(?![a-z])",
    re.IGNORECASE,
)
DRIVING = {"drivers", "emulation"}
"""Where an arm's maker is known."""
NAMED = {
    "cli/designing.py": {"ur3e": "the robot that ships as the default: a name in robots/"},
    "estimation/joints/joint_constraint.py": {"ur3e": "where a figure is from: a name in robots/"},
    "model/chain_sensor.py": {"ur": "the cross product u x r"},
    "model/dh_calibration.py": {
        "ur3e": "a robot's table of DH parameters: data",
        "ur5e": "a robot's table of DH parameters: data",
        "ur10e": "a robot's table of DH parameters: data",
        "universal robots": "who published these tables",
    },
    "model/dh_plausibility.py": {
        "ur5e": "whose calibration a bound rests on",
        "ur5": "whose calibration a bound rests on",
        "universal robots": "who published a bound",
        "ur": "the title of the document that a bound is from",
    },
    "planning/planner.py": {"ur3e": "whose reach a bound rests on"},
    "records/specs/arm_calibration.py": {"universal robots": "whose convention the numbers follow"},
    "studies/__init__.py": {"ur3e": "what a published study was measured with"},
}
"""Exceptions, each with its reason: data and sources, nothing that a run depends on."""


def part_of(module: Path) -> str:
    """The part of the package that a module belongs to: `cli` for cli/running.py, `clock` for
    clock.py.
    """
    return module.relative_to(PACKAGE).with_suffix("").parts[0]


def place(module: Path, node: ast.AST) -> str:
    return f"{module.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"


@pytest.fixture(scope="module")
def trees() -> Iterator[dict[Path, ast.Module]]:
    """Every module, parsed once for all tests of this file."""
    yield parsed(MODULES)
    nodes.cache_clear()


@pytest.fixture(scope="module")
def inner_uses(trees) -> dict[Path, list[tuple[ast.expr, str]]]:
    """The uses of imported names in the modules below the pipeline."""
    return {
        module: list(dotted_uses(tree))
        for module, tree in trees.items()
        if part_of(module) not in OUTERMOST
    }


def imported_names(tree: ast.AST) -> dict[str, str]:
    """From each name that an import binds anywhere in the module to what it stands for."""
    names = {}
    for node in nodes(tree):
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
    for node in nodes(tree):
        if not isinstance(node, ast.Attribute | ast.Name):
            continue
        parts: list[str] = []
        inner: ast.expr = node
        while isinstance(inner, ast.Attribute):
            parts.append(inner.attr)
            inner = inner.value
        if isinstance(inner, ast.Name) and inner.id in names:
            yield node, ".".join([names[inner.id], *reversed(parts)])


def reads_wall_clock(path: str) -> bool:
    return path in WALL_CLOCK


def uses_hidden_random_state(path: str) -> bool:
    if path.startswith("numpy.random."):
        return path.split(".")[2] not in EXPLICIT_RANDOM
    return path.startswith("random.")


def unseeded_generators(tree: ast.AST, uses: list[tuple[ast.expr, str]]) -> Iterator[ast.Call]:
    generators = {id(node) for node, path in uses if path == "numpy.random.default_rng"}
    for node in nodes(tree):
        if (
            isinstance(node, ast.Call)
            and id(node.func) in generators
            and not node.args
            and not node.keywords
        ):
            yield node


def named_makers(source: str, tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Makers of arms in identifiers, strings and comments, with their lines."""
    words: list[tuple[int, str]] = []
    for node in nodes(tree):
        line = getattr(node, "lineno", 1)
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            words.append((line, node.value))
        for field in ("id", "attr", "name", "arg", "asname", "module"):
            value = getattr(node, field, None)
            if isinstance(value, str):
                words.append((line, in_words(value)))
    words += [(row, text) for row, _, text in comments(source)]
    for line, text in words:
        for word in makers_in(text):
            yield line, word


@cache
def in_words(name: str) -> str:
    """`xArm_Settings` of `xArmSettings`."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)


@cache
def makers_in(text: str) -> list[str]:
    """Makers in one word or string; the same few names are asked for over and over."""
    return [word.lower() for word in MAKERS.findall(text.replace("_", " "))]


def test_only_drivers_and_emulators_know_the_makers_of_arms(trees) -> None:
    found, used = [], set()
    for module, tree in trees.items():
        name = str(module.relative_to(PACKAGE))
        if part_of(module) not in DRIVING:
            for line, word in named_makers(module.read_text(encoding="utf-8"), tree):
                used.add((name, word))
                if word not in NAMED.get(name, {}):
                    found.append(f"{name}:{line} {word}")
    assert found == []
    allowed = {(name, word) for name, words in NAMED.items() for word in words}
    assert allowed <= used, "exceptions that nothing needs any more"


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("class UrArm: ...", "ur"),
        ("def emulate_xarm(): ...", "xarm"),
        ("if driver == 'ur': ...", "ur"),
        ("fault = 'rtde_silence'", "rtde"),
        ("import rtde_control", "rtde"),
        ("x = 1  # as the dashboard says", "dashboard"),
        ('"""Of a Universal Robots arm."""', "universal robots"),
        ("def f(polyscope): ...", "polyscope"),
        ("settings.XArmSettings", "xarm"),
        ("'the xArm 6'", "xarm"),
        ("our_purpose = 'a curve, four hours, urn'", None),
        ("surface = 'dashboards'", None),
    ],
)
def test_the_search_for_makers_finds_them(source: str, word: str | None) -> None:
    assert {found for _, found in named_makers(source, ast.parse(source))} == (
        {word} if word else set()
    )


def test_imports_point_in_the_agreed_direction() -> None:
    command = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    result = subprocess.run(
        [sys.executable, "-c", command, "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_nothing_public_is_named_like_a_test(trees) -> None:
    found = []
    for module, tree in trees.items():
        for node in tree.body:
            names = []
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                names = [node.name]
            elif isinstance(node, ast.Assign):
                names = [target.id for target in node.targets if isinstance(target, ast.Name)]
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                names = [node.target.id]
            found += [f"{place(module, node)} {name}" for name in names if name.startswith("Test")]
    assert found == []


def test_only_the_command_line_prints(trees) -> None:
    found = []
    for module, tree in trees.items():
        if part_of(module) == "cli":
            continue
        for node in nodes(tree):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in {"print", "input"}
            ):
                found.append(place(module, node))
    assert found == []


def test_nothing_below_the_pipeline_reads_the_wall_clock(inner_uses) -> None:
    found = [
        f"{place(module, node)} {path}"
        for module, uses in inner_uses.items()
        for node, path in uses
        if reads_wall_clock(path)
    ]
    assert found == []


def test_nothing_below_the_pipeline_draws_from_hidden_random_state(trees, inner_uses) -> None:
    found = []
    for module, uses in inner_uses.items():
        found += [
            f"{place(module, node)} {path}" for node, path in uses if uses_hidden_random_state(path)
        ]
        found += [
            f"{place(module, call)} default_rng() without a seed"
            for call in unseeded_generators(trees[module], uses)
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
    uses = list(dotted_uses(tree))
    paths = [path for _, path in uses]
    assert sum(map(reads_wall_clock, paths)) == clock
    assert (
        sum(map(uses_hidden_random_state, paths)) + len(list(unseeded_generators(tree, uses)))
        == random
    )


SLEEPERS = {
    "drivers/fake_dots.py": "the loop of asyncio that a Bluetooth library runs on",
    "drivers/test_serial_line.py": "a pseudo-terminal",
    "drivers/pty_board.py": "a pseudo-terminal",
    "execution/test_faulty_boards.py": "a pseudo-terminal",
    "execution/test_record.py": "a pseudo-terminal",
    "benchmarks/networks.py": "makers' client libraries",
    "drivers/test_receiver.py": "packets of the machine's own network",
    "emulated_arms.py": "makers' client libraries",
    "emulation/test_proxy.py": "packets of the machine's own network",
    "lock_step/link.py": "waits on the virtual clock",
    "lock_step/serial_board.py": "waits on the virtual clock",
    "system/test_manifest_keys.py": "a pseudo-terminal",
    "system/test_real_clients.py": "makers' client libraries",
}
"""Tests that may sleep on the machine's time, and what for; everything else has a clock that a test
moves on, such as `FakeClock` or `tests.lock_step`.
"""
SLEEPS = {"sleep", "time.sleep", "asyncio.sleep", "signal.alarm", "signal.setitimer"}
TIMERS = {"Timer", "call_later"}
TIMED = {"wait_for", "join", "poll", "select"}
"""What takes for how long it waits at most among its arguments; `wait` as its first."""
WAITS = {"get", "put", "acquire"}
"""What takes it by its name alone."""
MAY_SLEEP = re.compile(
    r"sleep|wait|timeout|alarm|setitimer|Timer|call_later|select|\.(?:join|poll)\(\s*[\d.]"
)
"""What stands in a file that has such a call."""
PATIENCE_S = 5.0
"""Whoever waits for so long waits for something that happens at once, and fails where it does not;
shorter waits are for time to pass."""


def sleeps(tree: ast.Module) -> Iterator[ast.Call]:
    """Calls that let the machine's time pass: sleeps but for no time, timers, and waits for
    something that are shorter than patience, or as long as something says that is no constant.
    """
    constants = {
        target.id: number(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in nodes(tree):
        if not isinstance(node, ast.Call):
            continue
        name, last = ast.unparse(node.func), ast.unparse(node.func).split(".")[-1]
        given = [each.value for each in node.keywords if each.arg == "timeout"]
        if name in SLEEPS:
            given = [] if node.args and number(node.args[0]) == 0 else [node]
        elif last in TIMERS or last == "wait":
            given += node.args[:1]
        elif last in TIMED:
            given += [each for each in node.args if number(each) is not None]
        elif last not in WAITS:
            continue
        for each in given:
            if isinstance(each, ast.Constant) and each.value is None:
                continue  # for ever
            known = constants.get(each.id) if isinstance(each, ast.Name) else number(each)
            if known is None or 0 < known < PATIENCE_S:
                yield node
                break


def number(node: ast.expr) -> float | None:
    """A number that is written as such, but for truth values; None for anything else."""
    if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
        return float(node.value)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div | ast.Mult):
        left, right = number(node.left), number(node.right)
        if left is not None and right:
            return left / right if isinstance(node.op, ast.Div) else left * right
    return None


def test_no_test_sleeps_on_the_machines_time_but_for_what_knows_no_other() -> None:
    tests = ROOT / "tests"
    sleeping = {
        str(path.relative_to(tests))
        for path in tests.rglob("*.py")
        if MAY_SLEEP.search(text := path.read_text(encoding="utf-8"))
        if any(True for _ in sleeps(ast.parse(text)))
    }
    nodes.cache_clear()
    assert sleeping == set(SLEEPERS)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("time.sleep(0.1)", 1),
        ("sleep(seconds)", 1),
        ("await asyncio.sleep(0.001)", 1),
        ("asyncio.sleep(0)", 0),
        ("clock.sleep(3.0)", 0),
        ("threading.Timer(0.5, stop)", 1),
        ("loop.call_later(1, stop)", 1),
        ("ended.wait(0.01)", 1),
        ("ended.wait(1 / 60)", 1),
        ("ended.wait(timeout=until - now)", 1),
        ("ended.wait()", 0),
        ("ended.wait(timeout=None)", 0),
        ("assert ended.wait(60)", 0),
        ("LONG_S = 30.0\nassert ended.wait(LONG_S)", 0),
        ("SHORT_S = 0.3\nended.wait(timeout=SHORT_S)", 1),
        ("thread.join(0.2)", 1),
        ("thread.join(timeout=patience)", 1),
        ("thread.join(5)", 0),
        ("', '.join(names)", 0),
        ("queue.get(timeout=0.1)", 1),
        ("table.get(key, 0)", 0),
        ("pipe.poll(0.2)", 1),
        ("pipe.poll()", 0),
        ("select.select([port], [], [], 0.1)", 1),
        ("asyncio.wait_for(answer, timeout=0.2)", 1),
        ("asyncio.wait_for(answer, 30)", 0),
        ("lock.acquire(timeout=1)", 1),
        ("subprocess.run(command, timeout=1)", 0),
    ],
)
def test_the_search_for_sleeps_finds_them(source: str, found: int) -> None:
    assert len(list(sleeps(ast.parse(source)))) == found
    assert not found or MAY_SLEEP.search(source)


TESTS_ALONE = {
    "readinto": "asked for by the buffered reader of the standard library",
    "replay_arm": "named in the catalogue of arms as module:function",
    "simulated_arm": "named in the catalogue of arms as module:function",
    "ur_arm": "named in the catalogue of arms as module:function",
    "xarm_arm": "named in the catalogue of arms as module:function",
    "make_server": "named in the catalogue of emulated controllers as module:function",
    "to_earth_frame": "for authors of filters, whom docs/filters.md tells of it",
    "allan": "for notebooks, one of the figures of testbench.plot",
    "on_start": "called by numba, at whose events it listens",
    "on_end": "called by numba, at whose events it listens",
    "due_ns": "the virtual clock of the tests goes from one control period to the next by it",
}
"""Public names that nothing of the program spells, and why they stay."""


def test_no_public_name_is_of_the_tests_alone(trees) -> None:
    """Filters are found by their names, and so are their classes."""
    used: set[str] = set()
    for tree in trees.values():
        for node in nodes(tree):
            if isinstance(node, ast.Name):
                used.add(node.id)
            elif isinstance(node, ast.Attribute):
                used.add(node.attr)
            elif isinstance(node, ast.alias) and node.asname:
                used.add(node.name)
    known = used | {type(get_filter(name)).__name__ for name in FILTERS} | set(TESTS_ALONE)
    lonely = [
        f"{place(module, node)}: {node.name}"
        for module, tree in trees.items()
        for node in public(tree)
        if node.name not in known
    ]
    assert lonely == []


def public(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Functions, classes and methods that others may call, but for what a decorator registers."""
    for node in tree.body:
        inner = node.body if isinstance(node, ast.ClassDef) else []
        for own in (node, *inner):
            if isinstance(own, ast.FunctionDef | ast.ClassDef) and not own.name.startswith("_"):
                called = [d for d in own.decorator_list if isinstance(d, ast.Call)]
                if not any("command" in ast.dump(d) or "valid" in ast.dump(d) for d in called):
                    yield own
