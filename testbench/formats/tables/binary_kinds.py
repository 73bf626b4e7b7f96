"""What a binary file is by its first bytes, and how to get on with it."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

HEAD_BYTES = 512
_ARRAYS = "the formats generic (--mapping), mti_mat and broad read it"
_TOPIC = "the format rosbag reads its topics: testbench import rosbag FILE"
_UNPACK = "unpack it and import the files in it"
_SHEET = "save the sheet as CSV (UTF-8) and import that"
_VENDOR = "export it to text or CSV with the maker's software and import that"


@dataclass(frozen=True)
class BinaryKind:
    """A kind of file that is no text.

    Attributes:
        name: With its article.
        advice: How to get on; "" where nothing can be said.
    """

    name: str
    advice: str = ""

    def __str__(self) -> str:
        """As a sentence goes on after "this is"."""
        return self.name + (f": {self.advice}" if self.advice else "")


MATLAB = BinaryKind("a MATLAB file", _ARRAYS)
HDF5 = BinaryKind("an HDF5 file", "the format generic reads it by a mapping (--mapping)")
PARQUET = BinaryKind("a Parquet file", "the format generic reads it by a mapping (--mapping)")

_PICKLE = BinaryKind(
    "a Python pickle", "it may run code when it is opened; save its arrays as CSV, Parquet or HDF5"
)
_BY_START: dict[bytes, BinaryKind] = {
    b"\x89MCAP": BinaryKind("an MCAP file", _TOPIC),
    b"#ROSBAG": BinaryKind("a ROS 1 bag", _TOPIC),
    b"SQLite format 3\0": BinaryKind("an SQLite database, such as a ROS 2 bag (.db3)", _TOPIC),
    b"\x89HDF": HDF5,
    b"MATLAB 5": MATLAB,
    b"PAR1": PARQUET,
    b"ARROW1": BinaryKind("an Arrow or Feather file", "save the table as Parquet or CSV"),
    b"FEA1": BinaryKind("a Feather file", "save the table as Parquet or CSV"),
    b"\x93NUMPY": BinaryKind("a numpy array (.npy)", "save it as CSV or Parquet with its titles"),
    b"\x1f\x8b": BinaryKind("a gzip archive", _UNPACK),
    b"BZh": BinaryKind("a bzip2 archive", _UNPACK),
    b"\xfd7zXZ\0": BinaryKind("an xz archive", _UNPACK),
    b"\x28\xb5\x2f\xfd": BinaryKind("a zstd archive", _UNPACK),
    b"7z\xbc\xaf\x27\x1c": BinaryKind("a 7z archive", _UNPACK),
    b"Rar!": BinaryKind("a rar archive", _UNPACK),
    b"\xd0\xcf\x11\xe0": BinaryKind("an old spreadsheet (.xls) or document", _SHEET),
    b"%PDF": BinaryKind("a PDF", "import the file that it was made from"),
    b"\x89PNG": BinaryKind("a picture (PNG)"),
    b"\xff\xd8\xff": BinaryKind("a picture (JPEG)"),
    b"GIF8": BinaryKind("a picture (GIF)"),
    b"RIFF": BinaryKind("a sound or video file (RIFF)"),
    b"{\\rtf": BinaryKind("a word processor's file (RTF)", "save it as plain text"),
    b"\xfa\xff": BinaryKind("a binary Xsens log (.mtb)", _VENDOR),
    b"RRF": BinaryKind("a rerun recording (.rrd)", "import the session or files it was made from"),
    b"\x7fELF": BinaryKind("a program"),
    b"MZ\x90": BinaryKind("a program"),
    b"OggS": BinaryKind("a sound file (Ogg)"),
    b"<?xml": BinaryKind("an XML file", "export the recording as CSV"),
    b"<!DOCTYPE html": BinaryKind("a web page", "download the file itself"),
    b"<html": BinaryKind("a web page", "download the file itself"),
    b"version https://git-lfs": BinaryKind(
        "the pointer of a file that Git LFS keeps", "fetch the file itself: git lfs pull"
    ),
}
_XLSX, _ODS = (
    BinaryKind("a spreadsheet (.xlsx)", _SHEET),
    BinaryKind("a spreadsheet (.ods)", _SHEET),
)
_DOCUMENT = BinaryKind("a word processor's file", "save it as plain text or CSV")
_NPZ = BinaryKind("an archive of numpy arrays (.npz)", "save them as CSV, Parquet or HDF5")


def binary_kind(file: Path) -> BinaryKind | None:
    """What a file is that is no text; None where its first bytes tell nothing.

    Args:
        file: That exists and can be read.

    Raises:
        OSError: It cannot.
    """
    with file.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
        stream.seek(0)
        for place in (512, 1024, 2048):  # HDF5 may stand behind a block of the user's
            stream.seek(place)
            if stream.read(4) == b"\x89HDF":
                return MATLAB if head.startswith(b"MATLAB 7.3") else HDF5
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return _archive(file)
    for magic, kind in _BY_START.items():
        if head.startswith(magic):
            return kind
    if len(head) > 2 and head[0] == 0x80 and head[1] in (2, 3, 4, 5):
        return _PICKLE
    if head[4:8] == b"ftyp":
        return BinaryKind("a video (MP4)")
    if len(head) == HEAD_BYTES and head[0] in range(2, 32) and head[1] == 0x50:
        return BinaryKind("a C3D file (markers)", "export its trajectories as text (TRC or CSV)")
    if head[257:262] == b"ustar":
        return BinaryKind("a tar archive", _UNPACK)
    return None


def _archive(file: Path) -> BinaryKind:
    """What a zip file is by what is in it."""
    try:
        with zipfile.ZipFile(file) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError):
        return BinaryKind("a zip archive or spreadsheet, and damaged")
    except NotImplementedError:  # of zipfile: the archive asks for a later version of the format
        return BinaryKind("a zip archive or spreadsheet of a kind that is not opened here")
    if any(name.startswith("xl/") for name in names):
        return _XLSX
    if any(name.startswith("word/") for name in names):
        return _DOCUMENT
    if "content.xml" in names:
        return _ODS
    if names and all(name.endswith(".npy") for name in names):
        return _NPZ
    listing = ", ".join(name[:60] for name in names[:5]) + (", ..." if len(names) > 5 else "")
    return BinaryKind(f"a zip archive ({listing or 'empty'})", _UNPACK)
