"""Reading .mat files that nobody vouches for.

Sizes are checked against the file's before anything is allocated. Objects of MATLAB (tables,
datetimes, function handles) are told and passed over: only MATLAB itself opens them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from scipy.io import loadmat, whosmat

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.array_table import ArrayTable, is_signal, upright

MOST_COMPRESSED = 1100
"""Deflate makes data at most 1032 times smaller; a header that claims more is lying."""
LARGEST = 4 << 30
"""Bytes that arrays may take in memory together."""
MOST_STRUCTS = 100
"""Of an array of structs, so many are looked into."""
_MATRIX, _COMPRESSED = 14, 15
_FUNCTION, _OPAQUE = 16, 17
_FLAGS = 6
_NUMBERS = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13))
_ELEMENTS = _NUMBERS | {_MATRIX, 16, 17, 18}
"""Types of data elements: numbers, arrays and text (MathWorks, MAT-File Format, table 1-1)."""
_NUMERIC_CLASSES = range(6, 16)
_DEEPEST = 40
_HEAD = 4096
"""Bytes of a variable that hold its class, shape and name (MathWorks, MAT-File Format, chapter 1,
"Array Flags Subelement" and tables 1-1 to 1-3).
"""


@dataclass(frozen=True)
class Variable:
    """A variable of a MATLAB 5 file by its header.

    Attributes:
        name: Of it.
        count: Elements that it claims.
        closed: Whether it is an object that only MATLAB opens; `name` then says of which class.
    """

    name: str
    count: float
    closed: bool = False


def load_mat(file: Path) -> dict[str, Any]:
    """Variables of a .mat file.

    Structs as dicts, arrays with time along axis 0 where their shapes tell.

    Raises:
        FileProblems: Missing, damaged, or claiming more than it can hold.
    """
    return _load(file)[0]


def mat_table(file: Path) -> ArrayTable:
    """The arrays of a .mat file as a source, those of structs by their path (`data/imu/acc`).

    Raises:
        FileProblems: Missing, damaged, or claiming more than it can hold.
    """
    content, closed = _load(file)
    found: dict[str, np.ndarray] = {}
    _flatten(content, "", found)
    numbers = {name: float(array.item()) for name, array in found.items() if array.size == 1}
    arrays = {name: array for name, array in found.items() if name not in numbers}
    return ArrayTable(file, arrays, closed, numbers)


def _flatten(content: dict[str, Any], path: str, found: dict[str, np.ndarray]) -> None:
    for name, value in content.items():
        place = f"{path}/{name}" if path else name
        if isinstance(value, dict):
            _flatten(value, place, found)
            continue
        array = np.asarray(value)
        if array.dtype.kind == "O" and array.ndim == 1:
            parts = {
                f"{name}[{i + 1}]": part
                for i, part in enumerate(array[:MOST_STRUCTS])
                if isinstance(part, dict)
            }
            _flatten(parts, path, found)
        elif array.dtype.kind in "fiub" and (array.size == 1 or is_signal(array.shape)):
            found[place] = upright(array)


def _load(file: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The variables, and the names of those that only MATLAB opens."""

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.is_file():
        raise refuse("the file does not exist")
    size = file.stat().st_size
    if size == 0:
        raise refuse("the file is empty")
    try:
        if h5py.is_hdf5(file):
            return _load_hdf5(file, size), ()
        variables = list(_variables(file))
        for variable in variables:
            if variable.count > size * MOST_COMPRESSED or 8 * variable.count > LARGEST:
                raise refuse(_lies(variable.name, 8 * variable.count, size))
        content = loadmat(
            file,
            squeeze_me=True,
            struct_as_record=False,
            chars_as_strings=True,
            variable_names=[variable.name for variable in variables if not variable.closed],
        )
    except FileProblems:
        raise
    except Exception as error:  # every reader has errors of its own for a damaged file
        raise refuse(f"not a readable MATLAB file: {str(error)[:200]}") from None
    closed = tuple(variable.name for variable in variables if variable.closed and variable.name)
    return {
        name: _plain(value) for name, value in content.items() if not name.startswith("__")
    }, closed


