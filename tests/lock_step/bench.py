"""Emulated arms on the lock-step clock, and runs on them."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from testbench.clock import SystemClock
from testbench.drivers.arms import remote
from testbench.drivers.arms.ur import UrArm, ur_settings
from testbench.drivers.arms.xarm import XArm, xarm_settings
from testbench.drivers.session_time import SessionTime
from testbench.emulation.server import CONTROL_PORT, Server
from testbench.emulation.ur.server import UrServer
from testbench.emulation.ur.setup import make_controller as make_ur
from testbench.emulation.xarm.server import XArmServer
from testbench.emulation.xarm.setup import make_controller as make_xarm
from testbench.execution import RunOptions
from testbench.execution.executor import execute_on_arm
from testbench.execution.sensors import Sensors
from testbench.records.session.plan import Plan
from testbench.records.session.session import Session
from tests.emulated_arms import COMMAND_PORT, free_address
from tests.lock_step.clock import LockStep
from tests.lock_step.link import LockStepLink
from tests.lock_step.network import Network
from tests.lock_step.ur_library import DASHBOARD, ur_library
from tests.lock_step.xarm_library import xarm_library


class VirtualArm:
    """What a test may ask of an emulated controller on the lock-step clock."""

    def __init__(self, server: Server, network: Network):
        self.server, self.network, self.address = server, network, server.address

    def control(self, line: str) -> str:
        """Say a line to the fault port, and give its answer."""
        return self._say(CONTROL_PORT, line)

    def dashboard(self, line: str) -> str:
        return self._say(DASHBOARD, line, greets=True)

    def _say(self, port: int, line: str, greets: bool = False) -> str:
        with self.network.connect((self.address, port), 5.0) as connection:
            if greets:
                connection.readline()
            connection.sendall(f"{line}\n".encode())
            return connection.readline().strip()

    def wait_until(self, wanted: str, timeout: float = 5.0) -> str:
        """Wait until the status holds a word."""
        end_ns = self.network.clock.now_ns + round(1e9 * timeout)
        while wanted not in (status := self.control("status")):
            assert self.network.clock.now_ns < end_ns, f"never '{wanted}', but: {status}"
            self.network.clock.sleep(0.01)
        return status


class VirtualBench:
    """A bench whose arms are emulated in this process."""

    def __init__(self) -> None:
        self.clock = LockStep()
        self.network = Network(self.clock)
        self.links: list[LockStepLink] = []

    def link(self, *told: Any) -> LockStepLink:
        """`Link`, on this bench's clock."""
        self.links.append(LockStepLink(*told[:-1], self.clock))
        return self.links[-1]

    def ur(self, model: str = "ur3e", **identity: Any) -> VirtualArm:
        """A Universal Robots controller; see `testbench.emulation.ur.setup`."""
        return self._add(UrServer(make_ur(model, **identity), free_address(), None, self.clock))

    def xarm(self, **identity: Any) -> VirtualArm:
        """An xArm controller; see `testbench.emulation.xarm.setup`."""
        controller = make_xarm("xarm6", **identity)
        return self._add(XArmServer(controller, free_address(), None, COMMAND_PORT, self.clock))

    def _add(self, server: Server) -> VirtualArm:
        self.network.add(server)
        return VirtualArm(server, self.network)

    def time(self) -> SessionTime:
        return SessionTime(self.clock)

    def kill_driving_process(self, after_s: float) -> None:
        """Kill the process that drives an arm then."""

        def kill() -> None:
            self.clock.sleep(after_s)
            self.links[-1].kill()

        self.clock.start(kill)

    def arm(
        self, plan: Plan, robot: VirtualArm | str, time: SessionTime | None = None
    ) -> UrArm | XArm:
        """The driver of an arm, not connected."""
        address = robot if isinstance(robot, str) else robot.address
        if plan.robot.name == "xarm6":
            settings = xarm_settings(plan, f"{address}:{COMMAND_PORT}")
            return XArm(plan.robot, settings, time or self.time())
        return UrArm(plan.robot, ur_settings(plan, address), time or self.time())

    def drive(self, plan: Plan, robot: VirtualArm, logs: Path, **options: Any) -> Session:
        """Run a plan with simulated sensors."""
        time = self.time()
        return execute_on_arm(
            plan,
            self.arm(plan, robot, time),
            Sensors.simulated(plan, 1),
            RunOptions(logs, 1, **options),
        )


@contextmanager
def virtual_bench() -> Iterator[VirtualBench]:
    """A bench in lock step: in this block the machine's clock, the driving processes, the client
    libraries and the way to emulated controllers are those of this bench.
    """
    bench = VirtualBench()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(remote, "Link", bench.link)
        patch.setattr(socket, "create_connection", bench.network.connect)
        for name in ("utc", "monotonic_ns", "sleep"):
            patch.setattr(SystemClock, name, _of(bench.clock, name))
        for name, module in (ur_library(bench.network) | xarm_library(bench.network)).items():
            patch.setitem(sys.modules, name, module)
        try:
            yield bench
        finally:
            bench.clock.close()
            bench.network.close()


def _of(clock: LockStep, name: str) -> Callable[..., Any]:
    """A method that asks the lock-step clock."""
    return lambda self, *arguments: getattr(clock, name)(*arguments)


@pytest.fixture
def bench() -> Iterator[VirtualBench]:
    """A bench in lock step with its emulated arms."""
    with virtual_bench() as bench:
        yield bench
