"""Long tables in pieces that overlap, for whatever looks at neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np


def overlapping(
    batches: Iterable[dict[str, np.ndarray]], size: int, margin: int
) -> Iterator[tuple[dict[str, np.ndarray], slice]]:
    """A table in chunks of `size` rows with up to `margin` further ones at either end.

    Args:
        batches: The table in any chunks, at least one: columns by name, each of shape (k,) or
            (k, m).
        size: Rows of a chunk.
        margin: Further rows before, and after it; 0 for none.

    Yields:
        Columns with their margins, and the rows among them that are the chunk itself; one chunk
        without rows where the table has none.
    """
    held: dict[str, np.ndarray] = {}
    done = 0  # rows at the beginning of what is held that were given out already
    given = False
    for batch in batches:
        held = (
            {name: np.concatenate([held[name], values]) for name, values in batch.items()}
            if held
            else dict(batch)
        )
        while len(next(iter(held.values()))) >= done + size + margin:
            yield (
                {name: values[: done + size + margin] for name, values in held.items()},
                slice(done, done + size),
            )
            given = True
            forget = max(done + size - margin, 0)
            held, done = (
                {name: values[forget:] for name, values in held.items()},
                done + size - forget,
            )
    if not given or len(next(iter(held.values()))) > done:
        yield held, slice(done, None)
