"""Long recordings: pieces that fit in memory, whatever the length of the file."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv

from testbench.exceptions import FileProblems, StorageError
from testbench.formats.recording import ImportedSensor, Recording, write_recording
from testbench.formats.tables import text_table
from testbench.formats.tables.bytes_stream import LineStream
from testbench.formats.tables.source import ROWS_PER_CHUNK
from testbench.formats.tables.text_table import TextTable
from testbench.records.session.samples import ImuSamples
from testbench.records.specs.protocol import Analysis
from tests.patience import PATIENCE_S

PROGRAM = """
import resource, sys, time
from datetime import UTC, datetime
from pathlib import Path
from testbench.formats import import_recording
from testbench.formats.options import Options
class Clock:
    def utc(self): return datetime(2026, 1, 1, tzinfo=UTC)
begun = time.perf_counter()
file, folder, options = Path(sys.argv[1]), Path(sys.argv[2]), Options(sys.argv[3])
session = import_recording("generic", [file], folder, Clock(), options)
took = time.perf_counter() - begun
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(session.manifest.samples["imu"], session.manifest.duration_s / took, peak)
"""
MAPPING = """\
description: long
rate_hz: 1000
sensors: {imu: {acc: {columns: [2, 3, 4], unit: m/s^2}, gyr: {columns: [5, 6, 7], unit: deg/s}}}
text: {header: false}
"""


def write(path: Path, rows: int) -> None:
    rng = np.random.default_rng(1)
    with path.open("wb") as file:
        for start in range(0, rows, 500_000):
            count = min(500_000, rows - start)
            noise = np.round(rng.normal(0, 0.01, (count, 6)) + [0, 0, 9.81, 0, 0, 0], 5)
            columns = {"t": np.arange(start, start + count)} | {
                str(i): noise[:, i] for i in range(6)
            }
            csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=False))


def measure(folder: Path, block: Path, repeats: int) -> tuple[int, float, float]:
    """Samples, times faster than they were taken, and peak memory [MB], of an import of a file of
    so many equal blocks in a process of its own.
    """
    with (folder / f"{repeats}.csv").open("wb") as file:
        for _ in range(repeats):
            file.write(block.read_bytes())
    (folder / "map.yaml").write_text(MAPPING)
    words = [
        sys.executable,
        "-c",
        PROGRAM,
        folder / f"{repeats}.csv",
        folder / f"session{repeats}",
        folder / "map.yaml",
    ]
    result = subprocess.run(words, capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert result.returncode == 0, result.stderr
    count, speed, peak = result.stdout.split()
    return int(count), float(speed), float(peak)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording_and_it_is_much_faster_than_real_time(tmp_path):
    write(tmp_path / "block.csv", 300_000)
    short, long = (measure(tmp_path, tmp_path / "block.csv", repeats) for repeats in (1, 4))
    assert (short[0], long[0]) == (300_000, 1_200_000)
    # 40 bytes a sample, where rate and force alone have 48: on a busy machine the reader runs ahead
    assert long[2] - short[2] < 36
    assert long[1] > 20  # a hundred on an idle machine: see the benchmarks


def test_chunks_are_small_and_give_the_whole(tmp_path):
    write(tmp_path / "d.csv", 600_000)
    table = TextTable(tmp_path / "d.csv", [str(i) for i in range(1, 8)], 1)
    sizes, first = [], []
    for chunk in table.chunks({"1": "integer", "4": "float"}):
        sizes.append(len(chunk["1"]))
        first.append(chunk["1"])
    assert sum(sizes) == 600_000 and max(sizes) < 3 * ROWS_PER_CHUNK and len(sizes) > 2
    np.testing.assert_array_equal(np.concatenate(first), np.arange(600_000))


def test_a_fault_deep_in_a_long_file_is_named_by_its_line(tmp_path):
    write(tmp_path / "d.csv", 400_000)
    lines = (tmp_path / "d.csv").read_bytes().split(b"\n")
    lines[345_677] = lines[345_677].replace(b"9.", b"9,,", 1)
    (tmp_path / "d.csv").write_bytes(b"\n".join(lines))
    table = TextTable(tmp_path / "d.csv", [str(i) for i in range(1, 8)], 1)
    with pytest.raises(FileProblems, match=r"d\.csv:345678: has 9 fields where 7 are expected"):
        list(table.chunks({"4": "float"}))


class Cut(Exception):
    """Stands for whatever may end an import in its middle."""


@pytest.mark.parametrize(
    "fault", [KeyboardInterrupt(), MemoryError(), OSError(28, "No space left on device"), Cut()]
)
def test_an_import_that_is_cut_off_leaves_nothing(fault, tmp_path, clock):
    def chunk(start: int) -> ImuSamples:
        time = np.arange(start, start + 100) * 10_000_000
        return ImuSamples(
            time,
            time,
            np.zeros((100, 3)),
            np.ones((100, 3)),
            None,
            None,
            time,
            np.zeros(100, dtype=bool),
        )

    class Chunks:
        def __iter__(self):
            yield chunk(0)
            yield chunk(100)
            raise fault

    recording = Recording(
        "cut", "cut off", {"imu": ImportedSensor(Chunks(), 100.0, "")}, Analysis()
    )
    expected = StorageError if isinstance(fault, OSError) else type(fault)
    with pytest.raises(expected):
        write_recording(recording, [tmp_path / "a.csv"], "made up", tmp_path / "session", clock)
    assert not (tmp_path / "session").exists()


def test_a_file_is_read_in_the_calling_thread_alone(tmp_path, monkeypatch):
    """A reader's thread that calls Python aborts the interpreter where an import is refused."""
    write(tmp_path / "d.csv", 200_000)
    threads, read = set(), LineStream._next

    def watched(stream: LineStream) -> bytes:
        threads.add(threading.get_ident())
        return read(stream)

    monkeypatch.setattr(LineStream, "_next", watched)
    table = TextTable(tmp_path / "d.csv", [str(i) for i in range(1, 8)], 1)
    next(table.chunks({"4": "float"}))
    assert threads == {threading.get_ident()}


