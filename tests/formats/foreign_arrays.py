"""Files of arrays with what only MATLAB opens beside them, as scipy cannot write them."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes((-len(data)) % 8)


def opaque(name: bytes, kind: bytes) -> bytes:
    """A variable of a class of MATLAB's own, such as datetime, as MATLAB 5 files hold it."""
    body = _element(6, struct.pack("<II", 17, 0))
    body += b"".join(_element(1, text) for text in (name, b"MCOS", kind))
    inner = _element(6, struct.pack("<II", 13, 0)) + _element(5, struct.pack("<ii", 6, 1))
    inner += _element(1, b"") + _element(6, np.arange(6, dtype=np.uint32).tobytes())
    return _element(14, body + _element(14, inner))


def mat_with_objects(path: Path, content: dict[str, Any], packed: bool = False) -> Path:
    """A MATLAB 5 file with a datetime before its arrays and a table after them."""
    memory = io.BytesIO()
    savemat(memory, content, do_compression=packed)
    whole = memory.getvalue()
    first, last = opaque(b"when", b"datetime"), opaque(b"walk", b"table")
    if packed:
        small = zlib.compress(last)
        last = struct.pack("<II", 15, len(small)) + small
    path.write_bytes(whole[:128] + first + whole[128:] + last)
    return path


def mat73_with_objects(path: Path, content: dict[str, Any]) -> Path:
    """A MATLAB 7.3 file: columns first, behind 512 bytes of MATLAB, a datetime beside."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in content.items():
            file[name] = np.atleast_2d(np.asarray(values)).T if np.ndim(values) > 1 else values
        when = file.create_dataset("when", data=np.arange(6, dtype=np.uint32).reshape(1, 6))
        when.attrs["MATLAB_object_decode"] = 3
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as raw:
        raw.write(head)
    return path
