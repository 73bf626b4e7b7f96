"""Orientation filters by name."""

from __future__ import annotations

from testbench.estimation.filters.base import OrientationFilter, UniformSamples
from testbench.estimation.filters.device import Device
from testbench.estimation.filters.fusion import Fusion
from testbench.estimation.filters.madgwick import MadgwickImu
from testbench.estimation.filters.vqf_filters import Vqf6D, Vqf9D, VqfOffline
from testbench.exceptions import NotFoundError

FILTERS: dict[str, type[OrientationFilter]] = {
    kind.name: kind for kind in (Device, Vqf6D, Vqf9D, VqfOffline, Fusion, MadgwickImu)
}


def get_filter(name: str) -> OrientationFilter:
    """A filter by its name.

    Raises:
        NotFoundError: No such filter; lists those that exist.
    """
    if name not in FILTERS:
        raise NotFoundError("filter", name, list(FILTERS))
    return FILTERS[name]()


__all__ = ["FILTERS", "OrientationFilter", "UniformSamples", "get_filter"]
