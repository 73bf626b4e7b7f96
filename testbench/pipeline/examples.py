"""Recordings to try the bench with, written as the makers' apps write theirs: the documentation
goes by them.

What the sensors read is simulated, of part 0 of a data sheet, and the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from testbench.exceptions import NotFoundError
from testbench.frames import NANOSECONDS
from testbench.model import example_motions, rotation
from testbench.model.rigid_motion import RigidMotion
from testbench.pipeline.simulate import felt, sheet_of
from testbench.records.disk.replacing import replaced_folder, stored_where_asked

SEED = 1
DOT_HEAD = """\
sep=,
DeviceTag:,simulated_{name}
FirmwareVersion:,none
AppVersion:,testbench example
SyncStatus:,Synced
OutputRate:,60Hz
FilterProfile:,General
Measurement Mode:,simulated

"""
AU_UT = 40.0
"""The unit of a DOT's magnetic field [uT]."""
POSES = ("time_s", "q_w", "q_x", "q_y", "q_z", "x_m", "y_m", "z_m")
OPTICAL_HZ, OPTICAL_SD_DEG = 50.0, 0.1
OPTICAL_LATE_S = 2.5
"""The cameras began so long after the phone."""


@dataclass(frozen=True)
class Example:
    """A recording that can be had.

    Attributes:
        line: What it is, in a line.
        write: Writes its files into a folder.
        next: The command that reads them, as a person in the folder above would type it.
    """

    line: str
    write: Callable[[Path], None]
    next: str


def write_example(name: str, folder: Path) -> list[Path]:
    """Write the files of an example.

    Args:
        name: Which.
        folder: To be made.

    Returns:
        The files.

    Raises:
        NotFoundError: No such example; lists those that there are.
        InputError: The folder exists, or there is no place for it.
    """
    if name not in EXAMPLES:
        raise NotFoundError("example", name, list(EXAMPLES))
    with stored_where_asked(folder), replaced_folder(folder, anew=True) as new:
        EXAMPLES[name].write(new)
    return sorted(folder.iterdir())


def _squat(folder: Path) -> None:
    """Three Xsens DOTs: a file each, as the maker's app exports it."""
    titles = [
        "PacketCounter",
        "SampleTimeFine",
        *(f"Quat_{part}" for part in "WXYZ"),
        *(f"{kind}_{axis}" for kind in ("Acc", "Gyr", "Mag") for axis in "XYZ"),
    ]
    sheet = sheet_of("xsens_dot")
    assert sheet.device_orientation is not None
    # by their magnetometers all have the same north
    north = sheet.device_orientation.model_copy(update={"heading_unknown": False})
    sheet = sheet.model_copy(update={"device_orientation": north})
    for name, body in example_motions.squats().items():
        samples, _ = felt(name, sheet, "xsens_dot", body, SEED)
        assert samples.device_q is not None
        assert samples.mag is not None
        # the app's stamps are those of one synchronised clock
        stamps = np.round((samples.counter - samples.counter[0]) * 1e6 / 60) + 1e6
        numbers = [samples.counter - samples.counter[0] + 1, stamps]
        field = samples.mag / AU_UT
        readings = [samples.device_q, samples.acc, np.degrees(samples.gyr), field]
        table = np.column_stack([*numbers, *readings])
        formats = ["%d", "%d", *["%.6f"] * 13]
        _write(folder / f"{name}.csv", titles, table, formats, DOT_HEAD.format(name=name))


def _phone(folder: Path) -> None:
    """A phone by the app phyphox, a file a quantity, and the orientations that cameras saw."""
    body = example_motions.in_a_hand()
    samples, _ = felt("phone", sheet_of("bno080"), "bno080", body, SEED)
    seconds = (samples.device_time_ns - samples.device_time_ns[0]) / NANOSECONDS
    for file, values, unit in (
        ("Accelerometer", samples.acc, "m/s^2"),
        ("Gyroscope", samples.gyr, "rad/s"),
    ):
        titles = ["Time (s)", *(f"{axis} ({unit})" for axis in "XYZ")]
        _write(folder / f"{file}.csv", titles, np.column_stack([seconds, values]), ["%.6g"] * 4)
    t = np.arange(OPTICAL_LATE_S, body.duration, 1 / OPTICAL_HZ)
    q = body.at(np.round(t * NANOSECONDS).astype(np.int64)).q_world_from_frame
    rng = np.random.default_rng(SEED)
    seen = np.radians(OPTICAL_SD_DEG) * rng.standard_normal((len(t), 3))
    q = rotation.multiply(q, rotation.from_rotation_vector(seen))
    table = np.column_stack([t - OPTICAL_LATE_S, q])
    _write(folder / "optical.csv", POSES[:5], table, ["%.6g"] * 5)


def _walk(folder: Path) -> None:
    _write_poses(folder / "foot.csv", example_motions.walking_foot())


def _sides(folder: Path) -> None:
    _write_poses(folder / "board.csv", example_motions.laid_on_its_sides())


def _write_poses(file: Path, body: RigidMotion) -> None:
    """A motion that `testbench simulate` reads."""
    motion = body.at(body.time_ns)
    seconds = (body.time_ns - body.time_ns[0]) / NANOSECONDS
    q = motion.q_world_from_frame
    _write(file, POSES, np.column_stack([seconds, q, motion.position]), ["%.9g"] * 8)


def _write(
    file: Path,
    titles: list[str] | tuple[str, ...],
    table: np.ndarray,
    formats: list[str],
    above: str = "",
) -> None:
    header = above + ",".join(titles)
    np.savetxt(file, table, formats, ",", header=header, comments="", encoding="utf-8")


EXAMPLES = {
    "squat": Example(
        "three Xsens DOTs on pelvis, thigh and shank of somebody who squats, as the app exports",
        _squat,
        "testbench import xsens_dot {folder}/*.csv --out logs/squat --joint knee=RFemur:RTibia"
        " --simulated",
    ),
    "phone": Example(
        "a phone that is turned by hand, by the app phyphox, and what cameras saw (optical.csv)",
        _phone,
        "testbench import generic {folder}/Accelerometer.csv {folder}/Gyroscope.csv "
        "--mapping phyphox --truth {folder}/optical.csv --out logs/phone --simulated",
    ),
    "walk": Example(
        "the motion of a foot that walks 12 strides of 1.25 m, to simulate a sensor on",
        _walk,
        "testbench simulate {folder}/foot.csv --preset ngimu --out logs/walk",
    ),
    "sides": Example(
        "the motion of a board that is laid on 18 sides, to simulate a sensor on and calibrate it",
        _sides,
        "testbench simulate {folder}/board.csv --preset bno055 --out logs/sides",
    ),
}
"""By name."""
