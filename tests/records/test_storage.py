"""Tables read in parts: rows, columns and every so-manieth row are those of the whole."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from testbench.exceptions import SessionError
from testbench.records.disk.tables import (
    ROWS_PER_GROUP,
    from_arrow,
    last_value,
    read_stacked,
    to_arrow,
    write_parquet,
)

N = 2 * ROWS_PER_GROUP + 1234


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "t.parquet"
    row = np.arange(N)
    write_parquet(path, {"time": row, "x": row / 7, "y": -row / 3, "mark": row % 5 == 0})
    return path


@pytest.mark.parametrize("every", [1, 2, 7, 65_536, 65_537, 100_000])
@pytest.mark.parametrize(
    ("begin", "end"),
    [(0, None), (3, 50), (70_000, 131_080), (65_530, 65_540), (5, N + 99), (10, 10)],
)
def test_a_part_is_what_slicing_the_whole_gives(table, begin, end, every):
    part = read_stacked(
        table, {"time": "time", "xy": ["x", "y"], "mark": "mark"}, begin, end, every
    )
    stop = min(N if end is None else end, N)
    row = np.arange(begin + every - 1, begin + (stop - begin) // every * every, every)
    np.testing.assert_array_equal(part["time"], row)
    np.testing.assert_array_equal(part["xy"], np.column_stack([row / 7, -row / 3]))
    np.testing.assert_array_equal(part["mark"], row % 5 == 0)


def test_a_missing_column_is_named(table):
    with pytest.raises(SessionError, match="lacks the column z; it has time, x, y, mark"):
        read_stacked(table, {"xyz": ["x", "y", "z"]})


def test_a_table_without_rows_gives_empty_columns(tmp_path):
    write_parquet(tmp_path / "e.parquet", {"x": np.zeros(0), "y": np.zeros(0)})
    assert read_stacked(tmp_path / "e.parquet", {"xy": ["x", "y"]})["xy"].shape == (0, 2)


def test_the_last_value_is_read_from_the_last_rows_alone(table, tmp_path, monkeypatch):
    read: list[int] = []
    honest = pq.ParquetFile.read_row_group

    def noted(file: pq.ParquetFile, group: int, *columns: object) -> pa.Table:
        read.append(group)
        return honest(file, group, *columns)

    monkeypatch.setattr(pq.ParquetFile, "read_row_group", noted)
    assert last_value(table, "time") == N - 1 and read == [2]
    write_parquet(tmp_path / "e.parquet", {"time": np.zeros(0, dtype=np.int64)})
    assert last_value(tmp_path / "e.parquet", "time") is None
    for file, name in ((table, "z"), (tmp_path / "e.parquet", "z")):
        with pytest.raises(SessionError, match="lacks the column z"):
            last_value(file, name)
    with pytest.raises(SessionError, match="cannot be read"):
        last_value(tmp_path / "none.parquet", "time")


@pytest.mark.parametrize("kind", ["f8", "f4", "i8", "i4", "u4", "?"])
@pytest.mark.parametrize("length", [0, 1, 9, 100])
def test_a_column_goes_to_arrow_and_back_as_pyarrow_would_take_it(kind, length):
    values = (np.random.default_rng(length).normal(size=2 * length) * 9).astype(kind)[::2]
    if kind == "f8" and length:
        values[0] = np.nan
    taken = to_arrow(values)
    assert taken.equals(pa.array(values)) or np.isnan(values).any()
    assert taken.type == pa.array(values).type
    back = from_arrow(pa.chunked_array([taken]))
    np.testing.assert_array_equal(back, values)
    assert back.dtype == values.dtype


@pytest.mark.parametrize("kind", ["f8", "i8", "?"])
def test_a_part_of_a_column_in_several_pieces_is_that_part(kind):
    values = np.arange(100).astype(kind)
    column = pa.chunked_array([to_arrow(values[:41]), to_arrow(values[41:])])
    for begin, length in ((0, 100), (3, 21), (11, 60), (41, 59), (50, 0)):
        part = from_arrow(column.slice(begin, length))
        np.testing.assert_array_equal(part, values[begin : begin + length])


def test_texts_go_to_arrow_and_back():
    texts = np.array(["quick", "", "gait"], dtype=object)
    column = pa.chunked_array([to_arrow(texts)])
    assert column.type == pa.string()
    assert from_arrow(column).tolist() == texts.tolist()


def test_missing_values_of_a_foreign_table_are_nan():
    found = from_arrow(pa.chunked_array([pa.array([1.5, None, 3.0])]))
    np.testing.assert_array_equal(found, [1.5, np.nan, 3.0])
