"""C3D: markers and angles of motion capture (c3d.org, The C3D File Format User Guide)."""

from __future__ import annotations

import importlib.util
import io
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.extras import missing_extra
from testbench.formats.truth.tracked import (
    FASTEST_HZ,
    METRES,
    SLOWEST_HZ,
    Tracked,
    frame_times,
    points,
)

SGI, MOST_COUNTED = b"\x56", 65535
"""Processor whose numbers begin with the high byte, and the number of a last frame that stands for
any that is greater.
"""
PATIENCE_S = 6.0
S_PER_BYTE = 1e-6
"""A file may take so long to be read, and so much longer by its size."""


@dataclass(frozen=True)
class C3dAngles:
    """Angles in a C3D file, which stand among its points.

    Attributes:
        names: Of the points, k of them.
        values: As in the file, shape (n, k, 3); NaN where lost.
        rate: Of the frames [Hz].
        unit: "deg" or "rad", None where the file states none.
    """

    names: list[str]
    values: np.ndarray
    rate: float
    unit: Literal["deg", "rad"] | None

    def columns(self) -> dict[str, np.ndarray]:
        """By title, such as LKneeAngles.x, shape (n,) each."""
        return {
            f"{name}.{axis}": self.values[:, i, j]
            for i, name in enumerate(self.names)
            for j, axis in enumerate("xyz")
        }


def read_c3d(file: Path) -> Tracked:
    """Markers of a file.

    Raises:
        InputError: The package that reads it is not installed.
        FileProblems: It is damaged, or holds no markers.
    """
    content = _content(file)
    labels, values, unit = _labels(content), content["points"], str(content["unit"])
    if unit.lower() not in METRES:
        raise _refusal(file, f"the unit of its markers is '{unit}'; known: mm, cm, m")
    derived = {str(label) for label in content["angles"]}
    own = [i for i, label in enumerate(labels) if label and label not in derived]
    flat = values[:, own].reshape(len(values), -1)
    names = [labels[i] for i in own]
    times = frame_times(len(values), float(content["rate"]))
    return Tracked("C3D", times, points(flat, names, METRES[unit.lower()]))


def read_c3d_angles(file: Path) -> C3dAngles:
    """Angles of a file: the points that POINT:ANGLES lists.

    Raises:
        InputError: The package that reads it is not installed.
        FileProblems: It is damaged, or they are in a unit that is none.
    """
    content = _content(file)
    labels, derived = _labels(content), {str(label) for label in content["angles"]}
    own = [i for i, label in enumerate(labels) if label and label in derived]
    stated = str(content["angle_unit"]).strip().lower()
    units: dict[str, Literal["deg", "rad"] | None] = {"": None, "deg": "deg", "rad": "rad"}
    short = "" if not stated else stated[:3]
    if short not in units:
        raise _refusal(file, f"the unit of its angles is '{stated}'; known: deg, rad")
    values = np.array(content["points"][:, own], dtype=float)
    values[~np.any(values != 0, axis=2)] = np.nan
    return C3dAngles([labels[i] for i in own], values, float(content["rate"]), units[short])


def _labels(content: dict[str, np.ndarray]) -> list[str]:
    return [str(label) for label in content["labels"]][: content["points"].shape[1]]


def _refusal(file: Path, message: str) -> FileProblems:
    return FileProblems(file, [Problem(message)])


def _content(file: Path) -> dict[str, np.ndarray]:
    """What the reader found in a file.

    Raises:
        InputError: The package that reads it is not installed.
        FileProblems: It is damaged, or holds no points.
    """
    with file.open("rb") as stream:
        if stream.read(2)[1:] != b"\x50":
            raise _refusal(file, "not a C3D file: its second byte is not 80")
    if importlib.util.find_spec("ezc3d") is None:
        raise InputError(missing_extra("reading C3D needs", "markers"))
    child = str(Path(__file__).with_name("c3d_child.py"))
    patience = PATIENCE_S + S_PER_BYTE * file.stat().st_size
    try:
        done = subprocess.run(
            [sys.executable, child, str(file)], capture_output=True, timeout=patience, check=False
        )
    except subprocess.TimeoutExpired:
        raise _refusal(
            file, f"not a readable C3D file: its reader did not end in {patience:.0f} s"
        ) from None
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        why = said[-1] if done.returncode == 2 and said else "its reader broke off"
        raise _refusal(file, f"not a readable C3D file: {why}")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            content = dict(arrays)
    except (OSError, ValueError, zipfile.BadZipFile):
        raise _refusal(file, "not a readable C3D file: its reader gave no arrays") from None
    values, rate = content["points"], float(content["rate"])
    if values.ndim != 3 or not values.shape[0] or not len(content["labels"]):
        raise _refusal(file, "holds no markers")
    if not SLOWEST_HZ <= rate <= FASTEST_HZ:
        raise _refusal(file, f"a rate of {rate:g} Hz cannot be")
    stated = _stated_frames(file)
    if len(values) < stated:
        raise _refusal(
            file, f"is cut off: its header says {stated} frames, and it holds {len(values)}"
        )
    return content


def _stated_frames(file: Path) -> int:
    """How many frames the header says there are; 0 where it says nothing that can be counted on
    (words 4 and 5, of 16 bits; The C3D File Format, section The header section).
    """
    with file.open("rb") as stream:
        header = stream.read(512)
        stream.seek(512 * (max(header[0], 1) - 1) + 3)
        processor = stream.read(1)
    order: Literal["little", "big"] = "big" if processor == SGI else "little"
    first, last = (int.from_bytes(header[at : at + 2], order) for at in (6, 8))
    return last - first + 1 if 0 < first <= last < MOST_COUNTED else 0
