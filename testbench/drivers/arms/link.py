"""What passes between the bench and the process that drives an arm.

Client libraries hold the interpreter while they connect, and a servo loop must not wait for a disk:
the arm is driven by a process of its own, which stops the arm when the bench falls silent. The
bench talks to it over a pair of sockets.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO, Any

from testbench.clock import Clock, seconds
from testbench.drivers.arms.client import ArmClient
from testbench.drivers.arms.entry import ArmEntry
from testbench.drivers.arms.settings import LinkSettings
from testbench.exceptions import DriverError

ANSWER_S = 20.0
"""The process must answer a request for connection within this time [s]; the client allows 5 s for
each of its own steps.
"""
ENDING_S = 0.5
"""How a process ended is known within this time of its last word [s]."""
SILENCE_S = 5.0
"""During motion the process says something at least twice a second; after so long it is given up
and killed [s].
"""
MOST_WORDS = 4000
"""Characters of what the process wrote on its way that are kept, the last ones."""
Message = tuple[Any, ...]


class Link:
    """The process that drives the arm, seen from the bench.

    Args:
        client: The client library that it drives the arm through, made there of the settings.
        settings: How it is to drive.
        entry: Of the arm, for what a person does after a fault.
        time: The bench's clock.
    """

    _words: IO[bytes] | None = None

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
        # A file and no pipe: nobody needs to read it, and it is there after a crash.
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        path_of_this = [str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
        process = subprocess.Popen(
            [sys.executable, "-m", "testbench.drivers.arms.worker", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._words,
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
            raise self._ended() from None

    def _ended(self) -> DriverError:
        """That the process is gone, and how it went where that is known."""
        with suppress(subprocess.TimeoutExpired):
            code = self._process.wait(ENDING_S)
            if code < 0:
                how = signal.Signals(-code).name
                return DriverError(f"the process that drives the arm has ended by {how}")
        return DriverError("the process that drives the arm has ended")

    @property
    def words(self) -> str:
        """What the process wrote on stderr, the end of it."""
        if self._words is None:
            return ""
        with suppress(OSError, ValueError):
            size = self._words.seek(0, os.SEEK_END)
            self._words.seek(max(size - MOST_WORDS, 0))
            return self._words.read().decode("utf-8", "replace").strip()
        return ""

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
                raise self._ended() from None
        if not messages and seconds(self.time) - self._heard > SILENCE_S:
            self.kill()
            raise DriverError(
                f"the process that drives the arm said nothing for {SILENCE_S:g} s and was ended"
            )
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
                raise self._ended() from None
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
        """End the process at once; an arm in motion must be stopped in another way then."""
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
        if self._words is not None:
            self._words.close()
