"""Journals and tables on disk: what survives a cut, what is verified, and what a foreign reader
sees.
"""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbench.exceptions import SessionError
from testbench.records.disk.journal import Journal, compact, journal_batches
from testbench.records.disk.json_file import plain_values, read_json, write_json
from testbench.records.disk.tables import (
    ROWS_PER_GROUP,
    parquet_shape,
    read_parquet,
    read_parquet_batches,
    to_table,
    write_parquet,
    write_parquet_batches,
)

COLUMNS = {"host_time_ns": np.int64, "gyr_x_rad_s": np.float64, "saturated": np.bool_}


def rows(start: int, count: int) -> dict[str, np.ndarray]:
    times = np.arange(start, start + count)
    return {"host_time_ns": times, "gyr_x_rad_s": times / 7, "saturated": times % 2 == 0}


@pytest.fixture
def journal(tmp_path):
    """A journal of three batches of five rows, ended as it should be."""
    stream = Journal(tmp_path / "imu.arrows", COLUMNS, {"content": "test"})
    for batch in range(3):
        stream.append(rows(5 * batch, 5))
    stream.close()
    return stream.path


def test_a_journal_gives_back_what_was_put_in(journal):
    schema, batches = journal_batches(journal)
    assert schema.metadata == {b"content": b"test"}
    np.testing.assert_array_equal(
        np.concatenate([b["host_time_ns"].to_numpy() for b in batches]), np.arange(15)
    )


def test_a_journal_cut_at_any_byte_gives_back_its_whole_batches_and_never_a_wrong_number(
    journal, tmp_path
):
    whole = journal.read_bytes()
    cut_file = tmp_path / "cut.arrows"
    counts = []
    for length in range(len(whole) + 1):
        cut_file.write_bytes(whole[:length])
        try:
            batches = list(journal_batches(cut_file)[1])
        except SessionError:
            counts.append(-1)
            continue
        counts.append(len(batches))
        for index, batch in enumerate(batches):
            expected = rows(5 * index, 5)
            for name in COLUMNS:
                np.testing.assert_array_equal(
                    batch[name].to_numpy(zero_copy_only=False), expected[name]
                )
    assert counts[0] == -1 and counts[-1] == 3
    assert counts == sorted(counts)  # more bytes, never fewer batches
    assert set(counts) == {-1, 0, 1, 2, 3}


def test_every_append_is_on_its_way_to_the_disk_at_once(tmp_path):
    stream = Journal(tmp_path / "imu.arrows", COLUMNS)
    for batch in range(4):
        stream.append(rows(5 * batch, 5))
        _, batches = journal_batches(stream.path)  # as another process would read it now
        assert sum(b.num_rows for b in batches) == stream.rows == 5 * (batch + 1)
    stream.close()


def test_nothing_appended_leaves_an_empty_table_of_the_right_columns(tmp_path):
    stream = Journal(tmp_path / "imu.arrows", COLUMNS)
    stream.append(rows(0, 0))
    stream.close()
    stream.close()
    assert compact(stream.path, tmp_path / "imu.parquet") == 0
    assert list(read_parquet(tmp_path / "imu.parquet")) == list(COLUMNS)


def test_an_existing_journal_is_never_written_over(journal):
    with pytest.raises(FileExistsError):
        Journal(journal, COLUMNS)


def test_compaction_keeps_every_row_the_notes_and_no_journal(journal, tmp_path):
    target = tmp_path / "imu.parquet"
    assert compact(journal, target) == 15
    assert not journal.exists()
    assert list(tmp_path.iterdir()) == [target]
    table = pd.read_parquet(target)  # a reader that is not ours
    np.testing.assert_array_equal(table["gyr_x_rad_s"], np.arange(15) / 7)
    assert pq.read_schema(target).metadata[b"content"] == b"test"


def test_compaction_of_a_cut_journal_keeps_its_whole_batches(journal, tmp_path):
    whole = journal.read_bytes()
    journal.write_bytes(whole[: len(whole) - 200])
    assert compact(journal, tmp_path / "imu.parquet") in {5, 10}


