"""Malformed files through the command line: one clear message, exit code 2, nothing written,
whatever the format.
"""

from __future__ import annotations

import gzip
import os
import re
import struct
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from testbench.cli import main

TITLES = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Status\n"
ROWS = "".join(f"{i},{16_667 * i},0.{i % 10},0.2,9.8,0.1,-0.2,0.{i % 7},0\n" for i in range(1, 400))
GOOD = f"sep=,\nDeviceTag:,a\nOutputRate:,60Hz\n© Xsens\n\n{TITLES}{ROWS}"
MAPPING = """\
description: a table
text: {skip_lines: 5}
time: {column: SampleTimeFine, unit: us, wraps_bits: 32}
sensors:
  imu:
    acc: {columns: [Acc_X, Acc_Y, Acc_Z], unit: m/s^2}
    gyr: {columns: [Gyr_X, Gyr_Y, Gyr_Z], unit: deg/s}
"""


def run(monkeypatch, capsys, *words: str | Path) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["testbench", *map(str, words)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0), capsys.readouterr().err


def refused(monkeypatch, capsys, tmp_path, *words: str | Path) -> str:
    code, said = run(monkeypatch, capsys, "import", *words, "--out", tmp_path / "session")
    assert code == 2, said
    assert not (tmp_path / "session").exists()
    assert (
        said.startswith("error: ")
        and said.count("error: ") == 1
        and "Traceback" not in said
        and len(said) < 700
    )
    return said


def replaced(old: str, new: str) -> bytes:
    assert old in GOOD
    return GOOD.replace(old, new, 1).encode()


TEXT = {
    "empty": (b"", "the file is empty"),
    "blank": (b"\n\n \n", "nothing but blank lines"),
    "header only": (GOOD.split("\n1,")[0].encode() + b"\n", "no samples after the header"),
    "cut off": (
        replaced("\n300,5000100,0.0,", "\n300,5000100,"),
        r":306: has 8 fields where 9 are expected; the file may be cut off",
    ),
    "cut header": (GOOD.encode()[:90], "not an Xsens DOT export|no column|no samples"),
    "word": (
        replaced("9.8,0.1,-0.2,0.3,0\n11,", "up,0.1,-0.2,0.3,0\n11,"),
        r":16: 'up' in the column Acc_Z is not a number",
    ),
    "mixed encoding": (
        GOOD.encode()[:4000] + b"\xe9\xe8" + GOOD.encode()[4000:],
        r":\d+: the bytes 0xE9 .* are not utf-8",
    ),
    "latin header": (GOOD.encode("latin-1"), r":4: the bytes 0xA9 .* are not utf-8 text"),
    "half utf-16": (GOOD.encode() + GOOD.encode("utf-16"), r":\d+: "),
    "zero bytes": (
        GOOD.encode()[:5000] + bytes(100) + GOOD.encode()[5000:],
        r":\d+: holds zero bytes",
    ),
    "decimal commas": (
        GOOD.replace("9.8", "9,8").encode(),
        r":7: has 10 fields where 9 are expected; if its decimals are",
    ),
    "decimal commas among semicolons, once": (
        replaced("9.8", "9,8").replace(b",", b";").replace(b"9;8", b"9,8"),
        r":7: '9,8'|decimal",
    ),
    "unsorted": (
        re.sub(
            r"(?m)^([23]\d\d),\d+,",
            lambda row: f"{row[1]},{16_667 * (int(row[1]) - 199)},",
            GOOD,
        ).encode(),
        r":206: time goes back from 3.316\d+ s to 0.016667 s and does not return",
    ),
    "words too often": (
        re.sub(r"(?m)^(\d*00,)", r"I2C error\n" * 3 + r"\1", GOOD).encode(),
        r":\d+: has 1 fields where 9 are expected",
    ),
    "too many fields": (
        replaced("\n300,", "\n7,300,"),
        r":306: has 10 fields where 9 are expected",
    ),
    "missing time": (replaced(f"200,{16_667 * 200},", "200,,"), r":206: "),
    "no such columns": (GOOD.replace("Acc_", "Foo_").replace("Gyr_", "Bar_").encode(), "column"),
    "twice the same column": (
        GOOD.replace("Gyr_Z", "Acc_Z").encode(),
        "stands twice|no column|more than one",
    ),
    "another format": (
        b"Time (s),W,X,Y,Z\n0,1,0,0,0\n0.1,1,0,0,0\n",
        "not an Xsens DOT export|no column",
    ),
    "prose": (
        b"Dear colleague,\nplease find the data attached.\n" * 30,
        "not an Xsens DOT export|no column",
    ),
    "zip": (b"PK\x03\x04" + os.urandom(3000), "this is a zip archive"),
    "gzip": (gzip.compress(GOOD.encode()), "this is a gzip archive"),
    "noise": (
        bytes(np.random.default_rng(1).integers(0, 256, 20_000, dtype=np.uint8)),
        "is not text|zero bytes|are not utf-8",
    ),
    "one endless line": (b"1," * 3_000_000, "longer than 1 MB|too long"),
    "endless line below": (GOOD.encode() + b"9" * 3_000_000, "longer than 1 MB"),
    "all zero": (
        b"PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z\n" + b"0,0,0,0,0\n" * 20,
        "every sample is zero",
    ),
}


@pytest.mark.parametrize("case", TEXT)
def test_malformed_text_of_a_vendor(case, tmp_path, monkeypatch, capsys):
    content, said = TEXT[case]
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    message = refused(monkeypatch, capsys, tmp_path, "xsens_dot", path)
    assert str(path) in message
    assert re.search(said, message), message


