"""A board at the far end of a pseudo-terminal."""

from __future__ import annotations

import os
import time
import tty
from pathlib import Path

from tests.drivers.board_lines import line


class Board:
    """A board at the far end of a pseudo-terminal, reached through a link whose target changes when
    it is plugged in anew.
    """

    def __init__(self, folder: Path, name: str = "ttyBOARD"):
        self.link = folder / name
        self.master = -1
        self.heard = b""

    def plug_in(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(slave))
        self._slave = slave  # kept open, or the first closing of the port would hang the line up

    def unplug(self) -> None:
        if self.master >= 0:
            os.close(self.master)
            os.close(self._slave)
            self.link.unlink(missing_ok=True)
            self.master = -1

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self.master, data) :]

    def send_steadily(self, first: int, count: int, rate: float) -> None:
        begin = time.monotonic()
        for k in range(count):
            time.sleep(max(begin + k / rate - time.monotonic(), 0))
            self.send(line(first + k, 1000 / rate))

    def listen(self) -> bytes:
        self.heard += os.read(self.master, 1000)
        return self.heard
