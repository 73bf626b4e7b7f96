"""Foreign files: each importer turns a recording into a session that every later stage treats like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from testbench.clock import Clock
from testbench.exceptions import NotFoundError
from testbench.formats.recording import Recording, write_recording
from testbench.records.session import Session

Reader = Callable[[list[Path]], Recording]


@dataclass(frozen=True)
class Format:
    """A file format: where its importer lives, and a line for people."""

    module: str
    description: str

    def reader(self) -> Reader:
        """The function `read(files)` of the format."""
        function: Reader = import_module(self.module).read
        return function


FORMATS = {
    "broad": Format("testbench.formats.broad", "a BROAD trial (.mat or .hdf5): IMU and optical orientation at 285.7 Hz"),
}


def import_recording(name: str, files: list[Path], out: Path, clock: Clock) -> Session:
    """Turn foreign files into a session.

    Args:
        name: Of the format. files: To read. out: Folder of the session, to be made. clock: For the date.

    Raises:
        NotFoundError: No such format; lists those that exist.
        FileProblems: A file is not of this format; nothing is written then.
    """
    if name not in FORMATS:
        raise NotFoundError("format", name, list(FORMATS))
    return write_recording(FORMATS[name].reader()(files), files, name, out, clock)
