"""HDF5 files as a source, MATLAB 7.3 among them: arrays by their path, read in chunks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from testbench.exceptions import FileProblems, Problem
from testbench.formats.tables.array_table import ArrayTable, is_signal
from testbench.formats.tables.matlab_file import MOST_COMPRESSED

MOST_ARRAYS = 10_000
"""A file with more than this is not looked through."""


@dataclass(frozen=True)
class Dataset:
    """A dataset with time along its first axis, read when it is asked for.

    Attributes:
        data: As it stands in the file, shape (n,), (n, k), (k, n), or with axes of length 1.
        field: Of a dataset of records, the field; None for one of numbers.
    """

    data: Any
    field: str | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """(n,) or (n, k)."""
        long = [length for length in self.data.shape if length != 1]
        if self.field is not None:
            return (*long, *self.data.dtype[self.field].shape)
        return (max(long), min(long)) if len(long) == 2 else (long[0],)

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Some of its rows."""
        shape = self.data.shape
        axis = int(np.argmax(shape))
        if self.field is not None:
            return np.asarray(self.data[rows][self.field])
        where = tuple(rows if i == axis else slice(None) for i in range(len(shape)))
        read = np.moveaxis(np.asarray(self.data[where]), axis, 0)
        return read.reshape(len(read), -1) if len(self.shape) == 2 else read.reshape(len(read))


# One piece: a walk over the groups, each thing in which is kept, named or refused.
def hdf5_table(file: Path) -> ArrayTable:
    """The arrays of an HDF5 file as a source, those of groups by their path (`Sensors/7/Acc`).

    The file stays open as long as the source is in use.

    Raises:
        FileProblems: Missing, damaged, or claiming more than it can hold.
    """

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.is_file():
        raise refuse("the file does not exist")
    size = file.stat().st_size
    found: dict[str, Dataset] = {}
    closed: list[str] = []
    numbers: dict[str, float] = {}

    def look(group: Any, path: str, depth: int) -> None:
        numbers.update(
            {
                f"{path}/{name}" if path else name: float(np.asarray(value).item())
                for name, value in group.attrs.items()
                if np.asarray(value).size == 1 and np.asarray(value).dtype.kind in "fiu"
            }
        )
        for name, item in group.items():
            place = f"{path}/{name}" if path else name
            if name.startswith("#") or len(found) > MOST_ARRAYS:
                continue
            if isinstance(item, h5py.Group):
                if depth < 30:  # links may lead in circles
                    look(item, place, depth + 1)
            elif isinstance(item, h5py.Dataset):
                if item.attrs.get("MATLAB_object_decode"):
                    closed.append(place)
                elif item.size == 1 and item.dtype.kind in "fiu":
                    numbers[place] = float(np.asarray(item).item())
                elif item.nbytes > size * MOST_COMPRESSED:
                    claimed = f"{place} claims {item.nbytes / 1e9:.1f} GB, in a file of"
                    raise refuse(f"{claimed} {size / 1e6:.1f} MB: damaged")
                else:
                    found.update(_datasets(place, item))

    try:
        look(h5py.File(file), "", 0)
    except FileProblems:
        raise
    except Exception as error:  # h5py has many for a damaged file
        raise refuse(f"not a readable HDF5 file: {str(error)[:200]}") from None
    return ArrayTable(file, found, tuple(closed), numbers)


def _datasets(place: str, item: Any) -> dict[str, Dataset]:
    """What a dataset holds that can be samples, by name."""
    if not item.shape or not is_signal(item.shape) or 0 in item.shape:
        return {}
    if item.dtype.names is None:
        return {place: Dataset(item)} if item.dtype.kind in "fiub" else {}
    if len(item.shape) != 1:
        return {}
    parts = {name: item.dtype[name] for name in item.dtype.names}
    return {
        f"{place}/{name}": Dataset(item, name)
        for name, part in parts.items()
        if part.base.kind in "fiub" and is_signal((*item.shape, *part.shape))
    }
