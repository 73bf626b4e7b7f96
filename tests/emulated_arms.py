"""Emulated controllers in processes of their own, each on a loopback address that no other test
uses, for what must go through the makers' client libraries. These go by the machine's time: a test
that drives through one waits long, and asserts no latency. Everything else is in `tests.lock_step`.
"""

from __future__ import annotations

import itertools
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from testbench.clock import SystemClock
from testbench.drivers.arms.remote import RemoteArm
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.drivers.session_time import SessionTime
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.records.session.plan import Plan
from testbench.records.session.session import RunStatus, Session, list_sessions

ROOT = Path(__file__).resolve().parent.parent
COMMAND_PORT = 1502
"""Of emulated xArms; 502 needs privileges."""
PATIENT = {"tracking": 3.0, "arm_silence": 20.0, "host_silence": 60.0, "stuck": 20.0}
"""Of the driving process on a machine that may be busy: no stall of this machine looks like a fault
of the arm [rad, s, s, s].
"""
_numbers = itertools.count(2)

SHORT = """\
name: short
purpose: A reference, a pose and a sweep, for tests on an arm in real time
robot: ur3e
sensors:
  hand:
    preset: xsens_dot
    link: wrist_3_link
    mounting: {rotation_deg: {XYZ: [90, 90, 0]}, position_mm: [0, 0, 10]}
motion: {speed: 0.8, acceleration: 0.8, jerk: 0.8}
arm: {tool: {mass_kg: 0.2, centre_mm: [0, 0, 30]}}
sections:
  - name: rest
    role: reference
    steps: [{name: start, dwell_s: 0.4}]
  - name: moves
    steps:
      - {name: out, move_to_deg: {wrist_3_joint: 40, wrist_1_joint: -70}, dwell_s: 0.5}
      - name: wave
        sweep: {wrist_3_joint: {sine: {amplitude_deg: 6, frequency_hz: 1.5, cycles: 1}}}
        dwell_s: 0.3
      - {name: back, move_to: home, dwell_s: 0.5}
estimate: {filters: [device, vqf_6d], align: heading, calibrate: none}
"""


class Emulated:
    """What a test may ask of an emulator that runs."""

    def __init__(self, address: str, process: subprocess.Popen[str]):
        self.address, self.process = address, process

    def control(self, line: str) -> str:
        """Say a line to the fault port, and give its answer."""
        with socket.create_connection((self.address, 29998), 30) as connection:
            connection.sendall(f"{line}\n".encode())
            return connection.makefile().readline().strip()

    def wait_until(self, wanted: str, timeout: float = 60.0) -> str:
        """Wait until the status holds a word."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            status = self.control("status")
            if wanted in status:
                return status
            time.sleep(0.05)
        raise AssertionError(f"the emulator never said '{wanted}', but: {status}")


def free_address() -> str:
    """A loopback address of this process alone (Linux answers the whole of 127.0.0.0/8)."""
    return f"127.{100 + os.getpid() % 100}.{os.getpid() // 100 % 250}.{next(_numbers)}"


@contextmanager
def _emulated(maker: str, *options: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    address = free_address()
    process = subprocess.Popen(
        [sys.executable, "-m", "testbench", "emulate", maker, "--address", address, *options],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert "emulated at" in said, said + process.stdout.read()
        yield address, process
    finally:
        process.kill()
        process.communicate()


@contextmanager
def emulated_ur(*options: str) -> Iterator[Emulated]:
    """A Universal Robots controller."""
    with _emulated("ur", *options) as (address, process):
        yield Emulated(address, process)


@contextmanager
def emulated_xarm(*options: str) -> Iterator[Emulated]:
    """An xArm controller; commands go to port `COMMAND_PORT`, for 502 needs privileges."""
    with _emulated("xarm", "--command-port", str(COMMAND_PORT), *options) as (address, process):
        yield Emulated(address, process)


def drive(
    plan: Plan,
    address: str,
    logs: Path,
    patience: Mapping[str, float] | None = None,
    **options: Any,
) -> Session:
    """Run a plan through the real client library, with simulated sensors and patience, but for what
    is given of it.
    """
    time_, patient = SessionTime(SystemClock()), PATIENT | dict(patience or {})
    if plan.robot.name == "xarm6":
        slow = xarm_settings(plan, f"{address}:{COMMAND_PORT}")
        arm: RemoteArm = XArm(plan.robot, replace(slow, answer=1.5, **patient), time_)
    else:
        arm = UrArm(plan.robot, replace(ur_settings(plan, address), watchdog=3, **patient), time_)
    return execute_on_arm(plan, arm, Sensors.simulated(plan, 1), RunOptions(logs, 1, **options))


def run_on_ur(address: str, protocol: Path, logs: Path, *options: str) -> list[str]:
    """Arguments of `testbench` for a run on a UR arm with simulated sensors."""
    start = ["run", str(protocol), "--arm", "ur", "--host", address, "--logs", str(logs)]
    return [*start, "--simulate-imus", "--no-report", "--filters", "device", *options]


def faulted_session(logs: Path, kinds: set[str]) -> Session:
    """The one session of a folder, which a fault of one of these kinds has ended, closed as it must
    be, with samples of the arm.
    """
    (session,) = list_sessions(logs)
    assert session.status is RunStatus.ERROR
    assert not list(session.path.glob("*.arrows"))
    (told,) = [event for event in session.events if event.event == "arm_fault"]
    assert told.details["fault"] in kinds, told.details
    assert session.events[-1].event == "run_error"
    arm = session.arm()
    assert arm is not None and len(arm.host_time_ns) > 5
    return session