@pytest.mark.parametrize("case", [case for case in TEXT if case != "all zero"])
def test_malformed_text_by_a_mapping(case, tmp_path, monkeypatch, capsys):
    (tmp_path / "bad.csv").write_bytes(TEXT[case][0])
    (tmp_path / "map.yaml").write_text(MAPPING)
    message = refused(
        monkeypatch,
        capsys,
        tmp_path,
        "generic",
        tmp_path / "bad.csv",
        "--mapping",
        tmp_path / "map.yaml",
    )
    assert "bad.csv" in message


def test_the_sound_file_is_imported(tmp_path, monkeypatch, capsys):
    (tmp_path / "good.csv").write_text(GOOD, encoding="utf-8")
    monkeypatch.setattr(
        sys,
        "argv",
        [
            "testbench",
            "import",
            "xsens_dot",
            str(tmp_path / "good.csv"),
            "--out",
            str(tmp_path / "s"),
        ],
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code and "good: 399 samples at 60 Hz" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name",
    ["xsens_dot", "matrix", "technaid", "shimmer", "ngimu", "mtw", "mti_mat", "broad", "imu_tk"],
)
@pytest.mark.parametrize(
    "case", ["empty", "prose", "noise", "zip", "header only", "another format", "missing", "folder"]
)
def test_every_format_refuses_what_is_not_its_own(name, case, tmp_path, monkeypatch, capsys):
    path = tmp_path / "bad.dat"
    if case == "folder":
        path.mkdir()
    elif case != "missing" and not (name == "ngimu" and case == "another format"):
        path.write_bytes(TEXT[case][0])
    files = [path, path] if name == "imu_tk" else [path]
    assert "bad.dat" in refused(monkeypatch, capsys, tmp_path, name, *files)


def lying_mat(path: Path) -> None:
    """A MATLAB 5 file whose array says it has 2 GB."""
    savemat(path, {"acc": np.zeros((10, 3)), "gyr": np.zeros((10, 3)), "fs": 100.0})
    content = bytearray(path.read_bytes())
    at = content.index(struct.pack("<ii", 10, 3))
    content[at : at + 8] = struct.pack("<ii", 90_000_000, 3)
    path.write_bytes(content)


def lying_hdf5(path: Path) -> None:
    """A chunked dataset of 2 GB of which nothing was written."""
    with h5py.File(path, "w") as file:
        for name in ("acc", "gyr"):
            file.create_dataset(name, shape=(3, 90_000_000), dtype="f8", chunks=(3, 1000))


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("make", [lying_mat, lying_hdf5])
def test_a_header_that_claims_gigabytes_is_not_believed(make, tmp_path, monkeypatch, capsys):
    make(tmp_path / "lie.mat")
    message = refused(monkeypatch, capsys, tmp_path, "mti_mat", tmp_path / "lie.mat")
    assert "claims 2.2 GB, in a file of 0.0 MB" in message


def test_damaged_parquet(tmp_path, monkeypatch, capsys):
    (tmp_path / "map.yaml").write_text(MAPPING)
    for content in (b"", b"PAR1", b"PAR1" + os.urandom(500) + b"PAR1"):
        (tmp_path / "bad.parquet").write_bytes(content)
        message = refused(
            monkeypatch,
            capsys,
            tmp_path,
            "generic",
            tmp_path / "bad.parquet",
            "--mapping",
            tmp_path / "map.yaml",
        )
        assert "not a readable Parquet file" in message


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--unit", "acc"], "write it as WHAT=UNIT"),
        (["--unit", "acc=stone"], "unknown unit of acc 'stone'; known: m/s^2, g, mg"),
        (["--rate", "0"], "a sampling rate lies between"),
        (["--unit", "time=clock"], "unknown unit of time 'clock'; known: s, ms, us, ns"),
        (["--mapping", "x"], "--mapping: has no effect"),
        (["--axes", "sideways"], "unknown axis map 'sideways'"),
        (["--robot", "ur3e"], "describe the file of --truth"),
        (["--truth", "nowhere.csv"], "nowhere.csv: the file does not exist"),
        (["--truth", "good.csv", "--mounting", "rotation_deg: {ABC: [1, 2, 3]}"], "--mounting:1:"),
        (["--truth", "good.csv", "--mounting", "rotation: {"], "--mounting:1"),
    ],
)
def test_wrong_options_are_refused(words, said, tmp_path, monkeypatch, capsys):
    (tmp_path / "good.csv").write_text(GOOD, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert said in refused(monkeypatch, capsys, tmp_path, "xsens_dot", "good.csv", *words)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    position=st.integers(0, len(GOOD.encode()) - 1),
    junk=st.binary(min_size=1, max_size=6),
    remove=st.integers(0, 40),
)
def test_random_damage_is_either_harmless_or_refused(position, junk, remove, tmp_path_factory):
    from testbench.exceptions import InputError
    from testbench.formats import import_recording
    from tests.conftest import FakeClock

    folder = tmp_path_factory.mktemp("damaged")
    raw = GOOD.encode()
    (folder / "bad.csv").write_bytes(raw[:position] + junk + raw[position + remove :])
    out, said = folder / "session", ""
    try:
        import_recording("xsens_dot", [folder / "bad.csv"], out, FakeClock())
    except InputError as error:
        said = str(error)
    assert out.exists() != bool(said) and len(said) < 1000
    assert not list(out.glob("*.partial"))
