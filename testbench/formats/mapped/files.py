"""The files that a mapping reads, and which of them each of its parts means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from testbench.exceptions import FileProblems, InputError
from testbench.formats.any_table import Table, open_table
from testbench.formats.mapping import InAFile, MappingSpec, SensorColumns, TextLayout
from testbench.formats.names import stem_without_stamp, unique_names
from testbench.records.disk.yaml_file import YamlDocument

_VECTORS = ("acc", "gyr", "mag", "quaternion")


@dataclass(frozen=True)
class Place:
    """A part of the mapping, for messages that name its line.

    Attributes:
        document: The mapping.
        path: Of the part.
    """

    document: YamlDocument[MappingSpec]
    path: tuple[Any, ...]

    def problem(self, message: str, *further: Any) -> FileProblems:
        """The error that says `message` of the part."""
        return self.document.problem(message, *self.path, *further)

    def inside(self, *further: Any) -> Place:
        """A part of the part."""
        return replace(self, path=(*self.path, *further))


@dataclass
class Files:
    """The files of a recording, opened once each.

    Attributes:
        given: By a person.
        layout: How they are written, if they are text.
        used: Those that something is read from.
    """

    given: Sequence[Path]
    layout: TextLayout
    used: set[Path] = field(default_factory=set)
    _tables: dict[Path, Table] = field(default_factory=dict)

    def table(self, file: Path, layout: TextLayout | None = None) -> Table:
        """A file as a source."""
        self.used.add(file)
        if file not in self._tables:
            self._tables[file] = open_table(file, layout or self.layout)
        return self._tables[file]

    def listing(self) -> str:
        """Their names, for messages."""
        return ", ".join(file.name for file in self.given)


@dataclass(frozen=True)
class Meant:
    """One sensor of the recording, and the files that are its own.

    Attributes:
        key: In the mapping.
        name: Of the sensor.
        files: Those that its parts may name.
        file: That of the parts that name none; None where there is none.
    """

    key: str
    name: str
    files: Sequence[Path]
    file: Path | None


def inside(given: Path) -> list[Path]:
    """The tables of text in a folder, or a file itself.

    Raises:
        InputError: There are none.
    """
    if not given.is_dir():
        return [given]
    found = sorted(file for file in given.iterdir() if file.suffix.lower() in (".csv", ".tsv"))
    if not found:
        raise InputError(f"{given}: no .csv or .tsv stands in this folder")
    return found


def fitting(patterns: str | list[str], files: Sequence[Path]) -> list[Path]:
    """The files that a pattern, or the first of several that fits any, means."""
    for pattern in [patterns] if isinstance(patterns, str) else patterns:
        found = [file for file in files if fnmatch(file.name, pattern) or file.match(pattern)]
        if found:
            return found
    return []


def sensors_meant(document: YamlDocument[MappingSpec], files: Sequence[Path]) -> list[Meant]:
    """The sensors of a recording.

    A mapping of one sensor makes one of each file, or of each folder where its quantities stand in
    files of their own.

    Raises:
        InputError: A file is read by no sensor.
        FileProblems: A sensor's file cannot be singled out.
    """
    sensors = document.value.sensors
    (key, only), *others = sensors.items()
    if not others and _has_own_files(only):
        return _by_folder(key, only, files, Place(document, ("sensors", key)))
    if not others and len(files) > 1:
        beside = [file for file in files if fitting(document.value.beside, [file])]
        own = [file for file in files if file not in beside] if only.file is None else files
        chosen = [file for file in own if only.file is None or fitting(only.file, [file])]
        unused = [file.name for file in files if file not in (*chosen, *beside)]
        if unused:
            raise InputError(f"{', '.join(sorted(unused))}: no sensor of the mapping reads it")
        names = unique_names(stem_without_stamp(file.stem) for file in chosen)
        return [Meant(key, name, [file], file) for name, file in zip(names, chosen, strict=True)]
    return [
        Meant(key, key, files, _own_file(spec, files, Place(document, ("sensors", key))))
        for key, spec in sensors.items()
    ]


def _has_own_files(spec: SensorColumns) -> bool:
    parts: list[InAFile | None] = [getattr(spec, quantity) for quantity in _VECTORS]
    return any(part is not None and part.file is not None for part in parts)


def _by_folder(key: str, spec: SensorColumns, files: Sequence[Path], place: Place) -> list[Meant]:
    folders: dict[Path, list[Path]] = {}
    for file in files:
        folders.setdefault(file.resolve().parent, []).append(file)
    names = [key] if len(folders) == 1 else unique_names(folder.name for folder in folders)
    return [
        Meant(key, name, inside, _own_file(spec, inside, place))
        for name, inside in zip(names, folders.values(), strict=True)
    ]


def _own_file(spec: SensorColumns, files: Sequence[Path], place: Place) -> Path | None:
    """The file of those parts of a sensor that name none."""
    found = list(files) if spec.file is None else fitting(spec.file, files)
    if len(found) == 1:
        return found[0]
    if spec.file is None and _has_own_files(spec):
        return None
    listing = ", ".join(file.name for file in files)
    raise place.problem(
        f"{len(found)} of the files ({listing}) are meant; `file` must single one out"
    )


def file_of(place: Place, part: InAFile, meant: Meant) -> Path | None:
    """The file of a quantity; None where it is optional and there is none.

    Raises:
        FileProblems: No file, or more than one, is meant.
    """
    listing = ", ".join(file.name for file in meant.files)
    if part.file is None:
        if meant.file is None:
            raise place.problem(
                f"names no `file`, and {len(meant.files)} files were given ({listing})"
            )
        return meant.file
    found = fitting(part.file, meant.files)
    if len(found) == 1:
        return found[0]
    if not found and isinstance(part.file, str):
        beside = meant.files[0].parent / Path(part.file).name
        if beside.is_file():
            return beside
    if not found and part.optional:
        return None
    raise place.problem(
        f"{len(found)} of the files ({listing}) fit; the pattern must single one out", "file"
    )
