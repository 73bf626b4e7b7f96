"""Reading .mat files that nobody vouches for.

Sizes are checked against the file's before anything is allocated.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import loadmat, whosmat

from testbench.exceptions import FileProblems, Problem

MOST_COMPRESSED = 1100
"""Deflate makes data at most 1032 times smaller; a header that claims more is lying."""
LARGEST = 4 << 30
"""Bytes that arrays may take in memory together."""


def load_mat(file: Path) -> dict[str, Any]:
    """Variables of a .mat file.

    Structs as dicts, arrays with time along axis 0 where their shapes tell.

    Raises:
        FileProblems: Missing, damaged, or claiming more than it can hold.
    """

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.is_file():
        raise refuse("the file does not exist")
    size = file.stat().st_size
    if size == 0:
        raise refuse("the file is empty")
    try:
        if h5py.is_hdf5(file):
            return _load_hdf5(file, size)
        claimed = {name: int(np.prod(shape, dtype=float)) for name, shape, _ in whosmat(file)}
        for name, count in claimed.items():
            if count > size * MOST_COMPRESSED or 8 * count > LARGEST:
                raise refuse(_lies(name, 8 * count, size))
        content = loadmat(file, squeeze_me=True, struct_as_record=False, chars_as_strings=True)
    except FileProblems:
        raise
    except Exception as error:  # every reader has errors of its own for a damaged file
        raise refuse(f"not a readable MATLAB file: {str(error)[:200]}") from None
    return {name: _plain(value) for name, value in content.items() if not name.startswith("__")}


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
    return value
