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
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from testbench.clock import Clock, seconds
from testbench.drivers.arms.client import ArmClient
from testbench.drivers.arms.entry import ArmEntry
from testbench.drivers.arms.settings import LinkSettings
from testbench.exceptions import DriverError

ANSWER_S = 20.0
"""The process must answer a request for connection within this time [s]; the client allows 5 s for
each of its own steps.
"""
SILENCE_S = 5.0
"""During motion the process says something at least twice a second; after so long it is given up
and killed [s].
"""
Message = tuple[Any, ...]


class Link:
    """The process that drives the arm, seen from the bench.

    Args:
        client: The client library that it drives the arm through, made there of the settings.
        settings: How it is to drive.
        entry: Of the arm, for what a person does after a fault.
        time: The bench's clock.
    """

    def __init__(
        self, client: type[ArmClient], settings: LinkSettings, entry: ArmEntry, time: Clock
    ):
        self.settings, self.entry, self.time = settings, entry, time
        self._connection, self._process = self._start()
        self._heard = seconds(time)
        self.tell("settings", client, settings)

    def _start(self) -> tuple[Connection, subprocess.Popen[bytes]]:
        """Start the process: our end of the connection to it, and the process."""
        ours, theirs = socket.socketpair()
        path_of_this = [str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
        process = subprocess.Popen(
            [sys.executable, "-m", "testbench.drivers.arms.worker", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in path_of_this if path)},
            start_new_session=True,  # Ctrl-C goes to the bench, which stops the arm in order
        )
        theirs.close()
        connection = Connection(os.dup(ours.fileno()))
        ours.close()
        return connection, process

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
        """Send a request for motion; from now on the process must be heard of.

        Raises:
            DriverError: The process has ended.
        """
        self._heard = seconds(self.time)
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
                self._heard = seconds(self.time)
        except (EOFError, OSError):
            if not messages:
                raise DriverError(
                    f"the process that drives the arm has ended; {self.settings.orphaned}"
                ) from None
        if not messages and seconds(self.time) - self._heard > SILENCE_S:
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
        end, before = seconds(self.time) + timeout, list[Message]()
        while seconds(self.time) < end:
            try:
                if not self._connection.poll(0.1):
                    continue
                message = self._connection.recv()
            except (EOFError, OSError):
                raise DriverError(
                    f"the process that drives the arm has ended; {self.settings.orphaned}"
                ) from None
            self._heard = seconds(self.time)
            if message[0] == kind:
                return message, before
            if message[0] == "fault":
                error = DriverError(str(message[2]))
                remedy = self.entry.remedy(str(message[1]))
                if remedy is not None:
                    error.add_note(f"what to do: {remedy}")
                raise error
            before.append(message)
        self.kill()
        raise DriverError(
            f"the controller at {self.settings.host} does not answer within {timeout:g} s"
        )

    def kill(self) -> None:
        """End the process at once.

        An arm in motion is then left to what `LinkSettings.orphaned` says.
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
