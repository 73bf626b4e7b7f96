"""What passes between the bench and the process that drives an arm.

Client libraries hold the interpreter while they connect, and a servo loop must not wait for a disk:
the arm is driven by a process of its own, which stops the arm when the bench falls silent. The
bench talks to it over a pair of sockets.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from testbench.exceptions import DriverError

if TYPE_CHECKING:
    from testbench.drivers.arms.client import ArmClient

ANSWER_S = 20.0
"""The process must answer a request for connection within this time [s]; the client allows 5 s for
each of its own steps.
"""
SILENCE_S = 5.0
"""During motion the process says something at least twice a second; after so long it is given up
and killed [s].
"""
Message = tuple[Any, ...]


@dataclass(frozen=True)
class Motion:
    """One step as the process is told of it.

    Attributes:
        index: Of the step; -1 for the approach.
        kind: "move" (the controller plans it), "stream" (target by target) or "hold".
        target: Joint angles at its end, shape (n,) [rad].
        speed: Of the leading joint [rad/s], [rad/s^2].
        acceleration: Of the leading joint [rad/s], [rad/s^2].
        path: Targets at the streaming rate, shape (k, n) [rad], or None.
        dwell: [s].
        duration: As planned [s].
    """

    index: int
    kind: str
    target: np.ndarray
    speed: float = 0.0
    acceleration: float = 0.0
    path: np.ndarray | None = None
    dwell: float = 0.0
    duration: float = 0.0


@dataclass(frozen=True)
class LinkSettings(ABC):
    """How the process drives the arm.

    Attributes:
        host: Address of the controller.
        joints: How many.
        control_hz: Rates of streaming and of recording [Hz].
        record_hz: Rates of streaming and of recording [Hz].
        tracking: Largest error of following [rad].
        settled: Largest error of a pose that counts as reached [rad].
        host_silence: The arm stops when the bench, or the controller's data, are silent for so long
            [s].
        arm_silence: The arm stops when the bench, or the controller's data, are silent for so long
            [s].
        mass: Tool [kg], [m].
        centre: Tool [kg], [m].
        orphaned: What becomes of an arm whose driving process is gone, for a person to read.
        remedies: What a person does then, by the word for the cause.
        joint_names: For messages.
    """

    host: str
    joints: int = 6
    control_hz: float = 500.0
    record_hz: float = 125.0
    tracking: float = float(np.radians(5.0))
    settled: float = float(np.radians(0.01))
    host_silence: float = 3.0
    arm_silence: float = 0.5
    mass: float | None = None
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    joint_names: tuple[str, ...] = ()
    orphaned: ClassVar[str]
    remedies: ClassVar[Mapping[str, str]]

    @abstractmethod
    def client(self) -> ArmClient:
        """The client library that takes these settings, in the process that drives the arm; nothing
        is connected.
        """


class Link:
    """The process that drives the arm, seen from the bench.

    Args:
        settings: What it is to do.
    """

    def __init__(self, settings: LinkSettings):
        self.settings = settings
        ours, theirs = socket.socketpair()
        path_of_this = [str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "testbench.drivers.arms.worker", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in path_of_this if path)},
            start_new_session=True,  # Ctrl-C goes to the bench, which stops the arm in order
        )
        theirs.close()
        self._connection = Connection(os.dup(ours.fileno()))
        ours.close()
        self._heard = time.monotonic()
        self.tell("settings", settings)

    def tell(self, *message: Any) -> None:
        """Send something.

        Raises:
            DriverError: The process has ended.
        """
        try:
            self._connection.send(message)
        except OSError:
            raise DriverError(
                f"the process that drives the arm has ended; {self.settings.orphaned}"
            ) from None

    def begin(self, *message: Any) -> None:
        """Send a request for motion; from now on the process must be heard of, however long the
        bench took before.

        Raises:
            DriverError: The process has ended.
        """
        self._heard = time.monotonic()
        self.tell(*message)

    def take(self) -> list[Message]:
        """What the process said since the last call.

        Raises:
            DriverError: It has ended without saying why, or is silent.
        """
        messages: list[Message] = []
        try:
            while self._connection.poll():
                messages.append(self._connection.recv())
                self._heard = time.monotonic()
        except (EOFError, OSError):
            if not messages:
                raise DriverError(
                    f"the process that drives the arm has ended; {self.settings.orphaned}"
                ) from None
        if not messages and time.monotonic() - self._heard > SILENCE_S:
            self.kill()
            silent = (
                f"the process that drives the arm is silent for {SILENCE_S:g} s: it waits "
                "for the controller"
            )
            raise DriverError(f"{silent}; {self.settings.orphaned}")
        return messages

    def wait_for(self, kind: str, timeout: float = ANSWER_S) -> tuple[Message, list[Message]]:
        """The next message of a kind, and those that came before it.

        Raises:
            DriverError: The process ended, reported a fault, or took too long.
        """
        end, before = time.monotonic() + timeout, list[Message]()
        while time.monotonic() < end:
            try:
                if not self._connection.poll(0.1):
                    continue
                message = self._connection.recv()
            except (EOFError, OSError):
                raise DriverError(
                    f"the process that drives the arm has ended; {self.settings.orphaned}"
                ) from None
            self._heard = time.monotonic()
            if message[0] == kind:
                return message, before
            if message[0] == "fault":
                error = DriverError(str(message[2]))
                if message[1] in self.settings.remedies:
                    error.add_note(f"what to do: {self.settings.remedies[message[1]]}")
                raise error
            before.append(message)
        self.kill()
        raise DriverError(
            f"the controller at {self.settings.host} does not answer within {timeout:g} s"
        )

    def kill(self) -> None:
        """End the process at once; an arm in motion is then left to what `LinkSettings.orphaned`
        says.
        """
        self._process.kill()

    def close(self, timeout: float = 5.0) -> None:
        """End the process; a second call does nothing."""
        if self._connection.closed:
            return
        with suppress(OSError):
            self._connection.send(("close",))
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._connection.close()
