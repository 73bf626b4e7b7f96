"""Emulated controllers in processes of their own, each on a loopback address that no other test uses."""

from __future__ import annotations

import itertools
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from testbench.records.session import RunStatus, Session, list_sessions

ROOT = Path(__file__).resolve().parent.parent
COMMAND_PORT = 1502
_numbers = itertools.count(2)


class Emulated:
    """What a test may ask of an emulator that runs."""

    def __init__(self, address: str, process: subprocess.Popen[str]):
        self.address, self.process = address, process

    def control(self, line: str) -> str:
        """Say a line to the fault port, and give its answer."""
        with socket.create_connection((self.address, 29998), 5) as connection:
            connection.sendall(f"{line}\n".encode())
            return connection.makefile().readline().strip()

    def wait_until(self, wanted: str, timeout: float = 15.0) -> str:
        """Wait until the status holds a word."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            status = self.control("status")
            if wanted in status:
                return status
            time.sleep(0.05)
        raise AssertionError(f"the emulator never said '{wanted}', but: {status}")


class EmulatedUr(Emulated):
    """A Universal Robots controller."""

    def dashboard(self, line: str) -> str:
        with socket.create_connection((self.address, 29999), 5) as connection:
            file = connection.makefile("rw")
            file.readline()
            file.write(f"{line}\n")
            file.flush()
            return file.readline().strip()


def free_address() -> str:
    """A loopback address of this process alone (Linux answers the whole of 127.0.0.0/8)."""
    return f"127.{100 + os.getpid() % 100}.{os.getpid() // 100 % 250}.{next(_numbers)}"


@contextmanager
def _emulated(maker: str, *options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    address = free_address()
    process = subprocess.Popen(
        [sys.executable, "-m", "testbench", "emulate", maker, "--address", address, *options],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert "emulated at" in said, said + process.stdout.read()
        yield address, process
    finally:
        process.kill()
        process.communicate()


@contextmanager
def emulated_ur(*options: str) -> Iterator[EmulatedUr]:
    with _emulated("ur", *options) as (address, process):
        yield EmulatedUr(address, process)


@contextmanager
def emulated_xarm(*options: str) -> Iterator[Emulated]:
    """An xArm controller; commands go to port `COMMAND_PORT`, for 502 needs privileges."""
    with _emulated("xarm", "--command-port", str(COMMAND_PORT), *options) as (address, process):
        yield Emulated(address, process)


def faulted_session(logs: Path, kinds: set[str]) -> Session:
    """The one session of a folder, which a fault of one of these kinds has ended, closed as it must be."""
    (session,) = list_sessions(logs)
    assert session.status is RunStatus.ERROR
    assert not list(session.path.glob("*.arrows"))
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    assert told.details["fault"] in kinds
    assert session.events[-1].event == "run_error"
    arm = session.arm()
    assert arm is not None and len(arm.host_time_ns) > 5
    return session
