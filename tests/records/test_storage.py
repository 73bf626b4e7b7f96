"""Tables read in parts: rows, columns and every so-manieth row are those of the whole."""

import numpy as np
import pytest

from testbench.exceptions import SessionError
from testbench.records.disk.tables import ROWS_PER_GROUP, read_stacked, write_parquet

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
