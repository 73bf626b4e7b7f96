"""BROAD: the Berlin Robust Orientation Estimation Assessment Dataset.

Laidig et al., Data 6(7):72, 2021.

A trial holds one IMU, an optical reference in the same frames and on the same clock, and marks the
movement phases whose errors count.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from testbench.exceptions import FileProblems, InputError, Problem
from testbench.formats.recording import ImportedSensor, Recording
from testbench.formats.tables.matlab_file import load_mat
from testbench.formats.truth.reference import NORM_WITHIN
from testbench.frames import NANOSECONDS
from testbench.records.session.samples import ImuSamples, Truth
from testbench.records.specs.protocol import Analysis, Estimation

SENSOR = "imu"
FILTERS = ["vqf_6d", "vqf_9d", "fusion", "madgwick_imu"]
SHAPES = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4}


def read(files: list[Path]) -> Recording:
    """Read one trial.

    Args:
        files: One .mat or .hdf5 file.

    Raises:
        InputError: Not exactly one file.
        FileProblems: The file is not a BROAD trial.
    """
    if len(files) != 1:
        raise InputError(f"a BROAD trial is one file, {len(files)} were given")
    data = _load(files[0])
    rate, count = data["sampling_rate"], len(data["imu_gyr"])
    time = np.round(np.arange(count) * (NANOSECONDS / rate)).astype(np.int64)
    clean = np.zeros(count, dtype=bool)
    samples = ImuSamples(
        time, time, data["imu_gyr"], data["imu_acc"], data["imu_mag"], None, np.arange(count), clean
    )
    truth = Truth(time, _orientations(data["opt_quat"]), judged=data["movement"].astype(bool))
    analysis = Analysis(
        estimate=Estimation(filters=FILTERS, align="none", align_clock=False, calibrate="none")
    )
    purpose = "BROAD trial: real IMU against optical truth in the same earth frame (ENU)"
    return Recording(
        files[0].stem,
        purpose,
        {SENSOR: ImportedSensor([samples], rate, "myon aktos-t", truth)},
        analysis,
    )


def _orientations(q: np.ndarray) -> np.ndarray:
    """Orientations as recorded, shape (n, 4); NaN where they are not of unit length: lost."""
    with np.errstate(over="ignore", invalid="ignore"):
        known = np.abs(np.linalg.norm(q, axis=1) - 1) <= NORM_WITHIN
    return np.where(known[:, None], q, np.nan)


# One piece: what is read, what it must hold, and in which shapes.
def _load(file: Path) -> dict[str, Any]:
    def refuse(message: str) -> FileProblems:
        return FileProblems(file, [Problem(message)])

    if not file.is_file():
        raise refuse("the file does not exist")
    try:
        if file.suffix.lower() in {".hdf5", ".h5"}:
            with h5py.File(file) as content:
                data = {key: np.asarray(content[key]) for key in content}
                data["sampling_rate"] = content.attrs.get("sampling_rate", np.nan)
        else:
            data = load_mat(file)
    except FileProblems:
        raise
    except Exception as error:  # every reader has errors of its own for a damaged file
        raise refuse(f"not a readable MATLAB or HDF5 file: {error}") from None
    missing = [key for key in (*SHAPES, "movement", "sampling_rate") if key not in data]
    if missing:
        raise refuse(
            f"not a BROAD trial: it lacks {', '.join(missing)}; it has "
            f"{', '.join(sorted(data)) or 'nothing'}"
        )
    try:
        data |= {
            key: np.atleast_1d(np.asarray(data[key], dtype=float))
            for key in (*SHAPES, "movement", "sampling_rate")
        }
        rate = float(data["sampling_rate"].item())
    except (TypeError, ValueError) as error:
        raise refuse(f"not a BROAD trial: what should be numbers is none: {error}") from None
    count = len(data["imu_gyr"])
    for key, width in SHAPES.items():
        if data[key].shape != (count, width) or count < 10:
            raise refuse(
                f"{key} has shape {data[key].shape}; a BROAD trial has ({count}, {width}) with at "
                "least 10 rows"
            )
    data["movement"] = data["movement"].reshape(-1)
    if len(data["movement"]) != count or not 1 <= rate <= 100_000:
        raise refuse(
            f"{len(data['movement'])} movement marks and a rate of {rate} Hz do not fit {count} "
            "samples"
        )
    return data | {"sampling_rate": rate}
