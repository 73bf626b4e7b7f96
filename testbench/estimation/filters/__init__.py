"""Orientation filters by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from testbench.estimation.filters import (
    complementary,
    device,
    directions,
    ekf,
    error_state,
    euler_ekf,
    fusion,
    gyro,
    madgwick,
    mahony,
    mekf,
    vqf_filters,
)
from testbench.estimation.filters.base import (
    FilterState,
    OrientationFilter,
    Parameter,
    RecursiveFilter,
    UniformSamples,
)
from testbench.exceptions import InputError, NotFoundError
from testbench.records.specs.protocol import FILTER_NAMES

_MODULES = (
    complementary,
    device,
    directions,
    ekf,
    error_state,
    euler_ekf,
    fusion,
    gyro,
    madgwick,
    mahony,
    mekf,
    vqf_filters,
)


def kinds() -> dict[str, type[OrientationFilter]]:
    """The filters of all modules by name, not what they are derived from."""
    return {
        kind.name: kind
        for module in _MODULES
        for kind in vars(module).values()
        if isinstance(kind, type)
        and issubclass(kind, OrientationFilter)
        and kind.__module__ == module.__name__
        and "name" in vars(kind)
    }


_KINDS = kinds()
FILTERS: dict[str, type[OrientationFilter]] = {name: _KINDS[name] for name in FILTER_NAMES}
"""In the order in which the language of protocols lists them."""


def get_filter(name: str, parameters: Mapping[str, float] | None = None) -> OrientationFilter:
    """A filter by its name.

    Args:
        name: One of FILTERS.
        parameters: Those that differ from the filter's defaults, by name.

    Raises:
        NotFoundError: No such filter, or no such parameter; lists those that exist.
        InputError: A parameter's value is not allowed.
    """
    if name not in FILTERS:
        raise NotFoundError("filter", name, list(FILTERS))
    return FILTERS[name](parameters)


def choose_filters(
    filters: Sequence[str | OrientationFilter],
    parameters: Mapping[str, Mapping[str, float]] | None = None,
) -> list[OrientationFilter]:
    """Filters to run beside one another.

    Args:
        filters: Names, or filters as they are.
        parameters: Those of the named ones, by filter.

    Raises:
        NotFoundError: No such filter or parameter.
        InputError: A value is not allowed, or two filters have one name.
    """
    given = parameters or {}
    chosen = [
        get_filter(entry, given.get(entry)) if isinstance(entry, str) else entry
        for entry in filters
    ]
    names = [kind.name for kind in chosen]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"two of the filters are called {', '.join(twice)}")
    return chosen


__all__ = [
    "FILTERS",
    "FilterState",
    "OrientationFilter",
    "Parameter",
    "RecursiveFilter",
    "UniformSamples",
    "choose_filters",
    "get_filter",
]
