"""Which of several filters is far from all the others, by a rule that the far one cannot bend."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

FEWEST = 5
"""Of fewer values the far one itself moves the upper quartile."""
FAR = 3.0
"""Quartile ranges above the upper quartile: Tukey's outer fence (Exploratory Data Analysis, 1977,
section 2D).
"""
LEAST_DEG = 1.0
"""And at least so far above the median, or among filters that agree every digit would be an outlier
[deg].
"""


def outer_fence(values: Mapping[str, float]) -> float:
    """The largest error [deg] that is not far from the others; infinite for fewer than five values.

    Args:
        values: Errors by filter, none negative [deg]; those that are not finite are passed over.
    """
    known = np.array([value for value in values.values() if np.isfinite(value)])
    if len(known) < FEWEST:
        return float("inf")
    low, middle, high = np.quantile(known, [0.25, 0.5, 0.75])
    return float(max(high + FAR * (high - low), middle + LEAST_DEG))


def far_ones(values: Mapping[str, float]) -> dict[str, float]:
    """Those beyond the outer fence, with their values."""
    fence = outer_fence(values)
    return {name: value for name, value in values.items() if value > fence}
