"""Emulated arms for the tests that drive one, and a short protocol for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from testbench.pipeline.prepared import make_plan
from testbench.records.session.plan import Plan
from tests.asking import run_of
from tests.emulated_arms import SHORT
from tests.lock_step.bench import VirtualArm, VirtualBench, bench

__all__ = ["bench"]


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a reference, a pose, a sweep and the way back."""
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def short_plan(short: Path) -> Plan:
    return make_plan(run_of(short))


@pytest.fixture
def ur3e(bench: VirtualBench) -> VirtualArm:
    """An emulated UR3e at rest."""
    return bench.ur()