def _variables(file: Path) -> Iterator[Variable]:
    """The variables of a file by their headers."""
    with file.open("rb") as stream:
        head = stream.read(128)
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        if order is None:  # MATLAB 4, which knows no objects
            yield from (Variable(n, float(np.prod(s, dtype=float))) for n, s, _ in whosmat(file))
            return
        while len(tag := stream.read(8)) == 8:
            kind, length = struct.unpack(order + "II", tag)
            following = stream.tell() + length
            if kind == _COMPRESSED:
                start = zlib.decompressobj().decompress(stream.read(min(length, _HEAD)), _HEAD)[8:]
                yield _described(start, order)
            elif kind == _MATRIX:
                begin = stream.tell()
                yield _described(stream.read(min(length, _HEAD)), order)
                _check_elements(stream, order, (begin, following), 0)
            stream.seek(following)


def _check_elements(stream: BinaryIO, order: str, span: tuple[int, int], depth: int) -> None:
    """Refuse an uncompressed variable whose elements cannot be, which would crash its reader.

    Compressed ones bear a checksum.

    Args:
        stream: The file.
        order: Of its bytes.
        span: Where the elements of the variable begin and end.
        depth: How deep it lies in others.

    Raises:
        ValueError: An element is of no known type, or reaches out of its variable.
    """
    at, end = span
    numeric = False
    count = 0
    while at + 8 <= end and depth < _DEEPEST:
        stream.seek(at)
        tag = stream.read(12)
        kind, length = struct.unpack(order + "II", tag[:8])
        small = bool(kind >> 16)
        if small:
            kind, length = kind & 0xFFFF, kind >> 16
        allowed = _NUMBERS if numeric and count > 2 else _ELEMENTS
        if kind not in allowed or (small and length > 4) or at + 8 + (0 if small else length) > end:
            raise ValueError(f"an element of the type {kind} with {length} bytes cannot be there")
        if count == 0 and kind == _FLAGS and not small and len(tag) == 12:
            numeric = struct.unpack(order + "I", tag[8:])[0] & 0xFF in _NUMERIC_CLASSES
        if kind == _MATRIX:
            _check_elements(stream, order, (at + 8, at + 8 + length), depth + 1)
        at += 8 if small else 8 + length + (-length) % 8
        count += 1


def _described(start: bytes, order: str) -> Variable:
    """A variable by its first bytes: flags, shape and name, each behind a tag of its own."""
    at = 0

    def element() -> bytes:
        nonlocal at
        if at + 8 > len(start):
            raise ValueError("the header of a variable is cut off")
        kind, length = struct.unpack_from(order + "II", start, at)
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, length = kind & 0xFFFF, kind >> 16
            data = start[at + 4 : at + 4 + length]
            at += 8
        else:
            data = start[at + 8 : at + 8 + length]
            at += 8 + length + (-length) % 8
        return data

    (flags,) = struct.unpack(order + "I", element()[:4].ljust(4, b"\0"))
    if flags & 0xFF == _OPAQUE:
        name, _, kind = (element().decode("latin-1") for _ in range(3))
        return Variable(f"{name} ({kind})" if name else "", 0.0, closed=True)
    shape = element()
    count = float(np.prod(struct.unpack(f"{order}{len(shape) // 4}i", shape), dtype=float))
    name = element().decode("latin-1")
    if flags & 0xFF == _FUNCTION:
        return Variable(f"{name} (function)", 0.0, closed=True)
    return Variable(name, count)


def _load_hdf5(file: Path, size: int) -> dict[str, Any]:
    total = 0

    def load(group: h5py.Group) -> dict[str, Any]:
        nonlocal total
        result: dict[str, Any] = {}
        for name, item in group.items():
            if name.startswith("#"):
                continue
            if isinstance(item, h5py.Group):
                result[name] = load(item)
            elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub":
                total += item.nbytes
                if item.nbytes > size * MOST_COMPRESSED or total > LARGEST:
                    raise FileProblems(file, [Problem(_lies(item.name, item.nbytes, size))])
                result[name] = np.asarray(item).T.squeeze()  # MATLAB writes columns first
        return result

    with h5py.File(file) as content:
        return load(content)


def _lies(name: str, claimed: float, size: int) -> str:
    return (
        f"{name} claims {claimed / 1e9:.1f} GB, in a file of {size / 1e6:.1f} MB: damaged, or too "
        "large to import"
    )


def _plain(value: Any) -> Any:
    if hasattr(value, "_fieldnames"):
        return {name: _plain(getattr(value, name)) for name in value._fieldnames}
    if isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 1:
        result = np.empty(len(value), dtype=object)
        result[:] = [_plain(part) for part in value]
        return result
    return value
