"""Overlapping pieces: together they are the table, and each has its neighbours."""

import numpy as np

from testbench.records.disk.chunks import overlapping


def test_a_table_in_overlapping_pieces_is_whole_and_every_piece_has_its_margins():
    for count in (0, 1, 7, 100, 101, 250):
        column = np.arange(count)
        batches = [{"a": part, "b": -part} for part in np.array_split(column, max(count // 13, 1))]
        pieces = list(overlapping(iter(batches), 50, 12))
        np.testing.assert_array_equal(
            np.concatenate([held["a"][counted] for held, counted in pieces]), column
        )
        for held, counted in pieces:
            np.testing.assert_array_equal(held["b"], -held["a"])
            begin, end, _ = counted.indices(len(held["a"]))
            assert begin == 12 or held["a"][:1].tolist() in ([0], [])
            assert len(held["a"]) - end == 12 or held["a"][-1:].tolist() in ([count - 1], [])


def test_chunks_without_margins_are_never_empty_but_of_a_table_without_rows():
    for count in (0, 1, 50, 99, 100, 150):
        column = np.arange(count)
        pieces = list(overlapping(iter([{"a": column[:60]}, {"a": column[60:]}]), 50, 0))
        parts = [held["a"][counted] for held, counted in pieces]
        np.testing.assert_array_equal(np.concatenate(parts), column)
        assert [len(part) for part in parts[:-1]] == [50] * (len(parts) - 1)
        assert len(parts) == max(-(-count // 50), 1)
