"""Exporters: a session and its estimates in the formats that other programs read.

docs/exports.md describes each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from testbench.exceptions import BenchError, InputError, NotFoundError
from testbench.extras import missing_extra
from testbench.formats.exporters.settings import doubtful_notes, settings_notes
from testbench.formats.exporters.source import TRUTH, ExportSource, Frame
from testbench.formats.exporters.writing import check_target, written_whole
from testbench.formats.opensim_names import Model
from testbench.records.session.layout import EXPORT
from testbench.records.session.session import Session

Writer = Callable[[ExportSource, Path], list[str]]
"""Writes at a path what the source holds; returns notes: sentences on what the file does not show
by itself.
"""


@dataclass(frozen=True)
class ExportFormat:
    """A format that sessions can be exported to.

    Attributes:
        module: Where its `write(source, path)` lives; None where the caller brings the writer, as
            for the viewer's recordings.
        suffix: Of the file; empty where the format is a folder of tables.
        description: A line for people.
        one_filter: Whether it holds the orientation of one filter only.
        extra: Extra of this package that brings its library.
    """

    module: str | None
    suffix: str
    description: str
    one_filter: bool = False
    extra: str | None = None

    @property
    def is_folder(self) -> bool:
        return not self.suffix

    def writer(self) -> Writer:
        """The function that writes it.

        Raises:
            InputError: A library that it needs is not installed; names the extra that brings it.
        """
        assert self.module is not None
        try:
            function: Writer = import_module(self.module).write
        except ModuleNotFoundError as error:
            if self.extra is None or not error.name or error.name.startswith("testbench"):
                raise
            raise InputError(missing_extra("this format needs", self.extra)) from None
        return function


EXPORTS = {
    "csv": ExportFormat(
        "testbench.formats.exporters.csv_tables", "", "a folder of tables as comma-separated text"
    ),
    "parquet": ExportFormat(
        "testbench.formats.exporters.parquet_tables", "", "the same tables as Parquet"
    ),
    "mcap": ExportFormat(
        "testbench.formats.exporters.mcap_file",
        ".mcap",
        "ROS 2 messages, for Foxglove, rerun, ROS",
        True,
        "mcap",
    ),
    "sto": ExportFormat(
        "testbench.formats.exporters.opensim_sto",
        ".sto",
        "sensor orientations for OpenSim's OpenSense",
        True,
    ),
    "mot": ExportFormat(
        "testbench.formats.exporters.opensim_mot",
        ".mot",
        "joint angles in degrees for OpenSim",
        True,
    ),
    "mat": ExportFormat(
        "testbench.formats.exporters.matlab", ".mat", "one struct for MATLAB and Octave"
    ),
    "rrd": ExportFormat(None, ".rrd", "what the viewer shows, for rerun"),
}


@dataclass(frozen=True)
class Exported:
    """What an export came to.

    Attributes:
        path: The file or folder.
        filters: Whose estimates it holds.
        notes: Sentences on what the file does not show by itself.
    """

    path: Path
    filters: list[str]
    notes: list[str]


def export_format(name: str) -> ExportFormat:
    """A format by name.

    Raises:
        NotFoundError: No such format; lists those that exist.
    """
    if name not in EXPORTS:
        raise NotFoundError("export format", name, list(EXPORTS))
    return EXPORTS[name]


def check_options(
    name: str, filter_name: str | None, frame: Frame, model: Model = "rajagopal"
) -> None:
    """Refuse options that a format has no use for, rather than pass over them.

    Raises:
        InputError: Says which.
    """
    export_format(name)
    if name == "rrd" and filter_name is not None:
        raise InputError("an export to rrd shows every filter; it takes no --filter")
    if name != "sto" and frame != "opensim":
        raise InputError(
            f"--frame is for exports to sto; orientations exported to {name} are in the world, z up"
        )
    if name != "mot" and model != "rajagopal":
        raise InputError("--model is for exports to mot, whose columns are coordinates of a model")


def prepare_export(name: str, session: Session, out: Path | None, force: bool) -> Path:
    """Where an export goes, once it is known that it may go there; writes nothing.

    Args:
        name: Of the format.
        session: The recording.
        out: File or folder to write; one in the session's folder if None.
        force: Whether an earlier export may be replaced.

    Raises:
        InputError: The place is taken or does not suit the format, or a library is missing.
    """
    kind = export_format(name)
    if kind.module is not None:
        kind.writer()
    if out is None and (session.path / EXPORT).is_symlink():
        raise InputError(
            f"{session.path / EXPORT} is a symbolic link, and is not written to; name a place with "
            "--out"
        )
    path = (
        out
        if out is not None
        else session.path / EXPORT / (f"{session.name}{kind.suffix}" if kind.suffix else name)
    )
    check_target(path, name, kind.suffix, session, force)
    return path


def write_export(
    name: str, source: ExportSource, path: Path, writer: Writer | None = None
) -> Exported:
    """Write an export in one step: what is found under its name is whole.

    Args:
        name: Of the format.
        source: What to write.
        path: As `prepare_export` gave it.
        writer: Of a format that brings none.

    Raises:
        InputError: The session lacks what the format needs, or the place cannot be written to.
        StorageError: The disk is full.
    """
    kind = export_format(name)
    write = writer or kind.writer()
    if name == "mot" and source.wanted is None and not source.estimate.joints:
        # what the chain filter estimated, or else what an arm measured, is no orientation filter's
        measured = TRUTH if source.arm is not None else None
        source = replace(source, wanted=next(iter(source.chains), measured))
    try:
        with written_whole(path, kind.is_folder) as partial:
            notes = write(source, partial)
    except MemoryError:
        raise BenchError(f"{path}: there is not enough memory for this export") from None
    filters = [source.filter] if kind.one_filter else source.filters
    empty = [] if filters else ["no orientation is in it, for no filter could run"]
    doubtful = doubtful_notes(source) if set(filters) - {TRUTH} else []
    return Exported(path, filters, [*notes, *empty, *doubtful, *settings_notes(source, filters)])


__all__ = [
    "EXPORTS",
    "TRUTH",
    "ExportFormat",
    "ExportSource",
    "Exported",
    "Frame",
    "Model",
    "check_options",
    "export_format",
    "prepare_export",
    "write_export",
]