def test_a_table_that_reads_back_differently_is_refused_and_the_journal_kept(
    journal, tmp_path, monkeypatch
):
    honest = pq.ParquetWriter.write_table
    for change in (
        lambda table: table.slice(1),
        lambda table: pa.concat_tables([table, table]),
        _one_value_changed,
    ):
        with monkeypatch.context() as patch:
            patch.setattr(
                pq.ParquetWriter,
                "write_table",
                lambda file, table, change=change, **more: honest(file, change(table), **more),
            )
            with pytest.raises(SessionError, match="differs from its journal"):
                compact(journal, tmp_path / "imu.parquet")
        assert journal.exists()
        assert not (tmp_path / "imu.parquet").exists()


def _one_value_changed(table):
    values = table["gyr_x_rad_s"].to_numpy().copy()
    values[7] += 1e-12
    return table.set_column(1, table.schema.field(1), pa.array(values))


def test_pieces_of_any_length_make_the_same_file_as_the_whole(tmp_path):
    count = 3 * ROWS_PER_GROUP + 17
    whole = to_table(rows(0, count), {"content": "test"})
    cuts = [0, 1, 10, ROWS_PER_GROUP, ROWS_PER_GROUP + 3, 2 * ROWS_PER_GROUP + 9, count]
    pieces = [whole.slice(begin, end - begin) for begin, end in pairwise(cuts)]
    assert write_parquet_batches(tmp_path / "pieces.parquet", whole.schema, pieces) == count
    write_parquet_batches(tmp_path / "whole.parquet", whole.schema, [whole])
    assert (tmp_path / "pieces.parquet").read_bytes() == (tmp_path / "whole.parquet").read_bytes()
    read = list(
        read_parquet_batches(tmp_path / "pieces.parquet", ["host_time_ns", "saturated"], 1000)
    )
    assert [list(piece) for piece in read[:1]] == [["host_time_ns", "saturated"]]
    assert max(len(piece["saturated"]) for piece in read) <= 1000
    np.testing.assert_array_equal(
        np.concatenate([piece["host_time_ns"] for piece in read]), np.arange(count)
    )
    assert parquet_shape(tmp_path / "pieces.parquet") == (count, list(COLUMNS))


def test_a_journal_that_is_no_journal_is_refused(tmp_path):
    path = tmp_path / "imu.arrows"
    path.write_bytes(b"not an Arrow stream at all, but long enough to be looked at")
    with pytest.raises(SessionError, match="cannot be read"):
        journal_batches(path)


def test_a_damaged_or_missing_table_is_a_sentence_and_not_a_traceback(tmp_path):
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 and then nothing")
    for name in ("bad.parquet", "missing.parquet"):
        with pytest.raises(SessionError, match="cannot be read"):
            read_parquet(tmp_path / name)


def test_a_table_keeps_types_and_nothing_half_written_is_left(tmp_path):
    write_parquet(tmp_path / "t.parquet", rows(0, 100), {"units": "as named"})
    back = read_parquet(tmp_path / "t.parquet")
    assert {name: column.dtype for name, column in back.items()} == {
        name: np.dtype(t) for name, t in COLUMNS.items()
    }
    assert [path.name for path in tmp_path.iterdir()] == ["t.parquet"]


def test_json_has_null_where_a_number_is_not_finite(tmp_path):
    write_json(
        tmp_path / "a.json",
        {"value": float("nan"), "list": np.array([1.0, np.inf]), "n": np.int64(3)},
    )
    text = (tmp_path / "a.json").read_text()
    assert "NaN" not in text and "Infinity" not in text
    assert read_json(tmp_path / "a.json") == {"value": None, "list": [1.0, None], "n": 3}
    json.loads(json.dumps(plain_values({"b": np.bool_(True), "t": (1, 2)})))


def test_damaged_json_is_a_sentence(tmp_path):
    (tmp_path / "a.json").write_text('{"cut": ')
    with pytest.raises(SessionError, match=r"a\.json cannot be read"):
        read_json(tmp_path / "a.json")
