"""What the tests share: a clock of their own, runs that are made once, protocols with one thing
changed, public recordings.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

# What the bench remembers between commands is remembered beside the source, and not in the home
# folder of whoever runs the tests.
os.environ["XDG_CACHE_HOME"] = str(Path(__file__).resolve().parent.parent / "build" / "cache")
# Before NumPy is loaded: the matrices are small, and threads of two workers on two cores would wait
# for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
import typer.main
import typer.testing
import yaml
from hypothesis import settings

from testbench import execute, plan
from testbench.execution import RunOptions
from testbench.pipeline.analyse import Result, analyse
from testbench.records.specs.shipped import shipped_folder
from tests.asking import analysis, planned
from tests.skips import complaint

# The same examples every time, however busy the machine is.
settings.register_profile("repeatable", deadline=None, derandomize=True, database=None)
settings.load_profile("repeatable")


# A command line that is called in this process is built from its functions once, as in a process of
# its own, and not anew at each of the hundreds of calls.
typer.main.get_command = typer.testing._get_command = cache(typer.main.get_command)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]):
    return without_needless_skip((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    return without_needless_skip((yield))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests come first, so that no worker has one left at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def without_needless_skip(report):
    """The report of a test or a module, failed where it skipped what CI could have installed."""
    if report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if told := complaint(reason):
            report.outcome, report.longrepr = "failed", told
    return report


class FakeClock:
    """Time that passes only when somebody sleeps."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000
        self.slept: list[float] = []

    def utc(self) -> datetime:
        return datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now_ns += round(max(seconds, 0.0) * 1e9)


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of public recordings."""
    folder = os.environ.get("TESTBENCH_DATA")
    if not folder:
        pytest.skip(
            "TESTBENCH_DATA is not set; it names the folder of public recordings (BROAD and others)"
        )
    if not Path(folder).is_dir():
        pytest.skip(f"TESTBENCH_DATA names {folder}, which does not exist")
    return Path(folder)


@pytest.fixture(scope="session")
def cases() -> Path:
    """The folder of situations from public bug reports, one folder each."""
    folder = os.environ.get("TESTBENCH_CASES")
    if not folder:
        pytest.skip("TESTBENCH_CASES is not set; it names the folder of situations of users")
    if not (Path(folder) / "files").is_dir():
        pytest.skip(f"TESTBENCH_CASES names {folder}, which has no folder files")
    return Path(folder) / "files"


Change = Callable[[dict[str, Any]], None]
ProtocolMaker = Callable[[str, Change], Path]


@pytest.fixture(scope="session")
def altered_protocol(tmp_path_factory: pytest.TempPathFactory) -> ProtocolMaker:
    """Writes a copy of a shipped protocol (and those it includes) in which one thing is changed,
    and gives its path.
    """

    def make(name: str, change: Change) -> Path:
        folder = tmp_path_factory.mktemp("protocol")
        for file in shipped_folder("protocols").glob("*.yaml"):
            shutil.copy(file, folder)
        path = folder / f"{name}.yaml"
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        change(content)
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return path

    return make


RunMaker = Callable[..., Result]


@pytest.fixture(scope="session")
def run_protocol(tmp_path_factory: pytest.TempPathFactory) -> RunMaker:
    """Runs a protocol on the simulated bench, from its file to its evaluation."""

    def run(protocol: str | Path, seed: int = 1, filters: list[str] | None = None) -> Result:
        the_plan = planned(protocol) if isinstance(protocol, str) else plan(protocol)
        session = execute(
            the_plan, tmp_path_factory.mktemp("logs"), seed, RunOptions(clock=FakeClock())
        )
        return analyse(session, analysis(*(filters or ())), whatever=True)

    return run


@pytest.fixture(scope="session")
def quick(run_protocol: RunMaker) -> Result:
    """The protocol `quick`, run once; its files must not be changed."""
    return run_protocol("quick")


TINY = """\
name: tiny
purpose: Two moves and a short sweep, for tests that need a whole run and no more
robot: ur3e
sensors:
  hand:
    preset: xsens_dot
    parameters: {clock: {jitter_us: 500}} # so that samples fall on either side of every border
    link: wrist_3_link
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
sections:
  - name: rest
    role: reference
    steps: [{name: start, dwell_s: 1}]
  - name: moves
    steps:
      - {name: out, move_to_deg: {wrist_3_joint: 60, wrist_1_joint: -60}, dwell_s: 0.8}
      - name: wave
        sweep: {wrist_3_joint: {sine: {amplitude_deg: 10, frequency_hz: 1, cycles: 1}}}
        dwell_s: 0.4
estimate: {filters: [device, vqf_6d], align: heading, calibrate: none}
"""


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a protocol of about six seconds."""
    path = tmp_path_factory.mktemp("tiny") / "tiny.yaml"
    path.write_text(TINY, encoding="utf-8")
    return path
