"""What the operator asks for during a run: stop by Ctrl-C, pause and resume by key or signal.

Keys, where standard input is a terminal: p pauses, r resumes, q stops. Signals: SIGUSR1 pauses,
SIGUSR2 resumes, SIGINT and SIGTERM stop. (SIGTSTP is not used: a process that is suspended cannot
watch an arm.)
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress


class Operator:
    """Requests that the run looks for between two chunks of time."""

    def __init__(self) -> None:
        self.stop_asked = False
        self.pause_asked = False
        self.pause_reason = ""
        self._keyboard: int | None = None

    @property
    def how_to_go_on(self) -> str:
        """For a person in front of a run that is paused."""
        return (
            "r goes on, q stops" if self._keyboard is not None else "SIGUSR2 goes on, SIGINT stops"
        )

    def pause(self, reason: str) -> None:
        """Ask for a pause in the operator's place."""
        self.pause_asked, self.pause_reason = True, reason

    def look(self) -> None:
        """Take the keys that were pressed."""
        while self._keyboard is not None and select.select([self._keyboard], [], [], 0)[0]:
            try:
                pressed = os.read(self._keyboard, 1)
            except OSError:
                pressed = b""
            if not pressed:
                self._keyboard = None
                return
            self.key(pressed.decode("ascii", "replace"))

    def key(self, pressed: str) -> None:
        """Act on a key."""
        if pressed in {"p", "P"}:
            self.pause_asked = True
        elif pressed in {"r", "R"}:
            self.pause_asked = False
        elif pressed in {"q", "Q"}:
            self.stop_asked = True

    def _signalled(self, number: int, frame: object) -> None:
        if number in {signal.SIGINT, signal.SIGTERM}:
            self.stop_asked = True
        else:
            self.pause_asked = number == signal.SIGUSR1


@contextmanager
def operator_requests(keys: bool = False, pauses: bool = True) -> Iterator[Operator]:
    """An operator whose signals, and keys if wanted, are listened to instead of what they would do
    in the middle of a piece of work; only the main thread gets signals.

    Args:
        keys: Whether to listen to the keyboard, where standard input is a terminal.
        pauses: Whether there is anything to pause.
    """
    operator = Operator()
    if threading.current_thread() is not threading.main_thread():
        yield operator
        return
    numbers = [signal.SIGINT, signal.SIGTERM]
    numbers += [signal.SIGUSR1, signal.SIGUSR2] if pauses else []
    previous = {number: signal.signal(number, operator._signalled) for number in numbers}
    try:
        with _single_keys(operator, keys):
            yield operator
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def _single_keys(operator: Operator, keys: bool) -> Iterator[None]:
    if not keys or not sys.stdin.isatty():
        yield
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    try:
        before = termios.tcgetattr(descriptor)
        tty.setcbreak(descriptor)
    except termios.error:
        yield
        return
    operator._keyboard = descriptor
    try:
        yield
    finally:
        operator._keyboard = None
        with suppress(termios.error):
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
