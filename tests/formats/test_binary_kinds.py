"""Files that are no text are called by their name, with a way to get on."""

from __future__ import annotations

import gzip
import io
import pickle
import sqlite3
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pytest

from testbench.exceptions import FileProblems
from testbench.formats.any_table import kind_of
from testbench.formats.tables.text_table import head_of


def zipped(*names: str) -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        for name in names:
            archive.writestr(name, "x")
    return memory.getvalue()


def saved_by(write) -> bytes:
    memory = io.BytesIO()
    write(memory)
    return memory.getvalue()


def database(tmp_path: Path) -> bytes:
    with sqlite3.connect(tmp_path / "x") as connection:
        connection.execute("create table messages (data blob)")
    connection.close()
    return (tmp_path / "x").read_bytes()


def tarred() -> bytes:
    memory = io.BytesIO()
    with tarfile.open(fileobj=memory, mode="w") as archive:
        archive.addfile(tarfile.TarInfo("a.csv"))
    return memory.getvalue()


def of_a_later_version() -> bytes:
    """A zip file whose list of contents asks for version 9.9 of the format."""
    whole = bytearray(zipped("a.csv"))
    whole[whole.index(b"PK\x01\x02") + 6] = 99
    return bytes(whole)


KINDS = {
    "mcap": (b"\x89MCAP0\r\n" + bytes(40), "an MCAP file", "testbench import rosbag"),
    "ros 1 bag": (b"#ROSBAG V2.0\n" + bytes(40), "a ROS 1 bag", "testbench import rosbag"),
    "xlsx": (zipped("[Content_Types].xml", "xl/workbook.xml"), "a spreadsheet", "as CSV"),
    "ods": (zipped("mimetype", "content.xml"), "a spreadsheet", "as CSV"),
    "docx": (zipped("word/document.xml"), "a word processor's file", "as plain text"),
    "zip": (zipped("Accelerometer.csv", "b.csv"), r"a zip archive \(Accelerometer", "unpack it"),
    "later zip": (of_a_later_version(), "a zip archive .* of a kind that is not opened here", ""),
    "half a zip": (zipped("a.csv")[:30], "a zip archive or spreadsheet, and damaged", ""),
    "npz": (
        saved_by(lambda file: np.savez(file, acc=np.ones(3))),
        "an archive of numpy arrays",
        "HDF5",
    ),
    "npy": (saved_by(lambda file: np.save(file, np.ones(3))), "a numpy array", "Parquet"),
    "pickle": (pickle.dumps({"acc": [1.0]}), "a Python pickle", "may run code"),
    "old pickle": (pickle.dumps([1.0], 2), "a Python pickle", "may run code"),
    "gzip": (gzip.compress(b"a,b"), "a gzip archive", "unpack it"),
    "tar": (tarred(), "a tar archive", "unpack it"),
    "feather": (
        saved_by(lambda file: pyarrow.feather.write_feather(pa.table({"a": [1]}), file)),
        "an Arrow or Feather file",
        "Parquet",
    ),
    "pdf": (b"%PDF-1.7\n", "a PDF", ""),
    "png": (b"\x89PNG\r\n\x1a\n", "a picture", ""),
    "jpeg": (b"\xff\xd8\xff\xe0\x00\x10JFIF", "a picture", ""),
    "xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old spreadsheet", "as CSV"),
    "git lfs": (
        b"version https://git-lfs.github.com/spec/v1\n",
        "the pointer of a file that Git LFS keeps",
        "git lfs pull",
    ),
    "c3d": (b"\x02P" + bytes(600), "a C3D file", ""),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_binary_file_is_called_by_its_name(name, tmp_path):
    content, said, advice = KINDS[name]
    (tmp_path / "d.csv").write_bytes(content)
    with pytest.raises(FileProblems, match=f"d.csv: this is {said}.*(?:{advice})") as caught:
        head_of(tmp_path / "d.csv")
    assert "\n" not in str(caught.value)
    assert kind_of(tmp_path / "d.csv") is not None


def test_a_ros_2_bag_is_a_database(tmp_path):
    (tmp_path / "d.db3").write_bytes(database(tmp_path))
    with pytest.raises(FileProblems, match=r"this is an SQLite database, such as a ROS 2 bag"):
        head_of(tmp_path / "d.db3")


def test_text_is_no_binary_kind(tmp_path):
    for text in ("t,ax\n0,1\n", "P1,P2\n1,2\n", "RR,t\n0,1\n", "MATLAB,t\n1,2\n"):
        (tmp_path / "d.csv").write_text(text)
        assert kind_of(tmp_path / "d.csv") is None
