"""Which format a file seems to be of, by its first bytes or lines: a hint if another was named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from testbench.exceptions import BenchError, FileProblems
from testbench.formats.tables.text_table import head_of

_BYTES = {
    b"\x89MCAP0\r\n": "rosbag",
    b"#ROSBAG V": "rosbag",
    b"SQLite format 3\x00": "rosbag",
}
_LINES = {
    "ximu3": r"^\W*Timestamp \(us\)[,;\t]",
    "ngimu": r"^\W*Time \(s\)[,;\t].*(Gyroscope|Accelerometer) X|^\W*Time \(s\)[,;\t]W[,;\t]X",
    "opensim_sto": r"^DataType=Quaternion",
    "matrix": r"^\W*dateTime[,;\t].*acc_x",
    "shimmer": r"^\W*Shimmer_\w+_Timestamp",
    "mtw": r"^// .*(MT Manager|Filter Profile|Firmware Version)",
    "xsens_dot": r"^\W*(PacketCounter[,;\t]|)SampleTimeFine[,;\t]|^DeviceTag:",
}
_MARKERS = (
    r"^PathFileType|^Format Version,|^(NO_OF_MARKERS|NO_OF_BODIES|FILE_VERSION)\t"
    r"|^(Trajectories|Objects|Segments)\s*,*$"
)


def likely_format(file: Path) -> str | None:
    """The name of a format, or None."""
    try:
        with file.open("rb") as stream:
            head = stream.read(512)
        found = next((name for magic, name in _BYTES.items() if head.startswith(magic)), None)
        if found is None and head.startswith(b"\x89HDF"):
            return _hdf5(file)
        if found is not None:
            return found
        lines = head_of(file)
    except (OSError, BenchError):
        return None
    for name, pattern in _LINES.items():
        if any(re.search(pattern, line, re.IGNORECASE) for line in lines):
            return name
    return None


def holds_markers(file: Path) -> bool:
    """Whether a file is an export of a motion capture system, which is truth and no recording."""
    try:
        with file.open("rb") as stream:
            head = stream.read(2)
        if len(head) == 2 and head[1] == 0x50 and file.suffix.lower() == ".c3d":
            return True
        return any(re.search(_MARKERS, line) for line in head_of(file))
    except (OSError, BenchError):
        return False


def _hdf5(file: Path) -> str | None:
    import h5py

    try:
        with h5py.File(file) as content:
            names, attributes = set(content), set(content.attrs)
    except Exception:  # a damaged file raises errors of many kinds
        return None
    if "Sensors" in names or "CaseIdList" in attributes:
        return "apdm"
    return "broad" if {"imu_gyr", "imu_acc"} <= names else None


def with_other_format(error: FileProblems, asked: str) -> FileProblems:
    """The refusal of a file, with the way to read it where it seems to be of another format.

    Args:
        error: Why the file was refused.
        asked: Name of the format that refused it.
    """
    file = Path(error.file)
    other = likely_format(file)
    hint = None
    if other is not None and other != asked:
        hint = f"it looks like a file of the format {other}: testbench import {other} {file.name}"
    elif other is None and holds_markers(file):
        hint = (
            f"it looks like an export of a motion capture system: give it as --truth {file.name} "
            "beside the recording of the sensors"
        )
    if hint is None:
        return error
    *before, last = error.problems
    return FileProblems(error.file, [*before, replace(last, message=f"{last.message}; {hint}")])
