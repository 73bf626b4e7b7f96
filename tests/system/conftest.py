"""An emulated arm for the tests that drive one, and a short protocol for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from testbench.pipeline.prepared import make_plan
from testbench.records.plan import Plan
from tests.asking import run_of
from tests.emulated_arms import SHORT, EmulatedUr, emulated_ur


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a reference, a pose, a sweep and the way back."""
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def short_plan(short: Path) -> Plan:
    return make_plan(run_of(short))


@pytest.fixture(scope="session")
def ur_emulator() -> Iterator[EmulatedUr]:
    """One controller for all that drive a UR3e."""
    pytest.importorskip("rtde_control", reason="ur_rtde is not installed")
    with emulated_ur() as robot:
        yield robot


@pytest.fixture
def ur3e(ur_emulator: EmulatedUr) -> EmulatedUr:
    """The emulated arm at rest, without a fault."""
    ur_emulator.control("clear")
    ur_emulator.wait_until("at rest")
    return ur_emulator
