"""A stream is read while it is written: every row once, none that is not whole, and its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from testbench.records.disk.journal import Journal, compact
from testbench.records.disk.journal_tail import JournalTail

ROWS, BATCHES = 7, 6


def journal(folder: Path) -> Journal:
    return Journal(folder / "imu.arrows", {"host_time_ns": np.int64, "saturated": np.bool_})


def batch(k: int) -> dict[str, np.ndarray]:
    times = np.arange(k * ROWS, (k + 1) * ROWS)
    return {"host_time_ns": times, "saturated": times % 3 == 0}


def tail_of(folder: Path) -> JournalTail:
    return JournalTail(folder / "imu.arrows", folder / "imu.parquet")


def rest(tail: JournalTail) -> list[int]:
    """All rows that are left, whose marks fit their times."""
    found: list[int] = []
    while (rows := tail.read()) is not None:
        np.testing.assert_array_equal(rows["saturated"], rows["host_time_ns"] % 3 == 0)
        found += rows["host_time_ns"].tolist()
    return found


def test_a_journal_that_grows_by_bytes_gives_every_row_once_and_none_too_early(tmp_path) -> None:
    stream = journal(tmp_path)
    for k in range(BATCHES):
        stream.append(batch(k))
    stream.close()
    whole = stream.path.read_bytes()
    stream.path.write_bytes(b"")
    tail, seen = tail_of(tmp_path), []
    with stream.path.open("ab", buffering=0) as file:
        for begin in range(0, len(whole), 41):
            file.write(whole[begin : begin + 41])
            seen += rest(tail)
    assert seen == list(range(ROWS * BATCHES))
    tail.close()


def test_a_tail_opened_before_its_journal_waits_for_it_and_one_without_news_says_so(
    tmp_path,
) -> None:
    tail = tail_of(tmp_path)
    assert tail.read() is None
    stream = journal(tmp_path)
    assert tail.read() is None
    stream.append(batch(0))
    assert rest(tail) == list(range(ROWS))
    assert tail.read() is None
    stream.close()
    tail.close()


def test_the_end_of_a_journal_is_read_that_became_a_table_meanwhile(tmp_path) -> None:
    stream, tail = journal(tmp_path), tail_of(tmp_path)
    stream.append(batch(0))
    assert rest(tail) == list(range(ROWS))
    stream.append(batch(1))
    stream.close()
    compact(stream.path, tmp_path / "imu.parquet")
    assert rest(tail) == list(range(ROWS, 2 * ROWS))
    assert rest(tail_of(tmp_path)) == list(range(2 * ROWS))
    tail.close()


def test_a_batch_larger_than_a_look_is_read_all_the_same(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("testbench.records.disk.journal_tail.MOST_BYTES", 100)
    stream = journal(tmp_path)
    for k in range(BATCHES):
        stream.append(batch(k))
    tail, seen = tail_of(tmp_path), []
    for _ in range(40):
        rows = tail.read()
        seen += [] if rows is None else rows["host_time_ns"].tolist()
    assert seen == list(range(ROWS * BATCHES))
    stream.close()
    tail.close()
