"""Make long signals small without losing their extremes."""

from __future__ import annotations

import numpy as np

MOST_POINTS = 1600


class Envelope:
    """Smallest and largest value of each of equally long spans of time.

    Args:
        time: Increasing, shape (n,), any unit.
        keep: Which samples count, shape (n,), or None for all.
        points: At most so many points are drawn; signals with fewer samples stay as they are.
    """

    def __init__(self, time: np.ndarray, keep: np.ndarray | None = None, points: int = MOST_POINTS):
        self._keep = (
            np.ones(len(time), dtype=bool) if keep is None else np.asarray(keep, dtype=bool)
        )
        self._whole = len(time) <= points
        if self._whole:
            self.time = np.asarray(time, dtype=float)
            return
        edges = np.linspace(float(time[0]), float(time[-1]), points // 2 + 1)
        first = np.searchsorted(time, edges[:-1])
        self._filled = np.flatnonzero(
            np.diff(np.append(first, len(time)))
        )  # reduceat needs spans that hold samples
        self._first = first[self._filled]
        self._spans = len(first)
        quarter = (edges[1] - edges[0]) / 4
        self.time = np.column_stack([edges[:-1] + quarter, edges[:-1] + 3 * quarter]).ravel()

    def __call__(self, value: np.ndarray) -> np.ndarray:
        """The signal on `self.time`: lowest and highest of each span in turn, NaN where nothing
        counts; shape (m,).
        """
        if self._whole:
            return np.where(self._keep, value, np.nan)
        counts = self._keep & np.isfinite(value)
        result = np.full((self._spans, 2), np.nan)
        lowest = np.minimum.reduceat(np.where(counts, value, np.inf), self._first)
        highest = np.maximum.reduceat(np.where(counts, value, -np.inf), self._first)
        known = lowest <= highest
        result[self._filled[known]] = np.column_stack([lowest, highest])[known]
        return result.ravel()
