"""A missing extra is named before anything is connected, with a command that installs it."""

from __future__ import annotations

import ast
import logging
import sys
from importlib.metadata import metadata
from pathlib import Path

import pytest

from testbench import extras
from testbench.cli import _tell_of_compiling
from testbench.exceptions import DriverError
from testbench.model.kernel_cache import COMPILES, LOGGER, Announcement
from testbench.pipeline.arm import refuse_arm
from testbench.pipeline.record import record
from testbench.pipeline.request import ArmRequest, RecordRequest, RunRequest
from testbench.pipeline.watcher import Consent, Watcher

ROOT = Path(__file__).resolve().parent.parent


EXTRAS = sorted(
    set(metadata(extras.PROJECT).get_all("Provides-Extra") or ()) - {"all", "dev", "docs"}
)


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with the bench and nothing else."""

    def known(package: str) -> str:
        if package != extras.PROJECT:
            raise extras.PackageNotFoundError(package)
        return "1"

    monkeypatch.setattr(extras, "version", known)


def test_what_extras_bring_is_read_of_the_installed_package(bare: None) -> None:
    assert {"ur", "xarm", "serial", "ble", "mcap", "ros", "markers", "seal"} <= set(EXTRAS)
    assert all(extras.is_missing(name) for name in EXTRAS)
    assert extras.missing_extra("it needs", "ur").endswith(
        "(it is for python_version < '3.13' and platform_machine == 'x86_64' only)"
    )


def test_what_is_installed_is_not_missed() -> None:
    assert [name for name in EXTRAS if name != "ur" and extras.is_missing(name)] == []


def test_an_arm_without_its_library_is_refused_before_it_is_connected(bare: None) -> None:
    for driver in ("ur", "xarm"):
        arm = ArmRequest(driver=driver, host="192.0.2.1", simulate_imus=True)
        asked = RunRequest(protocol="quick", arm=arm)
        with pytest.raises(DriverError, match=rf"extra '{driver}'.*install .*\[{driver}\]"):
            refuse_arm(asked, Consent(motion=True))
        refuse_arm(asked, Consent())  # a dry run connects to nothing


def test_devices_without_their_library_are_refused_before_anything_is_said(bare: None) -> None:
    said: list[str] = []
    for asked in (
        RecordRequest(serial=("/dev/null:mpu6050",), duration_s=1.0),
        RecordRequest(dots=("D4:22:CD:00:11:22",), duration_s=1.0),
    ):
        with pytest.raises(DriverError, match="which is not installed"):
            record(asked, Watcher(notify=said.append))
    assert said == []


def test_the_command_that_installs_goes_with_this_interpreter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert extras.install_command("mcap").startswith(f"{sys.executable} -m pip install ")
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    assert extras.install_command("mcap").startswith(f"uv pip install --python {sys.executable} ")

    def unknown(name: str) -> str:
        raise extras.PackageNotFoundError(name)

    monkeypatch.setattr(extras, "version", unknown)
    assert not extras.is_missing("mcap")  # it is not known what the extra brings
    assert extras.install_command("mcap").endswith(f"'{ROOT}[mcap]'")


def test_an_older_python_is_told_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "testbench" / "__init__.py").read_text(encoding="utf-8")
    ast.parse(text, feature_version=(3, 7))  # such a Python reads as far as that sentence
    monkeypatch.setattr(sys, "version_info", (3, 10, 4, "final", 0))
    with pytest.raises(SystemExit, match=r"needs Python 3\.11, 3\.12 or 3\.13; .* is Python 3\.10"):
        exec(compile(text, "testbench", "exec"), {"__name__": "testbench"})


def test_compiling_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    told = Announcement()
    with caplog.at_level("INFO", LOGGER):
        for _ in range(3):
            told.on_start(None)
            told.on_end(None)
    assert [record.message for record in caplog.records] == [COMPILES]


def test_the_command_line_shows_it_on_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    logger = logging.getLogger(LOGGER)
    monkeypatch.setattr(logger, "handlers", [])
    monkeypatch.setattr(logger, "propagate", True)
    for terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal, raising=False)
        _tell_of_compiling()
        assert bool(logger.handlers) == terminal
    logger.setLevel(logging.NOTSET)