def test_who_looks_at_the_beginning_of_a_long_file_reads_and_parses_little_of_it(
    tmp_path, monkeypatch
):
    """Each importer looks half a dozen times; 8,192 rows tell what is usual in a file."""
    write(tmp_path / "d.csv", 200_000)
    sizes, parsed = [], text_table._parsed
    monkeypatch.setattr(
        text_table,
        "_parsed",
        lambda block, layout: sizes.append(len(block)) or parsed(block, layout),
    )
    table = TextTable(tmp_path / "d.csv", [str(i) for i in range(1, 8)], 1)
    next(table.chunks({"4": "float"}))
    assert sum(sizes) < 300_000
    sizes.clear()
    chunks = table.chunks({"4": "float"})
    rows = 0
    while rows < 8192:
        rows += len(next(chunks)["4"])
    chunks.close()
    assert rows < 20_000 and sum(sizes) < 1_000_000


@pytest.mark.parametrize("separator", [",", " "])
@pytest.mark.parametrize(("bad", "said"), [(b"\0", "zero bytes"), (b"\xe9", "0xE9 .*not utf-8")])
@pytest.mark.parametrize("line", [3, 20_000, 61_234])
def test_a_bad_byte_is_found_on_its_line_however_far_down(tmp_path, separator, bad, said, line):
    row = separator.join(["1.25"] * 12).encode() + b"\n"  # 60 bytes: pieces end within rows
    rows = [row] * 70_000
    rows[line - 1] = bad + row
    (tmp_path / "d.csv").write_bytes(b"".join(rows))
    blanks = separator == " "
    with (
        pytest.raises(FileProblems, match=f":{line}: .*{said}"),
        LineStream(tmp_path / "d.csv", "utf-8", squeeze=blanks) as stream,
    ):
        list(stream.blocks())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le", "cp1252"])
def test_blocks_hold_every_line_whole_and_once(tmp_path, encoding):
    rng = np.random.default_rng(3)
    lines = [f"{i}," + "\u00e9" * int(k) for i, k in enumerate(rng.integers(0, 60, 150_000))]
    (tmp_path / "d.csv").write_bytes("\n".join(lines).encode(encoding))
    with LineStream(tmp_path / "d.csv", encoding, skip=7) as stream:
        blocks = list(stream.blocks())
    assert b"".join(blocks).decode().split("\n") == lines[7:]
    assert all(block.endswith(b"\n") for block in blocks[:-1])
    sizes = [len(block) for block in blocks]
    assert len(sizes) > 3 and sizes[0] < sizes[1] < sizes[2]
