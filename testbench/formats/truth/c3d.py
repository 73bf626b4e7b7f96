"""C3D: markers of any motion capture system (c3d.org, The C3D File Format User Guide)."""

from __future__ import annotations

import importlib.util
import io
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.truth.tracked import METRES, Tracked, frame_times, points

PATIENCE_S = 10.0
S_PER_BYTE = 1e-6
"""A file may take so long to be read, and so much longer by its size."""


def read_c3d(file: Path) -> Tracked:
    """Markers of a file.

    Raises:
        InputError: The package that reads it is not installed.
        FileProblems: It is damaged, or holds no markers.
    """

    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    with file.open("rb") as stream:
        if stream.read(2)[1:] != b"\x50":
            raise refuse("not a C3D file: its second byte is not 80")
    if importlib.util.find_spec("ezc3d") is None:
        raise InputError(
            "reading C3D needs the extra 'markers', which is not installed: pip install "
            "'imu-testbench[markers]'"
        )
    child = str(Path(__file__).with_name("c3d_child.py"))
    patience = PATIENCE_S + S_PER_BYTE * file.stat().st_size
    try:
        done = subprocess.run(
            [sys.executable, child, str(file)], capture_output=True, timeout=patience, check=False
        )
    except subprocess.TimeoutExpired:
        raise refuse(
            f"not a readable C3D file: its reader did not end in {patience:.0f} s"
        ) from None
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        why = said[-1] if done.returncode == 2 and said else "its reader broke off"
        raise refuse(f"not a readable C3D file: {why}")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            content = dict(arrays)
    except (OSError, ValueError, zipfile.BadZipFile):
        raise refuse("not a readable C3D file: its reader gave no arrays") from None
    labels = [str(label) for label in content["labels"]]
    values, rate, unit = content["points"], float(content["rate"]), str(content["unit"])
    if values.ndim != 3 or not values.shape[0] or not labels:
        raise refuse("holds no markers")
    if not 0.1 <= rate <= 100_000:
        raise refuse(f"a rate of {rate:g} Hz cannot be")
    if unit.lower() not in METRES:
        raise refuse(f"the unit of its markers is '{unit}'; known: mm, cm, m")
    derived = {str(label) for label in content["angles"]}
    labels = labels[: values.shape[1]]
    own = [i for i, label in enumerate(labels) if label and label not in derived]
    flat = values[:, own].reshape(len(values), -1)
    names = [labels[i] for i in own]
    return Tracked("C3D", frame_times(len(values), rate), points(flat, names, METRES[unit.lower()]))
