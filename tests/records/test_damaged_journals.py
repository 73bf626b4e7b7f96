"""A journal ends where its file does, be it within a batch; damage before that is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from testbench.exceptions import SessionError
from testbench.records.disk.journal import Journal, compact
from testbench.records.disk.tables import read_parquet

ROWS = 3
BATCHES = 5


def written(folder: Path) -> tuple[Path, list[int]]:
    """A closed journal, and its size before each of its batches."""
    path, sizes = folder / "arm.arrows", []
    journal = Journal(path, {"x": "float64"})
    for batch in range(BATCHES):
        sizes.append(path.stat().st_size)
        journal.append({"x": np.arange(batch * ROWS, (batch + 1) * ROWS, dtype=float)})
    journal.close()
    return path, sizes


@pytest.mark.parametrize("damage", [b"\0" * 8, b"\xa5" * 8])
def test_a_journal_damaged_before_its_end_is_kept_and_its_place_is_named(tmp_path, damage) -> None:
    path, sizes = written(tmp_path)
    content = bytearray(path.read_bytes())
    content[sizes[2] : sizes[2] + len(damage)] = damage
    path.write_bytes(content)
    with pytest.raises(SessionError, match=r"arm\.arrows is damaged at byte \d+.*it is kept"):
        compact(path, tmp_path / "arm.parquet")
    assert path.read_bytes() == content
    assert not (tmp_path / "arm.parquet").exists()


@pytest.mark.parametrize("tail", [0, 4096])
def test_a_journal_cut_off_within_a_batch_gives_all_batches_before(tmp_path, tail) -> None:
    path, sizes = written(tmp_path)
    path.write_bytes(path.read_bytes()[: sizes[3] + 20] + b"\0" * tail)
    if tail:  # zeros of a file system begin where nothing was written
        path.write_bytes(path.read_bytes()[: sizes[3]] + b"\0" * tail)
    assert compact(path, tmp_path / "arm.parquet") == 3 * ROWS
    np.testing.assert_array_equal(
        read_parquet(tmp_path / "arm.parquet")["x"], np.arange(3.0 * ROWS)
    )
    assert not path.exists()
